"""Small scenes at the edge of what a contact solver meets, for ``test_extremes.py`` (serial).

Existence: with supports that hold the body, the discrete problem of static Coulomb
friction has a solution for any friction coefficient. A body that only contact holds has
one if the loads lie strictly inside what the friction cones can balance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from scenes import two_halves

import erc_contact as ec

Pair = tuple[ec.Scene, ec.Domain]
MESHES = Path(__file__).parents[1] / "meshes"


def mapped(domain: ec.Domain, new: Callable[[np.ndarray], Sequence[Any]]) -> ec.Domain:
    """The same mesh with its vertices moved to ``new(x)``, x of shape (d, vertices)."""
    x = domain.mesh.geometry.x
    x[:, : domain.dim] = np.column_stack(new(x[:, : domain.dim].T.copy()))
    return domain


def rotated(domain: ec.Domain, degrees: float) -> ec.Domain:
    c, s = cos(radians(degrees)), sin(radians(degrees))
    return mapped(domain, lambda x: (c * x[0] - s * x[1], s * x[0] + c * x[1]))


def square(nx: int = 8, ny: int = 8) -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(nx, ny))


def tower() -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (1.0, 4.0), cells=(6, 24))


def cube(n: int = 3) -> ec.Domain:
    return ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(n, n, n))


def graded(least: float) -> ec.Domain:
    """The unit square with rows whose heights above the contact grow geometrically from ``least`` to 1."""
    return mapped(
        square(16, 24),
        lambda x: (x[0], np.where(x[1] > 0, least ** (1 - (24 * x[1] - 1) / 23), 0.0)),
    )


def block(
    push: Sequence[float] = (0.1, -0.05),
    *,
    E: float = 1.0,
    nu: float = 0.3,
    friction: float = 0.3,
    gap: float = 0.0,
    size: float = 1.0,
    n: int = 4,
) -> Pair:
    """The 2 x 7 block of several contact codes, its top displaced, its right side pushed, in chosen units."""
    scene = ec.Scene(
        material=ec.Elastic(E, nu),
        supports=[ec.Displacement("top", tuple(size * p for p in push))],
        loads=[ec.Traction("right", (-0.0002 * E, 0.0))],
        contacts=[ec.Contact("bottom", friction=friction, gap=gap)],
    )
    return scene, ec.rectangle((0.0, 0.0), (2 * size, 7 * size), cells=(n, 7 * n // 2))


def pressed(
    domain: ec.Domain, push: Sequence[float] = (0.02, -0.05), friction: float = 0.3, E: Any = 1.0
) -> Pair:
    """A body with its top displaced, its bottom on a foundation."""
    support, contact = ec.Displacement("top", tuple(push)), ec.Contact("bottom", friction=friction)
    return ec.Scene(ec.Elastic(E, 0.3), [support], contacts=[contact]), domain


def greco(*, E: float = 130e3, size: float = 1.0) -> Pair:
    """Compressed and pushed block (GRECO): only the contact holds it vertically."""
    scene = ec.Scene(
        material=ec.Elastic(E, 0.2),
        supports=[ec.Displacement("right", (0.0, None))],
        loads=[ec.Traction("top", pressure=E / 2600), ec.Traction("left", pressure=3 * E / 2600)],
        contacts=[ec.Contact("bottom", friction=1.0)],
    )
    return scene, ec.rectangle((0.0, 0.0), (40 * size, 40 * size), cells=(8, 8))


def standing(
    push: Sequence[float], domain: ec.Domain | None = None, parts: Any = ("bottom",), **contact: Any
) -> Pair:
    """A body with nothing but contact to hold it, under a body force (in thousandths of E)."""
    contacts = [ec.Contact(part, **{"friction": 0.5, **contact}) for part in parts]
    weight = ec.BodyForce(tuple(1e-3 * p for p in push))
    return ec.Scene(ec.Elastic(1.0, 0.3), loads=[weight], contacts=contacts), domain or square()


def wedge(friction: float, weight: float = -1.0) -> Pair:
    """A wedge between two planes of slope 1:2 from the vertical, pressed in (or pulled out) by its weight."""
    domain = mapped(square(), lambda x: ((x[0] - 0.5) * (0.4 + x[1]), x[1]))
    return standing((0.0, weight), domain, ("left", "right"), friction=friction)


def in_a_channel() -> Pair:
    """A square pressed into a channel, whose walls it meets as it expands.

    Three contacts with friction.
    """
    contacts = [ec.Contact("bottom", friction=0.3)]
    contacts += [ec.Contact(side, friction=0.3, gap=0.002) for side in ("left", "right")]
    return ec.Scene(
        ec.Elastic(1.0, 0.3), loads=[ec.Traction("top", pressure=0.05)], contacts=contacts
    ), square()


def partly_clamped(clamped: Callable[[np.ndarray], Any]) -> Pair:
    """A square with a part of its bottom clamped, the rest in contact, pressed and sheared at its top."""
    scene, domain = pressed(square(), (0.02, -0.02))
    tags = domain.facet_tags
    own = (tags.values == domain.names["bottom"]) & clamped(
        dmesh.compute_midpoints(domain.mesh, 1, tags.indices).T
    )
    tags = dmesh.meshtags(
        domain.mesh, 1, tags.indices, np.where(own, 9, tags.values).astype(np.int32)
    )
    supports = [ec.Displacement("clamped", (0.0, 0.0)), *scene.supports]
    domain = ec.Domain(domain.mesh, tags, {**domain.names, "clamped": 9})
    return ec.Scene(scene.material, supports, contacts=scene.contacts), domain


def hertz() -> Pair:
    """A half disc on a plane, pressed and sheared."""
    contact = ec.Contact("arc", friction=0.3, normal=(0.0, -1.0), gap=lambda x: x[1])
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), [ec.Displacement("top", (0.01, -0.02))], contacts=[contact]
    )
    return scene, ec.read_mesh(MESHES / "half_disc.geo")


def roller_pulled_off(friction: float) -> Pair:
    """A block on a roller that leaves it free to rise, pulled upwards."""
    supports, loads = [ec.Displacement("left", (0.0, None))], [ec.Traction("top", (0.0, 0.01))]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), supports, loads, [ec.Contact("bottom", friction=friction)]
    )
    return scene, square()


SLIVERS = round(4 / np.tan(radians(1.0)))
SOLVABLE: dict[str, Callable[[], Pair]] = {
    **{
        f"nu {nu}, {n} squares": partial(block, nu=nu, n=n)
        for nu in (0.0, 0.49, 0.4999)
        for n in (4, 8)
    },
    **{
        f"mu {mu} sheared hard": lambda mu=mu: pressed(square(), (0.3, -0.05), mu)
        for mu in (0.0, 1.0, 20.0)
    },
    "opens altogether": lambda: block((0.0, 0.05)),
    "just touches": lambda: block((0.0, -0.02), gap=0.02),
    "slips everywhere": lambda: pressed(square(), (1.0, -0.05)),
    "tips onto an edge": lambda: pressed(tower(), (1.0, -0.02), 1.0),
    "stands pushed": lambda: standing((0.3, -1.0)),
    "stands pushed to 98% of the limit": lambda: standing((0.49, -1.0)),
    "stands pushed, mu 20": lambda: standing((0.3, -1.0), friction=20.0),
    "stands above a gap": lambda: standing((0.3, -1.0), gap=0.01),
    "stands pushed in space": lambda: standing((0.2, 0.1, -1.0), cube()),
    "tower leans": lambda: standing((0.2, -1.0), tower(), friction=1.0),
    "slope 15 degrees, mu 0.5": lambda: standing((0.0, -1.0), rotated(square(), 15.0)),
    "slope 44 degrees, mu 1": lambda: standing(
        (0.0, -1.0), rotated(square(24, 24), 44.0), friction=1.0
    ),
    "wedge mu 0": lambda: wedge(0.0),
    "wedge mu 0.2, below the slope": lambda: wedge(0.2),
    "wedge mu 1, above the slope": lambda: wedge(1.0),
    "three contacts": in_a_channel,
    "column 1:100": lambda: pressed(
        ec.rectangle((0.0, 0.0), (1.0, 100.0), cells=(2, 200)), (0.5, -0.05)
    ),
    "soft at the contact": lambda: pressed(two_halves(square()), E={"lower": 1.0, "upper": 1e6}),
    "hard at the contact": lambda: pressed(two_halves(square()), E={"lower": 1e6, "upper": 1.0}),
    "graded 1:1e5 in rows": lambda: pressed(graded(1e-5)),
    "slivers along the contact": lambda: pressed(square(4, SLIVERS)),
    "slivers across the contact": lambda: pressed(square(SLIVERS, 4)),
    "one square": lambda: pressed(square(1, 1)),
    "contact next to a clamp": lambda: partly_clamped(lambda x: x[0] < 0.5),
    "one contact facet next to a clamp": lambda: partly_clamped(lambda x: x[0] < 0.87),
    "contact between two clamps": lambda: partly_clamped(lambda x: abs(x[0] - 0.5) > 0.25),
    "Hertz mu 0.3, sheared": hertz,
    "zero load": lambda: pressed(square(), (0.0, 0.0)),
}
"""Scenes that have a solution."""

UNSOLVABLE: dict[str, Callable[[], Pair]] = {
    "nothing holds it sideways": lambda: standing((0.0, -1.0), friction=0.0),
    "pulled off": lambda: standing((0.0, 1.0)),
    "pulled off and sideways": lambda: standing((0.3, 0.5)),
    "pulled off a roller": lambda: roller_pulled_off(0.0),
    "pulled off a roller, mu 0.5": lambda: roller_pulled_off(0.5),
    "pushed beyond the limit": lambda: standing((0.3, -1.0), friction=0.1),
    "pushed to 102% of the limit": lambda: standing((0.51, -1.0)),
    "pushed beyond the limit above a gap": lambda: standing((0.6, -1.0), gap=0.01),
    "slope 15 degrees, mu 0.2": lambda: standing(
        (0.0, -1.0), rotated(square(), 15.0), friction=0.2
    ),
    "tower tips over": lambda: standing((0.3, -1.0), tower(), friction=1.0),
    "wedge pulled out": lambda: wedge(0.2, 1.0),
    "beyond the limit in space": lambda: standing((0.4, 0.4, -1.0), cube()),
    "pulled off in space": lambda: standing((0.1, 0.0, 1.0), cube()),
}
"""Scenes that have none."""


def loaded(build: Callable[..., Pair], sideways: float, value: float) -> Pair:
    return build(push=(sideways * value, -value), domain=square())


UNITS: dict[str, list[Callable[[], Pair]]] = {
    "block": [
        partial(block, E=10.0**k, size=10.0**m, n=8)
        for k, m in ((0, 0), (-9, 0), (12, 0), (0, -6), (3, 3))
    ],
    "GRECO": [
        partial(greco, E=10.0**k, size=10.0**m)
        for k, m in ((0, 0), (-9, 0), (12, 0), (0, -6), (3, 3))
    ],
    "displacement": [partial(loaded, pressed, 0.4, 10.0**k) for k in (0, -100, -50, 50, 100)],
    "force": [partial(loaded, standing, 0.3, 10.0**k) for k in (0, -100, -50, 50, 100)],
}
"""Scenes that are the same in other units or, where no gap has a size, under a multiple of the load."""

BEYOND: dict[str, Callable[[], Pair]] = {
    f"{what} 1e{k:+d}": partial(loaded, build, sideways, 10.0**k)
    for what, build, sideways in (("displacement", pressed, 0.4), ("force", standing, 0.3))
    for k in (-300, -150, 150, 300)
}
"""Loads whose energies are beyond double precision: solved, or refused by an InputError."""
