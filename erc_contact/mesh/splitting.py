"""Split the nodes of a mesh along interfaces between its regions.

The glued mesh has all bodies in one: the two sides of a contact are one set of interior
facets. It is what is refined, meshed again and distributed, so the sides keep matching
facets by themselves. In the split mesh each facet of an interface is two facets of the
boundary, one of each side, which face each other.

A vertex of an interface gets as many nodes as there are groups of cells around it that
are connected by common facets without crossing an interface. So the rim of an
interface, where it ends inside a body or on its surface, needs no rule of its own. Other
vertices stay as they are.

Every rank has all cells around the vertices of its own cells of the glued mesh, so it
finds their groups alone. The split mesh has the same owners and ghosts. So the partner
of each facet of an interface that a rank owns is on the rank, too.

Symbols: d dimension. A corner is a pair of a cell and one of its vertices. A side is a
pair of a cell and one of its facets; facet i is opposite to vertex i.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from dolfinx import graph
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.ranks import exchange, fetched
from erc_contact.mesh.graphs import components
from erc_contact.mesh.partition import distributed
from erc_contact.mesh.simplex import facet_vertices
from erc_contact.mesh.tags import tag_table, tags_of

Facing = Mapping[tuple[str, str], tuple[np.ndarray, np.ndarray]]
"""Names of two parts -> sides of the first, and of the second that face them, (n, 2)."""


class Glued(Protocol):
    """Represent what is split: a mesh, and the tags of its facets and cells."""

    @property
    def mesh(self) -> dmesh.Mesh:
        """Return the mesh, with complete vertex patches on each rank."""

    @property
    def facet_tags(self) -> dmesh.MeshTags:
        """Return the tags of facets."""

    @property
    def names(self) -> Mapping[str, int]:
        """Return the tag of each part."""

    @property
    def cell_tags(self) -> dmesh.MeshTags | None:
        """Return the tags of cells."""

    @property
    def regions(self) -> Mapping[str, int]:
        """Return the tag of each region."""

    @property
    def curved_facets(self) -> dmesh.MeshTags | None:
        """Return the marks of facets."""


@dataclass(frozen=True)
class Interface:
    """Say where a mesh is split, and how its two sides are called.

    Attributes:
        names: Names of the two new boundary parts.
        regions: Name of the region on each side.
        on: Name of the part whose facets are split; None takes all facets between the
            regions.
        tags: Tags of the new parts.
    """

    names: tuple[str, str]
    regions: tuple[str, str]
    on: str | None
    tags: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Seams:
    """Relate a split mesh to the glued one.

    Attributes:
        interfaces: The interfaces, in the order in which they were split.
        facing: The sides that face each other; each pair of parts in both orders.
        cells: Cell of the glued mesh on this rank of each cell, shape (n,).
        nodes: Node of the glued mesh of each node, shape (m,).
    """

    interfaces: tuple[Interface, ...]
    facing: Facing
    cells: np.ndarray
    nodes: np.ndarray

    def least(self, values: np.ndarray) -> np.ndarray:
        """Return the least of the values at the copies of each node of the glued mesh.

        Args:
            values: One value, or values at the nodes on this rank, shape (m,).

        Returns:
            The value, or values at the nodes of the glued mesh on this rank.
        """
        if values.ndim == 0:
            return values
        result = np.full(self.nodes.max(initial=-1) + 1, np.inf)
        np.minimum.at(result, self.nodes, values)
        return result


@dataclass(frozen=True, eq=False)
class Split:
    """Hold a split mesh with its tags.

    Attributes:
        mesh: The split mesh.
        facet_tags: Tags of facets, those of the new parts included.
        names: Tags of the parts that have facets, the new ones included.
        cell_tags: Tags of cells.
        curved_facets: Marks of facets, or None.
        seams: What relates it to the glued mesh.
    """

    mesh: dmesh.Mesh
    facet_tags: dmesh.MeshTags
    names: Mapping[str, int]
    cell_tags: dmesh.MeshTags
    curved_facets: dmesh.MeshTags | None
    seams: Seams


def split(glued: Glued, interfaces: Sequence[Interface]) -> Split:
    """Split the nodes of a mesh along interfaces; collective.

    A facet that two interfaces claim is one of the first of them.

    Args:
        glued: The mesh and its tags.
        interfaces: The interfaces, whose regions and parts the mesh has.
    """
    mesh = glued.mesh
    d = mesh.topology.dim
    interface_of_facet = claimed(glued, interfaces)
    numbers, x = _numbers(mesh, interface_of_facet >= 0)
    fine = distributed(mesh.comm, numbers, x, _same_ranks(mesh))
    fine.topology.create_entities(d - 1)
    fine.topology.create_connectivity(d, d - 1)
    fine.topology.create_connectivity(d - 1, d)
    carried = _Carried(mesh, fine, numbers)

    facets = _facets(mesh)
    tags = tag_table(glued.facet_tags)[facets]
    regions = _regions(glued)
    for number, interface in enumerate(interfaces):
        for region, tag in zip(interface.regions, interface.tags, strict=True):
            in_region = regions == glued.regions[region]
            tags[in_region[:, None] & (interface_of_facet[facets] == number)] = tag
    tags = carried.of_sides(tags)
    facet_tags = carried.facet_tags(tags)
    curved = None
    if glued.curved_facets is not None:
        marks = tag_table(glued.curved_facets)[facets]
        curved = carried.facet_tags(carried.of_sides(marks))
    region_tags = carried.of_cells(regions[:, None])[:, 0]
    cell_tags = tags_of(fine, d, np.arange(len(region_tags)), region_tags)

    # A facet of the glued mesh has one number on all ranks, which both its sides know.
    global_facets = mesh.topology.index_map(d - 1).local_to_global(facets.ravel())
    glued_facets = carried.of_sides(global_facets.reshape(facets.shape))
    names = _names(glued, interfaces, facet_tags)
    facing = {}
    for interface in interfaces:
        here, there = _facing(tags, glued_facets, interface.tags)
        facing[interface.names] = (here, there)
        facing[interface.names[::-1]] = (there, here)
    seams = Seams(tuple(interfaces), facing, carried.glued_cells, carried.nodes())
    return Split(fine, facet_tags, names, cell_tags, curved, seams)


def claimed(glued: Glued, interfaces: Sequence[Interface]) -> np.ndarray:
    """Return the number of the interface of each facet of this rank, -1 for none.

    Facets of which one cell only is on this rank belong to none here.
    """
    mesh = glued.mesh
    d = mesh.topology.dim
    regions = _regions(glued)
    facet_tags = tag_table(glued.facet_tags)
    facets, cells = _inner_facets(mesh)
    result = np.full(len(facet_tags), -1)
    # The first interface comes last, so that it keeps what several claim.
    for number in reversed(range(len(interfaces))):
        interface = interfaces[number]
        one, other = (glued.regions[name] for name in interface.regions)
        sides = regions[cells]
        between = np.all(sides == (one, other), axis=1) | np.all(sides == (other, one), axis=1)
        if interface.on is not None:
            between &= facet_tags[facets] == glued.names[interface.on]
        result[facets[between]] = number
    return result


def _regions(glued: Glued) -> np.ndarray:
    """Return the tag of the region of each cell of this rank, ghosts included."""
    assert glued.cell_tags is not None
    return tag_table(glued.cell_tags)


def _facets(mesh: dmesh.Mesh) -> np.ndarray:
    """Return the facets of the cells of this rank, shape (cells, d+1)."""
    d = mesh.topology.dim
    return mesh.topology.connectivity(d, d - 1).array.reshape(-1, d + 1)


def _inner_facets(mesh: dmesh.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets of which both cells are on this rank, and these, shape (n, 2)."""
    d = mesh.topology.dim
    facet_to_cell = mesh.topology.connectivity(d - 1, d)
    first = facet_to_cell.offsets[:-1]
    inner = np.flatnonzero(np.diff(facet_to_cell.offsets) == 2)
    cells = np.column_stack([facet_to_cell.array[first[inner] + i] for i in range(2)])
    return inner, cells


def _numbers(mesh: dmesh.Mesh, is_cut: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number the nodes of the split mesh; collective.

    The owner of the cell of lowest number in a group of corners numbers its node.

    Args:
        mesh: The glued mesh.
        is_cut: Whether a facet of this rank is one of an interface.

    Returns:
        Numbers of the corners of the owned cells in the order of all ranks' nodes,
        shape (cells, d+1), and the nodes that this rank numbers [length], (n, d).
    """
    comm = mesh.comm
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
    d = mesh.topology.dim
    nodes = mesh.geometry.dofmaps[0]
    facets, cells = _inner_facets(mesh)
    is_cut = is_cut[facets]
    # A vertex is a group of its own number, unless an interface touches it.
    vertex = _facet_nodes(mesh, facets, cells[:, 0])
    on_interface = np.zeros(len(mesh.geometry.x), dtype=bool)
    on_interface[vertex[is_cut]] = True
    group = nodes.astype(np.int64)
    # Those at interfaces are components of a graph, which has a link between the two
    # corners of each vertex of a facet that is not cut.
    corner_of_touched = on_interface[nodes]
    count = int(corner_of_touched.sum())
    number = np.full(nodes.shape, -1)
    number[corner_of_touched] = np.arange(count)
    row, place = np.nonzero(on_interface[vertex] & ~is_cut[:, None])
    ends = []
    for side in range(2):
        cell = cells[row, side]
        corner = np.argmax(nodes[cell] == vertex[row, place][:, None], axis=1)
        ends.append(number[cell, corner])
    group[corner_of_touched] = len(mesh.geometry.x) + components(count, np.column_stack(ends))
    return group


def _facet_nodes(mesh: dmesh.Mesh, facets: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the nodes of facets, each of which belongs to a cell, shape (n, d)."""
    d = mesh.topology.dim
    local = np.argmax(_facets(mesh)[cells] == facets[:, None], axis=1)
    nodes = mesh.geometry.dofmaps[0][cells]
    return np.take_along_axis(nodes, facet_vertices(d)[local], axis=1)


def _same_ranks(mesh: dmesh.Mesh) -> Callable[..., Any]:
    """Return a partitioner that repeats the owners and ghosts of a mesh; collective."""
    comm = mesh.comm
    index_map = mesh.topology.index_map(mesh.topology.dim)
    owned = index_map.size_local
    # Each owner learns which ranks have its cells as ghosts.
    cells, ranks = exchange(comm, index_map.owners, index_map.ghosts[:, None])
    ghosts = cells[:, 0] - index_map.local_range[0]
    all_cells = np.concatenate([np.arange(owned), ghosts])
    all_ranks = np.concatenate([np.full(owned, comm.rank), ranks])
    # The sort is stable, so that the owner comes first.
    order = np.argsort(all_cells, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(all_cells, minlength=owned))])
    destinations = graph.adjacencylist(all_ranks[order].astype(np.int32), offsets.astype(np.int32))

    def repeat(*_: Any) -> Any:
        """Return the ranks of the owned cells, the owner first."""
        return destinations._cpp_object

    return repeat


class _Carried:
    """Carry tables of the glued mesh over to the split one; its methods are collective.

    Values of a cell are those that its owner has: another rank may not know that a
    facet of its ghosts is on an interface.

    Attributes:
        glued_cells: Cell of the glued mesh on this rank of each split cell.
    """

    def __init__(self, glued: dmesh.Mesh, split_mesh: dmesh.Mesh, numbers: np.ndarray) -> None:
        self.glued = glued
        self.mesh = split_mesh
        index_map = glued.topology.index_map(glued.topology.dim)
        self._owned = index_map.size_local
        # Cells were given in the order of their global numbers.
        self._source = split_mesh.topology.original_cell_index
        self.glued_cells = index_map.global_to_local(self._source)
        # DOLFINx may give the corners of a cell another order.
        geometry = split_mesh.geometry
        numbers_here = geometry.input_global_indices[geometry.dofmaps[0]]
        given = self.of_cells(numbers)
        self._order = np.argmax(given[:, None, :] == numbers_here[:, :, None], axis=2)

    def of_cells(self, table: np.ndarray) -> np.ndarray:
        """Return the rows (cells, k) of the split cells on this rank, with ghosts."""
        return fetched(self.glued.comm, table[: self._owned], self._source)

    def of_sides(self, table: np.ndarray) -> np.ndarray:
        """Return the same for a table of sides or corners, shape (cells, d+1)."""
        return np.take_along_axis(self.of_cells(table), self._order, axis=1)

    def facet_tags(self, tags: np.ndarray) -> dmesh.MeshTags:
        """Return tags of facets, given by their sides."""
        return tags_of(
            self.mesh, self.mesh.topology.dim - 1, _facets(self.mesh).ravel(), tags.ravel()
        )

    def nodes(self) -> np.ndarray:
        """Return the node of the glued mesh of each node of the split mesh."""
        index_map = self.glued.geometry.index_map()
        nodes = self.glued.geometry.dofmaps[0]
        global_nodes = index_map.local_to_global(nodes.ravel()).reshape(nodes.shape)
        result = np.empty(len(self.mesh.geometry.x), dtype=np.int64)
        result[self.mesh.geometry.dofmaps[0]] = self.of_sides(global_nodes)
        return index_map.global_to_local(result)


def _names(
    glued: Glued, interfaces: Sequence[Interface], facet_tags: dmesh.MeshTags
) -> dict[str, int]:
    """Return the tags of the parts that have facets on the split mesh; collective.

    A part inside the body whose facets all came to interfaces is no longer there.
    """
    names = dict(glued.names)
    for interface in interfaces:
        names.update(zip(interface.names, interface.tags, strict=True))
    counts = np.array([len(facet_tags.find(tag)) for tag in names.values()])
    counts = glued.mesh.comm.allreduce(counts, MPI.SUM)
    return {name: tag for (name, tag), count in zip(names.items(), counts, strict=True) if count}


def _facing(
    tags: np.ndarray, glued_facets: np.ndarray, sides: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the sides that face each other on this rank, shape (n, 2) each.

    Args:
        tags: Tag of each side, shape (cells, d+1).
        glued_facets: Global number of the glued facet of each side.
        sides: Tags of the two parts.
    """
    here = np.argwhere(tags == sides[0]).astype(np.int32)
    there = np.argwhere(tags == sides[1]).astype(np.int32)
    _, i, j = np.intersect1d(
        glued_facets[tuple(here.T)], glued_facets[tuple(there.T)], return_indices=True
    )
    return here[i], there[j]
