"""Number the copies of the nodes at interfaces, where a mesh is split.

A vertex of an interface gets as many nodes as there are groups of cells around it that
are connected by common facets without crossing an interface. So the rim of an
interface, where it ends inside a body or on its surface, needs no rule of its own. A
vertex of the boundary does so, too: cells that touch at a vertex or along an edge only
would hang on a hinge, which an elastic body cannot have. Other vertices stay as they
are.

Every rank has all cells around the vertices of its own cells, so it finds their groups
alone.

Symbols: d dimension. A corner is a pair of a cell and one of its vertices.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.ranks import exchange, fetched
from erc_contact.base.runtime.communicators import lasting
from erc_contact.mesh.graphs import components, destinations
from erc_contact.mesh.sides import facets_of_cells, inner_facets
from erc_contact.mesh.simplex import facet_vertices


def numbered(mesh: dmesh.Mesh, is_cut: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number the nodes of the split mesh; collective.

    The owner of the cell of lowest number in a group of corners numbers its node.

    Args:
        mesh: The glued mesh.
        is_cut: Whether a facet of this rank is one of an interface.

    Returns:
        Numbers of the corners of the owned cells in the order of all ranks' nodes,
        shape (cells, d+1), and the nodes that this rank numbers [length], (n, d).
    """
    comm = lasting(mesh.comm)
    d = mesh.topology.dim
    nodes = mesh.geometry.dofmaps[0]
    index_map = mesh.topology.index_map(d)
    owned = index_map.size_local
    cells = index_map.local_to_global(np.arange(len(nodes), dtype=np.int32))
    group = _groups(mesh, is_cut)
    lowest = np.full(group.max(initial=-1) + 1, np.iinfo(np.int64).max)
    np.minimum.at(lowest, group, cells[:, None])
    lowest_cell = lowest[group[:owned]]

    own = lowest_cell == cells[:owned, None]
    start = comm.exscan(int(own.sum())) or 0
    numbers = np.where(own, start + np.cumsum(own.ravel()).reshape(own.shape) - 1, -1)
    x = mesh.geometry.x[nodes[:owned][own], :d]
    # The corner in the lowest cell has the same vertex of the glued mesh.
    vertices = mesh.geometry.index_map().local_to_global(nodes[:owned].ravel())
    vertices = vertices.reshape(owned, d + 1)
    cell, corner = np.nonzero(~own)
    known = fetched(comm, np.hstack([vertices, numbers]), lowest_cell[cell, corner])
    same_vertex = known[:, : d + 1] == vertices[cell, corner][:, None]
    numbers[cell, corner] = known[:, d + 1 :][same_vertex]
    return numbers, x


def _groups(mesh: dmesh.Mesh, is_cut: np.ndarray) -> np.ndarray:
    """Return the group of each corner of this rank, shape (cells, d+1).

    The groups of vertices that no owned cell has may be parts of the true ones.
    """
    nodes = mesh.geometry.dofmaps[0]
    facets, cells = inner_facets(mesh)
    is_cut = is_cut[facets]
    # A vertex inside a body is a group of its own number.
    vertex = _facet_nodes(mesh, facets, cells[:, 0])
    is_touched = np.zeros(len(mesh.geometry.x), dtype=bool)
    is_touched[vertex[is_cut]] = True
    is_touched[_boundary_nodes(mesh)] = True
    group = nodes.astype(np.int64)
    # Touched ones are components of a graph, which has a link between the two corners
    # of each vertex of a facet that is not cut.
    corner_of_touched = is_touched[nodes]
    count = int(corner_of_touched.sum())
    number = np.full(nodes.shape, -1)
    number[corner_of_touched] = np.arange(count)
    row, place = np.nonzero(is_touched[vertex] & ~is_cut[:, None])
    ends = []
    for side in range(2):
        cell = cells[row, side]
        corner = np.argmax(nodes[cell] == vertex[row, place][:, None], axis=1)
        ends.append(number[cell, corner])
    group[corner_of_touched] = len(mesh.geometry.x) + components(count, np.column_stack(ends))
    return group


def has_hinges(mesh: dmesh.Mesh) -> bool:
    """Tell whether cells touch at a vertex or along an edge only; collective."""
    comm = lasting(mesh.comm)
    facet_map = mesh.topology.index_map(mesh.topology.dim - 1)
    no_cut = np.zeros(facet_map.size_local + facet_map.num_ghosts, dtype=bool)
    _, x = numbered(mesh, no_cut)
    nodes = comm.allreduce(len(x), MPI.SUM)
    return bool(nodes > mesh.topology.index_map(0).size_global)


def _boundary_nodes(mesh: dmesh.Mesh) -> np.ndarray:
    """Return the nodes of facets of which one cell only is on this rank."""
    connectivity = mesh.topology.connectivity(mesh.topology.dim - 1, mesh.topology.dim)
    facets = np.flatnonzero(np.diff(connectivity.offsets) == 1)
    return _facet_nodes(mesh, facets, connectivity.array[connectivity.offsets[facets]])


def _facet_nodes(mesh: dmesh.Mesh, facets: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the nodes of facets, each of which belongs to a cell, shape (n, d)."""
    d = mesh.topology.dim
    local = np.argmax(facets_of_cells(mesh)[cells] == facets[:, None], axis=1)
    nodes = mesh.geometry.dofmaps[0][cells]
    return np.take_along_axis(nodes, facet_vertices(d)[local], axis=1)


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
