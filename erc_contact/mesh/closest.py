"""Find the closest points on triangles and edges in space."""

from __future__ import annotations

import numpy as np

PAIRS_AT_ONCE = 1_000_000
"""Greatest number of pairs (point, triangle) that are looked at together."""
CANDIDATES = 16
"""Number of triangles near a point whose distances are computed at first."""
CORNERS = np.array([[0, 1], [1, 2], [2, 0]])
"""Corners of the edges of a triangle."""


def on_edges(points: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the closest point of each point on any of several edges.

    Args:
        points: Points [length], shape (n, 3).
        ends: Ends of the edges [length], shape (m, 2, 3).

    Returns:
        The edge, the place on it between 0 and 1, and the distance [length], shape (n,)
        each. Without edges the distance is infinite.
    """
    edge = np.zeros(len(points), dtype=np.int64)
    place = np.zeros(len(points))
    distance = np.full(len(points), np.inf)
    if not len(ends):
        return edge, place, distance
    step = max(1, PAIRS_AT_ONCE // len(ends))
    for start in range(0, len(points), step):
        chunk = slice(start, start + step)
        share, apart = _to_edges(points[chunk, None], ends[None])
        best = apart.argmin(axis=1)
        row = np.arange(len(best))
        edge[chunk] = best
        place[chunk] = share[row, best]
        distance[chunk] = apart[row, best]
    return edge, place, distance


def on_triangles(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the closest triangle of each point.

    Args:
        points: Points [length], shape (n, 3).
        corners: Corners of the triangles [length], shape (m, 3, 3).

    Returns:
        The triangle and the distance from it [length], shape (n,) each.
    """
    triangle = np.zeros(len(points), dtype=np.int64)
    distance = np.zeros(len(points))
    step = max(1, PAIRS_AT_ONCE // len(corners))
    for start in range(0, len(points), step):
        chunk = slice(start, start + step)
        triangle[chunk], distance[chunk] = _closest(points[chunk], corners)
    return triangle, distance


def _closest(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Do the work of :func:`on_triangles` for a few points."""
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    # No point of a triangle is nearer than its ball.
    bound = np.linalg.norm(points[:, None] - centre, axis=2) - radius
    count = min(CANDIDATES, len(corners) - 1)
    near = np.argpartition(bound, count, axis=1)[:, : count + 1]
    row = np.arange(len(points))
    distance = _to_triangles(points[:, None], corners[near])
    best = distance.argmin(axis=1)
    triangle = near[row, best]
    distance = distance[row, best]
    # The next ball bounds all triangles that were left out.
    left_out = bound.copy()
    left_out[row[:, None], near] = np.inf
    open_rows = np.flatnonzero(left_out.min(axis=1) < distance)
    every = _to_triangles(points[open_rows, None], corners[None])
    triangle[open_rows] = every.argmin(axis=1)
    distance[open_rows] = every.min(axis=1, initial=np.inf)
    return triangle, distance


def _to_edges(points: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return places and distances of points (..., 3) on edges (..., 2, 3)."""
    start = ends[..., 0, :]
    along = ends[..., 1, :] - start
    offset = points - start
    share = np.sum(offset * along, axis=-1) / np.sum(along * along, axis=-1)
    share = np.clip(share, 0.0, 1.0)
    return share, np.linalg.norm(offset - share[..., None] * along, axis=-1)


def _to_triangles(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the distances of points (..., 3) from triangles (..., 3, 3) [length]."""
    ends = corners[..., CORNERS, :]
    distance = _to_edges(points[..., None, :], ends)[1].min(axis=-1)
    normal = np.cross(
        ends[..., 0, 1, :] - ends[..., 0, 0, :], ends[..., 1, 1, :] - ends[..., 0, 0, :]
    )
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    # The foot in the plane counts if it lies on the inner side of all three edges.
    offset = points[..., None, :] - ends[..., 0, :]
    inward = np.cross(normal[..., None, :], ends[..., 1, :] - ends[..., 0, :])
    above = np.all(np.sum(inward * offset, axis=-1) >= 0, axis=-1)
    height = abs(np.sum(normal * offset[..., 0, :], axis=-1))
    return np.where(above, np.minimum(height, distance), distance)
