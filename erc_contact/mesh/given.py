"""Relate the cells of a mesh of DOLFINx to the cells from which it was made."""

from __future__ import annotations

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.base.ranks import fetched
from erc_contact.base.releases import cell_nodes
from erc_contact.base.runtime.communicators import lasting
from erc_contact.mesh.sides import facets_of_cells
from erc_contact.mesh.tags import tags_of


class GivenCells:
    """Fetch rows of tables of the given cells for a mesh; all methods are collective.

    The cells of all ranks have the order in which they were given. Each given table has
    the rows of the cells that its rank gave.

    Args:
        mesh: The mesh, whose facets are connected to its cells.
        numbers: Numbers of the corners of the cells that this rank gave, shape (cells,
            d+1).
    """

    def __init__(self, mesh: dmesh.Mesh, numbers: np.ndarray) -> None:
        self.mesh = mesh
        self.source = mesh.topology.original_cell_index
        """Number of the given cell of each cell on this rank, with ghosts."""
        # DOLFINx may give the corners of a cell another order.
        geometry = mesh.geometry
        numbers_here = geometry.input_global_indices[cell_nodes(geometry)]
        order = self.of_cells(numbers)[:, None, :] == numbers_here[:, :, None]
        self._order = np.argmax(order, axis=2)

    def of_cells(self, table: np.ndarray) -> np.ndarray:
        """Return the rows (cells, k) of the cells on this rank, with ghosts."""
        return fetched(lasting(self.mesh.comm), table, self.source)

    def of_sides(self, table: np.ndarray) -> np.ndarray:
        """Return the same for a table of sides or corners, shape (cells, d+1)."""
        return np.take_along_axis(self.of_cells(table), self._order, axis=1)

    def of_corners(self, places: np.ndarray) -> np.ndarray:
        """Return the same for vectors at corners, shape (cells, d+1, d)."""
        return np.stack([self.of_sides(values) for values in np.moveaxis(places, 2, 0)], axis=2)

    def cell_tags(self, tags: np.ndarray) -> dmesh.MeshTags:
        """Return tags of cells, given by the tag of each cell, shape (cells,)."""
        values = self.of_cells(tags[:, None])[:, 0]
        return tags_of(self.mesh, self.mesh.topology.dim, np.arange(len(values)), values)

    def facet_tags(self, tags: np.ndarray) -> dmesh.MeshTags:
        """Return tags of facets, given by the tags of the sides, shape (cells, d+1)."""
        dim = self.mesh.topology.dim - 1
        facets = facets_of_cells(self.mesh)
        return tags_of(self.mesh, dim, facets.ravel(), self.of_sides(tags).ravel())
