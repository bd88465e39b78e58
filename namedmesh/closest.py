"""Find the closest points on edges and triangles, in the plane and in 3D.

Symbols: n points, f facets, m corners of a facet (2 or 3), d dimension of space.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

CLUSTER_SIZE = 64
"""Number of points for which the closest facets are found together."""
EDGES = np.array([[0, 1], [1, 2], [2, 0]])
"""Corners of the edges of a triangle."""


class Closest(NamedTuple):
    """Hold the closest points on facets.

    Attributes:
        facet: Numbers of the facets, shape (n,).
        local: Barycentric coordinates of the points on them, shape (n, m).
        distance: Distances to them [length], shape (n,), infinite without facets.
    """

    facet: np.ndarray
    local: np.ndarray
    distance: np.ndarray


def closest(x: np.ndarray, corners: np.ndarray) -> Closest:
    """Find the closest facet of each point, and the closest point on it.

    Points that are near to each other are worked on together, with the facets that may
    be the closest of one of them.

    Args:
        x: Points [length], shape (n, d).
        corners: Corners of edges or triangles [length], shape (f, m, d).
    """
    facet = np.zeros(len(x), dtype=np.int64)
    local = np.zeros((len(x), corners.shape[1]))
    distance = np.full(len(x), np.inf)
    if not len(corners):
        return Closest(facet, local, distance)
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    for cluster in _clusters(x):
        points = x[cluster]
        centre = points.mean(axis=0)
        spread = np.linalg.norm(points - centre, axis=1).max()
        away = np.linalg.norm(middle - centre, axis=1)
        # A facet is at least ``away - radius`` from the centre, and at most ``away``.
        # At another point of the cluster each differs by the spread.
        candidates = np.flatnonzero(away - radius <= away.min() + 2 * spread)
        # The middle of a facet is a point of it, and its ball holds it.
        to_middle = np.linalg.norm(points[:, None] - middle[candidates], axis=2)
        least = to_middle.min(axis=1, keepdims=True)
        # The pairs that may be closest, in the order of the points.
        row, place = np.nonzero(to_middle - radius[candidates] <= least)
        near = candidates[place]
        shape, apart = _feet(points[row], corners[near])
        order = np.lexsort((near, apart, row))
        chosen = order[np.searchsorted(row, np.arange(len(cluster)))]
        facet[cluster] = near[chosen]
        local[cluster] = shape[chosen]
        distance[cluster] = apart[chosen]
    return Closest(facet, local, distance)


def _feet(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the closest point of each of p facets (p, m, d) to its point, (p, d).

    Returns:
        Their barycentric coordinates (p, m), and the distances (p,).
    """
    if corners.shape[-2] == 2:
        return _feet_on_edges(points, corners)
    # The closest point of a triangle is the foot in its plane, or on one of its edges.
    shares, from_edges = _feet_on_edges(points[..., None, :], corners[:, EDGES])
    edge = from_edges.argmin(axis=-1)[..., None]
    of_edge = np.take_along_axis(shares, edge[..., None], axis=-2)[..., 0, :]
    shape = np.zeros((*of_edge.shape[:-1], 3))
    np.put_along_axis(shape, EDGES[edge[..., 0]], of_edge, axis=-1)
    distance = np.take_along_axis(from_edges, edge, axis=-1)[..., 0]

    sides = corners[..., 1:, :] - corners[..., :1, :]
    offset = points - corners[..., 0, :]
    aa, ab, bb = np.einsum("...id,...jd->...ij", sides, sides)[..., [0, 0, 1], [0, 1, 1]].T
    pa, pb = np.einsum("...id,...d->...i", sides, offset).T
    inner = np.stack([bb * pa - ab * pb, aa * pb - ab * pa], axis=-1)
    # A triangle without area has no foot in its plane.
    with np.errstate(divide="ignore", invalid="ignore"):
        inner /= (aa * bb - ab**2)[..., None]
    in_plane = np.concatenate([1 - inner.sum(axis=-1, keepdims=True), inner], axis=-1)
    is_inside = np.all(in_plane >= 0, axis=-1)
    return (
        np.where(is_inside[..., None], in_plane, shape),
        np.where(is_inside, _distance(points, corners, in_plane), distance),
    )


def _feet_on_edges(points: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Do the work of :func:`_feet` for edges (..., 2, d)."""
    along = ends[..., 1, :] - ends[..., 0, :]
    offset = points - ends[..., 0, :]
    share = np.sum(offset * along, axis=-1) / np.sum(along * along, axis=-1)
    share = np.clip(share, 0.0, 1.0)
    shape = np.stack([1 - share, share], axis=-1)
    return shape, _distance(points, ends, shape)


def _distance(points: np.ndarray, corners: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Return the distances of points from places in barycentric coordinates."""
    feet = np.sum(shape[..., None] * corners, axis=-2)
    return np.asarray(np.linalg.norm(feet - points, axis=-1))


def _clusters(x: np.ndarray) -> Iterator[np.ndarray]:
    """Divide points (n, d) into clusters of near points.

    A cluster is cut into halves along its longest axis.

    Yields:
        Numbers of at most :data:`CLUSTER_SIZE` points.
    """
    waiting = [np.arange(len(x))] if len(x) else []
    while waiting:
        cluster = waiting.pop()
        if len(cluster) <= CLUSTER_SIZE:
            yield cluster
            continue
        axis = np.ptp(x[cluster], axis=0).argmax()
        half = len(cluster) // 2
        order = np.argpartition(x[cluster, axis], half)
        waiting.append(cluster[order[:half]])
        waiting.append(cluster[order[half:]])
