"""Measure what small meshes cost once all forms are known to the process.

The block of demos/block.py, with degree 1 on 112 triangles: a contact solve, the
admissible pair and its error; with degree 2: adaptive runs to 1% and 0.1%, on 5 and 11
meshes. Each is done twice before it is timed; medians.

    OMP_NUM_THREADS=1 python benchmarks/small.py
"""

from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np

import erc_contact as ec

SCENE = ec.Scene(
    material=ec.Elastic(E=1.0, nu=0.3),
    supports=[ec.Displacement("top", (0.1, -0.05))],
    loads=[ec.Traction("right", (-0.0002, 0.0))],
    contacts=[ec.Contact("bottom", friction=0.3)],
)


def seconds(run: Callable[[], Any], rounds: int) -> float:
    times = []
    for _ in range(rounds + 2):
        began = process_time()
        run()
        times.append(process_time() - began)
    return float(np.median(times[2:]))


def main() -> None:
    coarse = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))
    block = ec.rectangle((0.0, 0.0), (2.0, 7.0), size=0.5)
    runs: dict[str, tuple[Callable[[], Any], int]] = {
        "solve, pair and error": (
            lambda: ec.constitutive_error(ec.equilibrate(ec.solve(SCENE, coarse))),
            50,
        ),
        "adaptive run to 1%": (lambda: ec.adapt(SCENE, block, accuracy=0.01, degree=2), 10),
        "adaptive run to 0.1%": (lambda: ec.adapt(SCENE, block, accuracy=0.001, degree=2), 5),
    }
    for name, (run, rounds) in runs.items():
        print(f"{name:<24}{seconds(run, rounds):6.3f} s", flush=True)


if __name__ == "__main__":
    main()
