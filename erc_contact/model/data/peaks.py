"""Bound functions on simplices from above, as the excess of a displacement over a gap.

Each simplex (a facet) is cut into the pieces of :mod:`.quadrature`, and
the function is sampled on each of them. It may be greater between the samples of a
piece than at them. Where it is smooth, a share of its range at the samples covers that;
where it is not, as at a cusp like ``-sqrt|x|``, its distance from the polynomial that
is nearest to the samples does. A piece whose bound may be the greatest of its simplex
by more than a tolerance is bisected, until the simplex has as many pieces as a mesh can
afford. What is left then makes the bound larger.

A peak that changes no value at the samples of the first pieces (72 on a facet in 2D,
352 in 3D) is missed.

Symbols: d' dimension of the simplices, v = d'+1 number of their vertices, n pieces, q
samples of a piece.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from erc_contact.model.data.quadrature import (
    CHUNK_PIECES,
    Cuts,
    Pieces,
    bisect,
    first_pieces,
    piece_points,
)

SMOOTH_RISE = 0.1
"""Rise of a smooth function between its samples, as a share of their range [-]."""
CUSP_RISE = 20.0
"""The same where it is not smooth, as a multiple of a distance from a polynomial [-].

The distance is the greatest one of the samples from the nearest polynomial. With this
multiple the bounds of cusps ``-|x - c|^a`` at 4000 random places c in a facet, a from
0.25 to 4, were all above the peak, also the bounds of cusps that are three times as
steep on one side.
"""
JUMP_SHARE = 0.02
"""Distance from the greatest or the least value in a piece with a jump [-].

If each value of a piece is within this share of the range from one of the two, nothing
hides between the samples.
"""
JUMP_RISE = SMOOTH_RISE / JUMP_SHARE
"""Rise of the pieces that are left at a jump, as a multiple of that distance [-]."""
INHERITED_AT_JUMP = 0.85
"""Share of that rise of a piece that its halves have at least [-].

It is the decrease of a cusp with power 0.25. A half may have a single sample on the
higher side of the jump, and no distance.
"""
SMOOTH_TOLERANCE = 1e-3
"""Excess of a bound in smooth pieces, as a share of the range on the simplex [-]."""
ROUGH_TOLERANCE = 1e-5
"""The same in other pieces [-]."""
INHERITED_SHARE = 0.5
"""Share of the rise of a piece that is not smooth that its halves have at least [-]."""
PEAK_ROUNDS = 60
"""Greatest number of bisections of a piece."""
JUMP_ROUNDS = 40
"""The same at a jump, so that round-off does not move its samples onto each other."""
MOST_PIECES = 4000
"""Number of pieces of a simplex that may be bisected, by default.

So a line of cusps in a triangle ends. What is left there makes the bound larger. The
limit holds for each simplex, so that a bound does not depend on which other simplices a
rank has.
"""
CHUNK_SIMPLICES = 256
"""Number of simplices that are worked on at once, for the sake of memory."""

Samples = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""A function that returns values at q points of n pieces, shape (n, q). It gets the
number of the simplex of each piece, shape (n,), and the points in barycentric
coordinates, shape (n, q, v), and in true coordinates, (n, q, d).
"""


def pieces_of_each(points: int, simplices: int, pieces: np.ndarray) -> int:
    """Return how many pieces of each simplex may be bisected.

    Args:
        points: Number of points of all simplices.
        simplices: Number of simplices of all ranks.
        pieces: The first pieces of each simplex, shape (c, v, v).

    Example:
        >>> pieces_of_each(9000, 50, facet_pieces(1))  # 8 of 20 are the first pieces
        6
    """
    evaluated = points // (max(simplices, 1) * len(piece_points(pieces.shape[1] - 1).points))
    return max(evaluated - len(pieces), 0) // 2


def upper_bounds(
    f: Samples,
    vertices: np.ndarray,
    pieces: np.ndarray,
    round_off: np.ndarray,
    cuts: Cuts | None = None,
    most: int = MOST_PIECES,
) -> np.ndarray:
    """Bound a function from above on each simplex.

    A bound is also at least the value of the function at all samples.

    Args:
        f: The function.
        vertices: Vertices of the simplices [length], shape (simplices, v, d).
        pieces: The first pieces of each simplex, from
            :func:`erc_contact.model.data.quadrature.facet_pieces`, (c, v, v).
        round_off: By how much the bound of each simplex may always be too large, shape
            (simplices,).
        cuts: Kinks of the function that are known, on segments; None without.
        most: Number of pieces of each simplex that may be bisected, see
            :func:`pieces_of_each`.

    Returns:
        The bounds, shape (simplices,).
    """
    bounds = np.empty(len(vertices))
    for start in range(0, len(vertices), CHUNK_SIMPLICES):
        chunk = slice(start, start + CHUNK_SIMPLICES)
        numbers = np.arange(len(vertices))[chunk]
        first = first_pieces(numbers, pieces, cuts)
        bounds[chunk] = _of_chunk(f, numbers, vertices[chunk], first, round_off[chunk], most)
    return bounds


def _of_chunk(
    f: Samples,
    numbers: np.ndarray,
    vertices: np.ndarray,
    pieces: Pieces,
    round_off: np.ndarray,
    most: int,
) -> np.ndarray:
    """Bound a function on the simplices of a chunk, see :func:`upper_bounds`.

    The function knows them by ``numbers``, shape (s,).
    """
    count = len(vertices)
    simplex = pieces.simplex - numbers[0]
    corners = pieces.corners
    highest = np.full(count, -np.inf)
    lowest = np.full(count, np.inf)
    bound = np.full(count, -np.inf)
    inherited = np.zeros(len(simplex))
    inherited_at_jump = np.zeros(len(simplex))
    left = np.full(count, most)

    def values_at(simplex: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return f(numbers[simplex], places, x)

    for turn in range(PEAK_ROUNDS + 1):
        found = _on_pieces(values_at, vertices, simplex, corners, inherited)
        at_jump = np.maximum(JUMP_RISE * found.at_jump, inherited_at_jump)
        is_jump = np.isfinite(at_jump)
        share_of_range = SMOOTH_RISE * (found.greatest - found.least)
        smooth = found.roughness <= share_of_range
        peak = found.greatest + share_of_range + found.roughness
        # The tolerance follows the range of all samples of the simplex so far.
        np.maximum.at(highest, simplex, found.greatest)
        np.minimum.at(lowest, simplex, found.least)
        share = np.where(smooth, SMOOTH_TOLERANCE, ROUGH_TOLERANCE)
        tolerance = np.maximum(share * (highest - lowest)[simplex], round_off[simplex])
        # A piece that cannot hold the peak, by more than the tolerance, is finished.
        goes_on = peak > highest[simplex] + tolerance
        bisected = np.bincount(simplex[goes_on], minlength=count)
        fits = bisected <= left
        left = np.where(fits, left - bisected, 0)
        rounds = np.where(is_jump, JUMP_ROUNDS, PEAK_ROUNDS)
        goes_on &= fits[simplex] & (turn < rounds)
        # The sides of a jump hide nothing where each of them is level. It is bisected
        # all the same, to find what is next to it.
        peak = np.minimum(peak, found.greatest + at_jump)
        np.maximum.at(bound, simplex[~goes_on], peak[~goes_on])
        if not goes_on.any():
            break
        inherits = np.where(is_jump, INHERITED_AT_JUMP * at_jump, 0.0)
        inherited_at_jump = np.repeat(inherits[goes_on], 2)
        simplex = simplex[goes_on]
        corners = bisect(corners[goes_on], vertices[simplex])
        simplex = np.repeat(simplex, 2)
        inherited = np.repeat(INHERITED_SHARE * found.roughness[goes_on], 2)
    return bound


class _Sampled(NamedTuple):
    """Hold what the samples on each piece tell, shape (n,) each.

    Attributes:
        greatest: The greatest sample.
        least: The least sample.
        roughness: The rise between the samples where the function is not smooth.
        at_jump: The greatest distance of a sample from the greatest or the least one,
            infinite where there is no jump.
    """

    greatest: np.ndarray
    least: np.ndarray
    roughness: np.ndarray
    at_jump: np.ndarray


def _on_pieces(
    f: Samples,
    vertices: np.ndarray,
    simplex: np.ndarray,
    corners: np.ndarray,
    inherited: np.ndarray,
) -> _Sampled:
    """Sample the function on each piece."""
    points, _, residual = piece_points(vertices.shape[1] - 1)
    greatest, least, at_jump, distance = np.empty((4, len(simplex)))
    for start in range(0, len(simplex), CHUNK_PIECES):
        chunk = slice(start, start + CHUNK_PIECES)
        places = np.matmul(points, corners[chunk])
        values = f(simplex[chunk], places, np.matmul(places, vertices[simplex[chunk]]))
        high = values.max(axis=1)
        low = values.min(axis=1)
        greatest[chunk] = high
        least[chunk] = low
        at_jump[chunk] = np.minimum(high[:, None] - values, values - low[:, None]).max(axis=1)
        distance[chunk] = abs(values @ residual.T).max(axis=1)
    span = greatest - least
    jumps = at_jump <= JUMP_SHARE * span
    roughness = CUSP_RISE * distance
    # A cusp that happens to look smooth in a piece did not in the piece around it.
    roughness = np.maximum(roughness, inherited)
    at_jump = np.where(jumps, at_jump, np.inf)
    return _Sampled(greatest, least, np.where(jumps, 0.0, roughness), at_jump)
