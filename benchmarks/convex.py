"""Solve random scenes whose contact is a quadratic programme, and count the steps.

A scene is a stack of two to six leaves in the plane, each 1 to 50 times as long as
thick, held at one end or lying on a foundation, bent by a displacement or a load, with
gaps that are constant or parabolic, without friction or with Tresca friction, of degree
1 or 2, by the default method or the augmented Lagrangian. For each it prints the steps
of Newton's method and of interior points together; then their distribution.

    OMP_NUM_THREADS=1 python benchmarks/convex.py [seed] [count]
"""

from __future__ import annotations

import logging
import sys
from dataclasses import dataclass
from time import process_time
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_families import scene_generator

MODULUS = 1.0
THICKNESS = 1.0


@dataclass(frozen=True)
class Stack:
    """Hold a random scene.

    Attributes:
        name: What it is, in words.
        scene: The scene.
        domain: Its mesh.
        method: The contact method, None for the default.
        degree: Degree of the displacement.
    """

    name: str
    scene: ec.Scene
    domain: ec.Domain
    method: ec.Method | None
    degree: int


def random_stack(rng: np.random.Generator) -> Stack:
    """Make a stack of leaves that are clamped on the left."""
    count = int(rng.integers(2, 7))
    slenderness = float(np.exp(rng.uniform(0.0, np.log(50.0))))
    length = slenderness * THICKNESS
    along = int(np.clip(2 * slenderness, 12, 60))
    shortening = float(rng.choice([0.0, rng.uniform(0.0, 0.6 / count)]))
    bodies = {}
    lengths = []
    for number in range(count):
        cells = max(round(along * (1 - shortening * number)), 4)
        lengths.append(cells * length / along)
        low = (0.0, number * THICKNESS)
        high = (lengths[-1], (number + 1) * THICKNESS)
        bodies[f"leaf{number}"] = ec.rectangle(low, high, cells=(cells, 1))
    domain = ec.assembly(bodies)
    for number in range(1, count):
        domain = domain.joined(f"leaf{number} bottom", f"leaf{number - 1} top")

    deflection = float(10 ** rng.uniform(-3.0, -1.0)) * length
    kind = str(rng.choice(["no gap", "gap", "parabola"]))
    friction: Any = 0.0
    if rng.random() < 0.4:
        # About the shear stress of the leaves.
        friction = ec.Tresca(float(10 ** rng.uniform(-4.0, -2.0)) / slenderness**2)
    contacts = []
    for number in range(1, count):
        gap = _random_gap(rng, kind, deflection, length)
        sides = f"leaf{number} bottom", f"leaf{number - 1} top"
        contacts.append(ec.Contact(sides[0], against=sides[1], friction=friction, gap=gap))
    supports = [ec.Displacement(f"leaf{number} left", (0.0, 0.0)) for number in range(count)]
    drive = str(rng.choice(["tip", "load", "bed"]))
    loads: list[Any] = []
    if drive == "tip":
        supports.append(ec.Displacement("leaf0 right", (None, deflection)))
    else:
        stiffness = MODULUS * THICKNESS**3 / length**4
        loads.append(ec.Traction("leaf0 bottom", (0.0, 8 * deflection * stiffness)))
    if drive == "bed":
        top = f"leaf{count - 1} top"
        contacts.append(ec.Contact(top, gap=_random_gap(rng, kind, deflection, length)))
    degree = int(rng.integers(1, 3))
    method = ec.AugmentedLagrangian() if rng.random() < 0.3 else None
    scene = ec.Scene(ec.Elastic(MODULUS, 0.3), supports, loads, contacts)
    by = "default" if method is None else "multiplier"
    name = (
        f"{count} leaves 1:{slenderness:.0f}, {drive}, {kind}, "
        f"{'Tresca friction' if friction else 'no friction'}, degree {degree}, {by}"
    )
    return Stack(name, scene, domain, method, degree)


def _random_gap(rng: np.random.Generator, kind: str, deflection: float, length: float) -> Any:
    """Make a gap of a kind, in proportion to a deflection [length]."""
    depth = float(10 ** rng.uniform(-2.0, 0.0)) * deflection
    middle = float(rng.uniform(0.2, 0.8)) * length
    if kind == "parabola":
        return lambda x: depth * ((x[0] - middle) / length) ** 2
    return depth if kind == "gap" else 0.0


def main(seed: int = 0, count: int = 200) -> None:
    """Solve the scenes of a seed, and print their steps."""
    steps = []
    failed = 0
    seconds = []
    for number in range(count):
        stack = random_stack(scene_generator(seed, number))
        began = process_time()
        try:
            solution = ec.solve(stack.scene, stack.domain, stack.method, degree=stack.degree)
        except ec.ErcContactError as reason:
            failed += 1
            print(f"{number}: {stack.name}: {type(reason).__name__}", flush=True)
            continue
        steps.append(solution.newton_steps)
        seconds.append(process_time() - began)
        print(f"{number}: {stack.name}: {steps[-1]} steps, {seconds[-1]:.2f} s", flush=True)
    most = np.percentile(steps, [50, 90, 100]).astype(int)
    print(
        f"{count} scenes, {failed} failed; steps: median {most[0]}, 90% {most[1]}, worst {most[2]}"
    )
    print(f"seconds: median {np.median(seconds):.2f}, worst {max(seconds):.2f}")


if __name__ == "__main__":
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    main(*(int(argument) for argument in sys.argv[1:]))
