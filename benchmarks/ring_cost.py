"""Measure what rings cost beside the plane: the same square, sheared by friction.

Contact solve, pair and error are measured one after the other in each hypothesis, in
seconds of the processor; medians of several turns, and their ratios.

    OMP_NUM_THREADS=1 python benchmarks/ring_cost.py [turns]
"""

from __future__ import annotations

import sys
from time import process_time

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first

CELLS = {1: 220, 2: 110}
"""Squares along a side for each degree, with 97 682 unknowns."""
HYPOTHESES = ("plane strain", "axisymmetric")


def seconds(hypothesis: str, degree: int, cells: int) -> np.ndarray:
    """Return the seconds of contact solve, pair and error."""
    material = ec.Elastic(1000.0, 0.3, hypothesis=hypothesis)
    contact = ec.Contact("bottom", friction=0.3)
    scene = ec.Scene(material, [ec.Displacement("top", (0.0, -0.01))], contacts=[contact])
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(cells, cells))
    times = [process_time()]
    solution = ec.solve(scene, domain, degree=degree)
    times.append(process_time())
    pair = ec.equilibrate(solution)
    times.append(process_time())
    ec.constitutive_error(pair)
    times.append(process_time())
    return np.diff(times)


def main(turns: int = 5) -> None:
    """Print seconds and ratios for both degrees."""
    for degree, cells in CELLS.items():
        for hypothesis in HYPOTHESES:
            seconds(hypothesis, degree, 8)  # Forms and kernels are compiled.
        found = [[seconds(name, degree, cells) for name in HYPOTHESES] for _ in range(turns)]
        plane, rings = np.median(found, axis=0)
        print(f"degree {degree}, seconds of contact solve, pair, error")
        print(
            "  plane", plane.round(2), "rings", rings.round(2), "ratios", (rings / plane).round(2)
        )
        print(f"  together {rings.sum() / plane.sum():.2f} times")


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
