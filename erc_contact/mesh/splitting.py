"""Carry a mesh over to one whose nodes are split along interfaces between regions.

The glued mesh has all bodies in one: the two sides of a contact are one set of interior
facets. It is what is refined, meshed again and distributed, so the sides keep matching
facets by themselves. In the split mesh each facet of an interface is two facets of the
boundary, one of each side, which face each other.

The split mesh has the same owners and ghosts as the glued one, where every rank has all
cells around the vertices of its own cells. So the partner of each facet of an interface
that a rank owns is on the rank, too.

Symbols: d dimension. A side is a pair of a cell and one of its facets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.ranks import fetched
from erc_contact.mesh.sides import facets_of_cells, inner_facets
from erc_contact.mesh.tags import tag_table, tags_of

Facing = Mapping[tuple[str, str], tuple[np.ndarray, np.ndarray]]
"""Names of two parts -> sides of the first, and those of the second that face them."""


@dataclass(frozen=True)
class Interface:
    """Say where a mesh is split, and how its two sides are called.

    Attributes:
        names: Names of the two new boundary parts.
        tags: Their tags.
        regions: Tag of the region on each side.
        on: Tag of the part whose facets are split; None takes all facets between the
            regions.
    """

    names: tuple[str, str]
    tags: tuple[int, int]
    regions: tuple[int, int]
    on: int | None

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> Interface:
        """Make it from plain data, where pairs are lists."""
        pairs = {name: tuple(plain[name]) for name in ("names", "tags", "regions")}
        return cls(**pairs, on=plain["on"])


@dataclass(frozen=True, eq=False)
class Seams:
    """Relate a split mesh to the glued one.

    Attributes:
        interfaces: The interfaces, in the order in which they were split.
        facing: The sides that face each other; each pair of parts in both orders.
        cells: Cell of the glued mesh on this rank of each cell, shape (n,).
        nodes: Node of the glued mesh of each node, shape (m,).
        counts: Number of facets of each interface over all ranks.
    """

    interfaces: tuple[Interface, ...]
    facing: Facing
    cells: np.ndarray
    nodes: np.ndarray
    counts: tuple[int, ...]

    def __str__(self) -> str:
        """Name the pairs of parts, and how many facets face each other."""
        pairs = zip(self.interfaces, self.counts, strict=True)
        return ", ".join(f"{'/'.join(one.names)} of {count} facets" for one, count in pairs)

    def between(self, here: str, there: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the sides of two parts that face each other.

        See :meth:`Domain.facing`.

        Raises:
            InputError: If they are no pair.
        """
        if (here, there) not in self.facing:
            names = [interface.names for interface in self.interfaces]
            pairs = ", ".join(f"{one!r} and {other!r}" for one, other in names)
            raise InputError(
                f"facing: {here!r} and {there!r} do not face each other; this domain has the "
                f"pairs {pairs}."
            )
        return self.facing[here, there]

    def least(self, values: np.ndarray) -> np.ndarray:
        """Return the least of the values at the copies of each node of the glued mesh.

        Args:
            values: One value, or values at the nodes on this rank, shape (m,).

        Returns:
            The value, or values at the nodes of the glued mesh on this rank.

        Raises:
            InputError: If there is another number of values.
        """
        if values.ndim == 0:
            return values
        if values.shape != self.nodes.shape:
            raise InputError(
                f"The sizes have shape {values.shape}; give a number, or one for each node of "
                f"this rank: domain.mesh.geometry.x has {len(self.nodes)}."
            )
        result = np.full(self.nodes.max(initial=-1) + 1, np.inf)
        np.minimum.at(result, self.nodes, values)
        return result


def claimed(
    mesh: dmesh.Mesh,
    facet_tags: dmesh.MeshTags,
    cell_tags: dmesh.MeshTags,
    interfaces: Sequence[Interface],
) -> np.ndarray:
    """Return the number of the interface of each facet on this rank; collective.

    It is -1 for none, and for facets of which one cell only is on this rank. A facet
    that several interfaces claim belongs to the first of them.

    Args:
        mesh: The glued mesh.
        facet_tags: Tags of its facets.
        cell_tags: Tags of its cells.
        interfaces: The interfaces.

    Raises:
        InputError: If an interface has no facet.
    """
    tags = tag_table(facet_tags)
    facets, cells = inner_facets(mesh)
    beside = np.sort(tag_table(cell_tags)[cells], axis=1)
    result = np.full(len(tags), -1)
    for number, interface in enumerate(interfaces):
        between = np.all(beside == sorted(interface.regions), axis=1)
        if interface.on is not None:
            between &= tags[facets] == interface.on
        between &= result[facets] < 0
        result[facets[between]] = number
        if not mesh.comm.allreduce(bool(between.any()), MPI.LOR):
            place = "" if interface.on is None else " of the part on="
            raise InputError(
                f"split: the regions of {interface.names[0]!r} and {interface.names[1]!r} share no "
                f"facet{place} that is not split already. Mesh both bodies in one piece, with "
                "common nodes where they touch (in gmsh: fragment)."
            )
    return result


def side_tags(
    mesh: dmesh.Mesh,
    facet_tags: dmesh.MeshTags,
    cell_tags: dmesh.MeshTags,
    interfaces: Sequence[Interface],
    interface_of_facet: np.ndarray,
) -> np.ndarray:
    """Return the tag of each side, shape (cells, d+1).

    At interfaces it is that of the new part, elsewhere that of the facet.

    Args:
        mesh: The glued mesh.
        facet_tags: Tags of its facets.
        cell_tags: Tags of its cells.
        interfaces: The interfaces.
        interface_of_facet: What :func:`claimed` returned.
    """
    facets = facets_of_cells(mesh)
    tags = tag_table(facet_tags)[facets]
    regions = tag_table(cell_tags)[:, None]
    for number, interface in enumerate(interfaces):
        on_interface = interface_of_facet[facets] == number
        for region, tag in zip(interface.regions, interface.tags, strict=True):
            tags[on_interface & (regions == region)] = tag
    return tags


class Carried:
    """Carry tables of the glued mesh over to the split one; all methods are collective.

    Values of a cell are those that its owner has: another rank may not know that a
    facet of its ghosts is on an interface.

    Args:
        glued: The glued mesh.
        split_mesh: The split mesh, with the same owners and ghosts.
        numbers: Numbers of the nodes of the glued mesh's owned cells from which the
            split mesh was made, shape (cells, d+1).
    """

    def __init__(self, glued: dmesh.Mesh, split_mesh: dmesh.Mesh, numbers: np.ndarray) -> None:
        self.glued = glued
        self.mesh = split_mesh
        # Cells were given in the order of their global numbers.
        self._source = split_mesh.topology.original_cell_index
        # DOLFINx may give the corners of a cell another order.
        geometry = split_mesh.geometry
        numbers_here = geometry.input_global_indices[geometry.dofmaps[0]]
        given = self._of_cells(numbers)
        self._order = np.argmax(given[:, None, :] == numbers_here[:, :, None], axis=2)

    def _of_cells(self, table: np.ndarray) -> np.ndarray:
        """Return the rows (cells, k) of the split cells on this rank, with ghosts."""
        owned = self.glued.topology.index_map(self.glued.topology.dim).size_local
        return fetched(self.glued.comm, table[:owned], self._source)

    def of_sides(self, table: np.ndarray) -> np.ndarray:
        """Return the same for a table of sides or corners, shape (cells, d+1)."""
        return np.take_along_axis(self._of_cells(table), self._order, axis=1)

    def cell_tags(self, tags: dmesh.MeshTags) -> dmesh.MeshTags:
        """Return tags of cells."""
        values = self._of_cells(tag_table(tags)[:, None])[:, 0]
        return tags_of(self.mesh, tags.dim, np.arange(len(values)), values)

    def facet_tags(self, tags: np.ndarray) -> dmesh.MeshTags:
        """Return tags of facets, given by the tags of their sides in the glued mesh."""
        d = self.mesh.topology.dim
        facets = facets_of_cells(self.mesh)
        return tags_of(self.mesh, d - 1, facets.ravel(), self.of_sides(tags).ravel())

    def marks(self, marks: dmesh.MeshTags | None) -> dmesh.MeshTags | None:
        """Return marks of facets, which are the same on both sides; None stays None."""
        if marks is None:
            return None
        return self.facet_tags(tag_table(marks)[facets_of_cells(self.glued)])

    def seams(self, interfaces: Sequence[Interface], tags: np.ndarray) -> Seams:
        """Return what relates the split mesh to the glued one.

        Args:
            interfaces: The interfaces.
            tags: Tags of the sides in the glued mesh, see :func:`side_tags`.
        """
        d = self.mesh.topology.dim
        tags = self.of_sides(tags)
        # A facet of the glued mesh has one number on all ranks, which both sides know.
        facets = facets_of_cells(self.glued)
        facet_map = self.glued.topology.index_map(d - 1)
        numbers = facet_map.local_to_global(facets.ravel()).reshape(facets.shape)
        numbers = self.of_sides(numbers)
        facing = {}
        for interface in interfaces:
            here, there = _facing(tags, numbers, interface.tags)
            facing[interface.names] = (here, there)
            facing[interface.names[::-1]] = (there, here)
        cell_map = self.glued.topology.index_map(d)
        cells = cell_map.global_to_local(self._source)
        # A pair is counted by the rank that owns the cell of its first side.
        firsts = [facing[interface.names][0] for interface in interfaces]
        owned = np.array([(sides[:, 0] < cell_map.size_local).sum() for sides in firsts])
        counts = tuple(map(int, self.glued.comm.allreduce(owned, MPI.SUM)))
        return Seams(tuple(interfaces), facing, cells, self._nodes(), counts)

    def _nodes(self) -> np.ndarray:
        """Return the node of the glued mesh of each node of the split mesh."""
        index_map = self.glued.geometry.index_map()
        nodes = self.glued.geometry.dofmaps[0]
        global_nodes = index_map.local_to_global(nodes.ravel()).reshape(nodes.shape)
        result = np.empty(len(self.mesh.geometry.x), dtype=np.int64)
        result[self.mesh.geometry.dofmaps[0]] = self.of_sides(global_nodes)
        return index_map.global_to_local(result)


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
