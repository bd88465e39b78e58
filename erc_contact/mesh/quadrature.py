"""Integrals over cells and facets of data that are not polynomials, with bounds of their errors.

Each simplex (a cell or a facet) is cut into a few pieces. The integrand is evaluated at
points inside a piece and near its boundary, and compared with a polynomial of degree 4
(3 in tetrahedra). If it is not near one, the piece is bisected. So there are few pieces
where the integrand is smooth, and many at a kink or a jump. The result tells whether
the integrand is resolved. If it is, the distances from the polynomials bound the error;
otherwise they estimate it.

Only the values at the points are known. Before any bisection there are 72 points on a
facet in 2D and 352 in 3D, and 66 points in a cell in 2D and 136 in 3D. A feature that
changes no value at these points is missed.

Symbols: d' dimension of the simplices, P = d'+1 number of their vertices, n pieces, q
points, m integrands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import basix
import numpy as np
from mpi4py import MPI

from erc_contact.mesh.simplex import CELLS, barycentric, bernstein, lattice, rule

SHARE = 1e-8
"""Share of an integral that may stay unknown by default [-]."""
SMOOTH = (0, 4, 4, 3)
"""Degree of the polynomials with which the integrand is compared, for each d'."""
LATTICE = (0, 4, 3, 2)
"""Number of parts of an edge of a piece between the points near its boundary, for each d'."""
INSIDE = 1e-6
"""Distance of these points from the boundary [-]. They do not lie on it, as data may jump from cell to cell."""
DEGREE = 6
"""Degree of the quadrature, whose points are inside a piece."""
ROUNDS = (0, 40, 20, 15)
"""Limit of the bisections of a piece, for each d'."""
PATIENCE = 6
"""From this bisection on they end as soon as the last two left more than GAIN of what
was unknown. This is for jumps in d' > 1 dimensions, which cannot be resolved."""
GAIN = 0.4
"""See PATIENCE [-]."""
BUDGET = (0, 50_000, 50_000, 20_000)
"""Number of pieces on all ranks that may be bisected in one round, beyond the number of first pieces, for each d'."""
ALONG = np.array([1.0, 1.618, 0.733])
"""A direction in which the middles of the edges of a piece hardly ever lie at the same place."""
CHUNK = 1024
"""Number of pieces that are worked on at once. Their arrays stay in the cache."""

Integrand = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""A function that returns the values of m integrands at q points of n pieces, shape (n,
q, m). It gets the number of the simplex of each piece, shape (n,), and the points in
barycentric coordinates, shape (n, q, P), and in true coordinates [length], shape (n, q,
d).
"""


@dataclass(frozen=True, eq=False)
class Integral:
    """Integrals over simplices.

    Attributes:
        value: The integrals, shape (simplices, m).
        rest: Bounds of their errors if the integrand is resolved, else estimates, of
            the same shape.
        resolved: Whether the sum of ``rest`` over all ranks is as small as was asked
            for, shape (m,).
    """

    value: np.ndarray
    rest: np.ndarray
    resolved: np.ndarray


def integrate(
    comm: MPI.Comm,
    f: Integrand,
    vertices: np.ndarray,
    measure: np.ndarray,
    pieces: np.ndarray,
    *,
    share: float | np.ndarray = SHARE,
    floor: float | np.ndarray = 0.0,
) -> Integral:
    """Integrate over simplices, with bisections where the integrand is not near a polynomial; collective.

    Args:
        comm: Communicator.
        f: The integrands.
        vertices: Vertices of the simplices [length], shape (simplices, P, d).
        measure: Their lengths, areas or volumes, shape (simplices,). Simplices of
            measure 0 are left out.
        pieces: The first pieces of each simplex, of equal size, from
            :func:`facet_pieces` or :func:`cell_pieces`: barycentric coordinates of
            their corners, shape (c, P, P).
        share: Share of each integral that may stay unknown, relative to the sum of the
            absolute values of the integrals over all pieces [-].
        floor: Amount of each integral that may always stay unknown.

    Returns:
        The integrals.
    """
    size = vertices.shape[1] - 1
    of = np.repeat(np.flatnonzero(measure > 0), len(pieces))
    corners = np.tile(pieces, (len(of) // len(pieces), 1, 1))
    part = measure[of] / len(pieces)
    value = rest = most = np.zeros((len(vertices), 0))
    begun = count = comm.allreduce(len(of), MPI.SUM)
    excess: list[float] = []
    for turn in range(ROUNDS[size] + 1):
        found, unknown = _on_pieces(f, vertices, of, corners, part)
        if turn == 0:
            value, rest = (np.zeros((len(vertices), found.shape[1])) for _ in range(2))
            most = np.maximum(share * comm.allreduce(abs(found).sum(axis=0), MPI.SUM), floor)
        bad = ~np.all(unknown <= 0.1 * most / max(count, 1), axis=1)
        left = comm.allreduce(int(bad.sum()), MPI.SUM)
        total = comm.allreduce(rest.sum(axis=0) + unknown.sum(axis=0), MPI.SUM)
        excess.append(
            float(
                np.divide(total, most, out=1e300 * np.sign(total), where=most > 0).max(initial=0.0)
            )
        )
        hopeless = size > 1 and turn >= PATIENCE and excess[-1] > GAIN * excess[-3]
        last = (
            excess[-1] <= 1
            or not left
            or left > begun + BUDGET[size]
            or turn == ROUNDS[size]
            or hopeless
        )
        done = np.ones_like(bad) if last else ~bad
        np.add.at(value, of[done], found[done])
        np.add.at(rest, of[done], unknown[done])
        if last:
            break
        of, part, count = np.repeat(of[bad], 2), np.repeat(part[bad] / 2, 2), count + left
        corners = bisected(corners[bad], vertices[of[::2]])
    return Integral(value, rest, comm.allreduce(rest.sum(axis=0), MPI.SUM) <= most)


def _on_pieces(
    f: Integrand, vertices: np.ndarray, of: np.ndarray, corners: np.ndarray, part: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The integrals over pieces, and what is unknown of them, each of shape (n, m).

    Unknown is twice the mean distance from a polynomial times the size of the piece.
    For 3000 random jumps at points, lines and planes this was on average 3 to 10 times
    the error. It was below the error in one of a hundred pieces, but its sum over the
    pieces was above.
    """
    points, weights, residual = _points(vertices.shape[1] - 1)
    parts = []
    for start in range(
        0, max(len(of), 1), CHUNK
    ):  # a rank without pieces does this once, to know m
        some = slice(start, start + CHUNK)
        places = np.matmul(points, corners[some])
        values = f(of[some], places, np.matmul(places, vertices[of[some]]))
        found = np.tensordot(values, weights, axes=(1, 0))
        unknown = 2 * abs(np.matmul(residual, values)).mean(axis=1)
        parts.append(np.stack([found, unknown]) * part[some, None])
    found, unknown = np.concatenate(parts, axis=1)
    return found, unknown


@cache
def _points(size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Barycentric points of a piece (q, P), weights (q,), matrix (q, q) from values to distances from polynomials."""
    inner, weights = rule(size, DEGREE)
    outer = (1 - INSIDE) * lattice(size, LATTICE[size]) + INSIDE / (size + 1)
    points = np.vstack([inner, outer])
    smooth = basix.tabulate_polynomials(
        basix.PolynomialType.legendre, CELLS[size], SMOOTH[size], points
    ).T
    residual = np.eye(len(points)) - smooth @ np.linalg.pinv(smooth)
    return barycentric(points), np.concatenate([weights, np.zeros(len(outer))]), residual


def piece_samples(size: int) -> tuple[np.ndarray, np.ndarray]:
    """The samples of a piece, barycentric (q, P), and the matrix (q, q) from values to distances from polynomials."""
    points, _, residual = _points(size)
    return points, residual


def bisected(corners: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """The two halves of each piece, cut at the middle of its longest edge, (n, P, P) -> (2n, P, P).

    Of edges of equal length the one is cut whose middle comes last along :data:`ALONG`.
    So the order of the vertices, which depends on the number of ranks, does not matter.

    Args:
        corners: Barycentric coordinates of the corners.
        vertices: Vertices of the simplices that they belong to, shape (n, P, d).
    """
    pairs = np.array(list(combinations(range(corners.shape[1]), 2)))
    x = np.matmul(corners, vertices)
    lengths = np.linalg.norm(x[:, pairs[:, 0]] - x[:, pairs[:, 1]], axis=2)
    longest = lengths > 0.999 * lengths.max(axis=1, initial=0.0)[:, None]
    place = (x[:, pairs[:, 0]] + x[:, pairs[:, 1]]) @ ALONG[: x.shape[2]]
    a, b = pairs[np.where(longest, place, -np.inf).argmax(axis=1)].T
    every = np.arange(len(corners))
    middle = 0.5 * (corners[every, a] + corners[every, b])
    halves = np.repeat(corners, 2, axis=0)
    halves[2 * every, a] = halves[2 * every + 1, b] = middle
    return halves


@cache
def facet_pieces(size: int) -> np.ndarray:
    """The first pieces of a facet: 8 of a segment, 16 of a triangle, shape (c, P, P).

    They do not depend on the order of the vertices, which depends on the number of
    ranks.
    """
    corners = np.eye(size + 1)[None]
    for _ in range((0, 3, 2)[size]):
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        if size == 1:
            parts = [[corners[:, 0], middles[:, 0]], [middles[:, 0], corners[:, 1]]]
        else:
            parts = [[corners[:, i], middles[:, i], middles[:, i - 1]] for i in range(3)]
            parts.append([middles[:, i] for i in range(3)])
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
    return corners


@cache
def cell_pieces(size: int) -> np.ndarray:
    """The first pieces of a cell, the sub-simplices of sigma^, shape (P, P, P).

    In piece i the barycentre of the cell replaces vertex i.
    """
    corners = np.repeat(np.eye(size + 1)[None], size + 1, axis=0)
    corners[np.arange(size + 1), np.arange(size + 1)] = 1 / (size + 1)
    return corners


def polynomials(degree: int, at: np.ndarray) -> np.ndarray:
    """Bernstein polynomials at barycentric points (n, q, P), shape (n, q, N)."""
    n, q, P = at.shape
    values = bernstein(P - 1, degree, at.reshape(n * q, P)[:, 1:])
    return values.reshape(n, q, values.shape[1])
