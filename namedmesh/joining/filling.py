"""Mesh a plane with given edges, and fill a closed surface, by gmsh on this rank."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from namedmesh.base.exceptions import InputError
from namedmesh.gmsh_session import FIELD, add_sizes, has_netgen, session
from namedmesh.graphs import components
from namedmesh.joining.triangles import edge_lengths
from namedmesh.rows import equal_rows, in_space

MARGIN = 0.3
"""Width of the frame around the edges in a plane, by their extent [-]."""
GROWTH = 3.0
"""Growth of sizes with the distance from short edges [-].

Cells are some two times the triangles of their surface, and most of these lie beside
short edges. With 4 the triangles between such an edge and the next row of points become
splinters, with 1 there are 1.4 times as many cells.
"""
FAR = 4.0
"""Distance, by the extent of the edges, within which all of them are [-]."""
SAMPLING = 3
"""Number of points of an edge from which distances are measured."""
DIGITS = 12
"""Digits of scaled coordinates and sizes: round-off must not change the mesh."""
DELAUNAY = 5
"""gmsh's number of the algorithm of Delaunay's triangles."""
POOR = 1e-3
"""Inscribed over circumscribed radius of a splinter, 1 for a regular cell [-].

Beside a side whose points moved a little, some cells have their corners nearly in a
plane.
"""
TRIANGLE = 2
"""gmsh's number of the type of triangles."""
TETRAHEDRON = 4
"""gmsh's number of the type of tetrahedra."""


@dataclass(frozen=True, eq=False)
class _Unit:
    """Scale points to a unit of length, as gmsh's tolerances are lengths.

    Attributes:
        low: The lowest coordinates [length], shape (d,).
        extent: The greatest extent [length].
    """

    low: np.ndarray
    extent: float

    @classmethod
    def of(cls, x: np.ndarray) -> _Unit:
        """Make it of points [length], shape (n, d)."""
        return cls(x.min(axis=0), float(np.ptp(x, axis=0).max()))

    def scale(self, x: np.ndarray) -> np.ndarray:
        """Return points [length], shape (..., d), without their unit."""
        return np.round((x - self.low) / self.extent, DIGITS)

    def sizes(self, h: np.ndarray) -> np.ndarray:
        """Return sizes [length] without their unit."""
        return np.round(h / self.extent, DIGITS)

    def lengths(self, x: np.ndarray) -> np.ndarray:
        """Return scaled points with their unit [length], shape (n, d)."""
        return self.low + self.extent * x


def triangulate(
    y: np.ndarray,
    edges: np.ndarray,
    sides: list[tuple[np.ndarray, np.ndarray]],
    *,
    graded: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Mesh a plane so that given edges are edges of triangles.

    The triangles cover a frame around the edges.

    Args:
        y: Points in the plane [length], shape (n, 2).
        edges: Points of the edges, which meet at their ends only, shape (k, 2).
        sides: Triangles that give the sizes: corners (m, 3, 2) and the sizes there (m,
            3) [length].
        graded: Whether triangles near short edges are small, too.

    Returns:
        Points [length], the given ones first, and triangles.

    Raises:
        InputError: If gmsh does not keep the edges.
    """
    used, edges = np.unique(edges, return_inverse=True)
    unit = _Unit.of(y[used])
    given = unit.scale(y[used])
    low = -np.full(2, MARGIN)
    high = given.max(axis=0) + MARGIN
    frame = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    corners = len(used) + np.arange(4)
    rim = np.column_stack([corners, np.roll(corners, -1)])

    def build(gmsh: Any) -> None:
        _set_field(gmsh, extend=False)
        geo = gmsh.model.geo
        # gmsh has no call for many points or lines; here they are points of outlines.
        for tag, point in enumerate(np.concatenate([given, frame]).tolist(), start=1):
            geo.addPoint(*point, 0.0, tag=tag)
        lines = [geo.addLine(*edge) for edge in (edges + 1).tolist()]
        for line in lines:
            geo.mesh.setTransfiniteCurve(line, 2)
        loop = geo.addCurveLoop([geo.addLine(*edge) for edge in (rim + 1).tolist()])
        surface = geo.addPlaneSurface([loop])
        geo.synchronize()
        gmsh.model.mesh.embed(1, lines, 2, surface)
        near = []
        if graded:
            near = _near_edges(gmsh, given, edges, lines)
            # The frontal algorithm leaves some loops of short edges without points.
            gmsh.option.setNumber("Mesh.Algorithm", DELAUNAY)
        _set_sizes(gmsh, [(unit.scale(x), unit.sizes(h)) for x, h in sides], near)
        gmsh.model.mesh.generate(2)

    with session(MPI.COMM_SELF, build, "joined: the plane of the contact") as model:
        x, triangles = _simplices(model, TRIANGLE)
    new, triangles = _renumber(x[:, :2], triangles, given, used, len(y))
    return np.concatenate([y, unit.lengths(new)]), triangles


def _improve(gmsh: Any) -> None:
    """Improve the tetrahedra of gmsh's model by Netgen's optimizer.

    Raises:
        InputError: If gmsh was built without it, as Debian's is.
    """
    if not has_netgen(gmsh):
        raise InputError(
            "joined: the cells behind the contact need Netgen's optimizer, and this gmsh was built "
            "without it; take the wheel of gmsh (pip install gmsh), or mesh both sides with the "
            "same facets."
        )
    gmsh.model.mesh.optimize("Netgen")


def _set_field(gmsh: Any, *, extend: bool) -> None:
    """Set gmsh's options for sizes, from the boundary or from a field."""
    for name, value in FIELD.items():
        gmsh.option.setNumber(name, value)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", int(extend))


def _near_edges(gmsh: Any, x: np.ndarray, edges: np.ndarray, lines: list[int]) -> list[int]:
    """Make fields of sizes that grow from the lengths of edges."""
    length = edge_lengths(x, edges)
    octaves = np.floor(np.log2(length))
    fields = []
    for octave in np.unique(octaves):
        of_octave = octaves == octave
        size = float(length[of_octave].mean())
        distance = gmsh.model.mesh.field.add("Distance")
        gmsh.model.mesh.field.setNumbers(distance, "CurvesList", np.array(lines)[of_octave])
        gmsh.model.mesh.field.setNumber(distance, "Sampling", SAMPLING)
        field = gmsh.model.mesh.field.add("Threshold")
        gmsh.model.mesh.field.setNumber(field, "InField", distance)
        gmsh.model.mesh.field.setNumber(field, "DistMin", 0.0)
        gmsh.model.mesh.field.setNumber(field, "DistMax", FAR)
        gmsh.model.mesh.field.setNumber(field, "SizeMin", size)
        gmsh.model.mesh.field.setNumber(field, "SizeMax", size + GROWTH * FAR)
        fields.append(field)
    return fields


def _set_sizes(
    gmsh: Any, sides: list[tuple[np.ndarray, np.ndarray]], fields: Sequence[int] = ()
) -> None:
    """Set the size to the least size of meshes of triangles, and of fields."""
    fields = list(fields)
    for corners, sizes in sides:
        x = in_space(corners.reshape(-1, 2)).reshape(-1, 3, 3)
        _, field = add_sizes(gmsh, x, sizes)
        fields.append(field)
    least = gmsh.model.mesh.field.add("Min")
    gmsh.model.mesh.field.setNumbers(least, "FieldsList", fields)
    gmsh.model.mesh.field.setAsBackgroundMesh(least)


def _simplices(model: Any, kind: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the points and simplices of gmsh's model."""
    tags, x, _ = model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags] = np.arange(len(tags))
    corners = {TRIANGLE: 3, TETRAHEDRON: 4}[kind]
    simplices = model.mesh.getElementsByType(kind)[1].reshape(-1, corners)
    return x.reshape(-1, 3), place[simplices]


def _renumber(
    x: np.ndarray, simplices: np.ndarray, given: np.ndarray, numbers: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Give points of gmsh the numbers of given points, and new points new numbers.

    Args:
        x: gmsh's points.
        simplices: gmsh's simplices.
        given: The points that gmsh was given.
        numbers: Their numbers.
        count: Number of all points that have numbers.

    Returns:
        The new points, and the simplices.

    Raises:
        InputError: If gmsh does not have all of the given points.
    """
    first, second = equal_rows(np.concatenate([given, x]))
    second = second - len(given)
    if len(first) != len(given) or first.max(initial=-1) >= len(given):
        raise InputError("joined: gmsh moved points of the contact; mesh the parts otherwise.")
    number = np.full(len(x), -1)
    number[second] = numbers[first]
    new = number < 0
    number[new] = count + np.arange(new.sum())
    return x[new], number[simplices]


def fill(
    x: np.ndarray, triangles: np.ndarray, *, optimize: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Fill a closed surface with tetrahedra that keep its triangles.

    Args:
        x: Points [length], shape (n, 3).
        triangles: Points of the triangles, shape (m, 3). Those around a hollow are not
            connected with the others.
        optimize: Whether Netgen's optimizer improves the tetrahedra, which a surface
            that is not Delaunay's needs. It does so, too, where there are splinters.

    Returns:
        Points [length], the given ones first, and tetrahedra.

    Raises:
        InputError: If gmsh fails.
    """
    used, triangles = np.unique(triangles, return_inverse=True)
    unit = _Unit.of(x[used])
    given = unit.scale(x[used])
    links = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    shell_of_point = components(len(used), links)
    # The outer shell, which gmsh wants first, has the lowest point.
    outer = shell_of_point[given[:, 0].argmin()]
    hollows = np.setdiff1d(shell_of_point, outer)

    def build(gmsh: Any) -> None:
        _set_field(gmsh, extend=True)
        loops = []
        for shell in (outer, *hollows):
            surface = gmsh.model.addDiscreteEntity(2)
            points = np.flatnonzero(shell_of_point == shell)
            gmsh.model.mesh.addNodes(2, surface, points + 1, given[points].ravel())
            of_shell = triangles[shell_of_point[triangles[:, 0]] == shell] + 1
            gmsh.model.mesh.addElementsByType(surface, TRIANGLE, [], of_shell.ravel())
            loops.append(gmsh.model.geo.addSurfaceLoop([surface]))
        gmsh.model.geo.addVolume(loops)
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(3)
        cells, _ = gmsh.model.mesh.getElementsByType(TETRAHEDRON)
        poorest = gmsh.model.mesh.getElementQualities(cells, "gamma").min(initial=1.0)
        if optimize or poorest < POOR:
            _improve(gmsh)

    subject = "joined: a body behind the contact, meshed anew,"
    with session(MPI.COMM_SELF, build, subject) as model:
        points, cells = _simplices(model, TETRAHEDRON)
    if not len(cells):
        raise InputError("joined: gmsh cannot fill a body behind the contact; mesh it otherwise.")
    new, cells = _renumber(points, cells, given, used, len(x))
    return np.concatenate([x, unit.lengths(new)]), cells
