"""What the flat facets of curved bodies in 3D change of the energy, and the estimate.

Spherical shells, balls, tubes, shells of a torus and plates with a hole, of random
sizes. Each is a body of revolution or in plane strain, so the energy of the true shape
is of a fine mesh in the plane, see ``curved.py``.

    python benchmarks/curved_in_space.py 30 0    # how many bodies, and the seed
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from typing import Any

from curved import FINE, PRESSURE, compare, drawn, energy_of, print_summary, scene

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from numpy.random import Generator, default_rng  # isort: skip

LEVEL = 0.5
"""Height of tubes and plates [length]."""
NAMES = {"x": 0, "y": 1, "z": 2}
"""Coordinate that is zero on planes of symmetry."""
Depth = Callable[[np.ndarray], bool]
"""Type of what tells whether a place is on the surface inside."""


def parts_of(gmsh: Any, dim: int, inside: Depth) -> dict[str, list[int]]:
    """Name the sides of a body: planes by the coordinate that they keep, bore and rim.

    The plane at the height of tubes and plates is "top", other planes are "far".
    """
    gmsh.model.occ.synchronize()
    parts: dict[str, list[int]] = {}
    for _, tag in gmsh.model.getEntities(dim - 1):
        low, high = np.reshape(gmsh.model.getBoundingBox(dim - 1, tag), (2, 3))
        flat = [name for name, i in NAMES.items() if i < dim and high[i] < 1e-3]
        is_plane = gmsh.model.getType(dim - 1, tag) in ("Plane", "Line")
        if is_plane and not flat:
            flat = ["top" if dim == 3 and low[2] > LEVEL - 1e-3 else "far x"]
            if high[1] - low[1] < 1e-3:
                flat = ["far y"]
        ends = gmsh.model.getParametrizationBounds(dim - 1, tag)
        middle = np.mean(ends, axis=0)
        place = np.array(gmsh.model.getValue(dim - 1, tag, middle))
        curved = "bore" if inside(place) else "rim"
        parts.setdefault(flat[0] if is_plane else curved, []).append(tag)
    return parts


def sphere(a: float, size: float, dim: int) -> ec.Domain:
    """Mesh an eighth of a spherical shell of radii a and 1, or its section.

    If a is 0 it is a ball.
    """

    def build(gmsh: Any) -> dict[str, list[int]]:
        occ = gmsh.model.occ
        add = occ.addSphere if dim == 3 else lambda x, y, z, r: occ.addDisk(x, y, z, r, r)
        body = [(dim, add(0, 0, 0, 1))]
        if a:
            body, _ = occ.cut(body, [(dim, add(0, 0, 0, a))])
        _quarter(occ, body, dim)
        return parts_of(gmsh, dim, lambda x: bool(np.linalg.norm(x) < (1 + a) / 2))

    return drawn(build, size, dim)


def torus(a: float, size: float, dim: int) -> ec.Domain:
    """Mesh an eighth of a shell of a torus of radii 1.5, a and 1, or its section."""

    def build(gmsh: Any) -> dict[str, list[int]]:
        occ = gmsh.model.occ
        if dim == 3:
            body, hollow = (occ.addTorus(0, 0, 0, 1.5, r) for r in (1, a))
        else:
            body, hollow = (occ.addDisk(1.5, 0, 0, r, r) for r in (1, a))
        cut, _ = occ.cut([(dim, body)], [(dim, hollow)])
        _quarter(occ, cut, dim)

        def inside(x: np.ndarray) -> bool:
            r, z = (np.hypot(x[0], x[1]), x[2]) if dim == 3 else x[:2]
            return bool(np.hypot(r - 1.5, z) < (1 + a) / 2)

        return parts_of(gmsh, dim, inside)

    return drawn(build, size, dim)


def _quarter(occ: Any, body: list[tuple[int, int]], dim: int) -> None:
    """Keep what has no negative coordinate."""
    tool = occ.addBox(0, 0, 0, 3, 3, 3) if dim == 3 else occ.addRectangle(0, 0, 0, 3, 3)
    occ.intersect(body, [(dim, tool)])


def tube(a: float, size: float, dim: int) -> ec.Domain:
    """Mesh a quarter of a tube of radii a and 1, or its section."""

    def build(gmsh: Any) -> dict[str, list[int]]:
        occ = gmsh.model.occ
        disc, hole = (occ.addDisk(0, 0, 0, r, r) for r in (1, a))
        body, _ = occ.cut([(2, disc)], [(2, hole)])
        return _raised(gmsh, body, dim, (1 + a) / 2)

    return drawn(build, size, dim)


def plate(a: float, size: float, dim: int) -> ec.Domain:
    """Mesh a quarter of a square with a hole of radius a, or its section."""

    def build(gmsh: Any) -> dict[str, list[int]]:
        occ = gmsh.model.occ
        square, hole = occ.addRectangle(-1, -1, 0, 2, 2), occ.addDisk(0, 0, 0, a, a)
        body, _ = occ.cut([(2, square)], [(2, hole)])
        return _raised(gmsh, body, dim, 2.0)

    return drawn(build, size, dim)


def _raised(
    gmsh: Any, body: list[tuple[int, int]], dim: int, between: float
) -> dict[str, list[int]]:
    """Keep a quarter of a section, give it its height, and name its sides."""
    occ = gmsh.model.occ
    _quarter(occ, body, 2)
    if dim == 3:
        occ.extrude(occ.getEntities(2), 0, 0, LEVEL)
    return parts_of(gmsh, dim, lambda x: bool(np.hypot(x[0], x[1]) < between))


def random_case(
    random: Generator, number: int
) -> tuple[str, ec.Scene, ec.Scene, Callable[[float, int], ec.Domain], float]:
    """Return a body: its name, scenes in 3D and in the plane, mesh and share.

    The share is the energy in 3D over the energy of the section.
    """
    a = random.uniform(0.3, 0.75)
    inside = ec.Traction("bore", pressure=PRESSURE)
    outside = ec.Traction("rim", pressure=PRESSURE)
    pulled = ec.Traction("far x", pressure=-PRESSURE)
    by_axis = {3: lambda x: PRESSURE * x[2] ** 2, 2: lambda x: PRESSURE * x[1] ** 2}
    level = {dim: ec.Traction("rim", pressure=p) for dim, p in by_axis.items()}
    turned = scene(inside, axisymmetric=True)
    in_plane = scene(inside)
    walls = ec.Symmetry("top")

    def walled(load: Any) -> ec.Scene:
        held: list[Any] = [*(ec.Symmetry(name) for name in "xyz"), walls]
        return ec.Scene(in_plane.material, held, loads=load)

    whole = scene(inside, planes="xyz")
    pressed = scene(outside, planes="xyz")
    cases: list[Any] = [
        ("shell, pressed inside", whole, turned, sphere, a, 0.25),
        ("shell, pressed outside", pressed, scene(outside, axisymmetric=True), sphere, a, 0.25),
        (
            "ball, pressed",
            scene(level[3], planes="xyz"),
            scene(level[2], axisymmetric=True),
            sphere,
            0.0,
            0.25,
        ),
        ("tube, pressed inside", walled(inside), in_plane, tube, a, LEVEL),
        ("torus, pressed inside", whole, turned, torus, a, 0.25),
        ("plate, pulled", walled(pulled), scene(pulled), plate, 0.8 * a, LEVEL),
    ]
    name, in_space, section, mesh, radius, share = cases[number % len(cases)]
    return name, in_space, section, lambda size, dim: mesh(radius, size, dim), share


def main(count: int, seed: int) -> None:
    """Print the family."""
    random = default_rng(seed)
    found = []
    for number in range(count):
        name, in_space, section, make, share = random_case(random, number)
        domain = make(random.uniform(0.25, 0.5), 3)
        true = share * energy_of(section, make(FINE, 2))
        found.append(compare(name, in_space, domain, true))
    print_summary(found)


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    main(int(sys.argv[1]), int(sys.argv[2]))
