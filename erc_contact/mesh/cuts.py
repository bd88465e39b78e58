"""Cut segments at the kinks of data, which are then smooth on each piece.

Quadrature finds kinks by bisection, but only those that change one of its samples. Of
data with hundreds of kinks a segment may have more of them than samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SAME_PLACE = 1e-9
"""Difference of places on a segment that counts as none, over its length [-]."""


@dataclass(frozen=True, eq=False)
class Cuts:
    """Hold places at which segments are cut.

    Attributes:
        simplex: Number of the segment of each place, shape (n,).
        place: Distance from its first vertex, over its length [-], shape (n,).

    Example:
        >>> cuts = Cuts(simplex=np.array([0]), place=np.array([0.3]))
        >>> whole = np.eye(2)[None]  # one piece, with the corners of the segment
        >>> first_pieces(np.array([0]), whole, cuts).share
        array([0.3, 0.7])
    """

    simplex: np.ndarray
    place: np.ndarray


@dataclass(frozen=True, eq=False)
class Pieces:
    """Hold pieces of simplices.

    Attributes:
        simplex: Number of the simplex of each piece, shape (n,).
        corners: Barycentric coordinates of the corners of each piece, shape (n, v, v).
        share: Share of each piece in its simplex [-], shape (n,).
    """

    simplex: np.ndarray
    corners: np.ndarray
    share: np.ndarray


def first_pieces(simplices: np.ndarray, pieces: np.ndarray, cuts: Cuts | None) -> Pieces:
    """Return the pieces of simplices, cut at places if any are given.

    Args:
        simplices: Numbers of the simplices in increasing order, shape (s,).
        pieces: Pieces of equal size of each simplex, shape (c, v, v).
        cuts: Further places, of segments only, also of others than these.
    """
    if cuts is None:
        simplex = np.repeat(simplices, len(pieces))
        corners = np.tile(pieces, (len(simplices), 1, 1))
        return Pieces(simplex, corners, np.full(len(simplex), 1 / len(pieces)))
    ends = np.unique(pieces[:, :, 1])
    inside = np.isin(cuts.simplex, simplices)
    simplex = np.concatenate([np.repeat(simplices, len(ends)), cuts.simplex[inside]])
    place = np.concatenate([np.tile(ends, len(simplices)), cuts.place[inside]])
    order = np.lexsort((place, simplex))
    simplex = simplex[order]
    place = place[order]
    # Between two neighbours of the same segment is a piece, unless they are one place.
    # The ends of a segment stay: they are the first and the last of it.
    follows = np.zeros(len(simplex), dtype=bool)
    follows[1:] = (simplex[1:] == simplex[:-1]) & (np.diff(place) < SAME_PLACE)
    follows &= place < 1.0
    simplex = simplex[~follows]
    place = place[~follows]
    has_next = simplex[1:] == simplex[:-1]
    low = place[:-1][has_next]
    high = place[1:][has_next]
    corners = np.stack([np.stack([1 - low, low], 1), np.stack([1 - high, high], 1)], axis=1)
    return Pieces(simplex[:-1][has_next], corners, high - low)
