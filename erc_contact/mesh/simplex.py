"""Tables of the reference simplex, for any dimension and degree.

The order of the nodes is DOLFINx's: the vertices, then the edges. Polynomials are given
by their Bernstein coefficients. There is one for each node; at a vertex it is the value
of the polynomial. The values lie in the convex hull of the coefficients. So if all
coefficients have a sign, lie in a cone or do not exceed a gap, the same holds for the
values at every point. All Bernstein polynomials of a degree have the same integral. For
degree 1 coefficients are the values at the nodes.

Symbols: d dimension, k degree, N number of nodes of a cell, m number of nodes of a
facet, q number of points. A facet is a simplex of dimension d-1, so tables of facets
are those of d-1.
"""

from __future__ import annotations

from functools import cache
from math import factorial

import basix
import numpy as np

CELLS = (
    basix.CellType.point,
    basix.CellType.interval,
    basix.CellType.triangle,
    basix.CellType.tetrahedron,
)
"""The reference simplex of each dimension."""


def facet_vertices(d: int) -> np.ndarray:
    """Local vertices of each local facet of a simplex (facet i is opposite to vertex i), shape (d+1, d)."""
    return np.array([[j for j in range(d + 1) if j != i] for i in range(d + 1)])


def in_space(x: np.ndarray) -> np.ndarray:
    """Points or vectors (n, d) with three components, as gmsh, DOLFINx and VTK want them, shape (n, 3)."""
    return np.pad(x, ((0, 0), (0, 3 - x.shape[1])))


def barycentric(points: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of reference points, shape (q, d) -> (q, d+1)."""
    return np.column_stack([1 - points.sum(axis=1), points])


def edges(d: int) -> np.ndarray:
    """Vertices of the edges, in the order of their nodes, shape (e, 2)."""
    return np.array(basix.topology(CELLS[d])[1])


@cache
def node_between(d: int, k: int) -> np.ndarray:
    """Node of each pair of vertices, on the edge between them or at the vertex, shape (d+1, d+1)."""
    number = np.full((d + 1, d + 1), -1)
    np.fill_diagonal(number, np.arange(d + 1))
    if k == 2:
        a, b = edges(d).T
        number[a, b] = number[b, a] = d + 1 + np.arange(len(a))
    return number


@cache
def node_vertices(d: int, k: int) -> np.ndarray:
    """The two vertices of the edge of each node, shape (N, 2); for a node at a vertex, this vertex twice."""
    own = np.repeat(np.arange(d + 1)[:, None], 2, axis=1)
    return own if k == 1 else np.vstack([own, edges(d)])


@cache
def local_facet_nodes(d: int, k: int) -> np.ndarray:
    """Local nodes of each local facet of the reference simplex, in the order of a facet's nodes, shape (d+1, m)."""
    pairs = facet_vertices(d)[:, node_vertices(d - 1, k)]
    return node_between(d, k)[pairs[..., 0], pairs[..., 1]]


@cache
def nodes(d: int, k: int) -> np.ndarray:
    """Reference points of the nodes, shape (N, d)."""
    return (
        np.vstack([np.zeros(d), np.eye(d)])[node_vertices(d, k)].mean(axis=1)
        if k
        else np.full((1, d), 1 / (d + 1))
    )


def bernstein(d: int, k: int, points: np.ndarray) -> np.ndarray:
    """Bernstein polynomials at reference points, shape (q, N)."""
    if k == 0:
        return np.ones((len(points), 1))
    a, b = node_vertices(d, k).T
    at = barycentric(points)
    return at[:, a] if k == 1 else at[:, a] * at[:, b] * np.where(a == b, 1.0, 2.0)


@cache
def at_nodes(d: int, k: int) -> np.ndarray:
    """Matrix (N, N) from Bernstein coefficients to values at the nodes."""
    return bernstein(d, k, nodes(d, k))


@cache
def coefficients(d: int, k: int) -> np.ndarray:
    """Matrix (N, N) from values at the nodes to Bernstein coefficients."""
    return np.linalg.inv(at_nodes(d, k))


def lagrange(d: int, k: int, points: np.ndarray) -> np.ndarray:
    """Shape functions of the nodes at reference points, shape (q, N)."""
    return bernstein(d, k, points) @ coefficients(d, k)


@cache
def rule(d: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (q, d) and weights (q,) of a quadrature. The weights have sum 1; permuted vertices permute the points."""
    points, weights = basix.make_quadrature(CELLS[d], degree)
    return points, weights / weights.sum()


@cache
def mass(d: int, k: int, l: int) -> np.ndarray:  # noqa: E741
    """Means of products of Bernstein polynomials of degrees k and l, shape (N_k, N_l)."""
    points, weights = rule(d, k + l)
    return bernstein(d, k, points).T @ (weights[:, None] * bernstein(d, l, points))


@cache
def _inverse_mass(d: int, k: int) -> np.ndarray:
    return np.linalg.inv(mass(d, k, k))


def from_means(d: int, k: int, means: np.ndarray) -> np.ndarray:
    """Bernstein coefficients of the polynomial with given means against the Bernstein polynomials.

    This is the L2 projection on degree k of any function that has these means.

    Args:
        d: Dimension.
        k: Degree.
        means: Shape (..., N, c) for c components.
    """
    return np.matmul(_inverse_mass(d, k), means)


def projection(d: int, k: int, points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Bernstein coefficients of the L2 projection on degree k from values at the points of a rule, shape (N, q)."""
    return from_means(d, k, bernstein(d, k, points).T * weights)


def averages(d: int, k: int, points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted means ``int f B / int B`` for each Bernstein polynomial B, from values at the points, shape (N, q).

    Such means lie in the convex hull of the values.
    """
    shape = bernstein(d, k, points)
    return shape.T * weights / (weights @ shape)[:, None]


def measures(corners: np.ndarray) -> np.ndarray:
    """Lengths, areas or volumes of simplices with corners of shape (..., p+1, d), p <= d; shape (...)."""
    edges = corners[..., 1:, :] - corners[..., :1, :]
    p, d = edges.shape[-2:]
    square = edges if p == d else edges @ edges.swapaxes(-1, -2)
    size = abs(np.linalg.det(square))
    return (size if p == d else np.sqrt(size)) / factorial(p)


@cache
def gradients(d: int, k: int) -> np.ndarray:
    """Derivatives ``d/d lambda_j`` of Bernstein polynomials of degree k, as coefficients of degree k-1.

    The barycentric coordinates are independent variables here. With their gradients,
    ``grad B_v`` is the sum over j of these derivatives times ``grad lambda_j``.

    Returns:
        Shape (N_(k-1), d+1, N_k): coefficient, j, v.
    """
    table = np.zeros((len(nodes(d, k - 1)), d + 1, len(nodes(d, k))))
    for v, (a, b) in enumerate(node_vertices(d, k)):
        for one, other in (
            (a, b),
            (b, a),
        ):  # B = 1 for k = 1, (1 + [a != b]) lambda_a lambda_b for k = 2
            if k == 1:
                table[0, a, v] = 1.0
            else:
                table[other, one, v] += 1.0 if a == b else 2.0
    return table


def lattice(d: int, divisions: int) -> np.ndarray:
    """Reference points of a regular lattice, the boundary included, shape (q, d)."""
    return basix.create_lattice(CELLS[d], divisions, basix.LatticeType.equispaced, True)
