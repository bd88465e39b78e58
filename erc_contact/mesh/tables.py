"""A domain as tables that know no ranks, one row for each cell; and back, on any number of ranks.

Numbers of nodes in the tables are those of the mesh that was written. A cell of a mesh
that is made from them may have its vertices in another order, so whatever belongs to a
vertex or a facet of a cell is put in order by these numbers. Facet i is opposite to
vertex i.

Symbols: d dimension, m number of cells, N nodes of a cell.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.domain import Domain, Geometry
from erc_contact.mesh.partition import distributed
from erc_contact.mesh.shape import Brick, Drawing
from erc_contact.mesh.simplex import node_between, node_vertices
from erc_contact.mesh.tags import tag_table, tags_of


def tag_tables(domain: Domain) -> dict[str, np.ndarray]:
    """Tags of the owned cells, shape (m,), and of their facets and curved facets, shape (m, d+1)."""
    topology, d, owned = domain.mesh.topology, domain.dim, domain.owned_cells
    facets = topology.connectivity(d, d - 1).array.reshape(-1, d + 1)[:owned]
    every = {"facets": (domain.facet_tags, facets), "curved": (domain.curved_facets, facets)}
    every["regions"] = (domain.cell_tags, np.arange(owned))
    return {name: tag_table(tags)[of] for name, (tags, of) in every.items() if tags is not None}


def described(geometry: Geometry | None) -> dict[str, Any] | None:
    """The true shape in plain data; its text is that of rank 0.

    Raises:
        InputError: If the shape is an object of a class of the user's.
    """
    if geometry is None:
        return None
    if not isinstance(geometry, Brick | Drawing):
        raise InputError(
            f"A checkpoint cannot keep the true geometry of this domain, an object of type {type(geometry).__name__}. "
            "Run without checkpoint=, or take a domain of rectangle, box, from_gmsh or read_mesh."
        )
    plain = asdict(geometry)
    if isinstance(geometry, Drawing):
        plain["curved"] = sorted(geometry.curved)
    return {"kind": type(geometry).__name__} | plain


def geometry_of(plain: Mapping[str, Any] | None) -> Geometry | None:
    """The true shape from what :func:`described` gave."""
    if plain is None:
        return None
    if plain["kind"] == "Brick":
        return Brick(tuple(plain["low"]), tuple(plain["high"]))
    return Drawing(plain["suffix"], plain["text"], frozenset(plain["curved"]))


class CellRows:
    """Rows of tables for the cells of a mesh that was made from them; all methods are collective.

    Args:
        comm: Communicator that shares the mesh.
        points: Places of all nodes [length], shape (n, 3), on rank 0.
        cells: Nodes of the cells, vertices first, shape (m, N), on rank 0.
        d: Dimension.
    """

    def __init__(
        self, comm: MPI.Comm, points: np.ndarray | None, cells: np.ndarray | None, d: int
    ) -> None:
        self.comm, self.d = comm, d
        vertices, x = np.empty((0, d + 1), dtype=np.int64), np.empty((0, d))
        if points is not None and cells is not None:
            used, vertices = np.unique(cells[:, : d + 1], return_inverse=True)
            vertices, x = vertices.reshape(-1, d + 1).astype(np.int64), points[used, :d]
        self.mesh = distributed(comm, vertices, np.ascontiguousarray(x))
        self._wanted = comm.gather(self.mesh.topology.original_cell_index)
        number = self.mesh.geometry.input_global_indices[self.mesh.geometry.dofmaps[0]]
        self.order = np.argmax(self.of_cells(vertices)[:, None, :] == number[:, :, None], axis=2)

    def of_cells(self, table: np.ndarray | None) -> np.ndarray:
        """The rows of a table on rank 0, one for each cell of this rank, ghosts included."""
        return self.comm.scatter(
            None if self._wanted is None or table is None else [table[w] for w in self._wanted]
        )

    def of_facets(self, table: np.ndarray | None) -> np.ndarray:
        """The same for a table of facets (m, d+1), in the order of the facets of each cell."""
        return np.take_along_axis(self.of_cells(table), self.order, axis=1)

    def of_nodes(
        self, table: np.ndarray | None, cells: np.ndarray | None, degree: int
    ) -> np.ndarray:
        """Values at the nodes of the cells of this rank, shape (local cells, N, ...), from a table of nodes."""
        values = self.of_cells(None if table is None or cells is None else table[cells])
        ends = self.order[:, node_vertices(self.d, degree)]
        place = node_between(self.d, degree)[ends[..., 0], ends[..., 1]]
        return np.take_along_axis(values, place[..., None], axis=1)

    def cell_tags(self, table: np.ndarray | None) -> dmesh.MeshTags:
        """Tags of cells from a table of tags."""
        values = self.of_cells(table)
        return tags_of(self.mesh, self.d, np.arange(len(values)), values)

    def facet_tags(self, table: np.ndarray | None) -> dmesh.MeshTags:
        """Tags of facets from a table of tags."""
        topology = self.mesh.topology
        topology.create_entities(self.d - 1)
        topology.create_connectivity(self.d, self.d - 1)
        topology.create_connectivity(self.d - 1, self.d)
        facets = topology.connectivity(self.d, self.d - 1).array.reshape(-1, self.d + 1)
        return tags_of(self.mesh, self.d - 1, facets, self.of_facets(table))
