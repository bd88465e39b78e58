"""Run a grid of scenes in 3D with both solvers and both methods.

Do they converge, and to the same error?

Poisson's ratio to 0.4999 with friction 0 to 5, slender bodies, flat and graded cells,
jumps of the modulus, spheres, rollers, several contacts, bodies that only contacts
hold, Tresca friction, a bilateral contact.

    OMP_NUM_THREADS=1 python benchmarks/solvers.py [--degree 1]

prints the pairs (scene, method) whose solvers do not agree to 1e-7 of eps, and how many
each solver solved. "auto" goes on with the direct solver where multigrid does not
converge.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from math import isclose
from typing import Any

from extreme_bodies import on_a_sphere, standing
from extreme_domains import cube, halved, mapped

import erc_contact as ec

Pair = tuple[ec.Scene, ec.Domain]
METHODS = (ec.Nitsche(), ec.AugmentedLagrangian())
SAME, NOTHING = 1e-7, 1e-9
"""Difference of eps that counts as none [-].

It is relative, and absolute where the solution is exact.
"""


def pressed(
    domain: ec.Domain,
    push: Any = (0.02, 0.01, -0.05),
    E: Any = 1.0,
    nu: float = 0.3,
    **contact: Any,
) -> Pair:
    """Make a body pressed and sheared at its top."""
    scene = ec.Scene(
        material=ec.Elastic(E=E, nu=nu),
        supports=[ec.Displacement("top", push)],
        contacts=[ec.Contact("bottom", **contact)],
    )
    return scene, domain


def on_rollers() -> Pair:
    """Make a cube that slides along its rollers as far as friction lets it."""
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[
            ec.Displacement("top", (0.0, None, -0.05)),
            ec.Displacement("left", (0.0, None, None)),
        ],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )
    return scene, cube(4)


def beside_a_wall() -> Pair:
    """Make a cube with a wall at a small distance of its left side.

    Below it is a foundation.
    """
    scene, domain = pressed(cube(4), friction=0.3)
    wall = ec.Contact("left", friction=0.2, gap=0.001)
    return ec.Scene(scene.material, scene.supports, contacts=[*scene.contacts, wall]), domain


def scenes() -> dict[str, Callable[[], Pair]]:
    """Make the scenes of the grid."""
    grid: dict[str, Callable[[], Pair]] = {}
    for nu in (0.0, 0.3, 0.45, 0.49, 0.499, 0.4999):
        for mu in (0.0, 0.3, 1.0, 5.0):
            grid[f"nu {nu}, friction {mu}"] = lambda nu=nu, mu=mu: pressed(
                cube(4), nu=nu, friction=mu
            )
    for n in (5, 20, 50):
        tower, beam = (1.0, 1.0, float(n)), (float(n), 1.0, 1.0)
        for name, corner, cells in (("tower", tower, (2, 2, 2 * n)), ("beam", beam, (2 * n, 2, 2))):
            grid[f"{name} {n}:1"] = lambda corner=corner, cells=cells: pressed(
                ec.box((0.0, 0.0, 0.0), corner, cells=cells), friction=0.3
            )
    for flat in (0.1, 0.01):
        grid[f"cells {flat} high"] = lambda flat=flat: pressed(
            mapped(cube(4), lambda x: (x[0], x[1], flat * x[2])),
            (0.02 * flat, 0.0, -0.05 * flat),
            friction=0.3,
        )
    grid["graded"] = lambda: pressed(
        mapped(cube(5), lambda x: (x[0], x[1], x[2] ** 6)), friction=0.3
    )
    for jump in (1e-6, 1e-3, 1e3, 1e6):
        grid[f"jump {jump}"] = lambda jump=jump: pressed(
            halved(cube(4), 2, 0.5), E={"low": 1.0, "high": jump}, friction=0.3
        )
    for mu in (0.0, 0.3, 2.0):
        grid[f"sphere, friction {mu}"] = lambda mu=mu: pressed(
            cube(5), friction=mu, gap=on_a_sphere
        )
    grid["beside a wall"] = beside_a_wall
    grid["on rollers"] = on_rollers
    grid["stands"] = lambda: standing((0.3, 0.0, -1.0), cube(4), friction=0.5)
    walls = ("bottom", "left", "front")
    grid["three walls"] = lambda: standing((-0.5, -0.5, -1.0), cube(4), parts=walls, friction=0.1)
    grid["three smooth walls"] = lambda: standing((-0.5, -0.5, -1.0), cube(4), parts=walls)
    grid["Tresca friction"] = lambda: pressed(cube(4), friction=ec.Tresca(0.01))
    grid["bilateral"] = lambda: pressed(cube(4), friction=ec.Tresca(0.01), bilateral=True)
    return grid


def outcome(pair: Pair, method: Any, degree: int, solver: str) -> float | str:
    """Return the error eps, or what the solver says."""
    try:
        return ec.constitutive_error(
            ec.equilibrate(ec.solve(*pair, method, degree=degree, solver=solver))
        ).relative
    except ec.ErcContactError as failure:
        return f"{type(failure).__name__}: {failure}"[:100]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--degree", type=int, default=1)
    degree = parser.parse_args().degree
    solved: Counter[tuple[str, str]] = Counter()
    grid = scenes()
    for name, make in grid.items():
        for method in METHODS:
            found = {
                solver: outcome(make(), method, degree, solver)
                for solver in ("direct", "iterative")
            }
            for solver, eps in found.items():
                solved[type(method).__name__, solver] += isinstance(eps, float)
            direct, iterative = found.values()
            both = isinstance(direct, float) and isinstance(iterative, float)
            if not both or not isclose(
                float(direct), float(iterative), rel_tol=SAME, abs_tol=NOTHING
            ):
                print(f"{name}, {type(method).__name__}: {found}", flush=True)
    for (method_name, solver), count in solved.items():
        print(f"{method_name}, {solver}: {count} of {len(grid)} solved")


if __name__ == "__main__":
    main()
