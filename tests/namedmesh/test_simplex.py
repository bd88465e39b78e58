"""Tables of the reference simplex.

Properties that all that follows relies on, each as a number.

- Bernstein polynomials are a positive partition of unity with equal integrals, and give
  back polynomials of the degree;
- coefficients and nodal values are inverse to each other; gradients agree with finite
  differences;
- a facet's nodes are the cell's nodes on it, in the order of the facet's own;
- a permutation of the vertices permutes the points of a rule;
- projections give back polynomials, averages of a constant are this constant, measures
  agree with known simplices.
"""

from itertools import permutations

import numpy as np
import pytest

from namedmesh import simplex

pytestmark = pytest.mark.serial

CASES = pytest.mark.parametrize(("d", "k"), [(d, k) for d in (1, 2, 3) for k in (1, 2)])


def points_in(d: int) -> np.ndarray:
    return np.random.default_rng(d).dirichlet(np.ones(d + 1), 20)[:, 1:]


@CASES
def test_bernstein(d, k):
    values = simplex.bernstein(d, k, points_in(d))
    assert values.min() >= 0
    assert np.allclose(values.sum(axis=1), 1, atol=1e-14)
    points, weights = simplex.rule(d, k)
    assert np.allclose(weights @ simplex.bernstein(d, k, points), 1 / values.shape[1], atol=1e-14)
    assert np.allclose(
        simplex.at_nodes(d, k) @ simplex.coefficients(d, k), np.eye(values.shape[1]), atol=1e-14
    )

    def polynomial(x):
        return (1 + x @ np.arange(1, d + 1)) ** k

    found = values @ simplex.coefficients(d, k) @ polynomial(simplex.nodes(d, k))
    assert np.allclose(found, polynomial(points_in(d)), atol=1e-12)


@CASES
def test_gradients(d, k):
    x, h = points_in(d), 1e-5
    slopes = np.vstack([-np.ones(d), np.eye(d)])  # gradients of the barycentric coordinates
    lower = simplex.bernstein(d, k - 1, x)
    exact = np.einsum("qc,cjv,ji->qiv", lower, simplex.gradients(d, k), slopes)
    for i, e in enumerate(np.eye(d)):
        found = (simplex.bernstein(d, k, x + h * e) - simplex.bernstein(d, k, x - h * e)) / (2 * h)
        assert np.allclose(found, exact[:, i], atol=1e-9)


@pytest.mark.parametrize(("d", "k"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_facet_nodes(d, k):
    corners = np.vstack([np.zeros(d), np.eye(d)])
    for on_facet, vertices in zip(
        simplex.local_facet_nodes(d, k), simplex.facet_vertices(d), strict=True
    ):
        expected = simplex.barycentric(simplex.nodes(d - 1, k)) @ corners[vertices]
        assert np.allclose(simplex.nodes(d, k)[on_facet], expected, atol=1e-15)


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("degree", [2, 4, 6])
def test_rules_are_symmetric(d, degree):
    points, weights = simplex.rule(d, degree)
    at = simplex.barycentric(points)
    for order in permutations(range(d + 1)):
        distance = np.linalg.norm(at[:, None, list(order)] - at[None], axis=2)
        assert distance.min(axis=1).max() < 1e-12
        assert np.allclose(weights[distance.argmin(axis=1)], weights, atol=1e-14)


@CASES
def test_projections_and_averages(d, k):
    points, weights = simplex.rule(d, 2 * k)
    known = np.random.default_rng(k).standard_normal((len(simplex.nodes(d, k)), 2))
    values = simplex.bernstein(d, k, points) @ known
    assert np.allclose(simplex.projection(d, k, points, weights) @ values, known, atol=1e-12)
    assert np.allclose(simplex.from_means(d, k, simplex.mass(d, k, k) @ known), known, atol=1e-12)
    averages = simplex.averages(d, k, points, weights)
    assert np.allclose(averages.sum(axis=1), 1, atol=1e-14)
    assert averages.min() >= 0


def test_measures():
    corners = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [1.0, 1.0, -4.0]])
    for p, expected in ((1, 2.0), (2, 3.0), (3, 4.0)):
        assert np.allclose(simplex.measures(np.stack([corners[: p + 1]] * 2)), expected, rtol=1e-14)


@pytest.mark.parametrize("d", [2, 3])
def test_outward_normals(d):
    """Orthogonal to the facet, away from the cell, of length 1; the divergence theorem adds them up."""
    rng = np.random.default_rng(d)
    corners = rng.normal(size=(50, d + 1, d))
    total = np.zeros((50, d))
    for facet, vertices in enumerate(simplex.facet_vertices(d)):
        normals = simplex.outward_normals(corners, np.full(50, facet))
        of_facet = corners[:, vertices]
        edges = of_facet[:, 1:] - of_facet[:, :1]
        assert abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-14
        assert abs(np.einsum("nej,nj->ne", edges, normals)).max() < 1e-12
        inside = corners[:, facet] - of_facet[:, 0]
        assert (np.einsum("nj,nj->n", inside, normals) < 0).all()
        total += simplex.measures(of_facet)[:, None] * normals
    assert abs(total).max() < 1e-12
