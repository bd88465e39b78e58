"""The certificate of Coulomb friction on random blocks: whether q +- change and what is claimed hold after refinement.

    OMP_NUM_THREADS=1 python benchmarks/attack_certificates.py [seed] [count in the
    plane] [count in space]

Each scene is certified on its mesh and on the mesh that is refined once:

- same field: q of the field t of the first mesh, on the refined one; q + change must
  not be below it;
- own field: q of the field that the refined mesh takes itself, which is made of another
  admissible pair and may be rougher; ``q_largest`` of the first mesh must not be below
  it;
- withdrawn: scenes in which ``unique``, or a bound, is claimed on the first mesh and
  not on the refined one.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_families import Sample, random_sliding_block, random_sliding_box, scene_generator

from erc_contact.error.other_mesh import body_on
from erc_contact.error.slip_direction import LENGTHS, slip_fields
from erc_contact.error.surface import pair_on_surface

QUANTILES = (0.5, 0.9, 0.95, 0.98, 1.0)


@dataclass(frozen=True)
class Certificates:
    """What was measured of one scene.

    Attributes:
        sample: The scene.
        first: The certificate on its mesh.
        refined: The certificate on the mesh that is refined once.
        same_field: q of the field of the first certificate, on the refined mesh.
    """

    sample: Sample
    first: ec.CoulombCertificate
    refined: ec.CoulombCertificate
    same_field: float


def certificates(
    seed: int, count: int, family: Callable[[np.random.Generator], Sample] = random_sliding_block
) -> list[Certificates]:
    """Certify the first scenes of a seed, a row for each that has a solution."""
    rows = []
    for number in range(count):
        sample = family(scene_generator(seed, number))
        try:
            rows.append(measured(sample))
        except ec.ErcContactError as reason:
            print(
                f"scene {number} of seed {seed} ({sample.name}) ends in {type(reason).__name__}",
                flush=True,
            )
    return rows


def measured(sample: Sample) -> Certificates:
    """Certify one scene."""
    error = _error(sample, sample.domain, None)
    first = ec.coulomb_certificate(error)
    pair = pair_on_surface(error.admissible)
    t = slip_fields(pair)[LENGTHS.index(first.smoothing)]
    finer = sample.domain.refined()
    same_field, _ = body_on(error.solution.model, finer).norm(pair.surface, t)
    refined = ec.coulomb_certificate(_error(sample, finer, error.solution))
    return Certificates(sample, first, refined, same_field)


def _error(sample: Sample, domain: ec.Domain, start: ec.Solution | None) -> ec.ConstitutiveError:
    """The error of a scene on a mesh."""
    return ec.constitutive_error(
        ec.equilibrate(ec.solve(sample.scene, domain, degree=sample.degree, start=start))
    )


def summary(rows: Sequence[Certificates]) -> str:
    """Write what held, and the quantiles, as Markdown."""
    limits = np.array([row.first.q + row.first.q_change for row in rows])
    norms = np.array([row.first.q for row in rows])
    same = np.array([row.same_field for row in rows])
    own = np.array([row.refined.q for row in rows])
    largest = np.array([row.first.q_largest for row in rows])
    unique = [row for row in rows if row.first.unique]
    bounded = [row for row in rows if np.isfinite(row.first.bound)]
    no_longer_unique = [row for row in unique if not row.refined.unique]
    no_longer_bounded = [row for row in bounded if not np.isfinite(row.refined.bound)]
    held = (
        f"q + change holds on the refined mesh in {np.count_nonzero(same <= limits)} of {len(rows)} scenes with the "
        f"same field, in {np.count_nonzero(own <= limits)} with the field of the refined mesh; this q is below "
        f"q_largest in {np.count_nonzero(own <= largest)}."
    )
    withdrawn = (
        f"Withdrawn: {len(no_longer_unique)} of {len(unique)} claims of uniqueness, "
        f"{len(no_longer_bounded)} of {len(bounded)} bounds."
    )
    lines = [
        held,
        withdrawn,
        "",
        f"| | {' | '.join(f'{share:.0%}' for share in QUANTILES)} |",
        "|---" * (1 + len(QUANTILES)) + "|",
        _line("q", norms),
        _line("change/q", (limits - norms) / norms),
        _line("q on the refined mesh/q, same field", same / norms),
        _line("q on the refined mesh/q, own field", own / norms),
        _line("bound/e", np.array([row.first.factor for row in bounded])),
    ]
    return "\n".join(lines)


def _line(name: str, values: np.ndarray) -> str:
    """One line of the table."""
    return f"| {name} | {' | '.join(f'{value:.2f}' for value in np.quantile(values, QUANTILES))} |"


def main() -> None:
    arguments = [int(argument) for argument in sys.argv[1:]]
    seed, plane, space = [*arguments, *(0, 60, 6)[len(arguments) :]]
    for title, count, family in (
        ("plane", plane, random_sliding_block),
        ("space", space, random_sliding_box),
    ):
        if count > 0:
            print(f"\n{title}\n\n{summary(certificates(seed, count, family))}", flush=True)


if __name__ == "__main__":
    main()
