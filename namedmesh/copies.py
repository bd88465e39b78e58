"""Number the copies of nodes where a mesh is split, and tear it at hinges.

A vertex at an interface gets as many nodes as there are groups of cells around it that
are connected by common facets without crossing an interface. So the rim of an
interface, where it ends inside a body or on its surface, needs no rule of its own.
Other vertices stay as they are.

Where cells meet at a vertex or an edge without a common facet, such a point would be a
hinge of the elements alone: in elasticity it transmits no force, and no stress in
equilibrium does. So a mesh is torn there by the same rule, and messages about what
nothing holds name these points.

Every rank has all cells around the vertices of its own cells, so it finds their groups
alone.

Symbols: d dimension. A corner is a pair of a cell and one of its vertices.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import la
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.percent import place_words
from namedmesh.base.ranks import distinct_rows, exchange, fetch, global_numbers
from namedmesh.base.releases import cell_nodes
from namedmesh.graphs import components, destinations
from namedmesh.sides import inner_facets, local_facets, outer_facets
from namedmesh.simplex import of_facets

ROUND_OFF = 1e-12
"""Coordinate that is told as zero, over the size of the bodies [-]."""
TOLD = 3
"""Greatest number of points in a message."""


def number_nodes(
    mesh: dmesh.Mesh, is_cut: np.ndarray | None = None, places: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Number the nodes of the split mesh; collective.

    The owner of the cell of lowest number in a group of corners numbers its node.

    Args:
        mesh: The glued mesh.
        is_cut: Whether a facet of this rank is one of an interface; None if none is.
        places: Places of the corners of the cells [length], shape (cells, d+1, d); None
            where they are the nodes.

    Returns:
        Numbers of the corners of the owned cells in the order of all ranks' nodes,
        shape (cells, d+1), and the nodes that this rank numbers [length], (n, d).
    """
    comm = lasting(mesh.comm)
    d = mesh.topology.dim
    nodes = cell_nodes(mesh.geometry)
    index_map = mesh.topology.index_map(d)
    owned = index_map.size_local
    cells = index_map.local_to_global(np.arange(len(nodes), dtype=np.int32))
    group = _groups(mesh, is_cut)
    lowest = np.full(group.max(initial=-1) + 1, np.iinfo(np.int64).max)
    np.minimum.at(lowest, group, cells[:, None])
    lowest_cell = lowest[group[:owned]]

    first = lowest_cell == cells[:owned, None]
    start = comm.exscan(int(first.sum())) or 0
    numbers = np.where(first, start + np.cumsum(first.ravel()).reshape(first.shape) - 1, -1)
    x = mesh.geometry.x[nodes[:owned][first], :d] if places is None else places[:owned][first]
    # The corner in the lowest cell has the same vertex of the glued mesh.
    vertices = global_numbers(mesh.geometry.index_map(), nodes[:owned])
    cell, corner = np.nonzero(~first)
    known = fetch(comm, np.hstack([vertices, numbers]), lowest_cell[cell, corner])
    same_vertex = known[:, : d + 1] == vertices[cell, corner][:, None]
    numbers[cell, corner] = known[:, d + 1 :][same_vertex]
    return numbers, x


def stay_closed(mesh: dmesh.Mesh, is_cut: np.ndarray) -> np.ndarray:
    """Tell which facets of interfaces do not open; collective.

    All vertices of such a facet are on the rim, where an interface ends inside a body
    and both sides keep one node. They are usual in the corners of a crack in 3D.

    Args:
        mesh: The glued mesh.
        is_cut: Whether a facet of this rank is one of an interface.

    Returns:
        Shape (facets,).
    """
    facets, cells = inner_facets(mesh)
    cells = cells[is_cut[facets]]
    facets = facets[is_cut[facets]]
    group = _groups(mesh, is_cut)
    nodes = cell_nodes(mesh.geometry)
    vertex = _facet_nodes(mesh, facets, cells[:, 0])
    of_sides = []
    for side in range(2):
        cell = cells[:, side]
        corner = np.argmax(nodes[cell][:, None] == vertex[:, :, None], axis=2)
        of_sides.append(np.take_along_axis(group[cell], corner, axis=1))
    closed = la.vector(mesh.topology.index_map(mesh.topology.dim - 1))
    closed.array[facets] = np.all(of_sides[0] == of_sides[1], axis=1)
    # The owner of a facet has a cell of it, and so all cells around its vertices.
    closed.scatter_forward()
    return np.asarray(closed.array > 0)


def _groups(mesh: dmesh.Mesh, is_cut: np.ndarray | None) -> np.ndarray:
    """Return the group of each corner of this rank, shape (cells, d+1).

    The groups of vertices that no owned cell has may be parts of the true ones.
    """
    nodes = cell_nodes(mesh.geometry)
    # A vertex is a group of its own number, unless it is on an interface or on the
    # boundary, as all vertices are at which cells meet without a common facet.
    touched = np.zeros(len(mesh.geometry.x), dtype=bool)
    touched[_facet_nodes(mesh, *outer_facets(mesh))] = True
    facets, cells = inner_facets(mesh)
    crossed = np.zeros(len(facets), dtype=bool) if is_cut is None else is_cut[facets]
    touched[_facet_nodes(mesh, facets[crossed], cells[crossed, 0])] = True
    group = nodes.astype(np.int64)
    # Their groups are components of a graph, which has a link between the two corners
    # of each vertex of a facet that is not cut.
    links = ~crossed & touched[nodes[cells[:, 0]]].any(axis=1)
    cells = cells[links]
    vertex = _facet_nodes(mesh, facets[links], cells[:, 0])
    corner_of_touched = touched[nodes]
    count = int(corner_of_touched.sum())
    number = np.full(nodes.shape, -1)
    number[corner_of_touched] = np.arange(count)
    row, column = np.nonzero(touched[vertex])
    ends = []
    for side in range(2):
        cell = cells[row, side]
        corner = np.argmax(nodes[cell] == vertex[row, column][:, None], axis=1)
        ends.append(number[cell, corner])
    group[corner_of_touched] = len(mesh.geometry.x) + components(count, np.column_stack(ends))
    return group


def is_pinched(mesh: dmesh.Mesh) -> bool:
    """Tell whether cells meet at a vertex or an edge alone; collective.

    Then :func:`number_nodes` without interfaces tears the mesh there.
    """
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    nodes = cell_nodes(mesh.geometry)
    group = _groups(mesh, None)
    # Around other vertices not all cells need be on this rank.
    known = np.zeros(len(mesh.geometry.x), dtype=bool)
    known[nodes[:owned]] = True
    of_boundary = known[nodes] & (group >= len(known))
    pairs = np.unique(np.column_stack([nodes[of_boundary], group[of_boundary]]), axis=0)
    several = len(np.unique(pairs[:, 0])) < len(pairs)
    return bool(lasting(mesh.comm).allreduce(several, MPI.LOR))


def _facet_nodes(mesh: dmesh.Mesh, facets: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the nodes of facets, each of which belongs to a cell, shape (n, d)."""
    return of_facets(cell_nodes(mesh.geometry)[cells], local_facets(mesh, facets, cells))


def same_ranks(mesh: dmesh.Mesh) -> Callable[..., Any]:
    """Return a partitioner that repeats the owners and ghosts of a mesh; collective."""
    comm = lasting(mesh.comm)
    index_map = mesh.topology.index_map(mesh.topology.dim)
    owned = index_map.size_local
    # Each owner learns which ranks have its cells as ghosts.
    cells, ranks = exchange(comm, index_map.owners, index_map.ghosts[:, None])
    ghosts = cells[:, 0] - index_map.local_range[0]
    adjacency = destinations(np.full(owned, comm.rank), ghosts, ranks)

    def repeat(*_: Any) -> Any:
        """Return the ranks of the owned cells, the owner first."""
        return adjacency

    return repeat


def shared_points(
    comm: MPI.Comm, x: np.ndarray, group: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the points that belong to several groups; collective.

    Args:
        comm: The ranks.
        x: Points of this rank [length], shape (n, d).
        group: Group of each, shape (n,).

    Returns:
        The points, and the group of each, one row for each point and group; the same on
        all ranks.
    """
    rows = distinct_rows(comm, np.column_stack([x, group]))
    _, number, count = np.unique(rows[:, :-1], axis=0, return_inverse=True, return_counts=True)
    rows = rows[count[number.ravel()] > 1]
    return rows[:, :-1], rows[:, -1].astype(int)


def points_in_words(points: np.ndarray, size: float) -> str:
    """Return points (n, d) in words; what is round-off of a size [length] is zero."""
    points = np.unique(np.where(abs(points) < ROUND_OFF * size, 0.0, points), axis=0)
    words = [place_words(point) for point in points[:TOLD]]
    more = len(points) - len(words)
    return ", ".join(words) + (f" and {more} more" if more else "")
