"""Find points at nodes, in any order, by their places."""

from __future__ import annotations

import numpy as np

SAME_PLACE = 1e-5
"""Distance of a point to a node that is none, over the extent of the body [-].

Result files often have six digits.
"""
DIGITS = 1e-12
"""Distance of places with the same digits, over the size of the body [-]."""
CHUNK = 256
"""Number of nodes that are compared with all points at once."""


def nearest(nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the nearest point of each node; points and nodes nearly coincide.

    Both are sorted along a line on which no two nodes share a place, so that digits
    that agree are found at once. The few others are compared with all points.
    """
    line = np.sqrt(np.arange(2, 2 + nodes.shape[1]))
    order = np.argsort(points @ line)
    after = np.searchsorted((points @ line)[order], nodes @ line)
    best = order[np.minimum(after, len(order) - 1)]
    before = order[np.maximum(after - 1, 0)]
    distance = np.linalg.norm(points[best] - nodes, axis=1)
    distance_before = np.linalg.norm(points[before] - nodes, axis=1)
    best = np.where(distance_before < distance, before, best)
    distance = np.minimum(distance, distance_before)
    size = float(np.ptp(nodes, axis=0).max(initial=0.0))
    left = np.flatnonzero(distance > DIGITS * size)
    for start in range(0, len(left), CHUNK):
        chunk = left[start : start + CHUNK]
        apart = np.linalg.norm(points[None] - nodes[chunk, None], axis=2)
        best[chunk] = apart.argmin(axis=1)
    return best
