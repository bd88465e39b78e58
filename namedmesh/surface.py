"""Compute the offset of the flat facets of a mesh from the curved surface of the body.

A mesh of a curved body has its boundary vertices on the true surface, or near it, and
flat facets between them. If the true surface is known, each of these facets has a mark:
the number of its curve or surface in the drawing. The nearest point of the true surface
gives the place of a new vertex and the true gap to a foundation. It also gives the
volume that facets cut off or add.

Symbols: d dimension, h size of a facet. The offset is the vector from a point of a
facet to the nearest point of the true surface. Its length is at most h^2/(8 R) where
the radius of curvature is R.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np
from dolfinx import fem, la
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.logs import log_of
from namedmesh.base.ranks import from_first, gather_rows, global_numbers
from namedmesh.base.releases import cell_nodes
from namedmesh.sides import boundary_sides, facets_of_cells
from namedmesh.simplex import (
    determinants,
    lagrange,
    measures,
    of_facets,
    outward_normals,
    projection,
    rule,
)
from namedmesh.simplex import nodes as reference_nodes
from namedmesh.tags import NO_TAG
from namedmesh.volume import MarkedSurface, balanced, marks_table

Nearest = Callable[[MPI.Comm, np.ndarray, np.ndarray], np.ndarray]
"""A function that returns the nearest points (n, d) of the true surface; collective. It
gets the communicator, points (n, d) and their marks (n, m), -1 where a point has fewer
than m. A point where several marks meet goes to the edge that all of them have, or else
to the corner, and stays where there is neither.
"""
LEAST_VOLUME = 0.3
"""Share of its volume that each cell keeps when vertices move to the true surface [-].

The vertices of a cell that would keep less move less, or not at all. This happens on a
mesh that is too coarse for its curves.
"""
LEAST_SHARE = 1 / 8
"""Least share of its move that a vertex makes, if it moves at all [-]."""
SETTLED = 1e-9
"""Move of a vertex that is too small to be made, as a share of the greatest coordinate.

gmsh's own kernel finds nearest points on curves to 3e-10 of their size. A mesh that is
read again must stay as it is to the last bit.
"""
OFFSET_ROUND_OFF = 1e-12
"""Offset that is round-off of the search, as a share of the greatest coordinate [-]."""


def sides_of_facets(mesh: dmesh.Mesh, facets: np.ndarray) -> np.ndarray:
    """Return all pairs (cell, local facet) of facets of this rank, shape (n, 2).

    There is one for each cell of a facet.
    """
    index_map = mesh.topology.index_map(mesh.topology.dim - 1)
    chosen = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=bool)
    chosen[facets] = True
    return np.argwhere(chosen[facets_of_cells(mesh)])


def on_surface(
    comm: MPI.Comm, x: np.ndarray, cells: np.ndarray, marks: np.ndarray, nearest: Nearest
) -> np.ndarray:
    """Return points whose marks are known on the true surface [length]; collective.

    Args:
        comm: Communicator.
        x: Points of the bodies [length], shape (n, 3).
        cells: Points of each cell, shape (m, d+1).
        marks: The mark of each side of the cells, shape (m, d+1).
        nearest: Nearest points of the true surface.

    Returns:
        Shape (n, 3); points that no marked side has are as they were.
    """
    d = cells.shape[1] - 1
    cell, local = np.nonzero(marks != NO_TAG)
    corners = of_facets(cells[cell], local)
    chosen, table = marks_table(corners.ravel(), np.repeat(marks[cell, local], d))
    result = x.copy()
    result[chosen, :d] = nearest(comm, x[chosen, :d], table)
    return result


def _facet_closures(W: fem.FunctionSpace) -> np.ndarray:
    """Return the local nodes of each local facet of a P2 space, shape (d+1, m)."""
    d = W.mesh.topology.dim
    layout = W.dofmap.dof_layout
    return np.array([layout.entity_closure_dofs(d - 1, i) for i in range(d + 1)])


def offset(mesh: dmesh.Mesh, marks: dmesh.MeshTags, nearest: Nearest) -> fem.Function:
    """Compute the offset of the marked facets [length]; collective.

    It is a continuous P2 Function, zero on other facets and inside. On a facet it
    interpolates the offset of the vertices and of the middles of the edges, up to
    O(h^4/R^3) in 2D.

    Args:
        mesh: Straight-sided simplices.
        marks: Marks of facets.
        nearest: Nearest points of the true surface.
    """
    d = mesh.topology.dim
    W = fem.functionspace(mesh, ("Lagrange", 2, (d,)))
    function = fem.Function(W)
    x = W.tabulate_dof_coordinates()[:, :d]
    cell, local = sides_of_facets(mesh, marks.indices).T
    nodes = W.dofmap.list[cell[:, None], _facet_closures(W)[local]]
    owned = W.dofmap.index_map.size_local
    moved_nodes, moves = _moves(mesh, marks, cell, local, nodes, owned, x, nearest)
    function.x.array.reshape(-1, d)[moved_nodes] = moves
    function.x.scatter_forward()
    return function


def snap(mesh: dmesh.Mesh, marks: dmesh.MeshTags, shape: Any) -> None:
    """Move the vertices of marked facets to the true surface, in place; collective.

    There they move on, until the facets enclose the true volume, see
    :mod:`namedmesh.volume`. What is there already stays as it is.

    Args:
        mesh: A new mesh that no other object uses yet, with complete vertex patches on
            every rank.
        marks: Marks of facets.
        shape: The true shape, a :class:`namedmesh.bodies.Geometry`.
    """
    geometry = mesh.geometry
    d = mesh.topology.dim
    cells = cell_nodes(geometry)
    before = geometry.x[:, :d].copy()
    cell, local = sides_of_facets(mesh, marks.indices).T
    nodes = of_facets(cells[cell], local)
    owned = geometry.index_map().size_local
    moved_nodes, moves = _moves(mesh, marks, cell, local, nodes, owned, before, shape.nearest)
    on_surface = before + _held_back(mesh, before, before, moved_nodes, moves)
    numbers, moves = _balanced(mesh, marks, on_surface, shape)
    made = _held_back(mesh, before, on_surface, numbers, moves)
    _tell_held_back(lasting(mesh.comm), moves, made[numbers])
    after = on_surface + made
    size = lasting(mesh.comm).allreduce(float(abs(before).max(initial=0.0)), MPI.MAX)
    has_moved = abs(after - before).max(axis=1) > SETTLED * size
    geometry.x[has_moved, :d] = after[has_moved]


def _tell_held_back(comm: MPI.Comm, wanted: np.ndarray, made: np.ndarray) -> None:
    """Tell how many vertices do not go where facets keep the volume; collective."""
    held = comm.allreduce(int((wanted != made).any(axis=1).sum()), MPI.SUM)
    if held:
        log_of(comm).info(
            "%d vertices of curved sides move less, as cells would be crushed: the facets there "
            "do not keep the volume. The mesh is coarse for its curves.",
            held,
        )


def _balanced(
    mesh: dmesh.Mesh, marks: dmesh.MeshTags, x: np.ndarray, shape: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Find the moves that keep the volume; collective.

    Args:
        mesh: The mesh.
        marks: Marks of facets.
        x: Positions of the nodes of this rank [length], shape (n, d).
        shape: The true shape.

    Returns:
        Owned nodes, shape (m,), and their vectors [length], shape (m, d).
    """
    comm = lasting(mesh.comm)
    d = mesh.topology.dim
    here = marks.indices < mesh.topology.index_map(d - 1).size_local
    facets, of_facets_here = marks.indices[here], marks.values[here]
    cell, local = boundary_sides(mesh, facets)
    nodes = of_facets(cell_nodes(mesh.geometry)[cell], local)
    index_map = mesh.geometry.index_map()
    rows = gather_rows(
        comm,
        nodes=global_numbers(index_map, nodes),
        x=x[nodes],
        marks=of_facets_here.astype(np.int64),
    )
    numbers = np.empty(0, dtype=np.int64)
    surface = MarkedSurface(np.empty((0, d)), np.empty((0, d), dtype=int), numbers)
    if rows:
        numbers, first, vertices = np.unique(rows["nodes"], return_index=True, return_inverse=True)
        places = rows["x"].reshape(-1, d)[first]
        surface = MarkedSurface(places, vertices.reshape(-1, d), rows["marks"])
    moves = balanced(comm, surface, shape)
    numbers, moves = from_first(comm, (numbers, moves))
    first_owned, end = index_map.local_range
    owned = (numbers >= first_owned) & (numbers < end)
    return numbers[owned] - first_owned, moves[owned]


def _held_back(
    mesh: dmesh.Mesh, before: np.ndarray, x: np.ndarray, moved_nodes: np.ndarray, moves: np.ndarray
) -> np.ndarray:
    """Return moves of all nodes that crush no cell [length], shape (n, d); collective.

    Args:
        mesh: The mesh.
        before: Positions of the nodes of the new mesh [length], shape (n, d).
        x: Positions from which the nodes move [length], shape (n, d).
        moved_nodes: Owned nodes that are to move, shape (m,).
        moves: Their vectors [length], shape (m, d).
    """
    geometry = mesh.geometry
    cells = cell_nodes(geometry)
    vector = la.vector(geometry.index_map(), x.shape[1])
    move = vector.array.reshape(x.shape)
    move[moved_nodes] = moves
    vector.scatter_forward()
    volume = determinants(before[cells])
    share = np.ones((len(x), 1))
    # Each round holds back at least one vertex more.
    while True:
        made = share * move
        after = determinants((x + made)[cells])
        crushed = np.unique(cells[after / volume < LEAST_VOLUME])
        back = crushed[made[crushed].any(axis=1)]
        if not lasting(mesh.comm).allreduce(len(back), MPI.SUM):
            return made
        # A vertex that one rank holds back is held back on all of them.
        held = la.vector(geometry.index_map(), 1)
        held.array[back] = 1.0
        held.scatter_reverse(la.InsertMode.add)
        held.scatter_forward()
        is_held = held.array > 0
        share[is_held] = np.where(share[is_held] > LEAST_SHARE, share[is_held] / 2, 0.0)


@dataclass(frozen=True, eq=False)
class Slivers:
    """Hold the height of the true surface over facets.

    The height is ``o.n``, with the offset o and the normal n out of a cell: it is
    positive where the facet cuts a sliver off.

    Attributes:
        sides: Facets as (cell, local facet), shape (n, 2).
        points: Points of a rule on the facets [length], shape (n, q, d).
        weights: Their weights times the areas of the facets [length^(d-1)], (n, q).
        heights: The heights there [length], shape (n, q).
        linear: The linear functions nearest to the heights, there [length], (n, q).
        slopes: Gradients of the heights along the facets, there [-], shape (n, q, d).
        depths: Greatest difference of two heights of nodes [length], shape (n,). On a
            circle of radius R it is ``h^2/(8 R)``.
    """

    sides: np.ndarray
    points: np.ndarray
    weights: np.ndarray
    heights: np.ndarray
    linear: np.ndarray
    slopes: np.ndarray
    depths: np.ndarray


def slivers(offset: fem.Function, sides: np.ndarray) -> Slivers:
    """Measure what lies between facets and the true surface.

    Args:
        offset: The offset from :func:`offset` [length].
        sides: Facets as (cell, local facet), shape (n, 2).
    """
    W = offset.function_space
    geometry = W.mesh.geometry
    d = W.mesh.topology.dim
    corners = geometry.x[cell_nodes(geometry)[sides[:, 0]], :d]
    normals = outward_normals(corners, sides[:, 1])
    ends = of_facets(corners, sides[:, 1])
    areas = measures(ends)
    points, weights = rule(d - 1, 4)
    nodes = W.dofmap.list[sides[:, :1], _facet_closures(W)[sides[:, 1]]]
    nodal = np.einsum("nmi,ni->nm", offset.x.array.reshape(-1, d)[nodes], normals)
    heights = nodal @ lagrange(d - 1, 2, points).T
    nearest = lagrange(d - 1, 1, points) @ projection(d - 1, 1, points, weights)
    of_points = areas[:, None] * weights
    # The gradients of the barycentric coordinates, but the first, are the rows.
    gradients = np.linalg.pinv(ends[:, 1:] - ends[:, :1]).swapaxes(1, 2)
    derivatives = _derivatives(nodal[..., None], points)[..., 0, :]
    return Slivers(
        sides=sides,
        points=np.matmul(lagrange(d - 1, 1, points), ends),
        weights=of_points,
        heights=heights,
        linear=heights @ nearest.T,
        slopes=np.matmul(derivatives, gradients),
        depths=np.ptp(nodal, axis=1),
    )


def _derivatives(nodal: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return derivatives of polynomials of degree 2 on facets by reference coordinates.

    Args:
        nodal: Values at the nodes of the facets, shape (n, m, v).
        points: Reference points, shape (q, d-1).

    Returns:
        Shape (n, q, v, d-1).
    """
    k = points.shape[1]
    result = []
    for step in np.eye(k) / 2:
        # The difference over 1 is the derivative of a polynomial of degree 2.
        slope = lagrange(k, 2, points + step) - lagrange(k, 2, points - step)
        result.append(np.matmul(slope, nodal))
    return np.stack(result, axis=-1)


def area_ratio(offset: fem.Function, sides: np.ndarray) -> np.ndarray:
    """Compute the area of the true surface over the area of facets [-], shape (n,).

    The surface is taken as a polynomial of degree 2 over each facet. The ratio of a
    facet of a plane face is 1: at a curved rim its vertices move in the plane, until
    the face has its area.

    Args:
        offset: The offset from :func:`offset` [length].
        sides: Facets as (cell, local facet), shape (n, 2).
    """
    W = offset.function_space
    d = W.mesh.topology.dim
    nodes = W.dofmap.list[sides[:, :1], _facet_closures(W)[sides[:, 1]]]
    geometry = W.mesh.geometry
    corners = geometry.x[cell_nodes(geometry)[sides[:, 0]], :d]
    ends = of_facets(corners, sides[:, 1])
    at_nodes = lagrange(d - 1, 1, reference_nodes(d - 1, 2))
    surface = np.matmul(at_nodes, ends) + offset.x.array.reshape(-1, d)[nodes]
    points, weights = rule(d - 1, 4)
    along = _derivatives(surface, points)
    gram = np.linalg.det(along.swapaxes(-1, -2) @ along)
    areas = measures(ends)
    ratio = np.sqrt(gram) @ weights / factorial(d - 1) / areas
    is_plane = slivers(offset, sides).depths <= SETTLED * areas ** (1 / (d - 1))
    return np.where(is_plane, 1.0, ratio)


def _moves(
    mesh: dmesh.Mesh,
    marks: dmesh.MeshTags,
    cell: np.ndarray,
    local: np.ndarray,
    nodes: np.ndarray,
    owned: int,
    x: np.ndarray,
    nearest: Nearest,
) -> tuple[np.ndarray, np.ndarray]:
    """Find the vectors from nodes of marked facets to the true surface; collective.

    A node of one mark goes to its surface. A node where two marks meet goes to their
    common edge in 3D, and corner in 2D; a node of three or more marks to their corner,
    or to the edge where bodies meet along one, as a pin, its sleeve and the plate below
    both do.

    Args:
        mesh: The mesh.
        marks: Marks of facets.
        cell: Cell of each marked facet, shape (f,).
        local: Local number of the facet there, shape (f,).
        nodes: Nodes of the facet, shape (f, m).
        owned: Number of nodes that this rank owns.
        x: Positions of all nodes of this rank [length], shape (N, d).
        nearest: Nearest points of the true surface.

    Returns:
        Owned nodes, shape (n,), and their vectors [length], shape (n, d).
    """
    facet = facets_of_cells(mesh)[cell, local]
    mark = marks.values[np.searchsorted(marks.indices, facet)]
    chosen, marks_of_node = marks_table(nodes.ravel(), np.repeat(mark, nodes.shape[1]))
    chosen, marks_of_node = chosen[chosen < owned], marks_of_node[chosen < owned]
    most = lasting(mesh.comm).allreduce(marks_of_node.shape[1], MPI.MAX)
    missing = most - marks_of_node.shape[1]
    marks_of_node = np.pad(marks_of_node, ((0, 0), (0, missing)), constant_values=-1)
    move = nearest(lasting(mesh.comm), x[chosen], marks_of_node) - x[chosen]
    size = lasting(mesh.comm).allreduce(float(abs(x).max(initial=0.0)), MPI.MAX)
    move[abs(move).max(axis=1, initial=0.0) <= OFFSET_ROUND_OFF * size] = 0.0
    return chosen, move
