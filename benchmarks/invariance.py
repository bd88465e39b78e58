"""Compare random scenes in other units, at other places, and by both solvers.

A block on a foundation, or two blocks, in the plane, as rings or in 3D, have a gap that
is above or below zero or varies, with or without friction. A support moves them, a
pressure or heat loads them, or an interference alone. The same scene is solved with
lengths and moduli of three units, and with supports and foundation moved together along
a vector, with the direct solver, at degree 1 with multigrid, too. Forces over modulus
and area, and eps, have to be the same.

- eps: greatest difference of eps of a scene, over eps, or over 0.1 where eps is less;
- force: the same of contact forces, over the greatest;
- different: scenes beyond 1e-5, or solved in some of these ways alone; none may be.

Scenes without any stress, whose numbers are round-off, are left out.

    OMP_NUM_THREADS=1 python benchmarks/invariance.py [seed] [count]
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first

SAME = 1e-5
"""Difference that counts as none [-]."""
NO_STRESS = 1e-6
"""Strain below which a scene has no stress [-]."""
LEAST_EPS = 0.1
"""Differences of a smaller eps are taken over this [-]."""


@dataclass(frozen=True)
class Frame:
    """Hold units and a place.

    Attributes:
        length: Unit of length.
        modulus: Unit of moduli and pressures.
        way: How far supports and foundation are moved [unit of length].
    """

    length: float = 1.0
    modulus: float = 1.0
    way: tuple[float, float, float] = (0.0, 0.0, 0.0)


FRAMES = (
    Frame(),
    Frame(length=1e-6),
    Frame(length=1e-3, modulus=2e11, way=(0.3, -0.2, 0.1)),
    Frame(way=(1e-4, 2e-4, 3e-4)),
)


class Case:
    """Draw one random scene, and declare it in a frame.

    Args:
        rng: Decides all of it.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.kind = str(rng.choice(["plane", "ring", "box"]))
        self.d = 3 if self.kind == "box" else 2
        self.is_pair = bool(rng.random() < 0.6)
        self.degree = int(rng.integers(1, 3))
        self.cells = int(rng.integers(2, 4 if self.d == 2 else 3))
        self.inner = float(rng.choice([0.0, 0.5])) if self.kind == "ring" else 0.0
        self.width = float(rng.choice([1.0, 0.7]))
        self.nu = rng.uniform(0.0, 0.45)
        self.friction = str(rng.choice(["none", "Coulomb", "Tresca"]))
        self.gap = str(rng.choice(["below zero", "above zero", "varies"]))
        self.size = rng.uniform(0.001, 0.01)
        self.low = rng.uniform(0.0, 1.0)
        self.driven = str(rng.choice(["moved", "pressed", "fit", "heated"]))
        self.amount = rng.uniform(0.002, 0.01)

    def __str__(self) -> str:
        bodies = "two bodies" if self.is_pair else "a body"
        words = (self.kind, bodies, f"degree {self.degree}", self.friction, self.gap, self.driven)
        return ", ".join(words)

    def domain(self, unit: float) -> ec.Domain:
        """Return one block, or two of which the upper one may be narrower."""

        def block(low: float, width: float) -> ec.Domain:
            first = unit * np.array([self.inner, *(0.0,) * (self.d - 2), low])
            last = unit * np.array([self.inner + width, *(1.0,) * (self.d - 2), low + 1.0])
            make = ec.box if self.d == 3 else ec.rectangle
            return make(tuple(first.tolist()), tuple(last.tolist()), cells=(self.cells,) * self.d)

        if not self.is_pair:
            return block(0.0, 1.0)
        bodies = ec.assembly({"lower": block(0.0, 1.0), "upper": block(1.0, self.width)})
        return bodies.joined("upper bottom", "lower top")

    def scene(self, frame: Frame) -> ec.Scene:
        """Declare the scene in a frame."""
        unit, modulus = frame.length, frame.modulus
        is_ring = self.kind == "ring"
        way = unit * np.array(frame.way[: self.d])
        way[0] *= not is_ring
        aside: tuple[Any, ...] = (None if is_ring else way[0], *way[1:-1])
        top = "upper top" if self.is_pair else "top"
        down = -self.amount * unit if self.driven == "moved" else 0.0
        supports = [ec.Displacement(top, (*aside, way[-1] + down))]
        loads = []
        if self.driven == "pressed":
            side = "upper right" if self.is_pair else "right"
            loads = [ec.Traction(side, pressure=self.amount * modulus)]
        options: dict[str, Any] = {"gap": self._gap(unit), "friction": self._friction(modulus)}
        if self.is_pair:
            supports.append(ec.Displacement("lower bottom", (*aside, way[-1])))
            contact = ec.Contact("upper bottom", against="lower top", **options)
        else:
            contact = ec.Contact("bottom", motion=tuple(way.tolist()), **options)
        hypothesis = "axisymmetric" if is_ring else "plane strain"
        material = ec.Elastic(modulus, self.nu, hypothesis=hypothesis)
        strains = [ec.ThermalStrain(1e-4, 50.0)] if self.driven == "heated" else []
        return ec.Scene(material, supports, loads, [contact], strains=strains)

    def _gap(self, unit: float) -> Any:
        """Return the gap [length]."""
        if self.gap == "varies":
            return lambda x: unit * (self.size * (x[0] / unit - self.low) ** 2 - 0.001)
        return unit * self.size * (1.0 if self.gap == "above zero" else -1.0)

    def _friction(self, modulus: float) -> Any:
        """Return the friction of the contact."""
        return {"none": 0.0, "Coulomb": 0.3, "Tresca": ec.Tresca(0.003 * modulus)}[self.friction]


def measured(case: Case) -> Iterator[tuple[float, np.ndarray]]:
    """Return eps and the contact force over modulus and area, in every way."""
    for frame in FRAMES:
        scene, domain = case.scene(frame), case.domain(frame.length)
        area = frame.length ** (1 if case.kind == "plane" else 2)
        for solver in ("direct", "iterative")[: 3 - case.degree]:
            solution = ec.solve(scene, domain, degree=case.degree, solver=solver)
            error = ec.constitutive_error(ec.equilibrate(solution))
            force = solution.force(scene.contacts[0].facets).force
            yield error.relative, np.array(force) / (area * frame.modulus)


def main(seed: int = 0, count: int = 100) -> None:
    """Print how far the ways of solving random scenes are from each other."""
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    found: dict[str, list[float]] = {"eps": [], "force": []}
    refused = different = still = 0
    for number in range(count):
        case = Case(np.random.default_rng([seed, number]))
        try:
            results = list(measured(case))
        except ec.ErcContactError as failure:
            refused += 1
            print(f"{number}, {case}: {type(failure).__name__}: {str(failure)[:200]}")
            continue
        eps = np.array([of_way for of_way, _ in results])
        forces = np.array([force for _, force in results])
        if abs(forces).max() < NO_STRESS:
            still += 1
            continue
        found["eps"].append(float(np.ptp(eps) / max(eps.max(), LEAST_EPS)))
        found["force"].append(float(np.ptp(forces, axis=0).max() / abs(forces).max()))
        if max(found["eps"][-1], found["force"][-1]) > SAME:
            different += 1
            print(f"{number}, {case}: eps {eps}, force {forces[:, -1]}")
    print(f"seed {seed}, {count} scenes, {still} without stress, {refused} refused")
    print(f"{different} different")
    for name, values in found.items():
        median, most, worst = np.percentile(values, (50, 95, 100))
        print(f"{name}: median {median:.1e}, 95% {most:.1e}, greatest {worst:.1e}")


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
