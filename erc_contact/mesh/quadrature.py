"""Integrals of data that are no polynomials, over cells and facets, with what is left unknown of them.

Each simplex (a cell, a facet) is cut into a few pieces. Where the integrand at the points of a piece, its boundary
included, is not near a polynomial of degree 4 (3 in tetrahedra), the piece is bisected, and so on: few pieces where the
integrand is smooth, many at a kink or a jump. The distances that are left at the end bound the error where the
integrand is resolved; where it is not, which is told, they are an estimate.

What is seen is what the points see: before any bisection these are 72 on a facet in 2D, 352 in 3D, and 66 in a cell in
2D, 136 in 3D. A feature that falls between them all, and does not show at the nearest ones, is missed.

Symbols: d' dimension of the simplices, P = d'+1 their vertices, n pieces, q points, m integrands.
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
"""What an integral may leave unknown to count as known, of itself [-]."""
SMOOTH = (0, 4, 4, 3)
"""Degree of the polynomials that a smooth integrand is near to, for each d'."""
LATTICE = (0, 4, 3, 2)
"""Subdivisions of an edge of a piece for the points that see its boundary, for each d'."""
INSIDE = 1e-6
"""How far inside a piece these points are [-]: data may jump from cell to cell."""
DEGREE = 6
"""Degree of the quadrature; its points see the inside."""
ROUNDS = (0, 40, 20, 15)
"""Bisections of a piece at most, for each d'."""
PATIENCE = 6
"""Bisections after which it is given up where two of them leave more than GAIN of what was unknown, d' > 1: a jump."""
GAIN = 0.4
BUDGET = (0, 50_000, 50_000, 20_000)
"""Pieces of all ranks that may be bisected in one round beyond those of the beginning, for each d'."""
CHUNK = 1024
"""Pieces that are worked on at once: what stays in the cache."""

Integrand = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Values (n, q, m) from the simplices of pieces (n,), points in barycentric (n, q, P) and in true coordinates."""


@dataclass(frozen=True, eq=False)
class Integral:
    """Integrals over simplices.

    Attributes:
        value: For each simplex and integrand, shape (simplices, m).
        rest: About the most by which they may be wrong, of the same shape.
        resolved: Whether the sum of what is left, over all ranks, is below what was asked for, shape (m,).
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
    """Integrate over simplices, bisecting where two rules differ; collective.

    Args:
        comm: Communicator.
        f: The integrands.
        vertices: Vertices of the simplices [length], shape (simplices, P, d).
        measure: Their lengths, areas or volumes, shape (simplices,); 0 to leave one out.
        pieces: The pieces that each is cut into at first, of one size, shape (c, P, P): the barycentric coordinates of
            the corners of each; of :func:`facet_pieces` or
            :func:`cell_pieces`.
        share: What may be left unknown of each integral, of the sum of the absolute values of all pieces [-].
        floor: What may be left unknown of each integral at least, whatever it is.

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
        excess.append(float(np.divide(total, most, out=1e300 * np.sign(total), where=most > 0).max(initial=0.0)))
        hopeless = size > 1 and turn >= PATIENCE and excess[-1] > GAIN * excess[-3]
        last = excess[-1] <= 1 or not left or left > begun + BUDGET[size] or turn == ROUNDS[size] or hopeless
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
    """The integrals over pieces, and twice the mean distances from a polynomial times the size, each of shape (n, m).

    At 3000 random jumps, points, lines and planes, the latter were on average 3 to 10 times the error, in one of a
    hundred pieces below it; sums of pieces were above it.
    """
    points, weights, residual = _points(vertices.shape[1] - 1)
    parts = []
    for start in range(0, max(len(of), 1), CHUNK):  # once also where a rank has no pieces: it learns m
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
    """Barycentric points of a piece (q, P), weights (q,), and the matrix (q, q) from values to what is not smooth."""
    inner, weights = rule(size, DEGREE)
    outer = (1 - INSIDE) * lattice(size, LATTICE[size]) + INSIDE / (size + 1)
    points = np.vstack([inner, outer])
    smooth = basix.tabulate_polynomials(basix.PolynomialType.legendre, CELLS[size], SMOOTH[size], points).T
    residual = np.eye(len(points)) - smooth @ np.linalg.pinv(smooth)
    return barycentric(points), np.concatenate([weights, np.zeros(len(outer))]), residual


def bisected(corners: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Halves of pieces, cut at the middle of the longest edge, one after the other: (n, P, P) -> (2n, P, P).

    Args:
        corners: Barycentric coordinates of the corners.
        vertices: Vertices of the simplices that they belong to, shape (n, P, d).
    """
    pairs = np.array(list(combinations(range(corners.shape[1]), 2)))
    x = np.matmul(corners, vertices)
    lengths = np.linalg.norm(x[:, pairs[:, 0]] - x[:, pairs[:, 1]], axis=2)
    a, b = pairs[(lengths > 0.999 * lengths.max(axis=1, initial=0.0)[:, None]).argmax(axis=1)].T
    every = np.arange(len(corners))
    middle = 0.5 * (corners[every, a] + corners[every, b])
    halves = np.repeat(corners, 2, axis=0)
    halves[2 * every, a] = halves[2 * every + 1, b] = middle
    return halves


@cache
def facet_pieces(size: int) -> np.ndarray:
    """The pieces that a facet is cut into at first: 8 of a segment, 16 of a triangle, (c, P, P).

    They are alike at all vertices, whose order depends on the number of ranks.
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
    """The pieces that a cell is cut into at first, those of sigma^: vertex i is replaced by the barycentre."""
    corners = np.repeat(np.eye(size + 1)[None], size + 1, axis=0)
    corners[np.arange(size + 1), np.arange(size + 1)] = 1 / (size + 1)
    return corners


def polynomials(degree: int, at: np.ndarray) -> np.ndarray:
    """Bernstein polynomials at barycentric points (n, q, P), shape (n, q, N)."""
    n, q, P = at.shape
    values = bernstein(P - 1, degree, at.reshape(n * q, P)[:, 1:])
    return values.reshape(n, q, values.shape[1])
