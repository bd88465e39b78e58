"""Cut the edges of two outlines in a plane where they run beside each other.

A strip of the width w between two outlines with edges of the length h gets triangles
with angles of w/h. So the edges along it become shorter, and with them the triangles of
both surfaces beside them: the longest edges are cut in halves, so that angles stay what
they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from namedmesh.closest import closest
from namedmesh.joining.triangles import cross, edge_lengths, shortest_edges
from namedmesh.rows import row_numbers
from namedmesh.simplex import facet_vertices

NARROW = 0.05
"""Width of a strip below which its edges are cut, by the shorter edge [-]."""
SPACING = 1.6
"""Length of edges along a strip, by the root of its width times the edge [-]."""
LONGEST = 20.0
"""Greatest length of edges along a strip, by its width [-]."""
PARALLEL = 0.5
"""Greatest sine of the angle between edges that run beside each other [-]."""


@dataclass(frozen=True, eq=False)
class CutSurface:
    """Hold the surface of a body, which may have been cut beside an outline.

    Attributes:
        triangles: The triangles, shape (m, 3).
        parents: The given triangle in which each lies, shape (m,).
        outline: Edges of the outline, shape (o, 2).
    """

    triangles: np.ndarray
    parents: np.ndarray
    outline: np.ndarray

    @classmethod
    def of(cls, triangles: np.ndarray, outline: np.ndarray) -> CutSurface:
        """Make it of a surface without cuts."""
        return cls(triangles, np.arange(len(triangles)), outline)


@dataclass(frozen=True, eq=False)
class _Limits:
    """Hold how long edges of two outlines may be.

    Attributes:
        along: Length allowed to each edge of each outline along strips [length].
        points: Corners near the other outline [length], shape (p, 2).
        at_points: Length allowed there [length], shape (p,).
    """

    along: tuple[np.ndarray, np.ndarray]
    points: np.ndarray
    at_points: np.ndarray

    def allowed_lengths(self, ends: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return the length that pieces of edges may have [length], shape (n,).

        It grows with the distance from a corner.

        Args:
            ends: Ends of the pieces [length], shape (n, 2, 2).
            along: Length allowed to their edges [length], shape (n,).
        """
        step = ends[:, 1] - ends[:, 0]
        offset = self.points[:, None] - ends[:, 0]
        share = np.einsum("pni,ni->pn", offset, step) / np.einsum("ni,ni->n", step, step)
        foot = np.clip(share, 0.0, 1.0)[..., None] * step
        distance = np.linalg.norm(offset - foot, axis=2)
        from_corners = (self.at_points[:, None] + distance).min(axis=0, initial=np.inf)
        return np.minimum(along, from_corners)


def with_short_edges(
    x: np.ndarray,
    surfaces: tuple[CutSurface, CutSurface],
    coordinates: Callable[[np.ndarray], np.ndarray],
    corners: np.ndarray,
    tolerance: float,
) -> tuple[np.ndarray, tuple[CutSurface, CutSurface]]:
    """Cut the edges of two outlines along narrow strips between them.

    Args:
        x: Points [length], shape (n, 3).
        surfaces: The surfaces of both bodies, with the outlines of the sides.
        coordinates: Gives the coordinates in the plane of the sides [length].
        corners: Whether each point stays where it is, shape (n,).
        tolerance: Distance that counts as none [length].

    Returns:
        The points, new ones last, and the surfaces.
    """
    first, second = surfaces
    limits = _limits(coordinates(x), first.outline, second.outline, corners, tolerance)
    x, first = _bisect(x, first, limits, limits.along[0], coordinates)
    x, second = _bisect(x, second, limits, limits.along[1], coordinates)
    return x, (first, second)


def _limits(
    y: np.ndarray, edges1: np.ndarray, edges2: np.ndarray, corners: np.ndarray, tolerance: float
) -> _Limits:
    """Find how long the edges of two outlines may be."""
    lengths = [edge_lengths(y, edges) for edges in (edges1, edges2)]
    width = _widths(y[edges1], y[edges2], tolerance)
    size = np.minimum(lengths[0][:, None], lengths[1])
    spacing = _spacing(width, size)
    points = []
    at_points = []
    for own_edges, other_edges, other_lengths in (
        (edges1, edges2, lengths[1]),
        (edges2, edges1, lengths[0]),
    ):
        every = np.unique(own_edges[corners[own_edges]])
        nearest, _, distance = closest(y[every], y[other_edges])
        sizes = np.minimum(shortest_edges(y, own_edges)[every], other_lengths[nearest])
        of_corners = _spacing(np.where(distance > tolerance, distance, np.inf), sizes)
        near = np.isfinite(of_corners)
        points.append(y[every[near]])
        at_points.append(of_corners[near])
    along = (spacing.min(axis=1), spacing.min(axis=0))
    return _Limits(along, np.concatenate(points), np.concatenate(at_points))


def _spacing(width: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the length of edges along strips, infinite where they are wide [length].

    With lengths of the root of width times size, neither the strip nor the triangles
    beside it need as many cuts as equal sides would.
    """
    narrow = width < NARROW * size
    width = np.where(narrow, width, 0.0)
    shorter = np.minimum(SPACING * np.sqrt(width * size), LONGEST * width)
    return np.where(narrow, shorter, np.inf)


def _widths(ends1: np.ndarray, ends2: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the least distance of edges that run beside each other, or infinity.

    Edges that touch each other do not count: they enclose an angle, not a strip.

    Args:
        ends1: Ends of edges [length], shape (k, 2, 2).
        ends2: The same for other ones, shape (l, 2, 2).
        tolerance: Distance that counts as none [length].

    Returns:
        Widths [length], shape (k, l).
    """
    along = []
    length = []
    for ends in (ends1, ends2):
        step = ends[:, 1] - ends[:, 0]
        length.append(np.linalg.norm(step, axis=1))
        along.append(step / length[-1][:, None])
    sine = cross(along[0][:, None], along[1])
    width = np.full(sine.shape, np.inf)
    for end in range(2):
        # Ends of the first edges over the second ones, and the other way round.
        offset = ends1[:, None, end] - ends2[None, :, 0]
        width = np.minimum(width, _height(offset, along[1][None], length[1][None], tolerance))
        offset = ends2[None, :, end] - ends1[:, None, 0]
        height = _height(offset, along[0][:, None], length[0][:, None], tolerance)
        width = np.minimum(width, height)
    return np.where((abs(sine) < PARALLEL) & (width > tolerance), width, np.inf)


def _height(
    offset: np.ndarray, along: np.ndarray, length: np.ndarray, tolerance: float
) -> np.ndarray:
    """Return the height of points over edges, infinite if they are not over them."""
    place = (offset * along).sum(axis=-1)
    height = abs(cross(offset, along))
    return np.where((place > -tolerance) & (place < length + tolerance), height, np.inf)


def _bisect(
    x: np.ndarray,
    surface: CutSurface,
    limits: _Limits,
    along: np.ndarray,
    coordinates: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, CutSurface]:
    """Cut long edges of an outline, and what else must be cut for that.

    Each cut is in the middle of an edge that is the longest one of both its triangles,
    so the triangles match at any time (M.-C. Rivara, 1997).
    """
    triangles = surface.triangles
    parents = surface.parents
    pieces = surface.outline
    while True:
        ends = coordinates(x[pieces.ravel()]).reshape(-1, 2, 2)
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        long = length > limits.allowed_lengths(ends, along)
        if not long.any():
            return x, CutSurface(triangles, parents, pieces)
        edges, of_triangles, of_pieces = _edges(triangles, pieces)
        is_cut = _cut_at_once(x, edges, of_triangles, of_pieces[long])
        new = np.full(len(edges), -1)
        new[is_cut] = len(x) + np.arange(is_cut.sum())
        x = np.concatenate([x, x[edges[is_cut]].mean(axis=1)])
        triangles, rows = _halves(triangles, new[of_triangles])
        parents = parents[rows]
        middle = new[of_pieces]
        halved = middle >= 0
        first = np.column_stack([pieces[:, 0], np.where(halved, middle, pieces[:, 1])])
        second = np.column_stack([middle[halved], pieces[halved, 1]])
        pieces = np.concatenate([first, second])
        along = np.concatenate([along, along[halved]])


def _edges(triangles: np.ndarray, pieces: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the edges of triangles, and their numbers.

    Returns:
        Ends of each edge, shape (e, 2); the edges of triangles, the first one opposite
        to the first corner, (m, 3); the edge of each piece of an outline.
    """
    sides = triangles[:, facet_vertices(2)].reshape(-1, 2)
    of_sides, of_pieces = row_numbers(sides, pieces)
    edges = np.zeros((of_sides.max() + 1, 2), dtype=np.int64)
    edges[of_sides] = sides
    return edges, of_sides.reshape(-1, 3), of_pieces


def _cut_at_once(
    x: np.ndarray, edges: np.ndarray, of_triangles: np.ndarray, long: np.ndarray
) -> np.ndarray:
    """Find the edges that can be cut on the way to cutting long edges.

    Args:
        x: Points [length], shape (n, 3).
        edges: Ends of the edges, shape (e, 2).
        of_triangles: The edges of each triangle, shape (m, 3).
        long: The edges that must be cut.
    """
    length = edge_lengths(x, edges)
    rank = np.empty(len(edges), dtype=np.int64)
    rank[np.argsort(length, kind="stable")] = np.arange(len(edges))
    longest = np.take_along_axis(
        of_triangles, rank[of_triangles].argmax(axis=1)[:, None], axis=1
    ).ravel()
    needed = np.zeros(len(edges), dtype=bool)
    needed[long] = True
    count = -1
    while count < needed.sum():
        count = needed.sum()
        needed[longest[needed[of_triangles].any(axis=1)]] = True
    beside = np.bincount(of_triangles.ravel(), minlength=len(edges))
    return needed & (np.bincount(longest, minlength=len(edges)) == beside)


def _halves(triangles: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut triangles from a corner to the middle of the opposite edge.

    Args:
        triangles: The triangles, shape (m, 3).
        middle: The point amid each edge, -1 if it is not cut, shape (m, 3). At most
            one edge of a triangle is.

    Returns:
        The triangles, and the numbers of those in which they lie.
    """
    row, corner = np.nonzero(middle >= 0)
    apex, left, right = (triangles[row, (corner + i) % 3] for i in range(3))
    point = middle[row, corner]
    result = triangles.copy()
    result[row] = np.column_stack([apex, left, point])
    more = np.column_stack([apex, point, right])
    return np.concatenate([result, more]), np.concatenate([np.arange(len(triangles)), row])
