"""Tightening on random blocks: how near the default comes to the least error, and the index of e.

    OMP_NUM_THREADS=1 python benchmarks/attack_tightening.py [seed] [count]

- ratio: e after the default tightening over e after 200 iterations that nothing ends
  before;
- iterations: of the default;
- index: e over the true error of u^, against a solution of degree 2 on a nested mesh
  (see ``true_errors.py``).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from unittest.mock import patch

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_families import Sample, random_block, scene_generator
from true_errors import reference, true_errors

from erc_contact.admissible.tighten import iteration

LONG = 200
"""Iterations after which e counts as the least one."""
LEVELS = 2
"""Refinements of the nested mesh of the reference: cells of a seventh of the size, of degree 2."""
WITHIN = 1.1
"""Ratio that the default is to keep."""
SMALL = 0.2
"""Eps below which indices are also listed apart [-]."""
QUANTILES = (0.5, 0.9, 0.95, 0.98, 1.0)


@dataclass(frozen=True)
class Tightening:
    """What was measured of one scene.

    Attributes:
        sample: The scene.
        iterations: Iterations of the default.
        ratio: e of the default over the least e.
        eps: Relative error of the default [-].
        index: e over the true error of u^.
    """

    sample: Sample
    iterations: int
    ratio: float
    eps: float
    index: float


def tightening(seed: int, count: int) -> list[Tightening]:
    """Measure the first scenes of a seed, a row for each that has a solution."""
    rows = []
    for number in range(count):
        sample = random_block(scene_generator(seed, number))
        try:
            rows.append(measured(sample))
        except ec.ErcContactError as reason:
            print(
                f"scene {number} of seed {seed} ({sample.name}) ends in {type(reason).__name__}",
                flush=True,
            )
    return rows


def measured(sample: Sample) -> Tightening:
    """Measure one scene."""
    solution = ec.solve(sample.scene, sample.domain, degree=sample.degree)
    pair = ec.equilibrate(solution)
    error = ec.constitutive_error(pair)
    with patch.object(iteration, "REMAINDER", 0.0):
        longest = ec.equilibrate(solution, tighten=LONG)
    exact = reference(solution, LEVELS, degree=2)
    return Tightening(
        sample=sample,
        iterations=pair.tightening,
        ratio=error.absolute / ec.constitutive_error(longest).absolute,
        eps=error.relative,
        index=error.absolute / true_errors(pair, exact).of_u,
    )


def summary(rows: Sequence[Tightening]) -> str:
    """Write the quantiles of all rows as a table in Markdown."""
    ratios = np.array([row.ratio for row in rows])
    lines = [
        f"{np.count_nonzero(ratios <= WITHIN)} of {len(rows)} scenes are within {WITHIN} of the least e.",
        "",
        f"| | scenes | {' | '.join(f'{share:.0%}' for share in QUANTILES)} |",
        "|---" * (2 + len(QUANTILES)) + "|",
        _line("ratio", ratios),
        _line("iterations", np.array([row.iterations for row in rows])),
    ]
    for degree in (1, 2):
        of_degree = [row for row in rows if row.sample.degree == degree]
        small = [row for row in of_degree if row.eps < SMALL]
        lines.append(_line(f"index, degree {degree}", np.array([row.index for row in of_degree])))
        lines.append(
            _line(
                f"index, degree {degree}, eps < {SMALL:.0%}", np.array([row.index for row in small])
            )
        )
    return "\n".join(lines)


def _line(name: str, values: np.ndarray) -> str:
    """One line of the table."""
    quantiles = np.quantile(values, QUANTILES) if len(values) else np.full(len(QUANTILES), np.nan)
    return f"| {name} | {len(values)} | {' | '.join(f'{value:.2f}' for value in quantiles)} |"


def main() -> None:
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 100
    print(summary(tightening(seed, count)))


if __name__ == "__main__":
    main()
