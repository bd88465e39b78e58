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

import numpy as np
from dolfinx import fem, la
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.releases import cell_nodes
from namedmesh.sides import facets_of_cells
from namedmesh.simplex import determinants, lagrange, of_facets, rule

Nearest = Callable[[MPI.Comm, np.ndarray, np.ndarray], np.ndarray]
"""A function that returns the nearest points (n, d) of the true surface; collective. It
gets the communicator, points (n, d) and their marks (n, m), -1 where a point has fewer
than m. A point where several marks meet goes to the edge that all of them have, and
stays where there is no such edge: it is a corner of the drawing.
"""
LEAST_VOLUME = 0.3
"""Share of its volume that each cell keeps when vertices move to the true surface [-].

A vertex of a cell that would keep less does not move. This happens on a mesh that is
too coarse for its curves.
"""
OFFSET_DEGREE = 6
"""Quadrature degree for the length of the offset.

The length is the square root of a polynomial of degree 4.
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


def snap(mesh: dmesh.Mesh, marks: dmesh.MeshTags, nearest: Nearest) -> None:
    """Move the vertices of marked facets to the true surface, in place; collective.

    Args:
        mesh: A new mesh that no other object uses yet, with complete vertex patches on
            every rank.
        marks: Marks of facets.
        nearest: Nearest points of the true surface.
    """
    geometry = mesh.geometry
    d = mesh.topology.dim
    cells = cell_nodes(geometry)
    x = geometry.x[:, :d].copy()
    cell, local = sides_of_facets(mesh, marks.indices).T
    nodes = of_facets(cells[cell], local)
    owned = geometry.index_map().size_local
    moved_nodes, moves = _moves(mesh, marks, cell, local, nodes, owned, x, nearest)
    vector = la.vector(geometry.index_map(), d)
    move = vector.array.reshape(-1, d)
    move[moved_nodes] = moves
    vector.scatter_forward()
    before = determinants(x[cells])
    # Each round holds back at least one vertex more.
    while True:
        after = determinants((x + move)[cells])
        crushed = np.unique(cells[after / before < LEAST_VOLUME])
        back = crushed[move[crushed].any(axis=1)]
        if not lasting(mesh.comm).allreduce(len(back), MPI.SUM):
            break
        # A vertex that one rank holds back stays on all of them.
        stays = la.vector(geometry.index_map(), 1)
        stays.array[back] = 1.0
        stays.scatter_reverse(la.InsertMode.add)
        stays.scatter_forward()
        move[stays.array > 0] = 0.0
    geometry.x[:, :d] += move


def swept(offset: fem.Function, sides: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """Compute the volume between each facet and the true surface [length^d].

    It is ``int_F |offset|``.

    Args:
        offset: The offset from :func:`offset` [length].
        sides: Facets as (cell, local facet), shape (n, 2).
        areas: Their areas [length^(d-1)], shape (n,).

    Returns:
        Shape (n,).
    """
    W = offset.function_space
    d = W.mesh.topology.dim
    points, weights = rule(d - 1, OFFSET_DEGREE)
    nodes = W.dofmap.list[sides[:, :1], _facet_closures(W)[sides[:, 1]]]
    nodal = offset.x.array.reshape(-1, d)[nodes]
    length = np.linalg.norm(np.matmul(lagrange(d - 1, 2, points), nodal), axis=2)
    return areas * (length @ weights)


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

    A node of one mark goes to its surface. In 3D, a node where two marks meet goes to
    their common edge; so does a node of three or more marks where bodies meet along one
    edge, as a pin, its sleeve and the plate below both do. Corners of the drawing stay.

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
    # All different pairs (node, mark), sorted by node.
    node_marks = np.column_stack([nodes.ravel(), np.repeat(mark, nodes.shape[1])])
    node_marks = np.unique(node_marks, axis=0)
    node_marks = node_marks[node_marks[:, 0] < owned]
    chosen, first, count = np.unique(node_marks[:, 0], return_index=True, return_counts=True)
    most = lasting(mesh.comm).allreduce(int(count.max(initial=1)), MPI.MAX)
    marks_of_node = np.full((len(chosen), most), -1)
    row = np.repeat(np.arange(len(chosen)), count)
    marks_of_node[row, np.arange(len(row)) - first[row]] = node_marks[:, 1]
    # In 2D two curves meet at a corner.
    may_move = (count == 1) | (mesh.topology.dim == 3)
    chosen = chosen[may_move]
    move = nearest(lasting(mesh.comm), x[chosen], marks_of_node[may_move]) - x[chosen]
    size = lasting(mesh.comm).allreduce(float(abs(x).max(initial=0.0)), MPI.MAX)
    move[abs(move).max(axis=1, initial=0.0) <= OFFSET_ROUND_OFF * size] = 0.0
    return chosen, move
