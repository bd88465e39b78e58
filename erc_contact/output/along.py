"""Find the coordinate along a contact in 2D, and curves along it; on rank 0.

Symbols: n normal of the foundation.
"""

from __future__ import annotations

import numpy as np

from erc_contact.output.drawing import coordinate, tangents, words
from erc_contact.output.gathered import AXIS, WholeContact, mean_normal
from namedmesh.for_solvers import successors, to_chain_ends

PART_DISTANCE = 0.05
"""Distance between parts of a contact along it, as a share of its length [-]."""


def along(surface: WholeContact) -> tuple[np.ndarray, str]:
    """Compute the coordinate of vertices along a contact in 2D [length].

    Returns:
        The coordinate of the vertices of each facet, shape (n, 2), and its label.
    """
    (tangent,) = tangents(mean_normal(surface))
    abscissa = surface.x[:, :2, :2] @ tangent
    # On a straight contact no facet is shorter along the tangent than it is.
    if np.allclose(np.ptp(abscissa, axis=1), surface.traction.area, rtol=10 * AXIS, atol=0.0):
        return abscissa, coordinate(tangent, surface.letters)
    return _arc_length(surface)


def _arc_length(surface: WholeContact) -> tuple[np.ndarray, str]:
    """Compute the arc length along a curved contact [length].

    The contact may have several parts or be closed. A closed part is cut far from the
    mean place of the pressure, where the arc length is zero.

    Returns:
        Arc length at the vertices of each facet, shape (n, 2), and its label.
    """
    traction = surface.traction
    n, area = traction.contact.direction, traction.area
    ends = surface.x[:, :2, :2]
    # All facets are followed along (-n_2, n_1), in whatever order their vertices are.
    forwards = np.column_stack([-n[:, 1], n[:, 0]])
    forward = np.einsum("fi,fi->f", ends[:, 1] - ends[:, 0], forwards) > 0
    vertices = surface.vertices.T
    first, last = np.where(forward, vertices, vertices[::-1])
    force = area * np.maximum(-traction.normal_component, 0).mean(axis=1)
    weights = force if force.any() else area
    centre = np.average(ends.mean(axis=1), axis=0, weights=weights)
    successor = successors(first, last)
    to_end, end = to_chain_ends(successor, area)
    closed = np.flatnonzero(successor[end] != end)
    while len(closed) > 0:
        # One cut opens one closed part.
        cut = closed[np.linalg.norm(ends[closed, 0] - centre, axis=1).argmax()]
        successor[cut] = cut
        to_end, end = to_chain_ends(successor, area)
        closed = np.flatnonzero(successor[end] != end)
    start = np.empty(len(area))
    offset = 0.0
    for last_facet in np.unique(end):
        part = end == last_facet
        start[part] = offset + to_end[part].max() - to_end[part]
        offset = float((start[part] + area[part]).max()) + PART_DISTANCE * area.sum()
    abscissa = np.where(forward, [start, start + area], [start + area, start]).T
    distance = np.linalg.norm(ends - centre, axis=2)
    facet, vertex = np.unravel_index(distance.argmin(), abscissa.shape)
    origin = words(ends[facet, vertex], area.sum())
    return abscissa - abscissa[facet, vertex], f"arc length from {origin} [length]"


def through_means(
    means: np.ndarray, lengths: np.ndarray, parts: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Compute a continuous curve with prescribed means on facets.

    It is a quadratic polynomial on each of them.

    Between two facets it meets the line through their means at their middles, but at
    most twice each mean, as on a line that begins at zero. So the curve does not change
    its sign on a facet. Between means of different signs it is zero.

    Args:
        means: Means on the facets in their order along the contact, shape (n,).
        lengths: Their lengths [length], shape (n,).
        parts: Numbers of facets that do not touch the one before, shape (p,).
        points: Reference points on a facet in [0, 1], shape (q,).

    Returns:
        Values at the points, shape (n, q).
    """
    # Left and right values of the curve on each facet.
    between = (lengths[1:] * means[:-1] + lengths[:-1] * means[1:]) / (lengths[1:] + lengths[:-1])
    same_sign = means[1:] * means[:-1] > 0
    limit = 2 * np.minimum(abs(means[1:]), abs(means[:-1])) * same_sign
    between = np.clip(between, -limit, limit)
    left = np.append(0.0, between)
    right = np.append(between, 0.0)
    # The ends of a part have no neighbour: there the curve goes on as a line.
    first = np.insert(parts, 0, 0)
    last = np.append(parts, len(means)) - 1
    at_start = 2 * means[first] - right[first]
    at_end = 2 * means[last] - left[last]
    left[first] = at_start
    right[last] = at_end
    alone = first[first == last]
    left[alone] = means[alone]
    right[alone] = means[alone]
    left = _with_sign_of(means, left)[:, None]
    right = _with_sign_of(means, right)[:, None]
    x = points[None, :]
    # The third term has the mean of its facet, and the others have none.
    ends = left * (1 - x) * (1 - 3 * x) + right * x * (3 * x - 2)
    return ends + 6 * means[:, None] * x * (1 - x)


def _with_sign_of(means: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Limit values to twice the means, and to zero where they have another sign."""
    limits = 2 * abs(means)
    return np.where(means * values > 0, np.clip(values, -limits, limits), 0.0)
