"""Measure how fast intervals shrink: the order of their width in e.

Blocks are pressed on a foundation by a support, or by a rigid face that may turn. Where
the contact is "free", a part of it opens, and its edge moves with the load. Where it is
"settled", all of it is closed, and it slides all over or has no friction. The order is
the slope of the logarithm of the width over the logarithm of e, on meshes refined one
after the other: four in the plane, in 3D three of degree 1 and two of degree 2.
"last" is the order of the last two meshes. Orders are medians over the scenes.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_families import scene_generator  # isort: skip
from goal_families import block  # isort: skip

MESHES = {(2, 1): 4, (2, 2): 4, (3, 1): 3, (3, 2): 2}
"""Number of meshes by dimension and degree."""
LAWS = ("none", "given", "Coulomb")
NARROW = 1e-9
"""Width over the number below which it is round-off [-]: it has no order."""


def pressed_block(
    rng: np.random.Generator, d: int, law: str, *, settled: bool, rigid: bool
) -> tuple[ec.Scene, ec.Domain]:
    """Make a block under a press.

    Args:
        rng: Makes it random: its size, Poisson's ratio, loads, friction, gap.
        d: Dimension.
        law: Kind of friction.
        settled: Whether the contact set stays as it is.
        rigid: Whether the press is a rigid face that may turn, else a support.
    """
    width = float(np.exp(rng.uniform(-0.2, 0.6)))
    nu = float(rng.uniform(0.0, 0.2 if settled else 0.4))
    depth = float(rng.uniform(0.005, 0.02))
    cells = int(rng.integers(4, 7)) if d == 2 else 2
    domain = block((0.0,) * d, (width, *(1.0,) * (d - 1)), (cells,) * d)
    still = (0.0,) * (d - 2)
    along = depth * float(rng.uniform(0.5, 1.0))
    pull = depth * float(rng.uniform(-0.1, 0.0) if settled else rng.uniform(0.5, 1.5))
    gap: Any = 0.0
    if not settled and rng.random() < 0.5:
        curvature = depth * float(rng.uniform(0.2, 1.0))
        gap = lambda x: curvature * (x[0] - width / 2) ** 2  # noqa: E731
    share = float(rng.uniform(0.01, 0.03) if settled else rng.uniform(0.1, 0.4))
    frictions: dict[str, Any] = {"none": 0.0, "given": ec.Tresca(share * depth), "Coulomb": share}
    contact = ec.Contact("bottom", friction=frictions[law], gap=gap)
    press: Any = ec.Displacement("top", (along, *still, -depth))
    if rigid:
        # A stronger pull would take the face off the foundation.
        pull *= 0.3 * width
        free = (None,) * (d - 1)
        force = (*free, -depth * width)
        torque = depth * width**2 * float(rng.uniform(-0.02, 0.02))
        rotation = None if d == 2 else (0.0, None, 0.0)
        moment = torque if d == 2 else (None, torque, None)
        moves = (along, *still, None)
        press = ec.Rigid("top", moves, rotation=rotation, force=force, moment=moment)
    loads = [ec.Traction("right", (0.0, *still, pull))]
    return ec.Scene(ec.Elastic(1.0, nu), [press], loads, [contact]), domain


def goals_of(d: int, *, rigid: bool) -> dict[str, Any]:
    """Return the goals by their names."""
    up = (*(0.0,) * (d - 1), 1.0)
    axis = None if d == 2 else (0.0, 1.0, 0.0)
    if rigid:
        return {"rotation": ec.Rotation("top", axis=axis)}
    heavier = ec.Traction("right", (*(0.0,) * (d - 1), lambda x: x[d - 1]))
    return {
        "force, support": ec.Resultant("top", up),
        "force, contact": ec.Resultant("bottom", up),
        "mean displacement": ec.MeanDisplacement("right", up),
        "moment": ec.Moment("top", axis=axis),
        "functional": ec.Functional(heavier),
        "energy": ec.Energy(),
    }


def orders_of(
    scene: ec.Scene, domain: ec.Domain, degree: int, goals: dict[str, Any]
) -> dict[str, tuple[float, float]]:
    """Return the orders of each goal whose interval is more than round-off.

    The first counts all meshes, the second the last two.
    """
    sizes = []
    widths: dict[str, list[float]] = {name: [] for name in goals}
    is_narrow = dict.fromkeys(goals, False)
    mesh = domain
    for number in range(MESHES[domain.dim, degree]):
        if number > 0:
            mesh = mesh.refined()
        error = ec.constitutive_error(ec.equilibrate(ec.solve(scene, mesh, degree=degree)))
        sizes.append(error.absolute)
        for name, goal in goals.items():
            bounds = ec.interval(error, goal)
            width = bounds.high - bounds.low
            widths[name].append(max(width, 1e-300))
            is_narrow[name] |= bool(width < NARROW * abs(bounds.value))
    orders = {}
    for name, values in widths.items():
        if not is_narrow[name]:
            logs = np.log(sizes), np.log(values)
            slopes = [np.polyfit(logs[0][i:], logs[1][i:], 1)[0] for i in (0, -2)]
            orders[name] = float(slopes[0]), float(slopes[1])
    return orders


def orders(seed: int, count: int, d: int) -> None:
    """Print the orders by goal, friction, and whether the contact is free.

    They are medians, with the least and the greatest, and the number of scenes.

    Args:
        seed: Seed of the scenes.
        count: Number of scenes of each kind of friction and contact.
        d: Dimension.
    """
    table: dict[tuple[str, str], dict[str, list[tuple[float, float]]]] = {}
    for kind, law in product(("free", "settled"), LAWS):
        for number, rigid in product(range(count), (False, True)):
            rng = scene_generator(seed, number)
            scene, domain = pressed_block(rng, d, law, settled=kind == "settled", rigid=rigid)
            goals = goals_of(d, rigid=rigid)
            try:
                found = orders_of(scene, domain, 1 + number % 2, goals)
            except ec.ErcContactError as reason:
                words = f"{type(reason).__name__} {str(reason)[:150]}"
                print(f"{kind}, {law}, scene {number}, rigid {rigid}: {words}", flush=True)
                continue
            for name, order in found.items():
                table.setdefault((kind, name), {}).setdefault(law, []).append(order)
    print(f"| contact, goal | {' | '.join(LAWS)} |\n{'|---' * (len(LAWS) + 1)}|")
    for (kind, name), by_law in table.items():
        entries = [_entry(by_law.get(law, [])) for law in LAWS]
        print(f"| {kind}, {name} | {' | '.join(entries)} |", flush=True)


def _entry(orders: list[tuple[float, float]]) -> str:
    """Write the median of orders, their range and number, and the last ones' median."""
    if not orders:
        return "none"
    values, last = np.array(orders).T
    spread = f"{values.min():.2f} to {values.max():.2f}, {len(values)}"
    return f"{np.median(values):.2f} ({spread}; last {np.median(last):.2f})"
