"""Number the faces of cells of any shape, and cut faces with four corners in two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.base.percent import place_words
from namedmesh.files.file_mesh import SHAPES, Block
from namedmesh.rows import row_numbers

SLIVER = 0.02
"""Area of a half of a face, by the whole, below which its other diagonal is tried [-].

A corner of 180 degrees makes a triangle without area.
"""


@dataclass(frozen=True, eq=False)
class Faces:
    """Hold the faces of cells, each once for each cell that has it.

    Attributes:
        corners: Their corners, shape (n, 2) in the plane, (n, 4) in 3D, where a
            triangle has a corner twice.
        first: Number of the first face of each block, and the number of all.
        number: Faces of two cells have the same number, shape (n,). Those that have
            collapsed have none (-1).
        count: In how many cells the face of each number is.
        by_second: Whether the face of each number is cut by its second diagonal.
    """

    corners: np.ndarray
    first: np.ndarray
    number: np.ndarray
    count: np.ndarray
    by_second: np.ndarray

    def triangles(self, faces: np.ndarray | slice) -> np.ndarray:
        """Return the triangles of faces in 3D, shape (n, 2, 3)."""
        return triangles_of(self.corners[faces], self.by_second[self.number[faces]])

    @property
    def outer(self) -> np.ndarray:
        """Tell which faces are of one cell alone, shape (n,)."""
        return (self.number >= 0) & (self.count[self.number] == 1)


def faces_of(blocks: Sequence[Block], x: np.ndarray) -> Faces:
    """Number the faces of cells.

    Args:
        blocks: The cells.
        x: Points [length], shape (n, d).

    Raises:
        InputError: If a face is in more than two cells.
    """
    tables = []
    for block in blocks:
        table = SHAPES[block.shape].face_table
        tables.append(block.nodes[:, table].reshape(-1, table.shape[1]))
    corners = np.concatenate(tables)
    first = np.cumsum([0, *map(len, tables)])
    keys, whole = _keys(corners)
    (all_numbers,) = row_numbers(keys[whole])
    number = np.full(len(corners), -1)
    number[whole] = all_numbers
    count = np.bincount(all_numbers)
    crowded = np.flatnonzero(whole & (count[number] > 2))
    if len(crowded):
        at = x[corners[crowded[0]]].mean(axis=0)
        raise InputError(
            f"{len(np.unique(number[crowded]))} faces belong to three cells or more, one near "
            f"{place_words(at, 6)}: cells lie over each other. Mesh the body anew, or leave the "
            "extra cells out."
        )
    by_second = np.zeros(len(count), dtype=bool)
    if corners.shape[1] == 4:
        _, one_of_each = np.unique(all_numbers, return_index=True)
        by_second = _with_other_diagonal(x, corners[np.flatnonzero(whole)[one_of_each]])
    return Faces(corners, first, number, count, by_second)


def distinct(corners: np.ndarray) -> np.ndarray:
    """Return rows of different corners plus 1, padded by 0."""
    rows = np.sort(corners, axis=1) + 1
    rows[:, 1:][rows[:, 1:] == rows[:, :-1]] = 0
    return rows


def _keys(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return different corners plus 1, padded by 0, and which faces have an area."""
    keys = distinct(corners)
    # A face of four corners of which two opposite ones are the same is folded.
    different = (keys > 0).sum(axis=1)
    if corners.shape[1] == 2:
        return keys, different == 2
    folded = (corners[:, 0] == corners[:, 2]) | (corners[:, 1] == corners[:, 3])
    return keys, (different >= 3) & ~folded


def triangles_of(corners: np.ndarray, by_second: np.ndarray) -> np.ndarray:
    """Cut faces with four corners in two triangles, shape (n, 2, 3).

    The diagonal starts at the corner with the least number, so that the cells on both
    sides have the same triangles. Of a triangle with a corner twice one half has a
    corner twice.

    Args:
        corners: Corners of the faces, shape (n, 4).
        by_second: Whether each face is cut by its second diagonal, shape (n,).
    """
    turned = _turn(corners)
    is_second = by_second[:, None, None]
    return np.where(is_second, turned[:, [[0, 1, 3], [1, 2, 3]]], turned[:, [[0, 1, 2], [0, 2, 3]]])


def _turn(corners: np.ndarray) -> np.ndarray:
    """Return the corners of faces (n, 4), of each face the least corner first."""
    start = np.argmin(corners, axis=1)[:, None]
    return np.take_along_axis(corners, (start + np.arange(4)) % 4, axis=1)


def _with_other_diagonal(x: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Tell which faces are cut better from their second corner, shape (n,).

    Args:
        x: Points [length], shape (n, 3).
        corners: Corners of the faces, each face once, shape (n, 4).
    """
    result = np.zeros(len(corners), dtype=bool)
    quadrilaterals = np.flatnonzero((np.diff(np.sort(corners, axis=1), axis=1) > 0).all(axis=1))
    turned = _turn(corners[quadrilaterals])
    first, second = (_area(x, turned[:, half]) for half in ([0, 1, 2], [0, 2, 3]))
    least = np.minimum(first, second)
    poor = np.flatnonzero(least < SLIVER * (first + second))
    first, second = (_area(x, turned[poor][:, half]) for half in ([0, 1, 3], [1, 2, 3]))
    better = least[poor] < np.minimum(first, second)
    result[quadrilaterals[poor[better]]] = True
    return result


def _area(x: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Compute the areas of triangles (n, 3) in 3D [length^2]."""
    origin = x[triangles[:, 0]]
    normal = cross(x[triangles[:, 1]] - origin, x[triangles[:, 2]] - origin)
    return 0.5 * np.sqrt(np.einsum("ni,ni->n", normal, normal))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Compute the vector products of vectors, shape (..., 3).

    numpy's own takes several times as long.
    """
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        result[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return result
