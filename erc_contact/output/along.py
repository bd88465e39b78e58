"""The coordinate along a contact in 2D, and curves along it. On rank 0.

Symbols: n normal of the foundation, s coordinate along a contact.
"""

from __future__ import annotations

import numpy as np

from erc_contact.mesh.graphs import successors, to_chain_ends
from erc_contact.output.drawing import coordinate, tangents, words
from erc_contact.output.gathered import AXIS, Surface, mean_normal


def along(surface: Surface) -> tuple[np.ndarray, str]:
    """The coordinate s of the vertices of each facet in 2D [length], shape (n, 2), and its label."""
    (tangent,) = tangents(mean_normal(surface))
    s = surface.x[:, :2, :2] @ tangent
    if np.allclose(np.ptp(s, axis=1), surface.traction.area, rtol=10 * AXIS, atol=0.0):
        return s, coordinate(tangent)
    return _arc_length(surface)


def _arc_length(surface: Surface) -> tuple[np.ndarray, str]:
    """The arc length s along a curved contact, which may have several parts or be closed, and its label.

    A closed part is cut far from the mean place of the pressure, where s is zero.
    """
    traction, ends = surface.traction, surface.x[:, :2, :2]
    n, area, many = traction.contact.direction, traction.area, len(traction.area)
    forward = (
        np.einsum("fi,fi->f", ends[:, 1] - ends[:, 0], np.column_stack([-n[:, 1], n[:, 0]])) > 0
    )
    first, last = np.where(forward, surface.vertices.T, surface.vertices.T[::-1])
    force = area * np.maximum(-traction.normal_component, 0).mean(axis=1)
    centre = np.average(ends.mean(axis=1), axis=0, weights=force if force.any() else area)
    successor = successors(first, last)
    while True:
        rest, end = to_chain_ends(successor, area)
        closed = np.flatnonzero(successor[end] != end)
        if len(closed) == 0:
            break
        cut = closed[np.linalg.norm(ends[closed, 0] - centre, axis=1).argmax()]
        successor[cut] = cut
    start, offset = np.empty(many), 0.0
    for part in np.unique(end):
        at = end == part
        start[at] = offset + rest[at].max() - rest[at]
        offset = float((start[at] + area[at]).max()) + 0.05 * area.sum()
    s = np.where(forward, [start, start + area], [start + area, start]).T
    facet, vertex = np.unravel_index(np.linalg.norm(ends - centre, axis=2).argmin(), s.shape)
    return s - s[
        facet, vertex
    ], f"arc length from {words(ends[facet, vertex], area.sum())} [length]"


def through_means(
    means: np.ndarray, lengths: np.ndarray, parts: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """A continuous curve with given means on facets: a quadratic polynomial on each of them.

    Between two facets its value is that of the line through their means at their
    middles, but at most twice each mean, as on a line that begins at zero. So the curve
    does not change its sign on a facet. Between means of different signs it is zero.

    Args:
        means: Means on the facets in their order along the contact, shape (n,).
        lengths: Their lengths [length], shape (n,).
        parts: Numbers of facets that do not touch the one before, shape (p,).
        points: Reference points on a facet in [0, 1], shape (q,).

    Returns:
        Values at the points, shape (n, q).
    """
    first, last = np.insert(parts, 0, 0), np.append(parts, len(means)) - 1
    between = (lengths[1:] * means[:-1] + lengths[:-1] * means[1:]) / (lengths[1:] + lengths[:-1])
    least = 2 * np.minimum(abs(means[1:]), abs(means[:-1])) * (means[1:] * means[:-1] > 0)
    between = np.clip(between, -least, least)
    left, right = np.append(0.0, between), np.append(between, 0.0)
    alone = first == last
    left[first], right[last] = 2 * means[first] - right[first], 2 * means[last] - left[last]
    left[first[alone]] = right[last[alone]] = means[first[alone]]
    limits = 2 * abs(means)
    left, right = (
        np.where(means * end > 0, np.clip(end, -limits, limits), 0.0)[:, None]
        for end in (left, right)
    )
    x = points[None, :]
    return left * (1 - x) * (1 - 3 * x) + right * x * (3 * x - 2) + 6 * means[:, None] * x * (1 - x)
