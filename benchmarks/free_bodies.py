"""Measure e against the true errors of random bodies that nothing holds.

A scene is one body whose modulus varies, or two bodies pressed on each other, in the
plane or in 3D, of degree 1 or 2, by both methods and solvers. A random stress in
equilibrium gives the tractions on all sides, so the loads are in balance. For each
scene it prints e over both errors, which is above 1; then the least one.

    OMP_NUM_THREADS=1 python benchmarks/free_bodies.py [seed] [count]
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from bricks import NAMES, SIDES, glued
from true_errors import reference, true_errors

UPPER, LOWER = NAMES
LEVELS = {2: 2, 3: 0}
"""Uniform refinements of the reference beyond the cut mesh, by dimension."""
PRESSURE = 3.0
"""Mean pressure of two bodies on each other [force/area]."""


@dataclass(frozen=True)
class FreeScene:
    """Hold a random scene.

    Attributes:
        name: What it is, in words.
        scene: The scene.
        domain: Its mesh.
        method: The contact method.
        degree: Degree of the displacement.
        solver: The solver.
    """

    name: str
    scene: ec.Scene
    domain: ec.Domain
    method: ec.Method
    degree: int
    solver: str


def balanced_tractions(rng: np.random.Generator, d: int, *, shear: bool) -> list[ec.Traction]:
    """Return tractions on the sides of two bricks, of a stress without divergence.

    Args:
        rng: Random numbers.
        d: Dimension.
        shear: Whether the stress has shear components.
    """
    constant = rng.uniform(-1.0, 1.0, (d, d))
    slopes = rng.uniform(-0.5, 0.5, (d, d, d))
    for i in range(d):
        # sigma_ij must not vary along x_i or x_j.
        slopes[i, :, i] = 0.0
        slopes[:, i, i] = 0.0
    constant = (constant + constant.T) / 2
    slopes = (slopes + slopes.transpose(1, 0, 2)) / 2
    if not shear:
        keep = np.eye(d)
        constant *= keep
        slopes *= keep[:, :, None]
    constant[-1, -1] -= PRESSURE
    loads = []
    for body in ("upper", "lower"):
        outside = 1.0 if body == "upper" else -1.0
        sides = [(f"{body} outer", d - 1, outside)]
        for axis, names in SIDES.items():
            if axis < d - 1:
                sides += [(f"{body} {names[0]}", axis, -1.0), (f"{body} {names[1]}", axis, 1.0)]
        for name, axis, sign in sides:
            row = [_linear(sign * constant[axis, j], sign * slopes[axis, j]) for j in range(d)]
            loads.append(ec.Traction(name, tuple(row)))
    return loads


def _linear(value: float, slopes: np.ndarray) -> Callable[[Any], Any]:
    """Return a linear function of the position."""
    return lambda x: value + sum(float(slope) * x[i] for i, slope in enumerate(slopes))


def random_free(rng: np.random.Generator, number: int) -> FreeScene:
    """Make one body whose modulus varies, or two bodies on each other."""
    d = 3 if number % 4 == 3 else 2
    kind = ("one body", "two bodies", "two bodies with Tresca friction")[number % 3]
    cells = (int(rng.integers(3, 7)), 3) if d == 2 else (2, 2, 1)
    domain = glued(d, cells)
    ratio = float(np.exp(rng.uniform(-2, 2)))
    moduli: Any = {"upper": ratio, "lower": 1.0}
    if kind == "one body":
        moduli = _linear((1.0 + ratio) / 2, (ratio - 1.0) / 2 * np.eye(d)[-1])
    material = ec.Elastic(moduli, float(rng.uniform(0.0, 0.4)))
    contacts = []
    if kind != "one body":
        domain = domain.split({UPPER: "upper", LOWER: "lower"})
        friction = ec.Tresca(float(rng.uniform(0.2, 1.0))) if "friction" in kind else 0.0
        contacts.append(ec.Contact(UPPER, against=LOWER, friction=friction))
    loads = balanced_tractions(rng, d, shear=kind == "one body")
    degree = int(rng.integers(1, 3))
    method: ec.Method = ec.Nitsche() if rng.integers(2) else ec.AugmentedLagrangian()
    solver = str(rng.choice(["direct", "iterative"]))
    name = f"{number}: {kind}, {d}D, degree {degree}, {type(method).__name__}, {solver}"
    scene = ec.Scene(material, loads=loads, contacts=contacts)
    return FreeScene(name, scene, domain, method, degree, solver)


def index(case: FreeScene) -> float:
    """Return e over both errors [-]."""
    options: dict[str, Any] = {"degree": case.degree, "solver": case.solver}
    solution = ec.solve(case.scene, case.domain, case.method, **options)
    error = ec.constitutive_error(ec.equilibrate(solution))
    exact = reference(solution, LEVELS[case.domain.dim])
    return error.absolute / true_errors(error.admissible, exact).of_both


def main() -> None:
    """Print the index of each scene, and the least one."""
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 60
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    rng = np.random.default_rng(seed)
    indices = []
    for number in range(count):
        case = random_free(rng, number)
        indices.append(index(case))
        print(f"{case.name}: {indices[-1]:.6f}", flush=True)
    print(f"{count} scenes, e over both errors from {min(indices):.10f} to {max(indices):.4f}")


if __name__ == "__main__":
    main()
