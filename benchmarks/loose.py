"""Solve bodies that nothing but friction holds along their contact.

A random block, pressed on a rigid foundation or on another body, is pushed by a share
of what friction can carry: 1 to 63 columns, degrees 1 and 2, nu to 0.4999, moduli of
the two bodies in a ratio of 1e-3 to 1e3, plane gaps, interference and parabolas;
Coulomb's friction of 0.01 to 2, and Tresca's of 0.01 to 1 times the pressure. The
resultant of pressure and push goes through the inner 90% of the contact, so that the
block does not tip. Where all of the contact slips in one of Newton's states, nothing
holds the block there.

``plane``, ``space``: which share is solved by default, by the augmented Lagrangian and
by Nitsche's method alone; Newton steps of all attempts. A scene that fails is told.

    OMP_NUM_THREADS=1 python benchmarks/loose.py [plane|space|all] [seed] [count]
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from bricks import NAMES, bricks  # isort: skip
from tasks import run, tell  # isort: skip

METHODS: dict[str, Any] = {
    "default": None,
    "augmented Lagrangian": ec.AugmentedLagrangian(),
    "Nitsche": ec.Nitsche(),
}
QUANTILES = (0.5, 0.95, 1.0)
INNER = 0.9
"""Part of the contact through which the resultant goes [-]."""


@dataclass(frozen=True)
class Case:
    """Hold a scene with a loose block.

    Attributes:
        name: What is special in the scene, in a few words.
        kind: Its friction law and what the block is on.
        scene: The scene.
        domain: The mesh.
        degree: Degree of the displacement.
    """

    name: str
    kind: str
    scene: ec.Scene
    domain: ec.Domain
    degree: int


def random_case(rng: np.random.Generator, d: int) -> Case:
    """Make a block of width 2 that is pressed on its foundation and pushed."""
    columns = int(2 ** rng.uniform(0.0, 6.0)) if d == 2 else int(rng.integers(1, 5))
    cells = (*(columns,) * (d - 1), int(rng.integers(1, 5)) if d == 2 else 1)
    degree = int(rng.integers(1, 3)) if d == 2 else 1
    height = float(np.exp(rng.uniform(-1.0, 1.0)))
    nu, nu_below = (float(value) for value in rng.choice([0.0, 0.3, 0.45, 0.49, 0.4999], 2))
    law = str(rng.choice(["Tresca", "Coulomb"]))
    on_body = bool(rng.random() < 0.5)
    E_below = float(10 ** rng.uniform(-3.0, 3.0))
    press = float(rng.uniform(0.005, 0.03)) * (min(1.0, E_below) if on_body else 1.0)

    limit = float(10 ** rng.uniform(-2.0, 0.0))
    coefficient = float(10 ** rng.uniform(-2.0, 0.3))
    friction = ec.Tresca(limit * press) if law == "Tresca" else ec.Coulomb(coefficient)
    carried = limit if law == "Tresca" else coefficient
    # A push at the top tips a block that is wider than the push's share of its height.
    most = min(0.95 * carried, INNER / height)
    push = float(rng.uniform(-1.0, 1.0)) * most * press

    shape = str(rng.choice(["plane", "interference", "parabola"]))
    gap: Any = {
        "plane": 0.0,
        "interference": -0.1 * press,
        "parabola": lambda x: 0.3 * press * x[0] ** 2,
    }[shape]
    pull = (push, *(0.0,) * (d - 2), -press)
    name = f"{cells} cells, degree {degree}, height {height:.2f}, nu {nu}, {law} {carried:.2f}, "
    name += f"push {push / press:.2f}, gap {shape}"
    if not on_body:
        sides = (-1.0,) * (d - 1), (1.0,) * (d - 1)
        make: Any = ec.rectangle if d == 2 else ec.box
        block = make((*sides[0], 0.0), (*sides[1], height), cells=cells)
        foundation = ec.Contact("bottom", friction=friction, gap=gap)
        loads = [ec.Traction("top", pull)]
        scene = ec.Scene(ec.Elastic(1.0, nu), loads=loads, contacts=[foundation])
        return Case(name, f"{law}, on a foundation", scene, block, degree)
    material = ec.Elastic({"upper": 1.0, "lower": E_below}, {"upper": nu, "lower": nu_below})
    first, second = NAMES if rng.random() < 0.5 else NAMES[::-1]
    scene = ec.Scene(
        material,
        [ec.Displacement("lower outer", (0.0,) * d)],
        [ec.Traction("upper outer", pull)],
        [ec.Contact(first, friction=friction, gap=gap, against=second)],
    )
    name += f", below E {E_below:.1e}, nu {nu_below}, {first} first"
    blocks = bricks(d, cells, heights=(height, 1.0))
    return Case(name, f"{law}, on a body", scene, blocks, degree)


def family(d: int, seed: int = 0, count: int = 100) -> None:
    """Solve random scenes of a dimension, and print what is solved by kind."""
    rng = np.random.default_rng(seed)
    tried: Counter[tuple[str, str]] = Counter()
    steps: dict[tuple[str, str], list[int]] = {}
    for _ in range(count):
        case = random_case(rng, d)
        for label, method in METHODS.items():
            row = case.kind, label
            tried[row] += 1
            try:
                solution = ec.solve(case.scene, case.domain, method, degree=case.degree)
            except ec.NotConverged:
                tell(f"not solved ({label}): {case.name}")
            else:
                steps.setdefault(row, []).append(solution.newton_steps)
    tell("| scene | method | solved | Newton steps: median, 95%, most |\n|---|---|---|---|")
    for row in sorted(tried):
        of_row = steps.get(row, [])
        spread = ", ".join(f"{value:.0f}" for value in np.quantile(of_row or [0], QUANTILES))
        tell(f"| {row[0]} | {row[1]} | {len(of_row)} of {tried[row]} | {spread} |")


FAMILIES: dict[str, Callable[..., None]] = {
    "plane": partial(family, 2),
    "space": partial(family, 3),
}


if __name__ == "__main__":
    run(FAMILIES)
