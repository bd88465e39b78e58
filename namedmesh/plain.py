"""Hold a mesh as plain arrays, in which bodies that were meshed apart are glued.

Bodies are glued in two ways. Where their sides lie on each other, they have points in
common. Where each side keeps its own place across a clearance, they have points of
their own, of which two are one point of the glued mesh.

Symbols: d dimension. A side is a pair of a cell and one of its facets; facet i is
opposite to vertex i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from namedmesh.graphs import components
from namedmesh.rows import row_numbers
from namedmesh.simplex import facet_vertices, of_facets
from namedmesh.tags import NO_TAG


@dataclass(frozen=True, eq=False)
class PlainMesh:
    """Hold the simplices of a mesh, with the tags of their regions and sides.

    Attributes:
        x: Points [length], shape (n, d).
        cells: Points of each cell, shape (m, d+1).
        regions: Tag of each cell, shape (m,).
        tags: Tag of each side, shape (m, d+1).
        glued: Number in the glued mesh of each point, shape (n,); the same for points
            that are apart and glued. None where all points are in one place.
        marks: Mark of the true curve or surface of each side, shape (m, d+1); None
            where it is not known.
    """

    x: np.ndarray
    cells: np.ndarray
    regions: np.ndarray
    tags: np.ndarray
    glued: np.ndarray | None = None
    marks: np.ndarray | None = None

    @classmethod
    def beside_each_other(cls, plains: Sequence[PlainMesh]) -> PlainMesh:
        """Make one mesh of several meshes, unconnected."""
        first = 0
        tables = []
        numbers = []
        for plain in plains:
            tables.append((plain.x, plain.cells + first, plain.regions, plain.tags))
            numbers.append(first + plain.glued_points)
            first += len(plain.x)
        marks = None
        if any(plain.marks is not None for plain in plains):
            marks = np.concatenate([plain.marks_of_sides for plain in plains])
        glued = None
        if any(plain.glued is not None for plain in plains):
            glued = np.concatenate(numbers)
        x, cells, regions, tags = map(np.concatenate, zip(*tables, strict=True))
        return cls(x, cells, regions, tags, glued, marks)

    @property
    def glued_points(self) -> np.ndarray:
        """Return the number of each point in the glued mesh, below n, shape (n,)."""
        return np.arange(len(self.x)) if self.glued is None else self.glued

    @property
    def marks_of_sides(self) -> np.ndarray:
        """Return the mark of each side, shape (m, d+1)."""
        return np.full_like(self.tags, NO_TAG) if self.marks is None else self.marks

    def with_points(self, x: np.ndarray) -> PlainMesh:
        """Return the mesh with more points (k, d) [length], which no cell has yet."""
        glued = self.glued
        if glued is not None:
            glued = np.append(glued, len(self.x) + np.arange(len(x)))
        return replace(self, x=np.concatenate([self.x, x]), glued=glued)

    def with_pairs(self, here: np.ndarray, there: np.ndarray) -> PlainMesh:
        """Return the mesh with pairs of points that are one point of the glued mesh.

        Args:
            here: First point of each pair, shape (k,).
            there: Second point of each pair.
        """
        count = len(self.x)
        _, first, of_points = np.unique(self.glued_points, return_index=True, return_inverse=True)
        same = np.column_stack([np.arange(count), first[of_points]])
        pairs = np.column_stack([here, there])
        return replace(self, glued=components(count, np.concatenate([same, pairs])))

    @property
    def dim(self) -> int:
        """Return the dimension of space, 2 or 3."""
        return self.x.shape[1]

    def sides(self, tag: int) -> np.ndarray:
        """Return the sides with a tag as pairs (cell, local facet), shape (k, 2)."""
        return np.argwhere(self.tags == tag)

    def points_of(self, sides: np.ndarray) -> np.ndarray:
        """Return the points of sides (cell, local facet), shape (k, d)."""
        return of_facets(self.cells[sides[:, 0]], sides[:, 1])

    @cached_property
    def facet_numbers(self) -> np.ndarray:
        """Number the facet of each side, shape (m, d+1); cells share a number."""
        points = self.cells[:, facet_vertices(self.dim)].reshape(-1, self.dim)
        return row_numbers(points)[0].reshape(self.cells.shape)

    @property
    def is_outer(self) -> np.ndarray:
        """Tell which sides are facets of one cell alone, shape (m, d+1)."""
        return np.bincount(self.facet_numbers.ravel())[self.facet_numbers] == 1

    def without_cells(self, cells: np.ndarray) -> PlainMesh:
        """Return the same mesh without some cells."""
        keep = np.ones(len(self.cells), dtype=bool)
        keep[cells] = False
        return PlainMesh(self.x, self.cells[keep], self.regions[keep], self.tags[keep])

    def without_unused_points(self) -> PlainMesh:
        """Return the same mesh without the points that are in no cell."""
        used, cells = np.unique(self.cells, return_inverse=True)
        glued = self.glued
        if glued is not None:
            glued = np.unique(glued[used], return_inverse=True)[1]
        return replace(self, x=self.x[used], cells=cells, glued=glued)
