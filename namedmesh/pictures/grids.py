"""Number simplices as VTK does, cut them into smaller pieces, and make grids of them.

Symbols: d dimension of simplices, k degree, N number of nodes of a simplex.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from namedmesh.base.ranks import global_numbers
from namedmesh.base.releases import cell_nodes
from namedmesh.domain import Domain
from namedmesh.simplex import determinants, lattice, node_between, node_vertices

VTK_EDGES = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
"""Vertices of the edges of a tetrahedron, in the order of VTK's nodes.

The first one is the edge of a line, and the first three are the edges of a triangle.
"""
VTK_KINDS = {1: (3, 5, 10), 2: (21, 22, 24)}
"""VTK's numbers of line, triangle and tetrahedron, by degree."""
POLYLINE = 4
"""VTK's number of a polyline."""


def degree_of(cells: np.ndarray, d: int) -> int:
    """Return the degree, 1 or 2, of simplices of dimension d with nodes (n, N)."""
    return 1 if cells.shape[1] == d + 1 else 2


@cache
def subdivide(d: int, divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Cut the reference line or triangle into smaller pieces.

    Returns:
        Reference points, shape (q, d), and the numbers of the points of each smaller
        one, shape (n, d+1).
    """
    points = lattice(d, divisions)
    steps = (points * divisions).round().astype(int).tolist()
    number = {tuple(step): i for i, step in enumerate(steps)}
    if d == 1:
        return points, np.array([[number[i,], number[i + 1,]] for i in range(divisions)])
    upward = []
    downward = []
    for (i, j), corner in number.items():
        if i + j < divisions:
            upward.append([corner, number[i + 1, j], number[i, j + 1]])
        if i + j < divisions - 1:
            downward.append([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]])
    return points, np.array(upward + downward)


def vtk_cells(cells: np.ndarray, d: int) -> tuple[int, np.ndarray]:
    """Return VTK's number of a kind of simplices, and their nodes in its order.

    Args:
        cells: Nodes of the simplices, shape (n, N).
        d: Their dimension.
    """
    k = degree_of(cells, d)
    order = list(range(d + 1))
    if k == 2:
        first, second = VTK_EDGES[: d * (d + 1) // 2].T
        order += node_between(d, k)[first, second].tolist()
    return VTK_KINDS[k][d - 1], cells[:, order]


def grid_of(points: np.ndarray, cells: np.ndarray, d: int) -> Any:
    """Make a grid of pyvista.

    It is one of lines, triangles or tetrahedra of degree 1 or 2, or of polylines.

    Args:
        points: Nodes [length], shape (p, 3).
        cells: Numbers of the nodes of each cell, in DOLFINx's order, shape (n, N).
            Lines with more than 3 nodes are polylines.
        d: Dimension of the cells.
    """
    import pyvista  # noqa: PLC0415

    if d == 1 and cells.shape[1] > 3:
        kind, nodes = POLYLINE, cells
    else:
        kind, nodes = vtk_cells(cells, d)
    # Before the nodes of a cell VTK wants their number.
    counted = np.insert(nodes, 0, nodes.shape[1], axis=1)
    kinds = np.full(len(nodes), kind, dtype=np.uint8)
    return pyvista.UnstructuredGrid(counted.ravel(), kinds, points)


def body_mesh(domain: Domain) -> dict[str, np.ndarray]:
    """Return the part of a mesh that this rank owns.

    Returns:
        Arguments of :func:`namedmesh.pictures.skin.skin_of`: "points", the vertices
        [length], shape (n, 3), and "cells", the global numbers of the vertices of each
        cell, shape (m, d+1). All cells are positively oriented.
    """
    geometry = domain.mesh.geometry
    cells = cell_nodes(geometry)[: domain.owned_cells]
    return number_cells(geometry.x, cells, geometry.index_map(), domain.dim)


def number_cells(x: np.ndarray, cells: np.ndarray, nodes: Any, d: int) -> dict[str, np.ndarray]:
    """Return owned nodes, and cells by global numbers, positively oriented.

    Args:
        x: Positions of the nodes of this rank [length], shape (n, 3).
        cells: Local numbers of the nodes of each cell, shape (m, N).
        nodes: Index map of the nodes.
        d: Dimension.
    """
    k = degree_of(cells, d)
    negative = determinants(x[cells[:, : d + 1], :d]) < 0
    # Two swapped vertices turn the orientation; the nodes on the edges go with them.
    swapped_vertices = np.array([*range(d - 1), d, d - 1])
    first, second = swapped_vertices[node_vertices(d, k)].T
    swapped_nodes = node_between(d, k)[first, second]
    cells = np.where(negative[:, None], cells[:, swapped_nodes], cells)
    return {"points": x[: nodes.size_local].copy(), "cells": global_numbers(nodes, cells)}
