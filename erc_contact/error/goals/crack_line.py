"""Find the line of a crack behind its tip, and on which side of it cells are.

Places are in the frame of the tip: along the direction of the crack, and aside. The
line is straight behind the tip. In the plane it may bend beyond: it goes back from
facet to facet, away from the tip, within a horn.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.error.goals.crack_tips import ON_LINE, Tip, boundary_ends, distances
from erc_contact.model.space import Space
from namedmesh.base.ranks import of_all

STEEPEST = 2.0
"""Greatest distance of a crack from its straight line, over the way beyond it [-]."""
MARGIN = 1.5
"""Width of the horn over the distance of the crack from the straight line [-]."""

NEAR = 1e-3
"""Way from a vertex to the middle of its cell to a point beside the vertex [-]."""


@dataclass(frozen=True, eq=False)
class CrackLine:
    """Know the line of a crack within a radius of its tip.

    Attributes:
        places: End of the straight piece, and ends of the facets beyond it [length],
            shape (m, 2); of a straight crack m is 1.
        radius: The radius [length].
    """

    places: np.ndarray
    radius: float

    @property
    def bends(self) -> bool:
        """Tell whether the crack bends within the radius."""
        return len(self.places) > 1

    @property
    def straight(self) -> float:
        """Return the length of the straight piece [length]."""
        return float(-self.places[0, 0])

    @cached_property
    def horn(self) -> tuple[float, float]:
        """Return the opening [-] and widening [1/length] of a horn around the crack.

        See :mod:`erc_contact.error.goals.bent_strain`. Where the straight piece is
        short the horn opens slowly, as the strain in it is large near the tip.
        """
        xi = -(self.places[:, 0] - self.places[0, 0])
        y = abs(self.places[:, 1])
        margin = MARGIN
        while True:
            opening = max(margin * y[1] / xi[1], 0.5 * self.straight / self.radius)
            beyond = (margin * y[1:] - opening * xi[1:]) / xi[1:] ** 2
            widening = max(float(beyond.max()), 0.0)
            if all(
                _is_within(opening, widening, *ends) for ends in pairwise(zip(xi, y, strict=True))
            ):
                return float(opening), widening
            margin *= MARGIN

    def sides(self, corners: np.ndarray) -> np.ndarray:
        """Return 1 for cells above the line and in front of the tip, else -1, (n,).

        Args:
            corners: Vertices of the cells [length], shape (n, 3, 2).
        """
        line = np.vstack([[0.0, 0.0], self.places])
        middles = corners.mean(axis=1, keepdims=True)
        # A vertex may be on the crack, or beyond the end of what is known of it.
        inside = np.concatenate([middles, corners + NEAR * (middles - corners)], axis=1)
        x, y = inside[..., 0], inside[..., 1]
        above = np.where(x < 0.0, y - np.interp(-x, -line[:, 0], line[:, 1]), 0.0)
        votes = (np.sign(above) * (x >= line[-1, 0])).sum(axis=1)
        votes = np.where(votes == 0.0, above.sum(axis=1), votes)
        return np.where(votes < 0.0, -1.0, 1.0)


def crack_line(space: Space, tip: Tip) -> CrackLine:
    """Return the line of a crack; collective.

    Raises:
        InputError: If the tip is no end of a crack that is as long as the radius, or
            something else is within the radius.
    """
    corners = boundary_ends(space)
    (ends,) = of_all(space.comm, tip.at(corners[tip.near(corners)]))
    # Each facet from its end that is nearer to the tip.
    order = np.argsort(-ends[..., 0], axis=1)
    ends = np.take_along_axis(ends, order[..., None], axis=1)
    tolerance = ON_LINE * tip.goal.radius
    straight = _straight_length(ends, tolerance)
    of_piece = (abs(ends[..., 1]) <= tolerance).all(axis=1) & (
        -ends[:, 1, 0] <= straight + tolerance
    )
    of_piece &= ends[:, 0, 0] <= tolerance
    start = np.array([-straight, 0.0])
    # Both faces of a crack have facets with the same ends.
    beyond, count = np.unique(ends[~of_piece], axis=0, return_counts=True)
    is_of_faces = (count == 2) & (beyond[:, 0, 0] <= tolerance - straight)
    of_faces = beyond[is_of_faces]
    of_faces = of_faces[np.argsort(-of_faces[:, 0, 0], kind="stable")]
    may_bend = tip.may_bend and straight > tolerance
    places = _chain(start, of_faces, tolerance) if may_bend else start[None]
    left = np.concatenate([beyond[~is_of_faces], of_faces[len(places) - 1 :]])
    room = float(distances(left).min(initial=np.inf))
    if room < tip.goal.radius * (1 - ON_LINE):
        raise InputError(
            f"{tip.goal!r}: {tip.bounds} comes as near as {room:.3g} to the tip,"
            f" where it is not the line of the crack. Give a radius up to that, {tip.bending},"
            " or the place of the tip and the direction in which the crack points."
        )
    length = abs(np.diff(ends[of_piece][..., 0])).sum()
    reach = float(np.linalg.norm(places[-1]))
    if reach < tip.goal.radius - tolerance or abs(length - 2 * straight) > tolerance:
        raise InputError(
            f"{tip.goal!r}: behind the tip both faces of a crack are {min(reach, length / 2):.3g}"
            " long within the radius; the tip has to be the end of a crack that is as long as the"
            " radius at least, and the direction points away from the crack."
        )
    return CrackLine(places, tip.goal.radius)


def _straight_length(ends: np.ndarray, tolerance: float) -> float:
    """Return how long facets on the line reach from the tip without a gap [length].

    Args:
        ends: Ends of facets, the nearer one first, shape (n, 2, 2).
        tolerance: Length that is none [length].
    """
    on_line = (abs(ends[..., 1]) <= tolerance).all(axis=1) & (ends[:, 0, 0] <= tolerance)
    ways = -ends[on_line][..., 0]
    ways = ways[np.argsort(ways[:, 0])]
    reached = np.append(0.0, np.maximum.accumulate(ways[:, 1]))
    goes_on = ways[:, 0] <= reached[:-1] + tolerance
    return float(reached[np.logical_and.accumulate(goes_on).sum()])


def _chain(start: np.ndarray, ends: np.ndarray, tolerance: float) -> np.ndarray:
    """Return a place and the ends of facets that go on from it, shape (m, 2).

    They end where the crack turns back towards the tip, or leaves its straight line by
    more than :data:`STEEPEST`.

    Args:
        start: End of the straight piece [length].
        ends: Ends of facets in the order of the distance behind the tip, shape (n, 2,
            2).
        tolerance: Length that is none [length].
    """
    places = np.vstack([start[None], ends[:, 1]])
    goes_on = (abs(ends[:, 0] - places[:-1]) <= tolerance).all(axis=1)
    way = ends[:, 1] - ends[:, 0]
    goes_away = (way[:, 0] < 0.0) & ((way * ends[:, 0]).sum(axis=1) > 0.0)
    is_flat = abs(ends[:, 1, 1]) <= STEEPEST * (start[0] - ends[:, 1, 0])
    is_next = np.logical_and.accumulate(goes_on & goes_away & is_flat)
    return places[: 1 + is_next.sum()]


def _is_within(
    opening: float, widening: float, first: tuple[float, float], second: tuple[float, float]
) -> bool:
    """Tell whether the horn holds a segment between two places (xi, y)."""
    slope = (second[1] - first[1]) / (second[0] - first[0])
    # The least of a quadratic function less a linear function.
    xi = (slope - opening) / (2 * widening) if widening > 0.0 else first[0]
    xi = min(max(xi, first[0]), second[0])
    return xi * (opening + widening * xi) >= first[1] + slope * (xi - first[0])
