"""Hold a mesh as plain arrays, in which bodies that were meshed apart are glued.

Symbols: d dimension. A side is a pair of a cell and one of its facets; facet i is
opposite to vertex i.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from erc_contact.mesh.simplex import facet_vertices


@dataclass(frozen=True, eq=False)
class PlainMesh:
    """Hold the simplices of a mesh, with the tags of their regions and sides.

    Attributes:
        x: Points [length], shape (n, d).
        cells: Points of each cell, shape (m, d+1).
        regions: Tag of each cell, shape (m,).
        tags: Tag of each side, shape (m, d+1).
    """

    x: np.ndarray
    cells: np.ndarray
    regions: np.ndarray
    tags: np.ndarray

    @property
    def dim(self) -> int:
        """Return the dimension of space, 2 or 3."""
        return self.x.shape[1]

    def sides(self, tag: int) -> np.ndarray:
        """Return the sides with a tag as pairs (cell, local facet), shape (k, 2)."""
        return np.argwhere(self.tags == tag)

    def points_of(self, sides: np.ndarray) -> np.ndarray:
        """Return the points of sides (cell, local facet), shape (k, d)."""
        cells = self.cells[sides[:, 0]]
        return np.take_along_axis(cells, facet_vertices(self.dim)[sides[:, 1]], axis=1)

    def without_unused_points(self) -> PlainMesh:
        """Return the same mesh without the points that are in no cell."""
        used, cells = np.unique(self.cells, return_inverse=True)
        return replace(self, x=self.x[used], cells=cells.reshape(self.cells.shape))


def row_numbers(rows: np.ndarray, *others: np.ndarray) -> list[np.ndarray]:
    """Number rows so that those with the same entries, in any order, have one number.

    Args:
        rows: Whole numbers, shape (n, k).
        others: More such tables, shape (., k) each.

    Returns:
        The numbers of the rows of each table.
    """
    tables = [rows, *others]
    every = np.sort(np.concatenate(tables), axis=1).astype(np.int64)
    size = int(every.max(initial=0)) + 1
    # One number for each row is sorted faster than several columns. As many columns as
    # 64 bits hold are put into it before they are numbered anew.
    keys = every[:, 0]
    greatest = size
    for column in every.T[1:]:
        if greatest * size >= np.iinfo(np.int64).max:
            _, keys = np.unique(keys, return_inverse=True)
            greatest = len(keys)
        keys = keys * size + column
        greatest *= size
    _, numbers = np.unique(keys, return_inverse=True)
    return np.split(numbers, np.cumsum([len(table) for table in tables])[:-1])
