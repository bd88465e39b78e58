"""Make one vertex of two where the facets of two sides in space match.

The sides may be plane or curved.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.mesh.plain import PlainMesh, row_numbers

SAME = 1e-3
"""Distance that counts as none, by the shortest edge of the sides [-]."""
DIRECTION = np.array([0.5411, 0.6231, 0.5647])
"""Direction along which points are sorted; few of a mesh have the same place on it."""
SAMPLES = np.array([[1, 1, 1], [8, 1, 1], [1, 8, 1], [1, 1, 8]])
"""Barycentric coordinates, not scaled, of points that are looked for in facets."""
PAIRS_AT_ONCE = 1_000_000
"""Greatest number of pairs (point, facet) that are looked at together."""


def matched(plain: PlainMesh, here: int, there: int) -> PlainMesh | None:
    """Return the mesh with common vertices, or None if the facets do not match.

    Args:
        plain: The mesh.
        here: Tag of side 1.
        there: Tag of side 2, whose vertices become those of side 1.
    """
    facets1 = plain.points_of(plain.sides(here))
    facets2 = plain.points_of(plain.sides(there))
    edges = np.concatenate([facets1, facets2])
    shortest = min(
        np.linalg.norm(plain.x[edges[:, i]] - plain.x[edges[:, i - 1]], axis=1).min()
        for i in range(3)
    )
    points1, points2 = in_one_place(
        plain.x, np.unique(facets1), np.unique(facets2), SAME * shortest
    )
    number = np.arange(len(plain.x))
    number[points2] = points1
    numbers1, numbers2 = row_numbers(number[facets1], number[facets2])
    alone1 = facets1[~np.isin(numbers1, numbers2)]
    alone2 = facets2[~np.isin(numbers2, numbers1)]
    nothing = len(alone1) == len(facets1)
    if nothing or _overlap(plain.x, alone1, alone2) or _overlap(plain.x, alone2, alone1):
        return None
    return replace(plain, cells=number[plain.cells])


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
    direction = DIRECTION[: x.shape[1]]
    height1 = x[points1] @ direction
    order = np.argsort(height1)
    height2 = x[points2] @ direction
    first = np.searchsorted(height1[order], height2 - tolerance)
    counts = np.searchsorted(height1[order], height2 + tolerance, side="right") - first
    starts = np.cumsum(counts) - counts
    row = np.repeat(first - starts, counts) + np.arange(counts.sum())
    pairs1 = points1[order[row]]
    pairs2 = np.repeat(points2, counts)
    near = np.linalg.norm(x[pairs1] - x[pairs2], axis=1) <= tolerance
    return pairs1[near], pairs2[near]


def _overlap(x: np.ndarray, facets: np.ndarray, others: np.ndarray) -> bool:
    """Check whether points of facets lie on other facets."""
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
        close = np.linalg.norm(offset - foot, axis=2) < 0.1 * size
        inside = (coordinates.min(axis=2) > 0) & (coordinates.sum(axis=2) < 1)
        if np.any(close & inside):
            return True
    return False
