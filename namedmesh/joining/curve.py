"""Project points on a curve of facets in the plane, along interpolated directions.

The directions are normals at the vertices, or directions that are given there.

The place of a point on a curve is the length from the curve's first vertex. Beyond the
ends of an open curve its first and last facet are continued.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from namedmesh.graphs import order_along_curves
from namedmesh.joining.triangles import cross

NEWTON_STEPS = 4
"""Newton steps for the place of a point on a facet; the equation is quadratic."""
LEAST_SLOPE = 1e-3
"""Slope below which a Newton step is left out, by the length of the facet [-]."""
ON_FACET = 1e-9
"""Distance beyond the end of a facet that is none, by its length [-]."""
ROWS_AT_ONCE = 1_000_000
"""Greatest number of pairs (point, facet) that are looked at together."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Hold facets in the plane that follow each other.

    Args:
        points: Number of each vertex, the last one too, shape (k+1,). A closed curve
            ends with its first vertex.
        x: Positions of the vertices [length], shape (k+1, 2).
        sides: Side (cell, local facet) of each facet, shape (k, 2).
        given: Unit vectors at the vertices along which points are projected, shape
            (k+1, 2); None takes the normals.

    Example:
        >>> x = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
        >>> curve = Curve(np.arange(3), x, sides=np.zeros((2, 2), dtype=int))
        >>> curve.places
        array([0., 1., 2.])
        >>> np.degrees(curve.turns)  # to the left at the vertex in the middle
        array([ 0., 90.,  0.])
    """

    points: np.ndarray
    x: np.ndarray
    sides: np.ndarray
    given: np.ndarray | None = None

    @property
    def closed(self) -> bool:
        """Check whether the curve ends where it begins."""
        return bool(self.points[0] == self.points[-1])

    @cached_property
    def lengths(self) -> np.ndarray:
        """Return the lengths of the facets [length], shape (k,)."""
        return np.linalg.norm(np.diff(self.x, axis=0), axis=1)

    @property
    def _directions(self) -> np.ndarray:
        """Return the unit vector along each facet, shape (k, 2)."""
        return np.diff(self.x, axis=0) / self.lengths[:, None]

    @cached_property
    def places(self) -> np.ndarray:
        """Return the places of the vertices [length], shape (k+1,)."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])

    @property
    def length(self) -> float:
        """Return the length of the curve [length]."""
        return float(self.places[-1])

    @cached_property
    def turns(self) -> np.ndarray:
        """Return the angle by which the curve turns at each vertex, shape (k+1,)."""
        direction = self._directions
        before = np.roll(direction, 1, axis=0)
        angle = np.arctan2(cross(before, direction), np.einsum("ij,ij->i", before, direction))
        if not self.closed:
            angle[0] = 0.0
        return np.append(angle, angle[0] if self.closed else 0.0)

    @cached_property
    def normals(self) -> np.ndarray:
        """Return the unit normals at the vertices, shape (k+1, 2)."""
        direction = self._directions
        facet_normal = np.column_stack([direction[:, 1], -direction[:, 0]])
        first = facet_normal[-1] if self.closed else facet_normal[0]
        last = facet_normal[0] if self.closed else facet_normal[-1]
        total = np.vstack([first, facet_normal]) + np.vstack([facet_normal, last])
        return total / np.linalg.norm(total, axis=1)[:, None]

    @property
    def across(self) -> np.ndarray:
        """Return the directions of projection at the vertices [-], shape (k+1, 2)."""
        return self.normals if self.given is None else self.given

    def project(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project points on the curve.

        Args:
            x: Points [length], shape (n, 2).

        Returns:
            Their places, and the distances from them to the points, shape (n,) each.
        """
        rows = max(1, ROWS_AT_ONCE // len(self.lengths))
        parts = [self._project(x[i : i + rows]) for i in range(0, len(x), rows)]
        places, distances = zip(*parts, strict=True)
        return np.concatenate(places), np.concatenate(distances)

    def _project(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project points on the nearest facet and its neighbours; keep the best."""
        count = len(self.lengths)
        edge = np.diff(self.x, axis=0)
        low = np.zeros(count)
        high = np.ones(count)
        if not self.closed:
            low[0] = -np.inf
            high[-1] = np.inf
        offset = x[:, None] - self.x[:-1]
        share = np.clip(np.einsum("nij,ij->ni", offset, edge) / self.lengths**2, low, high)
        distance = np.linalg.norm(offset - share[..., None] * edge, axis=2)
        beside = distance.argmin(axis=1)[:, None] + np.array([-1, 0, 1])
        facet = beside % count if self.closed else np.clip(beside, 0, count - 1)
        row = np.arange(len(x))[:, None]
        along_normal = self._shares(offset[row, facet], share[row, facet], facet)
        share = np.clip(along_normal, low[facet], high[facet])
        apart = np.linalg.norm(offset[row, facet] - share[..., None] * edge[facet], axis=2)
        # A vertex may be nearer to a point than the foot of the normal through it.
        beyond = abs(share - along_normal) > ON_FACET
        beyond &= ~beyond.all(axis=1, keepdims=True)
        best = (np.arange(len(x)), np.where(beyond, np.inf, apart).argmin(axis=1))
        place = self.places[facet[best]] + share[best] * self.lengths[facet[best]]
        return place, apart[best]

    def _shares(self, offset: np.ndarray, share: np.ndarray, facet: np.ndarray) -> np.ndarray:
        """Return where along facets the interpolated direction goes through points.

        Args:
            offset: Vectors from the first vertices of facets to points [length], shape
                (n, m, 2).
            share: First guess, shape (n, m).
            facet: The facets, shape (n, m).
        """
        edge = np.diff(self.x, axis=0)[facet]
        first = self.across[:-1][facet]
        change = np.diff(self.across, axis=0)[facet]
        # The vector from the foot to the point has the direction of the foot.
        for _ in range(NEWTON_STEPS):
            direction = first + share[..., None] * change
            foot_to_point = offset - share[..., None] * edge
            value = cross(foot_to_point, direction)
            slope = cross(foot_to_point, change) - cross(edge, direction)
            steep = abs(slope) > LEAST_SLOPE * self.lengths[facet]
            share = share - np.where(steep, value / np.where(steep, slope, 1.0), 0.0)
        return share

    def facet_at(self, places: np.ndarray) -> np.ndarray:
        """Return the facet at each place, the first or last facet beyond the ends."""
        facet = np.searchsorted(self.places, places, side="right") - 1
        return np.clip(facet, 0, len(self.lengths) - 1)

    def at(self, places: np.ndarray) -> np.ndarray:
        """Return the points at places [length], shape (n, 2)."""
        facet = self.facet_at(places)
        share = (places - self.places[facet]) / self.lengths[facet]
        return self.x[facet] + share[:, None] * (self.x[facet + 1] - self.x[facet])


def direct_facets(
    x: np.ndarray, cells: np.ndarray, sides: np.ndarray, *, left: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and the last point of facets, with their cells on one hand.

    Args:
        x: Points [length], shape (n, 2).
        cells: Points of the triangles, shape (m, 3).
        sides: Facets (cell, local facet), shape (k, 2).
        left: Whether the cells are on the left of their facets, or on the right.
    """
    corner = (sides[:, 1:] + np.arange(3)) % 3
    apex, start, end = np.take_along_axis(cells[sides[:, 0]], corner, axis=1).T
    on_left = cross(x[end] - x[start], x[apex] - x[start]) > 0
    turned = on_left != left
    return np.where(turned, end, start), np.where(turned, start, end)


def curves(x: np.ndarray, cells: np.ndarray, sides: np.ndarray) -> list[Curve]:
    """Return the curves that facets form, their cells on the left.

    Args:
        x: Points [length], shape (n, 2).
        cells: Points of the triangles, shape (m, 3).
        sides: Facets (cell, local facet), shape (k, 2).
    """
    start, end = direct_facets(x, cells, sides, left=True)
    order = order_along_curves(start, end, x[start])
    start = start[order]
    end = end[order]
    breaks = np.flatnonzero(end[:-1] != start[1:]) + 1
    result = []
    for facets in np.split(np.arange(len(start)), breaks):
        points = np.append(start[facets], end[facets[-1]])
        result.append(Curve(points, x[points], sides[order[facets]]))
    return result
