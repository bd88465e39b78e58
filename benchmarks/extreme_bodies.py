"""Make bodies on foundations at the edge of what a contact solver meets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi
from typing import Any

import numpy as np
from extreme_domains import half_disc, mapped, square, with_part

import erc_contact as ec

import basix.ufl  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip

from erc_contact.base.ufl_types import Value

from dolfinx import mesh as dmesh  # isort: skip
from mpi4py import MPI  # isort: skip

Pair = tuple[ec.Scene, ec.Domain]
"""A scene and its mesh."""


def block(
    push: Sequence[float] = (0.1, -0.05),
    *,
    E: float = 1.0,
    nu: float = 0.3,
    friction: Value = 0.3,
    gap: Value = 0.0,
    size: float = 1.0,
    n: int = 4,
) -> Pair:
    """Make the scene of the 2 x 7 block of several contact codes, in chosen units.

    Its top is displaced, its right side pushed.
    """
    scene = ec.Scene(
        material=ec.Elastic(E, nu),
        supports=[ec.Displacement("top", tuple(size * p for p in push))],
        loads=[ec.Traction("right", (-0.0002 * E, 0.0))],
        contacts=[ec.Contact("bottom", friction=friction, gap=gap)],
    )
    return scene, ec.rectangle((0.0, 0.0), (2 * size, 7 * size), cells=(n, 7 * n // 2))


def pressed(domain: ec.Domain, push: Sequence[float] = (0.02, -0.05), **contact: Any) -> Pair:
    """Make a body with its top displaced, its bottom on a foundation."""
    contacts = [ec.Contact("bottom", **{"friction": 0.3, **contact})]
    return ec.Scene(
        ec.Elastic(1.0, 0.3), [ec.Displacement("top", tuple(push))], contacts=contacts
    ), domain


def layered(domain: ec.Domain, low: float, high: float) -> Pair:
    """Make a pressed body of two layers with two moduli."""
    scene, _ = pressed(domain)
    return ec.Scene(
        ec.Elastic({"low": low, "high": high}, 0.3), scene.supports, contacts=scene.contacts
    ), domain


def greco(*, E: float = 130e3, size: float = 1.0, n: int = 8, friction: float = 1.0) -> Pair:
    """Make the compressed and pushed block (GRECO).

    Only the contact holds it vertically.
    """
    scene = ec.Scene(
        material=ec.Elastic(E, 0.2),
        supports=[ec.Displacement("right", (0.0, None))],
        loads=[ec.Traction("top", pressure=E / 2600), ec.Traction("left", pressure=3 * E / 2600)],
        contacts=[ec.Contact("bottom", friction=friction)],
    )
    return scene, ec.rectangle((0.0, 0.0), (40 * size, 40 * size), cells=(n, n))


def standing(
    push: Sequence[float], domain: ec.Domain | None = None, parts: Any = ("bottom",), **contact: Any
) -> Pair:
    """Make a body with nothing but contact to hold it, under a body force.

    The force is in thousandths of E.
    """
    contacts = [ec.Contact(part, **{"friction": 0.5, **contact}) for part in parts]
    weight = ec.BodyForce(tuple(1e-3 * p for p in push))
    return ec.Scene(ec.Elastic(1.0, 0.3), loads=[weight], contacts=contacts), domain or square()


def wedge(friction: float, weight: float = -1.0) -> Pair:
    """Make a wedge between two planes of slope 1:2 from the vertical.

    Its weight presses it in, or pulls it out.
    """
    domain = mapped(square(), lambda x: ((x[0] - 0.5) * (0.4 + x[1]), x[1]))
    return standing((0.0, weight), domain, ("left", "right"), friction=friction)


def in_a_corner() -> Pair:
    """Make a square pressed into a frictionless corner."""
    loads = [ec.Traction("top", pressure=0.02), ec.Traction("right", pressure=0.01)]
    contacts = [ec.Contact("left"), ec.Contact("bottom")]
    return ec.Scene(ec.Elastic(1.0, 0.3), loads=loads, contacts=contacts), square()


def in_a_channel() -> Pair:
    """Make a square pressed into a channel: three contacts with friction.

    It meets the walls as it expands.
    """
    contacts = [ec.Contact("bottom", friction=0.3)]
    contacts += [ec.Contact(side, friction=0.3, gap=0.002) for side in ("left", "right")]
    return ec.Scene(
        ec.Elastic(1.0, 0.3), loads=[ec.Traction("top", pressure=0.05)], contacts=contacts
    ), square()


def partly_clamped(clamped: Callable[[np.ndarray], Any], n: int = 8) -> Pair:
    """Make a square with a part of its bottom clamped, the rest in contact.

    It is pressed and sheared at its top.
    """
    scene, domain = pressed(with_part(square(n, n), "clamped", "bottom", clamped), (0.02, -0.02))
    supports = [ec.Displacement("clamped", (0.0, 0.0)), *scene.supports]
    return ec.Scene(scene.material, supports, contacts=scene.contacts), domain


def one_facet() -> Pair:
    """Make a square that touches with one facet in the middle of its bottom."""
    domain = with_part(square(9, 9), "foot", "bottom", lambda x: abs(x[0] - 0.5) < 0.05)
    scene, domain = pressed(domain)
    return ec.Scene(
        scene.material, scene.supports, contacts=[ec.Contact("foot", friction=0.3)]
    ), domain


def held_at_the_side() -> Pair:
    """Make a cantilever on a foundation.

    A corner of the contact is fixed by the support.
    """
    supports, loads = [ec.Displacement("left", (0.0, 0.0))], [ec.Traction("top", (0.002, -0.01))]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, loads, [ec.Contact("bottom", friction=0.3)])
    return scene, ec.rectangle((0.0, 0.0), (3.0, 1.0), cells=(18, 6))


def rod_on_its_side() -> Pair:
    """Make a rod 100 : 1 that lies on a foundation.

    It is pressed along its length and pulled at one end.
    """
    supports = [ec.Displacement("left", (0.0, 0.0))]
    loads = [ec.Traction("top", pressure=1e-3), ec.Traction("right", (5e-3, 0.0))]
    scene = ec.Scene(ec.Elastic(1.0, 0.3), supports, loads, [ec.Contact("bottom", friction=0.3)])
    return scene, ec.rectangle((0.0, 0.0), (100.0, 1.0), cells=(200, 2))


def continuum_of_solutions() -> Pair:
    """Make a triangle that slides along a branch of exact solutions.

    Its friction is 2, and each solution has e = 0.
    """
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.4, 0.3]])
    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))
    mesh = dmesh.create_mesh(MPI.COMM_SELF, np.array([[0, 1, 2]]), ufl.Mesh(element), x)
    mesh.topology.create_entities(1)
    mesh.topology.create_connectivity(1, 2)
    middle = dmesh.compute_midpoints(mesh, 1, np.arange(3, dtype=np.int32))
    names = {"bottom": 1, "right": 2, "left": 3}
    values = np.select([middle[:, 1] < 0.1, middle[:, 0] > 0.5], [1, 2], 3).astype(np.int32)
    scene = ec.Scene(
        material=ec.Elastic(1.2, 0.2),
        supports=[ec.Displacement("left", (lambda x: 0.1 + 1.6 / 3 * x[1], lambda x: -0.1 * x[1]))],
        loads=[ec.Traction("right", (0.1 * 5**0.5, 0.0))],
        contacts=[ec.Contact("bottom", friction=2.0)],
    )
    return scene, ec.Domain(
        mesh, dmesh.meshtags(mesh, 1, np.arange(3, dtype=np.int32), values), names
    )


def hertz(push: Sequence[float], friction: float, size: float = 0.01) -> Pair:
    """Make a half disc of radius 1 on a plane, with cells of ``size`` below."""
    contact = ec.Contact("arc", friction=friction, normal=(0.0, -1.0), gap=lambda x: x[1])
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), [ec.Displacement("top", tuple(push))], contacts=[contact]
    )
    return scene, half_disc(1.0, size)


def on_a_cylinder(x: Any) -> Any:
    """Return the gap to a cylinder of radius 2 below the middle [length]."""
    return 2.0 - ufl.sqrt(4.0 - (x[0] - 0.5) ** 2)


def on_a_sphere(x: Any) -> Any:
    """Return the gap to a sphere of radius 2 below the middle [length]."""
    return 2.0 - ufl.sqrt(4.0 - (x[0] - 0.5) ** 2 - (x[1] - 0.5) ** 2)


def on_a_sine(x: Any) -> Any:
    """Return the gap to a wavy foundation of height 0.02 [length]."""
    return 0.01 * (1 - ufl.cos(6 * pi * x[0]))


def roller_pulled_off(friction: float) -> Pair:
    """Make a block on a roller that leaves it free to rise, pulled upwards."""
    supports, loads = [ec.Displacement("left", (0.0, None))], [ec.Traction("top", (0.0, 0.01))]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3), supports, loads, [ec.Contact("bottom", friction=friction)]
    )
    return scene, square()
