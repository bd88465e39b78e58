"""Sweep the friction coefficient with the default method.

Does it solve every one? 500 from 0.001 to 2 on four scenes, of degree 1 and 2.

The scenes: the block that several contact codes agree on without its traction, (0, 2) x
(0, 7), pressed and sheared; the same with nu = 0.35, sheared more; GRECO, which only
the contact holds vertically; a cube of two materials (1 : 10) above a sphere, pressed
and sheared. Meshes are small and coarse: there the discrete problem is at its worst.

Printed for each scene and degree: failures, how often the default gave the solution of
the augmented Lagrangian because Nitsche's method did not converge, the mean and the
largest number of Newton steps (all attempts), seconds.

    OMP_NUM_THREADS=1 python benchmarks/friction_sweep.py [number of coefficients]
"""

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

import erc_contact as ec

from extreme_bodies import Pair, greco, on_a_sphere  # isort: skip - after erc_contact, which loads MPI
from extreme_domains import cube, halved  # isort: skip


def block(friction: float, nu: float = 0.3, push: tuple[float, float] = (0.1, -0.05)) -> Pair:
    """Make the scene of the block, pressed and sheared at its top."""
    scene = ec.Scene(
        ec.Elastic(1.0, nu),
        [ec.Displacement("top", push)],
        contacts=[ec.Contact("bottom", friction=friction)],
    )
    return scene, ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(4, 14))


def dome(friction: float) -> Pair:
    """Make a cube of two materials above a sphere."""
    scene = ec.Scene(
        ec.Elastic({"low": 1.0, "high": 10.0}, 0.3),
        [ec.Displacement("top", (0.04, -0.08, 0.02))],
        contacts=[ec.Contact("bottom", friction=friction, gap=on_a_sphere)],
    )
    return scene, halved(cube(2), 1, 0.4)


SCENES: dict[str, Callable[[float], Pair]] = {
    "block": block,
    "block, nu 0.35": lambda friction: block(friction, 0.35, (0.12, -0.05)),
    "GRECO": lambda friction: greco(n=6, friction=friction),
    "cube on a sphere": dome,
}


@dataclass
class Row:
    """Hold what a sweep of one scene and degree found.

    Attributes:
        failures: Coefficients without a solution.
        other: Coefficients with the solution of the augmented Lagrangian.
        steps: Newton steps of each solve.
        seconds: Of all solves.
    """

    failures: list[float] = field(default_factory=list)
    other: list[float] = field(default_factory=list)
    steps: list[int] = field(default_factory=list)
    seconds: float = 0.0


def sweep(name: str, degree: int, frictions: Iterable[float]) -> Row:
    """Solve one scene by the default method with every coefficient."""
    row, began = Row(), perf_counter()
    _, domain = SCENES[name](1.0)
    for friction in frictions:
        scene, _ = SCENES[name](friction)
        try:
            solution = ec.solve(scene, domain, degree=degree)
        except ec.ErcContactError:
            row.failures.append(friction)
            continue
        row.steps.append(solution.newton_steps)
        if solution.method.multiplier:
            row.other.append(friction)
    row.seconds = perf_counter() - began
    return row


def main() -> None:
    frictions = np.linspace(0.001, 2.0, int((sys.argv[1:] or ["500"])[0])).tolist()
    print(
        "scene             degree  solves  failures  augmented Lagrangian"
        "  Newton steps: mean, most  seconds"
    )
    for name in SCENES:
        for degree in (1, 2):
            row = sweep(name, degree, frictions)
            print(
                f"{name:17s} {degree:6d} {len(frictions):7d} {len(row.failures):9d} "
                f"{len(row.other):21d} "
                f"{np.mean(row.steps):19.1f}, {max(row.steps):4d} {row.seconds:8.1f}"
            )
            for what, which in (("failures", row.failures), ("augmented Lagrangian", row.other)):
                if which:
                    print(f"    {what}: {', '.join(f'{friction:.3f}' for friction in which)}")


if __name__ == "__main__":
    main()
