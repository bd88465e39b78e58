"""Make one vertex of two vertices where the facets of two sides in 3D match.

The sides may be plane or curved. Across a clearance or an interference the two are one
vertex of the glued mesh alone, and each stays where it is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.joining.side_contact import mean_normals, orient
from namedmesh.joining.thresholds import CRUSHED, SAME
from namedmesh.joining.triangles import area_vectors, side_lengths
from namedmesh.plain import PlainMesh
from namedmesh.rows import row_numbers
from namedmesh.simplex import determinants

ALONG_NORMAL = 0.5
"""Greatest share of a distance of facing points that is along the side [-]."""
SAMPLES = np.array([[1, 1, 1], [8, 1, 1], [1, 8, 1], [1, 1, 8]])
"""Barycentric coordinates, not scaled, of points that are looked for in facets."""
PAIRS_AT_ONCE = 1_000_000
"""Greatest number of pairs (point, facet) that are looked at together."""


def match_facets(
    plain: PlainMesh, here: int, there: int, apart: float = 0.0, *, keep: bool = False
) -> PlainMesh | None:
    """Return the mesh with common vertices, or None if the facets do not match.

    Args:
        plain: The mesh.
        here: Tag of side 1.
        there: Tag of side 2, which takes the vertices of side 1.
        apart: Greatest distance of both sides along their normal [length].
        keep: Whether each side keeps its place.

    Raises:
        InputError: If cells would be crushed.
    """
    facets1 = plain.points_of(plain.sides(here))
    facets2 = plain.points_of(plain.sides(there))
    corners = plain.x[np.concatenate([facets1, facets2])]
    tolerance = SAME * side_lengths(corners).min()
    points1, points2 = in_one_place(
        plain.x, np.unique(facets1), np.unique(facets2), tolerance + apart
    )
    if apart > 0:
        normals = _normals(plain, here)
        points1, points2 = _facing(plain.x, points1, points2, normals, tolerance)
    number = np.arange(len(plain.x))
    number[points2] = points1
    numbers1, numbers2 = row_numbers(number[facets1], number[facets2])
    alone1 = facets1[~np.isin(numbers1, numbers2)]
    alone2 = facets2[~np.isin(numbers2, numbers1)]
    nothing = len(alone1) == len(facets1)
    if nothing or _overlap(plain.x, alone1, alone2, apart):
        return None
    if _overlap(plain.x, alone2, alone1, apart):
        return None
    if keep:
        return plain.with_pairs(points1, points2)
    if apart > 0:
        _check_cells(plain, number)
    if plain.glued is not None:
        plain = plain.with_pairs(points1, points2)
    return replace(plain, cells=number[plain.cells])


def _normals(plain: PlainMesh, tag: int) -> np.ndarray:
    """Return unit normals of a side in 3D at its points, zero elsewhere, (n, 3)."""
    triangles = orient(plain, plain.sides(tag))
    return mean_normals(plain.x, triangles, area_vectors(plain.x[triangles]))


def _facing(
    x: np.ndarray, points1: np.ndarray, points2: np.ndarray, normals: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of near points that face each other, the nearest pairs.

    Args:
        x: Points [length], shape (n, 3).
        points1: Points of side 1, shape (p,).
        points2: Points of side 2, shape (p,).
        normals: Unit normals of side 1, shape (n, 3).
        tolerance: Distance that counts as none [length].
    """
    offset = x[points2] - x[points1]
    distance = np.linalg.norm(offset, axis=1)
    along = np.linalg.norm(np.cross(offset, normals[points1]), axis=1)
    faces = along <= ALONG_NORMAL * distance + tolerance
    order = np.lexsort((distance, points2))
    order = order[faces[order]]
    _, first = np.unique(points2[order], return_index=True)
    nearest = order[first]
    return points1[nearest], points2[nearest]


def _check_cells(plain: PlainMesh, number: np.ndarray) -> None:
    """Check that no cell is crushed where points move to other points.

    Raises:
        InputError: If a cell is: the distance is as large as the cells.
    """
    before = determinants(plain.x[plain.cells])
    after = determinants(plain.x[number[plain.cells]])
    if np.any(after / before < CRUSHED):
        raise InputError(
            "joined: the second part cannot move to the first one, the distance of the parts is "
            "as large as the cells there. Draw both where they touch, and give the distance by "
            "gap= of the contact."
        )


def in_one_place(
    x: np.ndarray, points1: np.ndarray, points2: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of points of two sets that are in one place.

    Args:
        x: Points [length], shape (n, d).
        points1: Numbers of the points of the first set.
        points2: Numbers of the points of the second set.
        tolerance: Distance of points that are in one place [length].
    """
    from scipy.spatial import cKDTree  # type: ignore[import-untyped]  # noqa: PLC0415 - for joints only

    tree = cKDTree(x[points1])
    other_tree = cKDTree(x[points2])
    near = tree.sparse_distance_matrix(other_tree, tolerance, output_type="ndarray")
    near = near[np.lexsort((near["i"], near["j"]))]
    return points1[near["i"]], points2[near["j"]]


def _overlap(x: np.ndarray, facets: np.ndarray, others: np.ndarray, apart: float) -> bool:
    """Check whether points of facets are on other facets, or within `apart` of them."""
    if not len(facets) or not len(others):
        return False
    shares = SAMPLES / SAMPLES.sum(axis=1)[:, None]
    points = np.matmul(shares, x[facets]).reshape(-1, 3)
    origin = x[others[:, 0]]
    edges = x[others[:, 1:]] - origin[:, None]
    inverse = np.linalg.pinv(edges)
    size = np.linalg.norm(edges, axis=2).max(axis=1)
    rows = max(1, PAIRS_AT_ONCE // len(others))
    for start in range(0, len(points), rows):
        offset = points[start : start + rows, None] - origin
        coordinates = np.einsum("nfi,fij->nfj", offset, inverse)
        foot = np.einsum("nfj,fji->nfi", coordinates, edges)
        close = np.linalg.norm(offset - foot, axis=2) < apart + 0.1 * size
        inside = (coordinates.min(axis=2) > 0) & (coordinates.sum(axis=2) < 1)
        if np.any(close & inside):
            return True
    return False
