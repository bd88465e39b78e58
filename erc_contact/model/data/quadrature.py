"""Integrate data that are not polynomials over cells and facets, with error bounds.

Each simplex (a cell or a facet) is cut into a few pieces. The integrand is evaluated at
points inside a piece and near its boundary, and compared with a polynomial of degree 4,
which squares of stresses of degree 2 are. If it is not near one, the piece is bisected.
So there are few pieces where the integrand is smooth, and many at a kink or a jump. If
they would be more than a mesh can afford (:class:`erc_contact.model.space.Space`), so
many are bisected that leave most unknown. The result tells whether the integrand is
resolved. If it is, the distances from the polynomials bound the error; otherwise they
estimate it.

Only the values at the points are known, unless the caller bounds what integrands do
between them (:data:`Hidden`). Before any bisection there are 72 points on a facet in 2D
and 352 in 3D, and 66 points in a cell in 2D and 236 in 3D, or 22 and 59 in a whole
cell. A feature that changes no value at these points is missed without such a bound.

Symbols: d' dimension of the simplices, v = d'+1 number of their vertices, n pieces, q
points, i integrands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import NamedTuple

import basix
import numpy as np
from mpi4py import MPI

from namedmesh.simplex import CELLS, barycentric, bernstein_at, lattice, rule

UNKNOWN_SHARE = 1e-8
"""Share of an integral that may stay unknown by default [-]."""
ROUND_OFF = 1e-12
"""Component of a vector that is round-off beside the others [-].

A load that is linear along a side has components across it of that size.
"""
FIT_DEGREE = (0, 4, 4, 4)
"""Degree of the polynomials with which the integrand is compared, for each d'."""
LATTICE_PARTS = (0, 4, 3, 4)
"""Number of parts of an edge between the points near the boundary, for each d'.

With the points of the quadrature they determine the polynomial.
"""
INSET = 1e-6
"""Distance of these points from the boundary [-].

They do not lie on it, as data may jump from cell to cell.
"""
RULE_DEGREE = 6
"""Degree of the quadrature, whose points are inside a piece."""
BISECTION_ROUNDS = 40
"""Limit of the bisections of a piece."""
MOST_POINTS = 1_000_000
"""Number of points of all ranks at which integrands are evaluated, by default.

A jump in d' > 1 dimensions takes any number.
"""
TIE_DIRECTION = np.array([1.0, 1.618, 0.733])
"""A direction along which the middles of edges hardly ever lie at the same place."""
EQUAL = 0.999
"""Share of the longest edge from which on an edge counts as long as it [-]."""
CHUNK_PIECES = 1024
"""Number of pieces that are worked on at once. Their arrays stay in the cache."""

LEFT_IN_A_ROUND = 0.1
"""Share of what is still allowed that the pieces of a round may leave [-].

What they do not leave is for the pieces of later rounds.
"""
CLASSES = 60
"""Number of powers of two below the worst piece that are told apart."""

INSIDE_CLASS = 0.7
"""Place of the worst piece in its class: classes end at powers of two."""

Integrand = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""A function that returns the values of i integrands at q points of n pieces, shape (n,
q, i). It gets the number of the simplex of each piece, shape (n,), and the points in
barycentric coordinates, shape (n, q, v), and in true coordinates [length], shape (n, q,
d).
"""
Hidden = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""A function that bounds what integrands may do between the points of pieces, as a mean
over each piece, shape (n, i). It gets what an :data:`Integrand` gets, after the corners
of the pieces in true coordinates [length], shape (n, v, d), as second argument.
"""
SAME_PLACE = 1e-9
"""Difference of places on a segment that counts as none, over its length [-]."""


@dataclass(frozen=True, eq=False)
class Integral:
    """Hold integrals over simplices.

    Attributes:
        value: The integrals, shape (simplices, i).
        bound: Bounds of their errors if the integrand is resolved, else estimates, of
            the same shape; of vectors times functions the sums over the functions.
        resolved: Whether the sum of ``bound`` over all ranks is as small as was asked
            for, for each column of it.
    """

    value: np.ndarray
    bound: np.ndarray
    resolved: np.ndarray


def integrate(
    comm: MPI.Comm,
    f: Integrand,
    vertices: np.ndarray,
    measure: np.ndarray,
    pieces: np.ndarray,
    *,
    share: float | np.ndarray = UNKNOWN_SHARE,
    floor: float | np.ndarray = 0.0,
    components: int | None = None,
    cuts: Cuts | None = None,
    hidden: Hidden | None = None,
    owned: np.ndarray | None = None,
    most: int = MOST_POINTS,
) -> Integral:
    """Integrate over simplices, with bisections where needed; collective.

    They are needed where the integrand is not near a polynomial, and end where it is,
    or with the number of points at which it may be evaluated.

    Args:
        comm: Communicator.
        f: The integrands.
        vertices: Vertices of the simplices [length], shape (simplices, v, d).
        measure: Their lengths, areas or volumes, shape (simplices,). Simplices of
            measure 0 are left out.
        pieces: The first pieces of each simplex, of equal size, from
            :func:`facet_pieces`, :func:`cell_pieces` or :func:`whole`: barycentric
            coordinates of their corners, shape (c, v, v).
        share: Share of each integral that may stay unknown, relative to the sum of the
            absolute values of the integrals over all pieces [-].
        floor: Amount of each integral that may always stay unknown.
        components: Number of components, if the integrands are vectors times some
            functions, in this order: then what is unknown is summed over the functions,
            and what is round-off beside the other components may stay unknown.
        cuts: Kinks of the integrands that are known, on segments; None without.
        hidden: What integrands may do between the points; it is unknown, too.
        owned: Whether this rank owns each simplex, shape (simplices,); None where it
            owns all. On all its ranks a simplex is cut into the same pieces.
        most: Number of points of all ranks at which integrands may be evaluated; the
            first pieces are evaluated in any case.

    Example:
        >>> kink = lambda simplex, places, x: abs(x - 0.3)
        >>> segment = np.array([[[0.0], [1.0]]])
        >>> result = integrate(block.comm, kink, segment, np.ones(1), facet_pieces(1))
        >>> round(float(result.value[0, 0]), 6)  # (0.3^2 + 0.7^2)/2
        0.29
    """
    size = vertices.shape[1] - 1
    first = first_pieces(np.flatnonzero(measure > 0), pieces, cuts)
    simplex = first.simplex
    corners = first.corners
    piece_measure = measure[simplex] * first.share
    owned = np.ones(len(vertices), dtype=bool) if owned is None else owned
    most_pieces = most // len(piece_points(size).points)
    most_pieces -= comm.allreduce(int(owned[simplex].sum()), MPI.SUM)
    value = unknown = allowed = np.zeros((len(vertices), 0))
    for turn in range(BISECTION_ROUNDS + 1):
        piece_value, piece_unknown = _on_pieces(
            f, vertices, simplex, corners, piece_measure, hidden
        )
        # The order of the functions may depend on the number of ranks, sums do not.
        piece_unknown = _summed(piece_unknown, components)
        counts = owned[simplex]
        if turn == 0:
            # The first evaluation tells the number of integrands, and their size.
            value = np.zeros((len(vertices), piece_value.shape[1]))
            unknown = np.zeros((len(vertices), piece_unknown.shape[1]))
            sizes = _summed(abs(piece_value[counts]), components)
            size_of_integrals = comm.allreduce(sizes.sum(axis=0), MPI.SUM)
            allowed = np.maximum(share * size_of_integrals, floor)
            if components is not None:
                allowed = np.maximum(allowed, ROUND_OFF * size_of_integrals.sum())
        sums = np.stack([unknown[owned].sum(axis=0), piece_unknown[counts].sum(axis=0)])
        of_done, of_pieces = comm.allreduce(sums, MPI.SUM)
        left = LEFT_IN_A_ROUND * (allowed - of_done)
        bad, bad_count = _worst(comm, piece_unknown, counts, left, most_pieces // 2)
        # All ranks decide alike, as they know the same numbers.
        resolved = (of_done + of_pieces <= allowed).all()
        last = not bad_count or resolved or turn == BISECTION_ROUNDS
        done = np.ones_like(bad) if last else ~bad
        np.add.at(value, simplex[done], piece_value[done])
        np.add.at(unknown, simplex[done], piece_unknown[done])
        if last:
            break
        most_pieces -= 2 * bad_count
        corners = bisect(corners[bad], vertices[simplex[bad]])
        simplex = np.repeat(simplex[bad], 2)
        piece_measure = np.repeat(piece_measure[bad] / 2, 2)
    total_unknown = comm.allreduce(unknown[owned].sum(axis=0), MPI.SUM)
    return Integral(value, unknown, total_unknown <= allowed)


def _summed(values: np.ndarray, components: int | None) -> np.ndarray:
    """Sum integrands (n, i) that are vectors times functions over these, (n, c)."""
    if components is None:
        return values
    functions = values.shape[1] // components
    return np.asarray(values.reshape(len(values), functions, components).sum(axis=1))


def _worst(
    comm: MPI.Comm, unknown: np.ndarray, counts: np.ndarray, allowed: np.ndarray, most: int
) -> tuple[np.ndarray, int]:
    """Tell which pieces leave too much unknown; collective.

    They are so few that the other pieces just leave what is allowed: what is unknown
    lies in few pieces, at kinks and jumps. If they are too many, they are the worst.

    Args:
        comm: Communicator.
        unknown: What is unknown in the pieces of this rank, shape (n, i).
        counts: Whether a piece counts on this rank, shape (n,).
        allowed: What may stay unknown in the other pieces of all ranks, shape (i,).
        most: Greatest number of these pieces on all ranks.

    Returns:
        Which they are, shape (n,), and their number on all ranks.
    """
    greatest = np.max(comm.allgather(unknown.max(axis=0, initial=0.0)), axis=0)
    # A class of pieces leaves the same power of two of what the worst one leaves. What
    # pieces leave are often powers of two of each other, which are no ends of a class.
    shares = np.divide(unknown, greatest, out=np.zeros_like(unknown), where=greatest > 0.0)
    shares *= INSIDE_CLASS
    _, powers = np.frexp(shares)
    classes = np.clip(powers + CLASSES, 0, CLASSES)
    classes[unknown == 0.0] = 0
    sums = np.zeros((CLASSES + 1, unknown.shape[1]))
    for i in range(unknown.shape[1]):
        sums[:, i] = np.bincount(classes[counts, i], unknown[counts, i], CLASSES + 1)
    up_to = np.cumsum(comm.allreduce(sums, MPI.SUM), axis=0)
    first_bad = np.count_nonzero(up_to <= np.maximum(allowed, 0.0), axis=0)
    # Levels are classes from the first bad one on. The worst integrand counts.
    level = np.maximum((classes - first_bad + 1).max(axis=1, initial=0), 0)
    of_level = comm.allreduce(np.bincount(level[counts], minlength=CLASSES + 2), MPI.SUM)
    from_level = np.append(np.cumsum(of_level[::-1])[::-1], 0)
    least = 1 + int(np.argmax(from_level[1:] <= max(most, 0)))
    return level >= least, int(from_level[least])


def _on_pieces(
    f: Integrand,
    vertices: np.ndarray,
    simplex: np.ndarray,
    corners: np.ndarray,
    piece_measure: np.ndarray,
    hidden: Hidden | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute integrals over pieces and what is unknown of them, each (n, i).

    Unknown is twice the mean distance from a polynomial times the size of the piece.
    For 3000 random jumps at points, lines and planes this was on average 3 to 10 times
    the error. It was below the error in one of a hundred pieces, but its sum over the
    pieces was above.
    """
    points, weights, residual = piece_points(vertices.shape[1] - 1)
    chunks = []
    # A rank without pieces does this once, to know the number of integrands.
    for start in range(0, max(len(simplex), 1), CHUNK_PIECES):
        chunk = slice(start, start + CHUNK_PIECES)
        places = np.matmul(points, corners[chunk])
        of_simplex = vertices[simplex[chunk]]
        x = np.matmul(places, of_simplex)
        # With the points last it is one large product, and not a small one a piece.
        values = np.ascontiguousarray(f(simplex[chunk], places, x).swapaxes(1, 2))
        mean = values @ weights
        distance = values.reshape(-1, len(weights)) @ residual.T
        unknown = 2 * abs(distance).mean(axis=1).reshape(mean.shape)
        if hidden is not None:
            unknown += hidden(simplex[chunk], np.matmul(corners[chunk], of_simplex), places, x)
        chunks.append(np.stack([mean, unknown]) * piece_measure[chunk, None])
    value, unknown = np.concatenate(chunks, axis=1)
    return value, unknown


class PiecePoints(NamedTuple):
    """Hold points of a piece, at which functions are sampled.

    Attributes:
        points: Barycentric coordinates, shape (q, v).
        weights: Weights of the quadrature, zero near the boundary, shape (q,).
        residual: Matrix that takes values at the points to their distances from the
            polynomial that is nearest to them, shape (q, q).
    """

    points: np.ndarray
    weights: np.ndarray
    residual: np.ndarray


@cache
def piece_points(size: int) -> PiecePoints:
    """Return points of a piece of a simplex of a dimension."""
    inner, weights = rule(size, RULE_DEGREE)
    outer = (1 - INSET) * lattice(size, LATTICE_PARTS[size]) + INSET / (size + 1)
    points = np.vstack([inner, outer])
    legendre = basix.PolynomialType.legendre
    fit = basix.tabulate_polynomials(legendre, CELLS[size], FIT_DEGREE[size], points).T
    residual = np.eye(len(points)) - fit @ np.linalg.pinv(fit)
    weights = np.concatenate([weights, np.zeros(len(outer))])
    return PiecePoints(barycentric(points), weights, residual)


def bisect(corners: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Cut pieces at the middle of their longest edge, (n, v, v) -> (2n, v, v).

    Rows 2i and 2i + 1 of the result are the halves of piece i. Of several longest edges
    the edge is cut whose middle is farthest along :data:`TIE_DIRECTION`. So the order
    of the vertices, which depends on the number of ranks, does not matter.

    Args:
        corners: Barycentric coordinates of the corners.
        vertices: Vertices of the simplices that they belong to, shape (n, v, d).
    """
    pairs = np.array(list(combinations(range(corners.shape[1]), 2)))
    x = np.matmul(corners, vertices)
    lengths = np.linalg.norm(x[:, pairs[:, 0]] - x[:, pairs[:, 1]], axis=2)
    longest = lengths > EQUAL * lengths.max(axis=1, initial=0.0)[:, None]
    place = (x[:, pairs[:, 0]] + x[:, pairs[:, 1]]) @ TIE_DIRECTION[: x.shape[2]]
    a, b = pairs[np.where(longest, place, -np.inf).argmax(axis=1)].T
    piece = np.arange(len(corners))
    middle = 0.5 * (corners[piece, a] + corners[piece, b])
    # The middle replaces one end of the edge in each half.
    halves = np.repeat(corners, 2, axis=0)
    halves[2 * piece, a] = middle
    halves[2 * piece + 1, b] = middle
    return halves


@cache
def facet_pieces(size: int) -> np.ndarray:
    """Return the first pieces of a facet, shape (c, v, v).

    There are 8 of a segment and 16 of a triangle. They do not depend on the order of
    the vertices, which depends on the number of ranks.
    """
    corners = np.eye(size + 1)[None]
    for _ in range((0, 3, 2)[size]):
        # Middle i lies between the corners i and i + 1.
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        if size == 1:
            halves = [[corners[:, 0], middles[:, 0]], [middles[:, 0], corners[:, 1]]]
            corners = _join(halves)
        else:
            outer = [[corners[:, i], middles[:, i], middles[:, i - 1]] for i in range(3)]
            inner = [middles[:, i] for i in range(3)]
            corners = _join([*outer, inner])
    return corners


def _join(parts: list[list[np.ndarray]]) -> np.ndarray:
    """Join pieces given part by part and corner by corner in an array (n, v, v)."""
    return np.concatenate([np.stack(part, axis=1) for part in parts])


@cache
def cell_pieces(size: int) -> np.ndarray:
    """Return the first pieces of a cell, the sub-simplices of sigma^, shape (v, v, v).

    In piece i the barycentre of the cell replaces vertex i.
    """
    corners = np.repeat(np.eye(size + 1)[None], size + 1, axis=0)
    corners[np.arange(size + 1), np.arange(size + 1)] = 1 / (size + 1)
    return corners


@cache
def whole(size: int) -> np.ndarray:
    """Return a simplex as its only piece, shape (1, v, v)."""
    return np.eye(size + 1)[None]


def polynomials(degree: int, points: np.ndarray) -> np.ndarray:
    """Evaluate Bernstein polynomials at barycentric points, shape (n, q, N)."""
    return bernstein_at(degree, points)


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
    # A kink at a vertex cuts nothing.
    inside = np.isin(cuts.simplex, simplices)
    inside &= (cuts.place > SAME_PLACE) & (cuts.place < 1.0 - SAME_PLACE)
    simplex = np.concatenate([np.repeat(simplices, len(ends)), cuts.simplex[inside]])
    place = np.concatenate([np.tile(ends, len(simplices)), cuts.place[inside]])
    order = np.lexsort((place, simplex))
    simplex = simplex[order]
    place = place[order]
    # Between two neighbours of the same segment is a piece, unless they are one place.
    follows = np.zeros(len(simplex), dtype=bool)
    follows[1:] = (simplex[1:] == simplex[:-1]) & (np.diff(place) < SAME_PLACE)
    simplex = simplex[~follows]
    place = place[~follows]
    has_next = simplex[1:] == simplex[:-1]
    low = place[:-1][has_next]
    high = place[1:][has_next]
    corners = np.stack([np.stack([1 - low, low], 1), np.stack([1 - high, high], 1)], axis=1)
    return Pieces(simplex[:-1][has_next], corners, high - low)
