"""Tables of the reference simplex for the energy of macro-element stresses.

The stress of a macro-element is given at nodes of its sub-simplices by a matrix that
acts on the moments of the facet tractions. For balanced tractions there are many such
matrices of degree k = 1, because what they give for unbalanced ones does not matter.
Here it is the sparse one: the stresses at a vertex are determined by the tractions at
this vertex alone, and the stress at the barycentre by the mean stress, which is the
dyad of tractions and positions.

Symbols: d dimension, k degree, s = d(d+1)/2, m moments of a facet and component, Q
nodes or points of a macro-element.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import factorial
from typing import NamedTuple, Self

import numpy as np

from erc_contact.admissible.macro import macro_points, rule_of
from erc_contact.admissible.reference import bubbles, reference_map
from erc_contact.scene.material import mandel_basis
from namedmesh.simplex import (
    bernstein,
    coefficients,
    facet_vertices,
    from_means,
    mass,
    nodes,
)


class Sparse(NamedTuple):
    """Hold a sparse matrix by rows: entries start[i] to start[i+1] are of row i."""

    start: np.ndarray
    column: np.ndarray
    value: np.ndarray

    @classmethod
    def from_matrix(cls, matrix: np.ndarray) -> Self:
        """Return the entries of a matrix that are not round-off."""
        row, column = np.nonzero(abs(matrix) > 1e-12 * abs(matrix).max(initial=0.0))
        start = np.searchsorted(row, np.arange(len(matrix) + 1)).astype(np.int32)
        return cls(start, column.astype(np.int32), matrix[row, column])


@dataclass(frozen=True, eq=False)
class MacroTable:
    """Hold the maps from facet moments to reference stresses, and their energies.

    Attributes:
        count: Q.
        to_coefficients: From hierarchical moments of a facet to coefficients of its
            traction, shape (m, m).
        stress: From these, (d+1, m, d) in one, to stresses, (Q, s) in one.
        back: Its transpose.
        weights: Products of the nodal functions, shape (Q, Q).
        body: From the coefficients of the body force to stresses, shape (Q, s, N_(k-1),
            d).
        bubbles: Stresses without tractions and divergence, shape (Q s, number).
        transposed: The same, shape (number, Q s).
        functions: These, and beside them the stresses of hierarchical moments, shape
            (Q s, N).
        products: Their energies for each entry a <= b of a metric, a lower triangle row
            by row, shape (N (N + 1)/2, s (s + 1)/2).
        nodal: From values at the nodes of the sub-simplices, (d+1, N_k) in one.
        from_points: From values at the points of the rule.

    Example:
        >>> table = macro_table(d=2, k=1, points=1)
        >>> table.count  # at 2 vertices of 3 sub-triangles, and at the barycentre
        7
        >>> round(float(table.weights.value.sum()), 12)  # the mean of 1
        1.0
    """

    count: int
    to_coefficients: np.ndarray
    stress: Sparse
    back: Sparse
    weights: Sparse
    body: np.ndarray
    bubbles: np.ndarray
    transposed: np.ndarray
    functions: np.ndarray
    products: np.ndarray
    nodal: Sparse
    from_points: np.ndarray


@cache
def hierarchical(d: int, k: int) -> np.ndarray:
    """Return the matrix (m, m) to hierarchical moments of a facet.

    It acts on moments against Bernstein polynomials.
    """
    # hat functions in Bernstein polynomials
    linear = (coefficients(d - 1, k) @ bernstein(d - 1, 1, nodes(d - 1, k))).T
    if k == 1:
        return linear
    on_linear = from_means(d - 1, 1, mass(d - 1, 1, k))[:, d:]  # P B_e
    return np.vstack([linear, np.eye(linear.shape[1])[d:] - on_linear.T @ linear])


def _to_coefficients(d: int, k: int) -> np.ndarray:
    """Return the matrix (m, m) from hierarchical moments to coefficients.

    They are Bernstein coefficients of the area times the traction.
    """
    return from_means(d - 1, k, np.linalg.inv(hierarchical(d, k)))


@cache
def macro_table(d: int, k: int, points: int) -> MacroTable:
    """Compute the table of a degree.

    Args:
        d: Dimension.
        k: Degree.
        points: Number of points of a cell between which the moduli vary, see
            :func:`.macro.rule_of`. Stresses are taken there, times the roots of the
            weights. With 1 the moduli are constant, and stresses are taken at nodes.
    """
    s = d * (d + 1) // 2
    near, _, point_weights = rule_of(d, k, points)
    stress, body, bubble, spread = _vertex_stresses(d) if k == 1 else _nodal_stresses(d, k)
    # values at the points from those at the nodes
    values = np.kron(np.eye(d + 1), near) @ spread
    weights = values.T * point_weights @ values
    from_points = np.linalg.pinv(values)
    if points > 1:
        values *= np.sqrt(point_weights)[:, None]
        stress = np.tensordot(values, stress, axes=1)
        body = np.tensordot(values, body, axes=1)
        bubble = np.tensordot(values, bubble, axes=1)
        weights = np.eye(len(values))
        from_points = np.diag(np.sqrt(point_weights))
        nodal = values
    else:
        nodal = np.linalg.pinv(spread)
    matrix = stress.reshape(len(stress) * s, -1)
    inputs = np.kron(np.eye(d + 1), np.kron(_to_coefficients(d, k), np.eye(d)))
    bubble = bubble.reshape(len(matrix), -1)
    functions = np.hstack([bubble, matrix @ inputs])
    return MacroTable(
        count=len(stress),
        to_coefficients=_to_coefficients(d, k),
        stress=Sparse.from_matrix(matrix),
        back=Sparse.from_matrix(matrix.T),
        weights=Sparse.from_matrix(weights),
        body=np.ascontiguousarray(body),
        bubbles=np.ascontiguousarray(bubble),
        transposed=np.ascontiguousarray(bubble.T),
        functions=functions,
        products=_products(functions.reshape(len(stress), s, -1), weights),
        nodal=Sparse.from_matrix(nodal),
        from_points=from_points,
    )


def _products(functions: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return energies of stresses for each entry of a metric, see :class:`MacroTable`.

    Args:
        functions: Stresses, shape (Q, s, N).
        weights: Products of the nodal functions, shape (Q, Q).
    """
    count, s, size = functions.shape
    columns = functions.reshape(count, -1)
    products = (columns.T @ weights @ columns).reshape(s, size, s, size)
    row, column = np.tril_indices(size)
    return np.ascontiguousarray(upper_entries(products[:, row, :, column]))


class ElasticTable(NamedTuple):
    """Hold the maps from what an elastic stress is given by, b values in a cell.

    Attributes:
        mean: To its mean, shape (b,).
        rows: To the stresses of a :class:`MacroTable`, (Q, b).
    """

    mean: np.ndarray
    rows: Sparse


@cache
def elastic_table(d: int, k: int, points: int, b: int) -> ElasticTable:
    """Compute the table for elastic stresses that are given by b values in a cell.

    The values are one constant, coefficients of degree k - 1, or values at the points
    of a rule. See :func:`macro_table` for the other arguments.
    """
    _, places, weights = rule_of(d, k, max(points, b))
    from_points = macro_table(d, k, points).from_points
    if b == len(places):
        return ElasticTable(weights, Sparse.from_matrix(from_points))
    of_degree = 0 if b == 1 else k - 1
    shape = bernstein(d, of_degree, places)
    return ElasticTable(weights @ shape, Sparse.from_matrix(from_points @ shape))


def upper_entries(products: np.ndarray) -> np.ndarray:
    """Return the factors of the entries a <= b of a symmetric metric.

    Args:
        products: Factors of all entries, shape (..., s, s).

    Returns:
        Shape (..., s (s + 1)/2).
    """
    a, b = np.triu_indices(products.shape[-1])
    symmetric = products + products.swapaxes(-1, -2)
    return symmetric[..., a, b] / np.where(a == b, 2, 1)


@cache
def stress_map(d: int, k: int) -> np.ndarray:
    """Return the matrix from hierarchical moments to stresses at points.

    The simplex is the reference one. The stresses are times the roots of the weights.

    Returns:
        Shape (s, Q, d+1, m, d): component, point, facet, number of the moment, its
        component.
    """
    near, _, weights = macro_points(d, k)
    m = len(nodes(d - 1, k))
    at_points = np.einsum("qn,insfc->siqfc", near, reference_map(d, k)[:, :, :, : (d + 1) * m])
    at_points = at_points.reshape(len(at_points), -1, d + 1, m, d)
    at_points = at_points * np.sqrt(weights)[:, None, None, None]
    return np.einsum("sQfmc,ml->sQflc", at_points, _to_coefficients(d, k))


class _Stresses(NamedTuple):
    """Hold the stresses of a reference cell at nodes of its sub-simplices.

    Attributes:
        of_tractions: Map from the coefficients of tractions.
        of_body_force: Map from the coefficients of the body force.
        bubbles: The stresses without tractions and body force.
        spread: Matrix from stresses at the nodes to coefficients in the sub-simplices.
    """

    of_tractions: np.ndarray
    of_body_force: np.ndarray
    bubbles: np.ndarray
    spread: np.ndarray


def _nodal_stresses(d: int, k: int) -> _Stresses:
    """Return the stresses at the nodes of all sub-simplices."""
    m = len(nodes(d - 1, k))
    full = reference_map(d, k)
    table = full.reshape(-1, *full.shape[2:])
    bubble = bubbles(d, k).reshape(len(table), table.shape[1], -1)
    of_tractions = table[:, :, : (d + 1) * m]
    of_body_force = table[:, :, (d + 1) * m :]
    return _Stresses(of_tractions, of_body_force, bubble, np.eye(len(table)))


def _vertex_stresses(d: int) -> _Stresses:
    """Return the same for degree 1, with fewer stresses.

    There is one for each vertex of each sub-simplex, and one at the barycentre. A
    constant body force changes nothing: its work on linear displacements about the
    barycentre is zero.
    """
    n = d + 1
    basis = mandel_basis(d)
    s = len(basis)
    vertices = facet_vertices(d)
    volume = 1 / factorial(d)
    # of the barycentric coordinates: -d volume slopes[i] is area i
    slopes = np.vstack([-np.ones(d), np.eye(d)])
    number: dict[tuple[int, int], int] = {}
    for i in range(n):
        for v in vertices[i]:
            number[i, v] = len(number)
    inputs = np.eye(n * d * d).reshape(n, d, d, -1)  # facet, node, component
    rows = []
    data = []

    def equation(factors: dict[int, float], act: np.ndarray, right: np.ndarray) -> None:
        """Add the condition that act on a sum of stresses is right."""
        row = np.zeros((len(act), n * d + 1, s))
        row[:, list(factors)] = np.multiply.outer(list(factors.values()), act).transpose(1, 0, 2)
        rows.append(row.reshape(len(act), -1))
        data.append(right)

    for (i, v), q in number.items():
        # The force on the facet of the cell is given.
        node = list(vertices[i]).index(v)
        equation({q: -d * volume}, (basis @ slopes[i]).T, inputs[i, node])
        # The traction between two sub-simplices is continuous.
        for neighbour in set(range(i)) - {v}:
            normal = slopes[i] - slopes[neighbour]
            jump = {q: 1.0, number[neighbour, v]: -1.0}
            equation(jump, (basis @ normal).T, np.zeros_like(inputs[0, 0]))
    # The mean stress is the dyad of tractions and positions.
    moments = np.einsum("lm,fmcz->flcz", mass(d - 1, 1, 1), inputs)
    mean = np.einsum("flcz,fle->cez", moments, (nodes(d, 1) - 1 / n)[vertices]) / volume
    shares = dict.fromkeys(number.values(), 1 / n**2) | {n * d: 1 / n}
    equation(shares, np.eye(s), np.einsum("aij,ijz->az", basis, mean))
    stress = np.linalg.solve(np.vstack(rows), np.vstack(data)).reshape(n * d + 1, s, n * d, d)
    spread = np.zeros((n, n, n * d + 1))
    for (i, v), q in number.items():
        spread[i, v, q] = 1.0
    spread[range(n), range(n), -1] = 1.0  # vertex i of sub-simplex i is the barycentre
    no_body_force = np.zeros((n * d + 1, s, 1, d))
    no_bubbles = np.zeros((n * d + 1, s, 0))
    return _Stresses(stress, no_body_force, no_bubbles, spread.reshape(n * n, -1))
