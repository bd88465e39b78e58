"""Mesh a plane with given edges, and fill a closed surface, by gmsh on this rank."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.gmsh_session import FIELD, session
from erc_contact.mesh.simplex import in_space

MARGIN = 0.3
"""Width of the frame around the edges in a plane, by their extent [-]."""
LINE, TRIANGLE, TETRAHEDRON = 1, 2, 4
"""gmsh's numbers of types of elements."""


def triangulated(
    y: np.ndarray, edges: np.ndarray, sides: list[tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Mesh a plane so that given edges are edges of triangles.

    The triangles cover a frame around the edges.

    Args:
        y: Points in the plane [length], shape (n, 2).
        edges: Points of the edges, which meet at their ends only, shape (k, 2).
        sides: Triangles that give the sizes: corners (m, 3, 2) and the sizes there (m,
            3) [length].

    Returns:
        Points [length], the given ones first, and triangles.

    Raises:
        InputError: If gmsh does not keep the edges.
    """
    used, edges = np.unique(edges, return_inverse=True)
    edges = edges.reshape(-1, 2)
    low = y[used].min(axis=0)
    high = y[used].max(axis=0)
    margin = MARGIN * (high - low).max()
    frame = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * (high - low + 2 * margin) + low - margin
    points = np.concatenate([y[used], frame])

    def build(gmsh: Any) -> None:
        _set_field(gmsh, extend=False)
        geo = gmsh.model.geo
        for tag, (x1, x2) in enumerate(points, start=1):
            geo.addPoint(x1, x2, 0.0, tag=tag)
        lines = [geo.addLine(int(a), int(b)) for a, b in edges + 1]
        corners = len(used) + 1 + np.arange(4)
        rim = [
            geo.addLine(int(a), int(b)) for a, b in zip(corners, np.roll(corners, -1), strict=True)
        ]
        for line in lines:
            geo.mesh.setTransfiniteCurve(line, 2)
        surface = geo.addPlaneSurface([geo.addCurveLoop(rim)])
        geo.synchronize()
        gmsh.model.mesh.embed(1, lines, 2, surface)
        _set_sizes(gmsh, sides)
        gmsh.model.mesh.generate(2)

    with session(MPI.COMM_SELF, build, "joined: the plane of the contact") as model:
        x, triangles = _simplices(model, TRIANGLE)
    return _renumbered(x[:, :2], triangles, points, used, y)


def _set_field(gmsh: Any, *, extend: bool) -> None:
    """Set gmsh's options for sizes, from the boundary or from a field."""
    for name, value in FIELD.items():
        gmsh.option.setNumber(name, value)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", int(extend))


def _set_sizes(gmsh: Any, sides: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """Set the sizes to the least of those of several meshes of triangles."""
    fields = []
    for corners, sizes in sides:
        view = gmsh.view.add("sizes")
        coordinates = in_space(corners.reshape(-1, 2)).reshape(-1, 3, 3).transpose(0, 2, 1)
        rows = np.hstack([coordinates.reshape(len(corners), -1), sizes])
        gmsh.view.addListData(view, "ST", len(rows), rows.ravel())
        field = gmsh.model.mesh.field.add("PostView")
        gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
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


def _renumbered(
    x: np.ndarray, simplices: np.ndarray, given: np.ndarray, numbers: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give points of gmsh the numbers of given points, and new points the next ones.

    Args:
        x: gmsh's points.
        simplices: gmsh's simplices.
        given: The points that gmsh was given, the first ones of which have numbers.
        numbers: Their numbers.
        y: All points that have numbers.

    Raises:
        InputError: If gmsh does not have all of them.
    """
    together = np.concatenate([given[: len(numbers)], x])
    order = np.lexsort(together.T)
    equal = np.all(together[order[1:]] == together[order[:-1]], axis=1)
    # The sort is stable: a given point comes before that of gmsh.
    first = order[:-1][equal]
    second = order[1:][equal] - len(numbers)
    if len(first) != len(numbers) or first.max(initial=-1) >= len(numbers):
        raise InputError("joined: gmsh moved points of the contact; mesh the parts otherwise.")
    number = np.full(len(x), -1)
    number[second] = numbers[first]
    new = number < 0
    number[new] = len(y) + np.arange(new.sum())
    return np.concatenate([y, x[new]]), number[simplices]


def filled(x: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fill a closed surface with tetrahedra that keep its triangles.

    Args:
        x: Points [length], shape (n, 3).
        triangles: Points of the triangles, shape (m, 3).

    Returns:
        Points [length], the given ones first, and tetrahedra.

    Raises:
        InputError: If gmsh fails.
    """
    used, triangles = np.unique(triangles, return_inverse=True)
    triangles = triangles.reshape(-1, 3)

    def build(gmsh: Any) -> None:
        _set_field(gmsh, extend=True)
        mesh = gmsh.model.mesh
        surface = gmsh.model.addDiscreteEntity(2)
        mesh.addNodes(2, surface, np.arange(1, len(used) + 1), x[used].ravel())
        mesh.addElementsByType(surface, TRIANGLE, [], (triangles + 1).ravel())
        loop = gmsh.model.geo.addSurfaceLoop([surface])
        gmsh.model.geo.addVolume([loop])
        gmsh.model.geo.synchronize()
        mesh.generate(3)

    with session(MPI.COMM_SELF, build, "joined: a body behind the contact, meshed anew,") as model:
        points, cells = _simplices(model, TETRAHEDRON)
    if not len(cells):
        raise InputError("joined: gmsh cannot fill a body behind the contact; mesh it otherwise.")
    return _renumbered(points, cells, x[used], used, x)
