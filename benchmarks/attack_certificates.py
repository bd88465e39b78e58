"""Test the certificate of Coulomb friction on random blocks and their refinements.

The question is whether q +- change and what is claimed hold on the refined mesh.

    OMP_NUM_THREADS=1 python benchmarks/attack_certificates.py [seed] [count in the
    plane] [count in 3D]

Each scene is certified on its mesh and on the mesh that is refined once:

- same field: q of the field t of the first mesh, on the refined one; q + change must
  not be below it;
- own field: q of the field that the refined mesh takes itself, which is made of another
  admissible pair and may be rougher; ``q_largest`` of the first mesh must not be below
  it;
- withdrawn: scenes in which ``unique``, or a bound, is claimed on the first mesh and
  not on the refined one; contradicted: withdrawn scenes with q + change >= 2 there.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_families import Sample, random_sliding_block, random_sliding_box
from attack_tables import measure_scenes, quantile_table

from erc_contact.error.coulomb.other_mesh import body_on
from erc_contact.error.coulomb.slip_direction import LENGTHS, slip_fields
from erc_contact.error.coulomb.surface import pair_on_surface

QUANTILES = (0.5, 0.9, 0.95, 0.98, 1.0)


@dataclass(frozen=True)
class Certificates:
    """Hold what was measured of one scene.

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
    return measure_scenes(seed, count, family, measured)


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
    """Measure the error of a scene on a mesh."""
    solution = ec.solve(sample.scene, domain, degree=sample.degree, start=start)
    return ec.constitutive_error(ec.equilibrate(solution))


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
    contradicted = [row for row in unique if row.refined.q + row.refined.q_change >= 2]
    below_limit = np.count_nonzero(same <= limits)
    own_below_limit = np.count_nonzero(own <= limits)
    own_below_largest = np.count_nonzero(own <= largest)
    columns = {
        "q": norms,
        "change/q": (limits - norms) / norms,
        "q on the refined mesh/q, same field": same / norms,
        "q on the refined mesh/q, own field": own / norms,
        "bound/e": np.array([row.first.factor for row in bounded]),
    }
    claims = (
        f"q + change holds on the refined mesh in {below_limit} of {len(rows)} scenes with the "
        f"same field, in {own_below_limit} with the field of the refined mesh; this q is below "
        f"q_largest in {own_below_largest}.\n"
        f"Withdrawn: {len(no_longer_unique)} of {len(unique)} claims of uniqueness, "
        f"{len(no_longer_bounded)} of {len(bounded)} bounds. "
        f"Contradicted: {len(contradicted)}."
    )
    return f"{claims}\n\n{quantile_table(columns, QUANTILES, counts=False)}"


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
