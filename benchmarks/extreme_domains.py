"""Make domains at the edge of what a contact solver meets: graded, flat, curved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, radians, sin
from typing import Any

import numpy as np

import erc_contact as ec

from dolfinx import mesh as dmesh  # isort: skip - after erc_contact, which loads MPI first


def mapped(domain: ec.Domain, new: Callable[[np.ndarray], Sequence[Any]]) -> ec.Domain:
    """Move the vertices of a mesh to ``new(x)``, x of shape (d, vertices)."""
    x = domain.mesh.geometry.x
    x[:, : domain.dim] = np.column_stack(new(x[:, : domain.dim].T.copy()))
    return domain


def rotated(domain: ec.Domain, degrees: float) -> ec.Domain:
    """Rotate a domain about the origin."""
    c, s = cos(radians(degrees)), sin(radians(degrees))
    return mapped(domain, lambda x: (c * x[0] - s * x[1], s * x[0] + c * x[1]))


def with_part(
    domain: ec.Domain, name: str, of: str, where: Callable[[np.ndarray], Any]
) -> ec.Domain:
    """Give a name of their own to some facets of a boundary part.

    They are those whose middles x, shape (3, n), satisfy ``where``.
    """
    tags = domain.facet_tags
    middle = dmesh.compute_midpoints(domain.mesh, tags.dim, tags.indices).T
    own = (tags.values == domain.names[of]) & where(middle)
    number = max(domain.names.values()) + 1
    new = dmesh.meshtags(
        domain.mesh, tags.dim, tags.indices, np.where(own, number, tags.values).astype(np.int32)
    )
    return ec.Domain(domain.mesh, new, {**domain.names, name: number})


def halved(domain: ec.Domain, axis: int, at: float) -> ec.Domain:
    """Divide the cells of a domain into two regions, low and high."""
    cells = domain.mesh.topology.index_map(domain.dim)
    every = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    high = dmesh.compute_midpoints(domain.mesh, domain.dim, every)[:, axis] > at
    tags = dmesh.meshtags(domain.mesh, domain.dim, every, np.where(high, 2, 1).astype(np.int32))
    return ec.Domain(domain.mesh, domain.facet_tags, domain.names, tags, {"low": 1, "high": 2})


def from_occ(build: Callable[[Any], None]) -> ec.Domain:
    """Make a domain from a model of gmsh in a session of its own."""
    import gmsh  # noqa: PLC0415 - only these scenes need it

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        build(gmsh)
        return ec.from_gmsh(gmsh.model)
    finally:
        gmsh.finalize()


def square(nx: int = 8, ny: int = 8) -> ec.Domain:
    """Make the unit square."""
    return ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(nx, ny))


def graded_tensor(nx: int, ny: int, least: float) -> ec.Domain:
    """Make the unit square with rows that are graded towards the contact.

    Their heights grow geometrically from ``least`` to 1.
    """
    return mapped(
        square(nx, ny),
        lambda x: (x[0], np.where(x[1] > 0, least ** (1 - (ny * x[1] - 1) / (ny - 1)), 0.0)),
    )


def graded_corner(least: float) -> ec.Domain:
    """Make the unit square with a mesh that is graded towards a corner.

    Triangles have the size ``least`` at a corner of the contact, and about 0.3 far from
    it.
    """

    def build(gmsh: Any) -> None:
        geo = gmsh.model.geo
        corners = [(0, 0, least), (1, 0, 0.3), (1, 1, 0.3), (0, 1, 0.3)]
        points = [geo.addPoint(x, y, 0, size) for x, y, size in corners]
        lines = [geo.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]
        geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()
        for line, name in zip(lines, ("bottom", "right", "top", "left"), strict=True):
            gmsh.model.addPhysicalGroup(1, [line], name=name)

    return from_occ(build)


def cap_row(n: int, angle: float) -> ec.Domain:
    """Make the unit square with flat triangles in the row at the contact.

    Their least angle is ``angle`` degrees.
    """
    height = np.tan(radians(angle))

    def new(x: np.ndarray) -> Sequence[Any]:
        first, inner = np.isclose(x[1], 1 / n), np.minimum(x[0], 1 - x[0]) > 1e-9
        return x[0] - np.where(first & inner, 0.5 / n, 0.0), np.where(first, height / n, x[1])

    return mapped(square(n, n), new)


def half_disc(radius: float, size: float) -> ec.Domain:
    """Make the lower half of a disc with its lowest point in 0, refined there.

    Its parts are top and arc.
    """

    def build(gmsh: Any) -> None:
        occ = gmsh.model.occ
        disc, box = (
            occ.addDisk(0, radius, 0, radius, radius),
            occ.addRectangle(-radius, 0, 0, 2 * radius, radius),
        )
        occ.intersect([(2, disc)], [(2, box)])
        occ.synchronize()
        curves = gmsh.model.getEntities(1)
        top = [tag for d, tag in curves if occ.getCenterOfMass(d, tag)[1] > radius * (1 - 1e-6)]
        gmsh.model.addPhysicalGroup(1, top, name="top")
        gmsh.model.addPhysicalGroup(1, [tag for _, tag in curves if tag not in top], name="arc")
        fields = gmsh.model.mesh.field
        fields.add("MathEval", 1)
        fields.setString(1, "F", f"{size} + 0.25 * sqrt(x * x + y * y)")
        fields.setAsBackgroundMesh(1)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)

    return from_occ(build)


def cube(n: int = 4) -> ec.Domain:
    """Make the unit cube."""
    return ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(n, n, n))


def tower() -> ec.Domain:
    """Make a rectangle 1 x 4 that stands on its short side."""
    return ec.rectangle((0.0, 0.0), (1.0, 4.0), cells=(6, 24))
