"""Tabulate the reference simplex, for any dimension and degree.

The order of the nodes is DOLFINx's: the vertices, then the edges. Polynomials are given
by their Bernstein coefficients. There is one for each node; at a vertex it is the value
of the polynomial. The values lie in the convex hull of the coefficients. So if all
coefficients have a sign, lie in a cone or do not exceed a gap, the same holds for the
values at every point. All Bernstein polynomials of a degree have the same integral. For
degree 1 coefficients are the values at the nodes.

Symbols: d dimension, k degree, N number of nodes of a cell, m number of nodes of a
facet, q number of points. A facet is a simplex of dimension d-1, so tables of facets
are tables of dimension d-1.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations_with_replacement
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
    """Return the local vertices of each local facet of a simplex, shape (d+1, d).

    Facet i is opposite to vertex i.
    """
    facets = []
    for opposite in range(d + 1):
        facets.append([vertex for vertex in range(d + 1) if vertex != opposite])
    return np.array(facets)


def of_facets(table: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Take what belongs to the vertices of a facet from tables of cells.

    Args:
        table: Entries for the vertices of each cell, as points or places, shape (n,
            d+1, ...).
        facets: The local facet of each cell, shape (n,).

    Returns:
        Shape (n, d, ...).
    """
    vertices = facet_vertices(table.shape[1] - 1)[facets]
    return np.asarray(table[np.arange(len(table))[:, None], vertices])


def barycentric(points: np.ndarray) -> np.ndarray:
    """Compute barycentric coordinates of reference points, shape (q, d) -> (q, d+1)."""
    return np.column_stack([1 - points.sum(axis=1), points])


def edges(d: int) -> np.ndarray:
    """Return the vertices of the edges, in the order of their nodes, shape (e, 2)."""
    return np.array(basix.topology(CELLS[d])[1])


@cache
def node_between(d: int, k: int) -> np.ndarray:
    """Return the node of each pair of vertices, shape (d+1, d+1).

    It lies on the edge between them, or at the vertex that is given twice. There is
    none (-1) on the edges for degree 1.
    """
    number = np.full((d + 1, d + 1), -1)
    np.fill_diagonal(number, np.arange(d + 1))
    if k == 2:
        a, b = edges(d).T
        edge_nodes = d + 1 + np.arange(len(a))
        number[a, b] = edge_nodes
        number[b, a] = edge_nodes
    return number


@cache
def node_vertices(d: int, k: int) -> np.ndarray:
    """Return the two vertices of the edge of each node, shape (N, 2).

    A node at a vertex has this vertex twice.
    """
    at_vertices = np.repeat(np.arange(d + 1)[:, None], 2, axis=1)
    return at_vertices if k == 1 else np.vstack([at_vertices, edges(d)])


@cache
def local_facet_nodes(d: int, k: int) -> np.ndarray:
    """Return the local nodes of each local facet, shape (d+1, m).

    They are in the order of a facet's nodes.
    """
    pairs = facet_vertices(d)[:, node_vertices(d - 1, k)]
    return node_between(d, k)[pairs[..., 0], pairs[..., 1]]


@cache
def nodes(d: int, k: int) -> np.ndarray:
    """Return the reference points of the nodes, shape (N, d)."""
    if k == 0:
        return np.full((1, d), 1 / (d + 1))
    vertices = np.vstack([np.zeros(d), np.eye(d)])
    return vertices[node_vertices(d, k)].mean(axis=1)


def bernstein(d: int, k: int, points: np.ndarray) -> np.ndarray:
    """Evaluate Bernstein polynomials at reference points, shape (q, N).

    Example:
        >>> bernstein(1, 2, np.array([[0.5]]))  # both ends and the edge, in the middle
        array([[0.25, 0.25, 0.5 ]])
    """
    return bernstein_at(k, barycentric(points))


def bernstein_at(k: int, places: np.ndarray) -> np.ndarray:
    """Evaluate Bernstein polynomials at places (..., d+1), shape (..., N).

    Args:
        k: Their degree.
        places: Barycentric coordinates of points.
    """
    if k == 0:
        return np.ones((*places.shape[:-1], 1))
    if k == 1:
        return places
    a, b = node_vertices(places.shape[-1] - 1, k).T
    return places[..., a] * places[..., b] * np.where(a == b, 1.0, 2.0)


@cache
def at_nodes(d: int, k: int) -> np.ndarray:
    """Return the matrix (N, N) from Bernstein coefficients to values at the nodes."""
    return bernstein(d, k, nodes(d, k))


@cache
def coefficients(d: int, k: int) -> np.ndarray:
    """Return the matrix (N, N) from values at the nodes to Bernstein coefficients."""
    return np.linalg.inv(at_nodes(d, k))


@cache
def times_linear(d: int, k: int) -> np.ndarray:
    """Return the weights (M, N, d+1) of a product of polynomials of degrees k and 1.

    Each Bernstein coefficient of the product is the sum of them times a coefficient of
    the first factor and one of the second.

    Example:
        >>> times_linear(1, 1)[2]  # of the edge, between the products at its ends
        array([[0. , 0.5],
               [0.5, 0. ]])
    """
    count = d + 1
    powers = np.zeros((len(nodes(d, k)), count), dtype=int)
    for vertex in node_vertices(d, k).T[:k]:
        powers[np.arange(len(powers)), vertex] += 1
    number = {tuple(power): node for node, power in enumerate(powers.tolist())}
    # Coefficients of degree k+1: the vertices first, as everywhere.
    of_product = (k + 1) * np.eye(count, dtype=int)
    others = [power for power in _powers(count, k + 1) if max(power) <= k]
    of_product = np.vstack([of_product, np.array(others, dtype=int).reshape(-1, count)])
    weights = np.zeros((len(of_product), len(powers), count))
    for row, power in enumerate(of_product):
        for vertex in np.flatnonzero(power):
            less = power.copy()
            less[vertex] -= 1
            weights[row, number[tuple(less.tolist())], vertex] = power[vertex] / (k + 1)
    return weights


def _powers(count: int, degree: int) -> list[tuple[int, ...]]:
    """Return the powers of barycentric coordinates whose sum is a degree."""
    powers = []
    for vertices in combinations_with_replacement(range(count), degree):
        powers.append(tuple(vertices.count(vertex) for vertex in range(count)))
    return powers


def lagrange(d: int, k: int, points: np.ndarray) -> np.ndarray:
    """Evaluate the shape functions of the nodes at reference points, shape (q, N)."""
    return bernstein(d, k, points) @ coefficients(d, k)


@cache
def rule(d: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points (q, d) and weights (q,) of a quadrature.

    The weights have sum 1. Permuted vertices permute the points.
    """
    points, weights = basix.make_quadrature(CELLS[d], degree)
    return points, weights / weights.sum()


@cache
def mass(d: int, k: int, l: int) -> np.ndarray:  # noqa: E741
    """Compute means of products of Bernstein polynomials of degrees k and l.

    Returns:
        Shape (N_k, N_l).
    """
    points, weights = rule(d, k + l)
    return bernstein(d, k, points).T @ (weights[:, None] * bernstein(d, l, points))


@cache
def _inverse_mass(d: int, k: int) -> np.ndarray:
    """Return the inverse of the matrix :func:`mass` of one degree, shape (N, N)."""
    return np.linalg.inv(mass(d, k, k))


def from_means(d: int, k: int, means: np.ndarray) -> np.ndarray:
    """Compute Bernstein coefficients of a polynomial from its means.

    The polynomial times each Bernstein polynomial has these means. So it is the L2
    projection on degree k of any function that has them, too.

    Args:
        d: Dimension.
        k: Degree.
        means: Shape (..., N, c) for c components.
    """
    return np.matmul(_inverse_mass(d, k), means)


def projection(d: int, k: int, points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the matrix (N, q) of the L2 projection on degree k.

    It takes values at the points of a rule to Bernstein coefficients.
    """
    return from_means(d, k, bernstein(d, k, points).T * weights)


def averages(d: int, k: int, points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the matrix (N, q) to ``int f B / int B`` for each Bernstein polynomial B.

    It takes values of f at the points of a rule to weighted means. Such means lie in
    the convex hull of the values.
    """
    shape = bernstein(d, k, points)
    return shape.T * weights / (weights @ shape)[:, None]


def determinants(corners: np.ndarray) -> np.ndarray:
    """Compute d! times the volumes of simplices, with a sign [length^d].

    Args:
        corners: Corners [length], shape (..., d+1, d).

    Returns:
        Shape (...).
    """
    return np.linalg.det(corners[..., 1:, :] - corners[..., :1, :])


def inverses(matrices: np.ndarray) -> np.ndarray:
    """Invert small matrices that are far from singular, as edges of cells.

    In 3D the rows of a matrix are a, b, c; the columns of its inverse are ``b x c``,
    ``c x a`` and ``a x b`` over the determinant.

    Args:
        matrices: Regular matrices, shape (..., d, d), d from 1 to 3.

    Example:
        >>> inverses(np.array([[2.0, 0.0], [0.0, 4.0]]))
        array([[ 0.5 , -0.  ],
               [-0.  ,  0.25]])
    """
    d = matrices.shape[-1]
    if d == 1:
        return 1 / matrices
    if d == 2:
        a, b = matrices[..., 0, 0], matrices[..., 0, 1]
        c, e = matrices[..., 1, 0], matrices[..., 1, 1]
        adjugate = np.stack([np.stack([e, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2)
        return adjugate / (a * e - b * c)[..., None, None]
    result = np.empty_like(matrices)
    rows = matrices[..., 0, :], matrices[..., 1, :], matrices[..., 2, :]
    for j in range(3):
        result[..., :, j] = np.cross(rows[(j + 1) % 3], rows[(j + 2) % 3])
    determinant = (rows[0] * result[..., :, 0]).sum(axis=-1)
    result /= determinant[..., None, None]
    return result


def measures(corners: np.ndarray) -> np.ndarray:
    """Compute lengths, areas or volumes of simplices [length^p].

    Args:
        corners: Corners [length], shape (..., p+1, d), p <= d.

    Returns:
        Shape (...).
    """
    vertices, d = corners.shape[-2:]
    p = vertices - 1
    if p == d:
        return abs(determinants(corners)) / factorial(p)
    edges = corners[..., 1:, :] - corners[..., :1, :]
    # Gram's determinant is the square of the measure, times (p!)^2.
    gram = edges @ edges.swapaxes(-1, -2)
    return np.sqrt(abs(np.linalg.det(gram))) / factorial(p)


def normals_across(ends: np.ndarray) -> np.ndarray:
    """Return normals of facets of any length, their signs open, shape (n, d).

    They are products of coordinates, so that a facet along an axis has a normal along
    an axis.

    Args:
        ends: Vertices of the facets [length], shape (n, d, d).
    """
    edges = ends[:, 1:] - ends[:, :1]
    if ends.shape[2] == 2:
        return np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
    return np.cross(edges[:, 0], edges[:, 1])


def outward_normals(corners: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Compute the unit normals of facets that point out of their cells, shape (n, d).

    Args:
        corners: Corners of the cells [length], shape (n, d+1, d).
        facets: The local facet of each cell, shape (n,).
    """
    ends = of_facets(corners, facets)
    normals = normals_across(ends)
    opposite = corners[np.arange(len(corners)), facets]
    outward = ((ends[:, 0] - opposite) * normals).sum(axis=1)
    normals *= np.sign(outward)[:, None]
    return normals / np.linalg.norm(normals, axis=1)[:, None]


@cache
def gradients(d: int, k: int) -> np.ndarray:
    """Tabulate the derivatives ``d/d lambda_j`` of Bernstein polynomials of degree k.

    They are given as coefficients of degree k-1.

    The barycentric coordinates are independent variables here. With their gradients,
    ``grad B_v`` is the sum over j of these derivatives times ``grad lambda_j``.

    Returns:
        Shape (N_(k-1), d+1, N_k): coefficient, j, v.
    """
    table = np.zeros((len(nodes(d, k - 1)), d + 1, len(nodes(d, k))))
    # B_v is lambda_a for k = 1, and (1 + [a != b]) lambda_a lambda_b for k = 2.
    for v, (a, b) in enumerate(node_vertices(d, k)):
        if k == 1:
            table[0, a, v] = 1.0
        elif a == b:
            table[a, a, v] = 2.0
        else:
            table[b, a, v] = 2.0
            table[a, b, v] = 2.0
    return table


def lattice(d: int, divisions: int) -> np.ndarray:
    """Return reference points of a regular lattice with its boundary, shape (q, d)."""
    return basix.create_lattice(CELLS[d], divisions, basix.LatticeType.equispaced, True)
