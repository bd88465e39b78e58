"""Solve stacks of bodies at the edge of what contact between bodies is.

A partial overlap, a contact that opens everywhere, a sandwich whose middle only
contacts hold, five blocks that their weight presses, a body that only a contact holds,
one that only friction holds, and tied ones; in the plane and in 3D, degrees 1 and 2,
both methods, both solvers. "check" is the largest deviation of the contact forces from
what balance says of them, over the largest force. What fails is told in words.

    OMP_NUM_THREADS=1 python benchmarks/stacks.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first

METHODS: tuple[Any, ...] = (ec.Nitsche(), ec.AugmentedLagrangian())
LEAST_FORCE = 1e-3
"""Least force that the check is relative to, over the modulus [length^(d-1)]."""
WEIGHT = 0.002
"""Force per volume over the modulus [-]."""


@dataclass(frozen=True)
class Case:
    """Hold a scene with what balance says of its contacts.

    Attributes:
        scene: The scene.
        domain: The mesh.
        forces: What the forces on some parts add up to, by the names of these parts.
    """

    scene: ec.Scene
    domain: ec.Domain
    forces: dict[tuple[str, ...], tuple[float, ...]]


def stack(d: int, count: int, shift: float = 0.0) -> ec.Domain:
    """Make bricks "0", "1", ... on each other, of width 2 and height 1."""
    bodies = {}
    for i in range(count):
        low = (-1.0 + i * shift, *(-1.0,) * (d - 2), float(i))
        high = (1.0 + i * shift, *(1.0,) * (d - 2), float(i + 1))
        # The facets of neighbours do not match in the plane.
        columns = (4 + i % 2, 3) if d == 2 else (2, 2, 2)
        make: Any = ec.rectangle if d == 2 else ec.box
        bodies[str(i)] = make(low, high, cells=columns)
    domain = ec.assembly(bodies)
    for lower, upper in pairs(count):
        domain = domain.joined(upper, lower)
    return domain


def pairs(count: int) -> list[tuple[str, str]]:
    """Return the names of facing parts, of the lower body first."""
    return [(f"{i} top", f"{j} bottom") for i, j in pairwise(range(count))]


def vector(d: int, along: float, up: float) -> tuple[float, ...]:
    """Return a vector along the first axis and up the last one."""
    return (along, *(0.0,) * (d - 2), up)


def touching(count: int, **options: Any) -> list[ec.Contact]:
    """Return the contacts of a stack."""
    how = {"friction": 0.3} | options
    return [ec.Contact(upper, against=lower, **how) for lower, upper in pairs(count)]


def held(d: int, part: str, along: float = 0.0, up: float = 0.0) -> ec.Displacement:
    """Return the support of a part that is moved."""
    return ec.Displacement(part, vector(d, along, up))


def partial_overlap(d: int) -> Case:
    """Press a body on another one that it covers in part."""
    supports = [held(d, "0 bottom"), held(d, "1 top", 0.005, -0.02)]
    return Case(ec.Scene(steel(), supports, [], touching(2)), stack(d, 2, 0.7), {})


def opens_everywhere(d: int) -> Case:
    """Move two bodies away from each other."""
    supports = [held(d, "0 bottom"), held(d, "1 top", 0.005, 0.02)]
    nothing: dict[tuple[str, ...], tuple[float, ...]] = {}
    nothing["1 bottom",] = vector(d, 0.0, 0.0)
    return Case(ec.Scene(steel(), supports, [], touching(2)), stack(d, 2), nothing)


def sandwich(d: int) -> Case:
    """Press a body between two others, which slide past each other."""
    supports = [held(d, "0 bottom"), held(d, "2 top", 0.005, -0.02)]
    return Case(ec.Scene(steel(), supports, [], touching(3)), stack(d, 3), {})


def five_by_weight(d: int) -> Case:
    """Put five blocks on each other, which their weight presses on a foundation."""
    load = ec.BodyForce(vector(d, 0.0, -WEIGHT))
    contacts = [ec.Contact("0 bottom", friction=0.3), *touching(5)]
    volume = 2.0 ** (d - 1)
    forces: dict[tuple[str, ...], tuple[float, ...]] = {}
    for i in range(5):
        forces[f"{i} bottom",] = vector(d, 0.0, (5 - i) * volume * WEIGHT)
    return Case(ec.Scene(steel(), [], [load], contacts), stack(d, 5), forces)


def by_contact_only(d: int) -> Case:
    """Press a body that nothing but a contact holds, and push it below its friction."""
    load = ec.Traction("1 top", vector(d, 0.002, -0.02))
    area = 2.0 ** (d - 1)
    forces: dict[tuple[str, ...], tuple[float, ...]] = {}
    forces["1 bottom",] = vector(d, -0.002 * area, 0.02 * area)
    return Case(ec.Scene(steel(), [held(d, "0 bottom")], [load], touching(2)), stack(d, 2), forces)


def by_friction_only(d: int) -> Case:
    """Hold a body between two jaws by friction alone, against its weight along them."""
    supports = [held(d, "0 bottom"), held(d, "2 top", 0.0, -0.02)]
    load = ec.BodyForce(vector(d, WEIGHT, 0.0))
    forces: dict[tuple[str, ...], tuple[float, ...]] = {}
    forces["1 bottom", "1 top"] = vector(d, -WEIGHT * 2.0 ** (d - 1), 0.0)
    return Case(ec.Scene(steel(), supports, [load], touching(3)), stack(d, 3), forces)


def tied_five(d: int) -> Case:
    """Hang five glued blocks up by the first, of moduli from 1 to 1e4."""
    E = {str(i): 10.0**i for i in range(5)}
    load = ec.BodyForce(vector(d, 0.0, -WEIGHT))
    ties = [ec.Tied(upper, lower) for lower, upper in pairs(5)]
    volume = 2.0 ** (d - 1)
    forces: dict[tuple[str, ...], tuple[float, ...]] = {}
    for i in range(1, 5):
        forces[f"{i} bottom",] = vector(d, 0.0, (5 - i) * volume * WEIGHT)
    scene = ec.Scene(ec.Elastic(E, 0.3), [held(d, "0 bottom")], [load], ties=ties)
    return Case(scene, stack(d, 5), forces)


def steel() -> ec.Elastic:
    """Return the material of all bodies."""
    return ec.Elastic(1.0, 0.3)


CASES: dict[str, Callable[[int], Case]] = {
    "partial overlap": partial_overlap,
    "opens everywhere": opens_everywhere,
    "sandwich": sandwich,
    "five by their weight": five_by_weight,
    "held by contact only": by_contact_only,
    "held by friction only": by_friction_only,
    "five tied, E to 1e4": tied_five,
}


def deviation(case: Case, error: ec.ConstitutiveError) -> float:
    """Return the largest deviation of forces from balance, over the largest force."""
    forces = {name: force.force for name, force in error.reactions().items()}
    size = max(LEAST_FORCE, *(float(abs(force).max()) for force in forces.values()))
    worst = [abs(forces["balance"]).max()]
    for parts, expected in case.forces.items():
        total = np.sum([forces[part] for part in parts], axis=0)
        worst.append(abs(total - expected).max())
    for part, force in forces.items():
        # Action and reaction, where there is a body above.
        below, _, side = part.partition(" ")
        above = f"{int(below) + 1} bottom" if side == "top" else ""
        if above in forces:
            worst.append(abs(force + forces[above]).max())
    return float(np.max(worst) / size)


def main() -> None:
    """Print the table."""
    print("| scene | | solved | eps | check |")
    print("|---|---|---|---|---|")
    for (name, make), d in product(CASES.items(), (2, 3)):
        case = make(d)
        tried = 0
        eps = []
        checks = []
        for degree, method, solver in product((1, 2), METHODS, ("direct", "iterative")):
            tried += 1
            try:
                solution = ec.solve(case.scene, case.domain, method, degree=degree, solver=solver)
                error = ec.constitutive_error(ec.equilibrate(solution))
            except ec.ErcContactError as reason:
                kind = f"degree {degree}, {method}, {solver}"
                print(f"{name}, {d}D, {kind}: {type(reason).__name__} {str(reason)[:200]}")
                continue
            eps.append(error.relative)
            checks.append(deviation(case, error))
        numbers = "| | |"
        if eps:
            least, most = np.min(eps), np.max(eps)
            numbers = f"| {least:.2%} to {most:.2%} | {max(checks):.0e} |"
        print(f"| {name} | {d}D | {len(eps)} of {tried} {numbers}", flush=True)


if __name__ == "__main__":
    main()
