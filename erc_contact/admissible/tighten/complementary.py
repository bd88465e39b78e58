"""The complementary energy of sigma^ - C eps(u^) as a quadratic form of facet moments.

On the reference simplex the stress at the points of a quadrature rule is one matrix times the moments of the facet
tractions. No matrix of a cell is stored: a product costs two products with this matrix, and for degree 1 0.2 kB a cell
are kept in 2D, 0.5 kB in 3D. The stresses without tractions (the bubbles of degree 2) always have the amounts of least
energy.

Moments are taken against the linear functions on a facet and, for degree 2, against the functions ``B_e - P B_e`` with
P the L2 projection on linear functions. The linear part alone balances a cell. These moments are called hierarchical.

Components come first and cells or facets last, because numpy is fast on long last axes. Symbols: d dimension,
s = d(d+1)/2, Q points in the sub-simplices of a cell, n cells, F facets, m moments of a facet and component, c cells of
a chunk.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from erc_contact.admissible.cells import CellGeometry, force_coefficients
from erc_contact.admissible.macro import bubbles, macro_points, piola, reference_map, tensors
from erc_contact.mesh.simplex import bernstein, coefficients, from_means, mass, nodes

CHUNK = (0, 0, 4096, 1024)
"""Number of cells, facets or patches that are worked on at once, for each d, so that arrays stay in the cache."""


def chunks(count: int, d: int) -> Iterator[slice]:
    """Slices of ``range(count)`` of this size."""
    return (slice(i, min(i + CHUNK[d], count)) for i in range(0, count, CHUNK[d]))


def times(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Product of small matrices (a, b, ..., n) and vectors (b, ..., n) for all n at once."""
    return np.einsum("ab...,b...->a...", matrix, vectors)


@cache
def hierarchical(d: int, k: int) -> np.ndarray:
    """Matrix (m, m) from moments against Bernstein polynomials on a facet to the hierarchical moments."""
    linear = (coefficients(d - 1, k) @ bernstein(d - 1, 1, nodes(d - 1, k))).T  # hat functions in Bernstein polynomials
    if k == 1:
        return linear
    on_linear = from_means(d - 1, 1, mass(d - 1, 1, k))[:, d:]  # P B_e
    return np.vstack([linear, np.eye(linear.shape[1])[d:] - on_linear.T @ linear])


@cache
def stress_map(d: int, k: int) -> np.ndarray:
    """Matrix from hierarchical moments on the reference simplex to stresses at points times the roots of the weights.

    Returns:
        Shape (s, Q, d, m, d+1): component, point, component of the moment, its number, facet.
    """
    near, _, weights = macro_points(d, k)
    m = len(nodes(d - 1, k))
    at_points = np.einsum("qm,kmsfc->skqfc", near, reference_map(d, k)[:, :, :, : (d + 1) * m])
    at_points = at_points.reshape(len(at_points), -1, d + 1, m, d) * np.sqrt(weights)[:, None, None, None]
    moments = force_coefficients(at_points, k)  # a symmetric matrix on the nodes
    return np.ascontiguousarray(np.einsum("sQfmc,ml->sQclf", moments, np.linalg.inv(hierarchical(d, k))))


@cache
def _bubble_map(d: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Bubbles at the points times the roots of the weights, (s, Q, number), and the products of their components."""
    near, _, weights = macro_points(d, k)
    s, number = bubbles(d, k).shape[2:]
    at_points = np.einsum("qm,kmsb->skqb", near, bubbles(d, k)).reshape(s, len(weights), number)
    at_points *= np.sqrt(weights)[:, None]
    return at_points, np.einsum("aQx,bQy->xyab", at_points, at_points)


def _metric(cells: CellGeometry, some: slice, compliance: np.ndarray) -> np.ndarray:
    """``|T| P C^-1 P^T`` with P the Piola transform: the compliance for reference stresses, (c, Q or 1, s, s)."""
    P = piola(cells, some)[:, None] * np.sqrt(cells.volume[some])[:, None, None, None]
    local = compliance[some] if len(compliance) > 1 else compliance
    return np.matmul(np.matmul(P, local), P.transpose(0, 1, 3, 2))


def _bubble_inverse(d: int, k: int, metric: np.ndarray) -> np.ndarray:
    """Inverses of the energy matrices of the bubbles in some cells, from the metric (c, Q or 1, s, s)."""
    at_points, products = _bubble_map(d, k)
    if metric.shape[1] == 1:
        energy = np.tensordot(metric[:, 0], products, axes=((1, 2), (2, 3)))
    else:
        energy = np.einsum("aQx,cQab,bQy->cxy", at_points, metric, at_points, optimize=True)
    return np.linalg.inv(energy)


def relaxed(cells: CellGeometry, sigma: np.ndarray, elastic: np.ndarray, compliance: np.ndarray) -> np.ndarray:
    """The stress of the same tractions and divergence that is nearest to ``C eps(u^)``, cell by cell.

    Args:
        cells: Geometry.
        sigma: Stress of the owned cells, of degree k in the sub-simplices, shape (owned, d+1, N_k, s).
        elastic: ``C eps(u^)`` of the owned cells [force/area], shape (owned, Q or 1, s).
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).

    Returns:
        Of the same shape as sigma.
    """
    d, k = cells.d, cells.degree
    near, _, weights = macro_points(d, k)
    at_points, _ = _bubble_map(d, k)
    result = np.empty_like(sigma)
    for some in chunks(len(sigma), d):
        here, P = sigma[some], piola(cells, some)
        difference = np.matmul(near, here).reshape(len(here), -1, here.shape[3]) - elastic[some]
        local = compliance[some] if len(compliance) > 1 else compliance
        dual = np.matmul(np.matmul(local, difference[..., None])[..., 0], P.transpose(0, 2, 1))
        dual *= cells.volume[some, None, None] * np.sqrt(weights)[:, None]
        work = np.tensordot(dual, at_points, axes=((1, 2), (1, 0)))
        amount = np.matmul(_bubble_inverse(d, k, _metric(cells, some, compliance)), work[:, :, None])[..., 0]
        added = np.tensordot(amount, bubbles(d, k), axes=(1, 3))
        result[some] = here - np.matmul(added, P[:, None])
    return result


class ComplementaryEnergy:
    """The complementary energy as a quadratic form of hierarchical facet moments.

    Args:
        cells: Geometry, n cells.
        owned: Number of owned cells, the first ones.
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).

    Attributes:
        metric: ``|T| P C^-1 P^T``, the compliance for reference stresses [length^(4-d)/(force/area)], shape
            (s, s, Q or 1, n).
        inverse: Inverse Jacobians [1/length], shape (d, d, 1, n).
        facets: Facet of each cell opposite to its vertices, shape (d+1, n).
        sign: +1 where the cell is the first of its facet, else -1, shape (d+1, n).
        first, second: The two places of each facet as index i * n + cell, n * (d+1) for none, shape (F,).
    """

    def __init__(self, cells: CellGeometry, owned: int, compliance: np.ndarray) -> None:
        d, n, k = cells.d, len(cells.nodes), cells.degree
        self.cells, self.owned = cells, owned
        every = stress_map(d, k)
        s, Q, _, self.m, _ = every.shape
        self.map = every.reshape(s * Q, -1)
        near, _, weights = macro_points(d, k)
        body = np.einsum("qm,imsbc->siqbc", near, reference_map(d, k)[:, :, :, (d + 1) * self.m :])
        self.body = (body.reshape(s, Q, -1) * np.sqrt(weights)[:, None]).reshape(s * Q, *body.shape[3:])
        self.roots = np.sqrt(weights)
        self.facets = np.ascontiguousarray(cells.facets.T)
        places = np.arange(cells.facets.size).reshape(n, d + 1).T
        self.sign = np.where(cells.side[0][self.facets] == places, 1.0, -1.0)
        at = cells.side % (d + 1) * n + cells.side // (d + 1)
        self.first = np.where(cells.side[0] >= 0, at[0], n * (d + 1))
        self.second = np.where(cells.has_second, at[1], n * (d + 1))
        self.inverse = np.ascontiguousarray(cells.inverse.transpose(1, 2, 0))[:, :, None]
        self.metric = np.empty((s, s, compliance.shape[1], n))
        self.bubbles = _bubble_map(d, k)[0].reshape(s * Q, bubbles(d, k).shape[3])
        self.relief = np.empty((owned, *[self.bubbles.shape[1]] * 2))
        for some in chunks(n, d):
            metric = _metric(cells, some, compliance)
            self.metric[..., some] = metric.transpose(2, 3, 1, 0)
            mine = max(min(some.stop, owned) - some.start, 0)
            if self.relief.size and mine:
                self.relief[some.start : some.start + mine] = _bubble_inverse(d, k, metric[:mine])

    def start(self, moment: np.ndarray, force: np.ndarray | None, elastic: np.ndarray) -> tuple[float, np.ndarray]:
        """``|sigma^ - C eps(u^)|^2`` of the owned cells and half its derivative by the moments.

        The map from moments to stresses reproduces constant stresses. So the mean of C eps(u^) in a cell is subtracted
        from its tractions.

        Args:
            moment: Hierarchical moments, shape (d, m, F).
            force: Coefficients of the body force times volume, shape (n, N_(k-1), d), or None.
            elastic: ``C eps(u^)`` of the owned cells, shape (owned, Q or 1, s).
        """
        cells, d = self.cells, self.cells.d
        at_points = elastic.shape[1] > 1
        means = (self.roots**2 @ elastic) if at_points else elastic[:, 0]
        mean = tensors(means, d)
        moment = moment.reshape(d * self.m, -1)
        square, on_cells = 0.0, np.zeros((d * self.m, self.facets.size + 1))
        for some in chunks(self.owned, d):
            local = self._on_cells(moment, some)
            local[:, :d] -= np.matmul(cells.area[some], mean[some]).transpose(2, 1, 0)[:, None] / d
            stress = self._stress(local, some)
            if force is not None:
                inside = times(self.inverse[..., some], force[some].transpose(2, 1, 0))
                stress += np.tensordot(self.body, inside, axes=((2, 1), (0, 1))).reshape(stress.shape)
            if at_points:
                rest = (means[some, None] - elastic[some]) * self.roots[:, None]
                rest = np.linalg.solve(piola(cells, some).transpose(0, 2, 1), rest.transpose(0, 2, 1))
                stress += rest.transpose(1, 2, 0)
            dual = self._dual(stress, some)
            square += float(np.vdot(stress, dual))
            self._add(dual, some, on_cells)
        return square, self._on_facets(on_cells)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Change of half the derivative for a change x of the moments, of the owned cells, shape (d, m, F)."""
        d = self.cells.d
        x = x.reshape(d * self.m, -1)
        on_cells = np.zeros((d * self.m, self.facets.size + 1))
        for some in chunks(self.owned, d):
            stress = self._stress(self._on_cells(x, some), some)
            self._add(self._dual(stress, some), some, on_cells)
        return self._on_facets(on_cells)

    def _on_cells(self, moment: np.ndarray, some: slice) -> np.ndarray:
        """Moments of the tractions on some cells, (d m, F) -> (d, m, d+1, c)."""
        d = self.cells.d
        local = np.take(moment, self.facets[:, some], axis=1)
        local *= self.sign[:, some]
        return local.reshape(d, self.m, d + 1, -1)

    def _stress(self, local: np.ndarray, some: slice) -> np.ndarray:
        """Reference stresses from the moments of the tractions on the cells, (d, m, d+1, c) -> (s, Q, c)."""
        local = times(self.inverse[..., some], local.reshape(len(local), -1, local.shape[-1]))
        stress = self.map @ local.reshape(-1, local.shape[-1])
        return stress.reshape(len(self.metric), -1, local.shape[-1])

    def _dual(self, stress: np.ndarray, some: slice) -> np.ndarray:
        """Strains of reference stresses (s, Q, c) with the bubbles of least energy added."""
        dual = times(self.metric[..., some], stress)
        if self.relief.size:
            work = self.bubbles.T @ dual.reshape(len(self.bubbles), -1)
            amount = np.matmul(self.relief[some], work.T[:, :, None])[..., 0].T
            dual -= times(self.metric[..., some], (self.bubbles @ amount).reshape(stress.shape))
        return dual

    def _add(self, dual: np.ndarray, some: slice, on_cells: np.ndarray) -> None:
        """The transpose of ``_on_cells`` and ``_stress``, written to the columns of these cells in ``on_cells``."""
        d = self.cells.d
        local = (self.map.T @ dual.reshape(-1, dual.shape[-1])).reshape(d, self.m * (d + 1), -1)
        local = times(self.inverse.transpose(1, 0, 2, 3)[..., some], local).reshape(d * self.m, d + 1, -1)
        np.multiply(local, self.sign[:, some], out=on_cells[:, :-1].reshape(d * self.m, d + 1, -1)[..., some])

    def _on_facets(self, on_cells: np.ndarray) -> np.ndarray:
        """Sum over the two sides of each facet, shape (d, m, F)."""
        values = np.take(on_cells, self.first, axis=1)
        values += np.take(on_cells, self.second, axis=1)
        return values.reshape(self.cells.d, self.m, -1)
