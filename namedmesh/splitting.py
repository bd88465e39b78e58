"""Carry a mesh over to a mesh whose nodes are split along interfaces between regions.

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

from collections.abc import Sequence

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.exceptions import InputError
from namedmesh.base.ranks import global_numbers, union
from namedmesh.base.releases import cell_nodes
from namedmesh.copies import points_in_words, shared_points
from namedmesh.interface_map import Interface, InterfaceMap
from namedmesh.sides import facets_of_cells, inner_facets
from namedmesh.simplex import of_facets
from namedmesh.tags import NO_TAG, tag_table
from namedmesh.transfer import GivenCells

ONE_PLACE = 1e-12
"""Distance of two sides over the greatest coordinate that is round-off [-]."""
NO_INTERFACE = -1
"""Number that stands for no interface."""


def claim_facets(
    mesh: dmesh.Mesh,
    facet_tags: dmesh.MeshTags,
    cell_tags: dmesh.MeshTags,
    interfaces: Sequence[Interface],
) -> np.ndarray:
    """Return the number of the interface of each facet on this rank; collective.

    It is :data:`NO_INTERFACE` for none, and for facets of which one cell only is on
    this rank. A facet that several interfaces claim belongs to the first of them.

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
    beside = tag_table(cell_tags)[cells]
    result = np.full(len(tags), NO_INTERFACE)
    for number, interface in enumerate(interfaces):
        on_first = np.isin(beside, interface.regions[0])
        on_second = np.isin(beside, interface.regions[1])
        between = np.any(on_first & on_second[:, ::-1], axis=1)
        if interface.on is not None:
            between &= tags[facets] == interface.on
        between &= result[facets] < 0
        result[facets[between]] = number
        if not lasting(mesh.comm).allreduce(bool(between.any()), MPI.LOR):
            place = "" if interface.on is None else " of the part on="
            hinges = _hinges(mesh, tag_table(cell_tags), interface)
            raise InputError(
                f"split: the regions of {interface.names[0]!r} and {interface.names[1]!r} share no "
                f"facet{place} that is not split already. Mesh both bodies in one piece, with "
                f"common nodes where they touch (in gmsh: fragment).{hinges}"
            )
    return result


def check_opened(
    mesh: dmesh.Mesh, interfaces: Sequence[Interface], interface_of_facet: np.ndarray
) -> None:
    """Check that each interface has a facet that opens; collective.

    Args:
        mesh: The glued mesh.
        interfaces: The interfaces.
        interface_of_facet: The interface of each facet that opens or is tied.

    Raises:
        InputError: If an interface has none.
    """
    local = np.isin(np.arange(len(interfaces)), interface_of_facet)
    has_facet = lasting(mesh.comm).allreduce(local.astype(int), MPI.SUM)
    for interface, opens in zip(interfaces, has_facet, strict=True):
        if not opens:
            raise InputError(
                f"split: {interface.names[0]!r} and {interface.names[1]!r} do not open: all "
                "vertices of their facets are where the interface ends inside the body. Make the "
                "mesh finer there, with a vertex amid the interface."
            )


def _hinges(mesh: dmesh.Mesh, tags: np.ndarray, interface: Interface) -> str:
    """Say at which points the regions of an interface touch; collective.

    Args:
        mesh: The glued mesh.
        tags: Tags of its cells.
        interface: The interface, whose regions share no facet.
    """
    first, second = (np.isin(tags, region) for region in interface.regions)
    cells = np.flatnonzero(first | second)
    nodes = cell_nodes(mesh.geometry)[cells]
    x = mesh.geometry.x[nodes.ravel(), : mesh.topology.dim]
    group = np.repeat(second[cells], nodes.shape[1])
    points, _ = shared_points(lasting(mesh.comm), x, group)
    if len(points) == 0:
        return ""
    places = points_in_words(points, abs(x).max(initial=0.0))
    return (
        f" They touch at {places} alone; bodies in contact need"
        " common facets: let them overlap before, or mesh them apart and join their sides by"
        " assembly and joined."
    )


def touching_regions(
    mesh: dmesh.Mesh, cell_tags: dmesh.MeshTags, interface_of_facet: np.ndarray
) -> list[tuple[int, int]]:
    """Return the tags of each two regions that share facets; collective.

    Args:
        mesh: The glued mesh.
        cell_tags: Tags of its cells.
        interface_of_facet: What :func:`claim_facets` returned; facets of an interface
            do not count.
    """
    facets, cells = inner_facets(mesh)
    beside = tag_table(cell_tags)[cells[interface_of_facet[facets] == NO_INTERFACE]]
    between = beside[(beside[:, 0] != beside[:, 1]) & np.all(beside != NO_TAG, axis=1)]
    here = {(int(first), int(second)) for first, second in np.unique(np.sort(between), axis=0)}
    return sorted(union(lasting(mesh.comm), here))


def side_tags(
    mesh: dmesh.Mesh,
    facet_tags: dmesh.MeshTags,
    cell_tags: dmesh.MeshTags,
    interfaces: Sequence[Interface],
    interface_of_facet: np.ndarray,
) -> np.ndarray:
    """Return the tag of each side, shape (cells, d+1).

    At interfaces it is the tag of the new part, elsewhere the tag of the facet.

    Args:
        mesh: The glued mesh.
        facet_tags: Tags of its facets.
        cell_tags: Tags of its cells.
        interfaces: The interfaces.
        interface_of_facet: What :func:`claim_facets` returned.
    """
    facets = facets_of_cells(mesh)
    tags = tag_table(facet_tags)[facets]
    regions = tag_table(cell_tags)[:, None]
    for number, interface in enumerate(interfaces):
        on_interface = interface_of_facet[facets] == number
        for region, tag in zip(interface.regions, interface.tags, strict=True):
            tags[on_interface & np.isin(regions, region)] = tag
    return tags


class CarriedTables:
    """Carry tables of the glued mesh over to the split mesh; methods are collective.

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
        self._given = GivenCells(split_mesh, numbers)

    def of_sides(self, table: np.ndarray) -> np.ndarray:
        """Return a table of sides or corners of the glued mesh, shape (cells, d+1)."""
        return self._given.of_sides(self._of_owned(table))

    def of_corners(self, places: np.ndarray) -> np.ndarray:
        """Return vectors at the corners of the glued mesh, shape (cells, d+1, d)."""
        return self._given.of_corners(self._of_owned(places))

    def places(self) -> np.ndarray:
        """Return the places of the corners of glued cells [length], (cells, d+1, d)."""
        d = self.mesh.topology.dim
        count = len(cell_nodes(self.glued.geometry))
        corners = self.of_sides(np.tile(np.arange(d + 1), (count, 1)))
        places = np.empty((count, d + 1, d))
        here = cell_nodes(self.mesh.geometry)
        places[self._cells()[:, None], corners] = self.mesh.geometry.x[here, :d]
        return places

    def check_places(self, places: np.ndarray) -> None:
        """Check that each node of the split mesh has one place.

        Args:
            places: Places of the corners of the glued mesh [length], shape (cells, d+1,
                d).

        Raises:
            InputError: If two sides that are apart have a node in common.
        """
        d = self.mesh.topology.dim
        x = self.mesh.geometry.x[cell_nodes(self.mesh.geometry), :d]
        away = np.linalg.norm(self.of_corners(places) - x, axis=2).max(initial=0.0)
        away = lasting(self.mesh.comm).allreduce(float(away), MPI.MAX)
        if away > 0:
            raise InputError(
                f"Two sides that are up to {away:.3g} apart have nodes in common: a tied joint "
                "has no distance, and bodies that are tied elsewhere beside such sides neither. "
                "Join sides that are to be tied by joined(..., tied=True), which moves the second "
                "one onto the first one, or leave a facet between both joints."
            )

    def _of_owned(self, table: np.ndarray) -> np.ndarray:
        """Return the rows of the owned cells of the glued mesh."""
        return table[: self.glued.topology.index_map(self.glued.topology.dim).size_local]

    def cell_tags(self, tags: dmesh.MeshTags | None) -> dmesh.MeshTags | None:
        """Return tags of cells; None stays None."""
        if tags is None:
            return None
        return self._given.cell_tags(self._of_owned(tag_table(tags)))

    def facet_tags(self, tags: np.ndarray) -> dmesh.MeshTags:
        """Return tags of facets, given by the tags of their sides in the glued mesh."""
        return self._given.facet_tags(self._of_owned(tags))

    def marks(self, marks: dmesh.MeshTags | None) -> dmesh.MeshTags | None:
        """Return marks of facets, which are the same on both sides; None stays None."""
        if marks is None:
            return None
        return self.facet_tags(tag_table(marks)[facets_of_cells(self.glued)])

    def interface_map(
        self, interfaces: Sequence[Interface], tags: np.ndarray, *, keep: bool
    ) -> InterfaceMap:
        """Return what relates the split mesh to the glued mesh.

        Args:
            interfaces: The interfaces.
            tags: Tags of the sides in the glued mesh, see :func:`side_tags`.
            keep: Whether sides may keep their own places.
        """
        d = self.mesh.topology.dim
        tags = self.of_sides(tags)
        # A facet of the glued mesh has one number on all ranks, which both sides know.
        facet_map = self.glued.topology.index_map(d - 1)
        numbers = self.of_sides(global_numbers(facet_map, facets_of_cells(self.glued)))
        facing = {}
        for interface in interfaces:
            here, there = _facing(tags, numbers, interface.tags)
            facing[interface.names] = (here, there)
            facing[interface.names[::-1]] = (there, here)
        cells = self._cells()
        count = self.glued.topology.index_map(d).size_local
        # A pair is counted by the rank that owns the cell of its first side.
        firsts = [facing[interface.names][0] for interface in interfaces]
        owned = np.array([(sides[:, 0] < count).sum() for sides in firsts])
        counts = tuple(map(int, lasting(self.glued.comm).allreduce(owned, MPI.SUM)))
        nodes = self._nodes()
        distances = np.zeros(len(interfaces))
        if keep:
            for number, interface in enumerate(interfaces):
                distances[number] = self._distance(nodes, *facing[interface.names])
            lasting(self.glued.comm).Allreduce(MPI.IN_PLACE, distances, MPI.MAX)
            extent = float(abs(self.mesh.geometry.x).max(initial=0.0))
            extent = lasting(self.glued.comm).allreduce(extent, MPI.MAX)
            distances[distances <= ONE_PLACE * extent] = 0.0
        return InterfaceMap(
            tuple(interfaces), facing, cells, nodes, counts, tuple(map(float, distances))
        )

    def _distance(self, nodes: np.ndarray, here: np.ndarray, there: np.ndarray) -> float:
        """Return the greatest distance of facing vertices on this rank [length].

        Args:
            nodes: Node of the glued mesh of each node of the split mesh.
            here: Sides (cell, local facet), shape (n, 2).
            there: The sides that they face.
        """
        of_sides = []
        for sides in (here, there):
            vertices = of_facets(cell_nodes(self.mesh.geometry)[sides[:, 0]], sides[:, 1])
            order = np.argsort(nodes[vertices], axis=1)
            of_sides.append(self.mesh.geometry.x[np.take_along_axis(vertices, order, axis=1)])
        return float(np.linalg.norm(of_sides[1] - of_sides[0], axis=-1).max(initial=0.0))

    def _cells(self) -> np.ndarray:
        """Return the cell of the glued mesh on this rank of each cell, shape (n,)."""
        cell_map = self.glued.topology.index_map(self.glued.topology.dim)
        return cell_map.global_to_local(self._given.source)

    def _nodes(self) -> np.ndarray:
        """Return the node of the glued mesh of each node of the split mesh."""
        index_map = self.glued.geometry.index_map()
        global_nodes = global_numbers(index_map, cell_nodes(self.glued.geometry))
        result = np.empty(len(self.mesh.geometry.x), dtype=np.int64)
        result[cell_nodes(self.mesh.geometry)] = self.of_sides(global_nodes)
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
