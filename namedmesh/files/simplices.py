"""Split cells of any shape into simplices so that neighbours agree.

In 3D each face is cut by its own rule, see :func:`triangles_of`, which knows nothing
of the cells. The tetrahedra of a cell join its point with the least number to all
triangles of its faces that do not have this point. Where that is no good tetrahedra, as
in cells that are far from convex, they join the middle of the cell, which becomes a new
point, to all its triangles. Cells that have collapsed have fewer triangles, and need no
rule of their own.

In the plane each quadrilateral is cut by the diagonal that leaves the larger lesser
half.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.base.percent import counted, place_words
from namedmesh.files.cleaning import Body
from namedmesh.files.faces import Faces, cross
from namedmesh.files.file_mesh import SHAPES, Block
from namedmesh.simplex import determinants

FLAT_SHARE = 0.02
"""Volume of a part of a cell, by the mean of its parts, below which it is poor [-]."""
NO_VOLUME = 1e-14
"""Volume of a simplex that is round-off, by its longest edge to the d [-]."""
EQUAL = 1e-6
"""Relative difference of two areas that is none [-]."""


@dataclass(frozen=True, eq=False)
class Simplices:
    """Hold the simplices of a body.

    Attributes:
        x: Points [length], points of the body first, shape (n, d).
        cells: Their points, shape (m, d+1).
        parents: Number of the cell of each, shape (m,).
    """

    x: np.ndarray
    cells: np.ndarray
    parents: np.ndarray


def split(body: Body, faces: Faces) -> Simplices:
    """Split the cells of a body into simplices.

    Raises:
        InputError: If a cell is folded or has no volume.
    """
    d = body.x.shape[1]
    points = [body.x]
    cells = []
    parents = []
    added = len(body.x)
    for block, numbers, begin, end in zip(
        body.cells, body.numbers, faces.first[:-1], faces.first[1:], strict=True
    ):
        if block.shape in ("triangle", "tetrahedron"):
            pieces = block.nodes, np.arange(len(block.nodes)), np.empty((0, d))
        elif d == 2:
            pieces = _of_quadrilaterals(body.x, block)
        else:
            count = 2 * len(SHAPES[block.shape].faces)
            triangles = faces.triangles(slice(begin, end)).reshape(-1, count, 3)
            pieces = _of_solids(body.x, block, triangles, added)
        simplices, cell, middles = pieces
        cells.append(simplices)
        parents.append(numbers[cell])
        points.append(middles)
        added += len(middles)
    result = Simplices(np.concatenate(points), np.concatenate(cells), np.concatenate(parents))
    _check_volumes(result)
    return result


def _of_quadrilaterals(x: np.ndarray, block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut quadrilaterals in two; a collapsed quadrilateral is a triangle or nothing.

    Returns:
        Triangles, number of the quadrilateral of each, and no new point.

    Raises:
        InputError: If a quadrilateral crosses itself.
    """
    corners = block.nodes
    options = corners[:, [[[0, 1, 2], [0, 2, 3]], [[1, 2, 3], [1, 3, 0]]]]
    areas = determinants(x[options])
    whole = areas.sum(axis=2)
    shares = areas * np.sign(whole)[..., None]
    least = shares.min(axis=2)
    difference = least[:, 1] - least[:, 0]
    equal = abs(difference) <= EQUAL * abs(whole[:, 0])
    by_number = np.isin(np.argmin(corners, axis=1), (1, 3))
    second = np.where(equal, by_number, difference > 0)
    triangles = options[np.arange(len(corners)), second.astype(int)]
    distinct = (np.diff(np.sort(triangles, axis=2), axis=2) > 0).all(axis=2)
    quadrilateral = distinct.all(axis=1)
    folded = np.flatnonzero(quadrilateral & (least.max(axis=1) <= 0))
    if len(folded):
        _refuse(len(folded), block.shape, x[corners[folded[0]]].mean(axis=0), "cross themselves")
    cell, half = np.nonzero(distinct)
    return triangles[cell, half], cell, np.empty((0, 2))


def _of_solids(
    x: np.ndarray, block: Block, triangles: np.ndarray, added: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Split cells in 3D into tetrahedra.

    Args:
        x: Points [length], shape (n, 3).
        block: The cells.
        triangles: Halves of their faces, shape (cells, 2 faces, 3).
        added: How many points there are before the new ones.

    Returns:
        Tetrahedra, number of the cell of each, and the new points.

    Raises:
        InputError: If a cell is folded.
    """
    a, b, c = np.moveaxis(triangles, 2, 0)
    whole = (a != b) & (b != c) & (c != a)
    apex = block.nodes.min(axis=1)
    usual = whole & (triangles != apex[:, None, None]).all(axis=2)
    volumes, worst = _shares(x, triangles, usual, x[apex])
    poor = np.flatnonzero(worst < FLAT_SHARE)
    if len(poor):
        middles = _middles(x, block.nodes[poor])
        middle_volumes, worst_by_middle = _shares(x, triangles[poor], whole[poor], middles)
        better = worst_by_middle > worst[poor]
        poor = poor[better]
        middles = middles[better]
        usual[poor] = whole[poor]
        worst[poor] = worst_by_middle[better]
        volumes[poor] = middle_volumes[better]
        apex[poor] = added + np.arange(len(poor))
    folded = np.flatnonzero(usual.any(axis=1) & (worst <= 0) & (abs(volumes).sum(axis=1) > 0))
    if len(folded):
        at = x[block.nodes[folded[0]]].mean(axis=0)
        _refuse(len(folded), block.shape, at, "are folded or have a point out of place")
    cell, triangle = np.nonzero(usual)
    tetrahedra = np.column_stack([apex[cell], triangles[cell, triangle]])
    return tetrahedra, cell, middles if len(poor) else np.empty((0, 3))


def _shares(
    x: np.ndarray, triangles: np.ndarray, taken: np.ndarray, apex: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute volumes of tetrahedra over triangles, and their least share of the mean.

    Args:
        x: Points [length], shape (n, 3).
        triangles: Triangles of each cell, shape (cells, k, 3).
        taken: Which of them have a tetrahedron, shape (cells, k).
        apex: Their other point, shape (cells, 3).

    Returns:
        Volumes [length^3], shape (cells, k), and the least share of each cell [-].
    """
    corners = x[triangles] - apex[:, None, None]
    normals = cross(corners[:, :, 1], corners[:, :, 2])
    volumes = np.einsum("cki,cki->ck", corners[:, :, 0], normals)
    volumes = np.where(taken, volumes, 0.0) / 6
    whole = volumes.sum(axis=1)
    mean = np.where(whole == 0, 1.0, whole) / np.maximum(taken.sum(axis=1), 1)
    shares = np.where(taken, volumes / mean[:, None], np.inf)
    return volumes, shares.min(axis=1)


def _middles(x: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the mean of the different corners of each cell [length], shape (n, 3)."""
    ordered = np.sort(corners, axis=1)
    new = np.column_stack([np.full(len(corners), True), np.diff(ordered, axis=1) > 0])
    return (x[ordered] * new[..., None]).sum(axis=1) / new.sum(axis=1)[:, None]


def _check_volumes(simplices: Simplices) -> None:
    """Check that there are cells, and that each has a volume.

    Raises:
        InputError: If not.
    """
    corners = simplices.x[simplices.cells]
    d = corners.shape[2]
    volumes = abs(determinants(corners))
    longest = abs(corners[:, 1:] - corners[:, :1]).max(axis=(1, 2))
    flat = np.flatnonzero(volumes <= NO_VOLUME * longest**d)
    if len(flat):
        parents = np.unique(simplices.parents[flat])
        at = corners[flat[0]].mean(axis=0)
        raise InputError(
            f"{len(parents)} cells have a flat part, without volume, the first near "
            f"{place_words(at, 6)}: corners lie on a line or in a plane. Mesh there anew, or move "
            "one."
        )


def _refuse(number: int, shape: str, at: np.ndarray, what: str) -> None:
    """Raise an error about cells of a shape."""
    raise InputError(
        f"cells {what}: {counted(number, shape)}, the first near {place_words(at, 6)}; mesh there "
        "anew, or move a point."
    )
