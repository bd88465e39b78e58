"""The complementary energy of sigma^ - C eps(u^) as a quadratic form of facet moments.

On the reference simplex the stress at the points of a quadrature rule is one matrix times the moments of the facet
tractions. No matrix of a cell is stored: a product costs two products with this matrix, and 0.2 kB a cell are kept in
2D, 0.5 kB in 3D.

Components come first and cells or facets last: numpy is fast on long last axes. Symbols: d dimension, s = d(d+1)/2,
q = (d+1)^2 points in the sub-simplices of a cell, n cells, F facets, c cells of a chunk.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from erc_contact.admissible.geometry import Simplices, nodal_forces
from erc_contact.admissible.macro import macro_points, piola, reference_map, tensors

CHUNK = (0, 0, 4096, 1024)
"""Number of cells, facets or hinges that are worked on at once, for each d: what stays in the cache."""


def chunks(count: int, d: int) -> Iterator[slice]:
    """Parts of ``range(count)`` that stay in the cache."""
    return (slice(i, min(i + CHUNK[d], count)) for i in range(0, count, CHUNK[d]))


def times(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Product of small matrices (a, b, ..., n) and vectors (b, ..., n) for all n at once."""
    result = np.empty((len(matrix), *vectors.shape[1:]))
    for i, row in enumerate(matrix):
        np.multiply(row[0], vectors[0], out=result[i])
        for entry, vector in zip(row[1:], vectors[1:], strict=True):
            result[i] += entry * vector
    return result


class Energy:
    """The complementary energy as a quadratic form of facet moments; no matrix of a cell is stored.

    On the reference simplex the stress at the points is one matrix times the moments; the rest is in a metric of the
    components, ``|T|/q  P C^-1 P^T`` with P the Piola transform.

    Attributes:
        map: Reference stresses of reference moments, shape (s q, d d (d+1)): component, node, facet.
        metric: Shape (s, s, q or 1, n) [length^(4-d)/(force/area)].
        inverse: Inverse Jacobians [1/length], shape (d, d, 1, n).
        facets: Facet of each cell opposite to its vertices, shape (d+1, n).
        sign: +1 where the cell is the first of its facet, else -1, shape (d+1, n).
        first, second: The two places of each facet as index i * n + cell, n * (d+1) for none, shape (F,).
    """

    def __init__(self, cells: Simplices, owned: int, compliance: np.ndarray) -> None:
        d, n = cells.d, len(cells.nodes)
        self.cells, self.owned = cells, owned
        near, _ = macro_points(d)
        at_points = np.einsum("qm,kmsfc->skqfc", near, reference_map(d))
        s, q = len(at_points), (d + 1) ** 2
        at_points = at_points.reshape(s * q, -1, d)
        self.body = np.ascontiguousarray(at_points[:, -1])
        moments = nodal_forces(at_points[:, :-1].reshape(-1, d + 1, d, d))  # a symmetric matrix on the nodes
        self.map = np.ascontiguousarray(moments.transpose(0, 3, 2, 1)).reshape(s * q, -1)
        self.facets = np.ascontiguousarray(cells.facets.T)
        places = np.arange(cells.facets.size).reshape(n, d + 1).T
        self.sign = np.where(cells.side[0][self.facets] == places, 1.0, -1.0)
        at = cells.side % (d + 1) * n + cells.side // (d + 1)
        self.first = np.where(cells.side[0] >= 0, at[0], n * (d + 1))
        self.second = np.where(cells.has_second, at[1], n * (d + 1))
        self.inverse = np.ascontiguousarray(cells.inverse.transpose(1, 2, 0))[:, :, None]
        self.metric = np.empty((s, s, compliance.shape[1], n))
        for some in chunks(n, d):
            P = piola(cells, some)[:, None] * np.sqrt(cells.volume[some] / q)[:, None, None, None]
            local = compliance[some] if len(compliance) > 1 else compliance
            self.metric[..., some] = np.matmul(np.matmul(P, local), P.transpose(0, 1, 3, 2)).transpose(2, 3, 1, 0)

    def start(self, moment: np.ndarray, force: np.ndarray | None, elastic: np.ndarray) -> tuple[float, np.ndarray]:
        """``|sigma^ - C eps(u^)|^2`` and half its derivative, of the owned cells.

        The map of facet moments keeps constant stresses, so the mean of C eps(u^) is taken off the tractions.
        """
        cells, d = self.cells, self.cells.d
        mean = tensors(elastic.mean(axis=1), d)
        moment = np.ascontiguousarray(moment.transpose(2, 1, 0)).reshape(d * d, -1)
        square, seen = 0.0, np.zeros((d * d, self.facets.size + 1))
        for some in chunks(self.owned, d):
            local = self._seen(moment, some)
            local -= np.matmul(cells.area[some], mean[some]).transpose(2, 1, 0)[:, None] / d
            stress = self._stress(local, some)
            if force is not None:
                inside = times(self.inverse[:, :, 0, some], force[some].T)
                stress += (self.body @ inside).reshape(stress.shape)
            if elastic.shape[1] > 1:
                rest = elastic[some].mean(axis=1, keepdims=True) - elastic[some]
                rest = np.linalg.solve(piola(cells, some).transpose(0, 2, 1), rest.transpose(0, 2, 1))
                stress += rest.transpose(1, 2, 0)
            dual = times(self.metric[..., some], stress)
            square += float(np.vdot(stress, dual))
            self._add(dual, some, seen)
        return square, self._on_facets(seen)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """The change of the derivative for a change x of the moments, of the owned cells, shape (d, d, F)."""
        d = self.cells.d
        x = x.reshape(d * d, -1)
        seen = np.zeros((d * d, self.facets.size + 1))
        for some in chunks(self.owned, d):
            stress = self._stress(self._seen(x, some), some)
            self._add(times(self.metric[..., some], stress), some, seen)
        return self._on_facets(seen)

    def _seen(self, moment: np.ndarray, some: slice) -> np.ndarray:
        """Moments as some cells see them, (d d, F) -> (d, d, d+1, c)."""
        d = self.cells.d
        local = np.take(moment, self.facets[:, some], axis=1)
        local *= self.sign[:, some]
        return local.reshape(d, d, d + 1, -1)

    def _stress(self, local: np.ndarray, some: slice) -> np.ndarray:
        """Reference stresses of moments as the cells see them, (d, d, d+1, c) -> (s, q, c)."""
        local = times(self.inverse[..., some], local.reshape(len(local), -1, local.shape[-1]))
        stress = self.map @ local.reshape(-1, local.shape[-1])
        return stress.reshape(len(self.metric), -1, local.shape[-1])

    def _add(self, dual: np.ndarray, some: slice, seen: np.ndarray) -> None:
        """The transpose of ``_stress`` and ``_seen``, written to the places of the cells."""
        d = self.cells.d
        local = (self.map.T @ dual.reshape(-1, dual.shape[-1])).reshape(d, d * (d + 1), -1)
        local = times(self.inverse.transpose(1, 0, 2, 3)[..., some], local).reshape(d * d, d + 1, -1)
        np.multiply(local, self.sign[:, some], out=seen[:, :-1].reshape(d * d, d + 1, -1)[..., some])

    def _on_facets(self, seen: np.ndarray) -> np.ndarray:
        """Sum over the two sides, shape (d, d, F)."""
        d = self.cells.d
        values = np.take(seen, self.first, axis=1)
        values += np.take(seen, self.second, axis=1)
        return values.reshape(d, d, -1)
