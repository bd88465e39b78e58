"""Give two outlines in a plane common points: where they run together or cross.

Points of both outlines that are close become one, if a point moves along its own
outline for it. A point that lies on an edge of the other outline is inserted there, and
so is the crossing of two edges.

Symbols: 1 and 2 the outlines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from namedmesh.joining.triangles import cross, shortest_edges

STRAIGHT = 1e-3
"""Sine of the angle between two edges on one line [-]."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """Hold what gives two outlines common points.

    Attributes:
        y: Points in the plane [length], the new ones last, shape (n, 2).
        number: The point that each point has become, shape (n,).
        inserted1: Edge of outline 1 and the point that cuts it, shape (k, 2).
        inserted2: The same for outline 2.
        tolerance: Distance that counted as none [length].
    """

    y: np.ndarray
    number: np.ndarray
    inserted1: np.ndarray
    inserted2: np.ndarray
    tolerance: float


def common_points(
    y: np.ndarray,
    edges1: np.ndarray,
    edges2: np.ndarray,
    fixed: np.ndarray,
    close: float,
    tolerance: float,
) -> Alignment:
    """Find the common points of two outlines.

    Args:
        y: Points in the plane [length], shape (n, 2).
        edges1: Points of the edges of outline 1, shape (k, 2).
        edges2: Points of the edges of outline 2, shape (l, 2).
        fixed: Whether each point must stay, shape (n,).
        close: Distance below which points become one, by the shorter edge [-].
        tolerance: Distance that counts as none [length].
    """
    y = y.copy()
    number = np.arange(len(y))
    direction = directions(y, np.concatenate([edges1, edges2]), fixed)
    sizes = shortest_edges(y, np.concatenate([edges1, edges2]))

    _move_to_crossings(y, edges1, edges2, direction, sizes, (close, tolerance))
    _merge(y, number, (edges1, edges2), direction, sizes, (close, tolerance))
    edges1 = number[edges1]
    edges2 = number[edges2]
    inserted1 = _points_on_edges(y, np.setdiff1d(edges2, edges1), edges1, tolerance)
    inserted2 = _points_on_edges(y, np.setdiff1d(edges1, edges2), edges2, tolerance)
    edge1, edge2, crossing = _crossings(y, edges1, edges2, tolerance)
    new = len(y) + np.arange(len(crossing))
    return Alignment(
        np.concatenate([y, crossing]),
        np.concatenate([number, new]),
        np.concatenate([inserted1, np.column_stack([edge1, new])]),
        np.concatenate([inserted2, np.column_stack([edge2, new])]),
        tolerance,
    )


def cut_edges(y: np.ndarray, edges: np.ndarray, inserted: np.ndarray) -> np.ndarray:
    """Return the pieces of edges that points cut, shape (k, 2).

    Args:
        y: Points in the plane [length], shape (n, 2).
        edges: Points of the edges, shape (k, 2).
        inserted: Edge and the point that cuts it, shape (l, 2).
    """
    along = y[edges[:, 1]] - y[edges[:, 0]]
    edge = np.concatenate([np.tile(np.arange(len(edges)), 2), inserted[:, 0]])
    point = np.concatenate([edges.T.ravel(), inserted[:, 1]])
    place = np.einsum("ij,ij->i", y[point] - y[edges[edge, 0]], along[edge])
    order = np.lexsort([place, edge])
    edge = edge[order]
    point = point[order]
    same = edge[1:] == edge[:-1]
    return np.column_stack([point[:-1], point[1:]])[same]


def inside(y: np.ndarray, points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Check which points lie within outlines, by the edges that a ray meets.

    Args:
        y: Points in the plane [length], shape (n, 2).
        points: Points that lie on no edge [length], shape (m, 2).
        edges: Points of the edges of all outlines, shape (k, 2).
    """
    start = y[edges[:, 0]]
    end = y[edges[:, 1]]
    above = start[:, 1] > points[:, None, 1]
    crossed = above != (end[:, 1] > points[:, None, 1])
    rise = end[:, 1] - start[:, 1]
    share = (points[:, None, 1] - start[:, 1]) / np.where(rise == 0, 1.0, rise)
    right = points[:, None, 0] < start[:, 0] + share * (end[:, 0] - start[:, 0])
    return np.sum(crossed & right, axis=1) % 2 == 1


def directions(y: np.ndarray, edges: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Return the unit vector along which each point may move, zero if it must stay."""
    tangent = y[edges[:, 1]] - y[edges[:, 0]]
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    # The sum of t t^T over the two edges of a point has rank one if they are on a line.
    total = np.zeros((len(y), 2, 2))
    for end in edges.T:
        np.add.at(total, end, tangent[:, :, None] * tangent[:, None])
    values, vectors = np.linalg.eigh(total)
    straight = (values[:, 0] < STRAIGHT**2) & (values[:, 1] > 1.5)
    return np.where((straight & ~fixed)[:, None], vectors[:, :, 1], 0.0)


def _crossings(
    y: np.ndarray, edges1: np.ndarray, edges2: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the pairs of edges that cross inside, and the points where [length]."""
    start1 = y[edges1[:, 0]][:, None]
    start2 = y[edges2[:, 0]][None]
    along1 = y[edges1[:, 1]][:, None] - start1
    along2 = y[edges2[:, 1]][None] - start2
    length1 = np.linalg.norm(along1, axis=2)
    length2 = np.linalg.norm(along2, axis=2)
    sine = cross(along1, along2)
    skew = abs(sine) > STRAIGHT * length1 * length2
    divisor = np.where(skew, sine, 1.0)
    share1 = cross(start2 - start1, along2) / divisor
    share2 = cross(start2 - start1, along1) / divisor
    amid = skew
    for share, length in ((share1, length1), (share2, length2)):
        amid = amid & (share * length > tolerance) & ((1 - share) * length > tolerance)
    edge1, edge2 = np.nonzero(amid)
    point = start1[edge1, 0] + share1[amid][:, None] * along1[edge1, 0]
    return edge1, edge2, point


def _move_to_crossings(
    y: np.ndarray,
    edges1: np.ndarray,
    edges2: np.ndarray,
    direction: np.ndarray,
    sizes: np.ndarray,
    limits: tuple[float, float],
) -> None:
    """Move points of both outlines along them to close crossings, in place."""
    close, tolerance = limits
    edge1, edge2, crossing = _crossings(y, edges1, edges2, tolerance)
    before = y.copy()
    for edge, edges in ((edge1, edges1), (edge2, edges2)):
        for end in range(2):
            point = edges[edge, end]
            near = np.linalg.norm(before[point] - crossing, axis=1) < close * sizes[point]
            near &= direction[point].any(axis=1)
            y[point[near]] = crossing[near]
            # A point that sits on a crossing stays there.
            direction[point[near]] = 0.0


def _merge(
    y: np.ndarray,
    number: np.ndarray,
    outlines: tuple[np.ndarray, np.ndarray],
    direction: np.ndarray,
    sizes: np.ndarray,
    limits: tuple[float, float],
) -> None:
    """Merge close points of both outlines, in place."""
    close, tolerance = limits
    points1 = np.unique(outlines[0])
    points2 = np.unique(outlines[1])
    distance = np.linalg.norm(y[points2][:, None] - y[points1], axis=2)
    partner = points1[distance.argmin(axis=1)]
    step = y[partner] - y[points2]
    near = distance.min(axis=1)
    small = near < close * np.minimum(sizes[partner], sizes[points2])
    same = near < tolerance
    ways = []
    for point in (points2, partner):
        may_move = direction[point].any(axis=1)
        ways.append(may_move & (abs(cross(step, direction[point])) < tolerance))
    second_moves = same | (small & ways[0])
    first_moves = small & ways[1] & ~second_moves
    y[partner[first_moves]] = y[points2[first_moves]]
    merged = first_moves | second_moves
    y[points2[merged]] = y[partner[merged]]
    number[points2[merged]] = partner[merged]


def _points_on_edges(
    y: np.ndarray, points: np.ndarray, edges: np.ndarray, tolerance: float
) -> np.ndarray:
    """Return pairs (edge, point) of points that lie amid edges, shape (k, 2)."""
    start = y[edges[:, 0]]
    along = y[edges[:, 1]] - start
    length = np.linalg.norm(along, axis=1)
    offset = y[points][:, None] - start
    place = np.einsum("pij,ij->pi", offset, along) / length
    height = abs(cross(offset, along)) / length
    amid = (place > 0) & (place < length) & (height < tolerance)
    point, edge = np.nonzero(amid)
    return np.column_stack([edge, points[point]])
