"""The distance between the flat facets of a mesh and the curved surface of the body.

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

from erc_contact.mesh.simplex import facet_vertices, lagrange, rule

Nearest = Callable[[MPI.Comm, np.ndarray, np.ndarray], np.ndarray]
"""A function that returns the nearest points (n, d) of the true surface; collective. It
gets the communicator, points (n, d) and their marks (n, 2). A point of facets of one
mark has this mark and -1. A point where two marks meet has both, and goes to their
common edge.
"""
LEAST_VOLUME = 0.3
"""A vertex does not move to the true surface if a cell would keep less than this share
of its volume [-]. This happens on a mesh that is too coarse for its curves."""
OFFSET_DEGREE = 6
"""Quadrature degree for the length of the offset, a square root of a polynomial of degree 4."""


def pairs(mesh: dmesh.Mesh, facets: np.ndarray) -> np.ndarray:
    """All (cell, local facet) of facets of this rank, one row for each cell of a facet, shape (n, 2)."""
    d = mesh.topology.dim
    chosen = np.zeros(
        mesh.topology.index_map(d - 1).size_local + mesh.topology.index_map(d - 1).num_ghosts,
        dtype=bool,
    )
    chosen[facets] = True
    of_cell = mesh.topology.connectivity(d, d - 1).array.reshape(-1, d + 1)
    return np.argwhere(chosen[of_cell])


def offset(mesh: dmesh.Mesh, marks: dmesh.MeshTags, nearest: Nearest) -> fem.Function:
    """The offset of the marked facets [length], a continuous P2 Function that is zero elsewhere; collective.

    On a facet it interpolates the offset of the vertices and of the middles of the
    edges, up to O(h^4/R^3) in 2D.

    Args:
        mesh: Straight-sided simplices.
        marks: Marks of facets.
        nearest: Nearest points of the true surface.
    """
    d = mesh.topology.dim
    W = fem.functionspace(mesh, ("Lagrange", 2, (d,)))
    cell, local = pairs(mesh, marks.indices).T
    closure = np.array([W.dofmap.dof_layout.entity_closure_dofs(d - 1, i) for i in range(d + 1)])
    function = fem.Function(W)
    values = function.x.array.reshape(-1, d)
    x = W.tabulate_dof_coordinates()[:, :d]
    nodes = W.dofmap.list[cell[:, None], closure[local]]
    at, found = _moves(mesh, marks, cell, local, nodes, W.dofmap.index_map.size_local, x, nearest)
    values[at] = found
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
    geometry, d = mesh.geometry, mesh.topology.dim
    cell, local = pairs(mesh, marks.indices).T
    nodes = geometry.dofmaps[0][cell[:, None], facet_vertices(d)[local]]
    moves = la.vector(geometry.index_map(), d)
    move = moves.array.reshape(-1, d)
    x = geometry.x[:, :d].copy()
    at, found = _moves(mesh, marks, cell, local, nodes, geometry.index_map().size_local, x, nearest)
    move[at] = found
    moves.scatter_forward()
    cells = geometry.dofmaps[0]
    before = np.linalg.det(x[cells[:, 1:]] - x[cells[:, :1]])
    while True:  # each round holds back at least one vertex more
        moved = x + move
        after = np.linalg.det(moved[cells[:, 1:]] - moved[cells[:, :1]])
        crushed = np.unique(cells[after / before < LEAST_VOLUME])
        back = crushed[move[crushed].any(axis=1)]
        if not mesh.comm.allreduce(len(back), MPI.SUM):
            break
        held = la.vector(geometry.index_map(), 1)
        held.array[back] = 1.0
        held.scatter_reverse(la.InsertMode.add)
        held.scatter_forward()
        move[held.array > 0] = 0.0
    geometry.x[:, :d] += move


def swept(offset: fem.Function, sides: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """The volume between each facet and the true surface, ``int_F |offset|`` [length^d].

    Args:
        offset: The offset from :func:`offset` [length].
        sides: Facets as (cell, local facet), shape (n, 2).
        areas: Their areas [length^(d-1)], shape (n,).

    Returns:
        Shape (n,).
    """
    W = offset.function_space
    d = W.mesh.topology.dim
    closure = np.array([W.dofmap.dof_layout.entity_closure_dofs(d - 1, i) for i in range(d + 1)])
    points, weights = rule(d - 1, OFFSET_DEGREE)
    nodal = offset.x.array.reshape(-1, d)[W.dofmap.list[sides[:, :1], closure[sides[:, 1]]]]
    return areas * (np.linalg.norm(np.matmul(lagrange(d - 1, 2, points), nodal), axis=2) @ weights)


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
    """Owned nodes (n,) of marked facets, and the vectors (n, d) from there to the true surface [length]; collective.

    A node where two marks meet in 2D, or three in 3D, is a corner of the drawing. It is
    left out and stays in place.
    """
    d = mesh.topology.dim
    of_cell = mesh.topology.connectivity(d, d - 1).array.reshape(-1, d + 1)
    facet = of_cell[cell, local]
    mark = marks.values[np.searchsorted(marks.indices, facet)]
    every = np.unique(np.column_stack([nodes.ravel(), np.repeat(mark, nodes.shape[1])]), axis=0)
    every = every[every[:, 0] < owned]
    at, first, count = np.unique(every[:, 0], return_index=True, return_counts=True)
    known = np.full((len(at), 2), -1)
    known[:, 0] = every[first, 1]
    known[count > 1, 1] = every[first[count > 1] + 1, 1]
    keep = count < d
    at, known = at[keep], known[keep]
    move = nearest(mesh.comm, x[at], known) - x[at]
    size = mesh.comm.allreduce(float(abs(x).max(initial=0.0)), MPI.MAX)
    move[abs(move).max(axis=1, initial=0.0) <= 1e-12 * size] = 0.0  # round-off of the search
    return at, move
