"""Measure tightening on random blocks: how near it comes to the least error.

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
from attack_families import Sample, random_block
from attack_tables import measure_scenes, quantile_table
from true_errors import reference, true_errors

from erc_contact.admissible.tighten import iteration

LONG = 200
"""Iterations after which e counts as the least one."""
LEVELS = 2
"""Refinements of the nested mesh of the reference.

Its cells have a seventh of the size, and degree 2.
"""
WITHIN = 1.1
"""Ratio that the default is to keep."""
SMALL = 0.2
"""Eps below which indices are also listed apart [-]."""
QUANTILES = (0.5, 0.9, 0.95, 0.98, 1.0)


@dataclass(frozen=True)
class Tightening:
    """Hold what was measured of one scene.

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
    return measure_scenes(seed, count, random_block, measured)


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
    within = np.count_nonzero(ratios <= WITHIN)
    columns: dict[str, Sequence[float] | np.ndarray] = {
        "ratio": ratios,
        "iterations": [row.iterations for row in rows],
    }
    for degree in (1, 2):
        of_degree = [row for row in rows if row.sample.degree == degree]
        small = [row for row in of_degree if row.eps < SMALL]
        columns[f"index, degree {degree}"] = [row.index for row in of_degree]
        columns[f"index, degree {degree}, eps < {SMALL:.0%}"] = [row.index for row in small]
    head = f"{within} of {len(rows)} scenes are within {WITHIN} of the least e."
    return f"{head}\n\n{quantile_table(columns, QUANTILES)}"


def main() -> None:
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 100
    print(summary(tightening(seed, count)))


if __name__ == "__main__":
    main()
