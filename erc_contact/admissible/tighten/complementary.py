"""The complementary energy of sigma^ - C eps(u^) as a quadratic form of facet moments.

On the reference simplex the stress is one sparse matrix times the moments of the facet
tractions (:mod:`erc_contact.admissible.tighten.tables`). No matrix of a cell is stored;
a product passes once over the cells, in compiled code. The stresses without tractions
(the bubbles of degree 2) always have the amounts of least energy.

Moments are taken against the linear functions on a facet and, for degree 2, against the
functions ``B_e - P B_e`` with P the L2 projection on linear functions. The linear part
alone balances a cell. These moments are called hierarchical.

Symbols: d dimension, s = d(d+1)/2, Q points in the sub-simplices of a cell, n cells, F
facets, m moments of a facet and component, c cells of a chunk.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.macro import chunks, macro_points, piola, reference_metric
from erc_contact.admissible.reference import bubbles, tensors
from erc_contact.admissible.tighten.tables import macro_table


@cache
def _bubble_map(d: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the bubbles at the points, and the products of their components.

    Returns:
        Bubbles times the roots of the weights, shape (s, Q, number), and products,
        shape (number, number, s, s).
    """
    near, _, weights = macro_points(d, k)
    s, number = bubbles(d, k).shape[2:]
    at_points = np.einsum("qm,kmsb->skqb", near, bubbles(d, k)).reshape(s, len(weights), number)
    at_points *= np.sqrt(weights)[:, None]
    return at_points, np.einsum("aQx,bQy->xyab", at_points, at_points)


def _bubble_inverse(d: int, k: int, metric: np.ndarray) -> np.ndarray:
    """Invert the energies of the bubbles in some cells.

    Args:
        d: Dimension.
        k: Degree.
        metric: Metric of reference stresses, shape (c, Q or 1, s, s).
    """
    at_points, products = _bubble_map(d, k)
    # A metric that is the same at all points is taken out of their sum.
    if metric.shape[1] == 1:
        energy = np.tensordot(metric[:, 0], products, axes=((1, 2), (2, 3)))
    else:
        energy = np.einsum("aQx,cQab,bQy->cxy", at_points, metric, at_points, optimize=True)
    return np.linalg.inv(energy)


def relaxed(
    cells: CellGeometry, sigma: np.ndarray, elastic: np.ndarray, compliance: np.ndarray
) -> np.ndarray:
    """Return the stress nearest to ``C eps(u^)`` with the same tractions, cell by cell.

    Its divergence is the same, too: the bubbles get their amounts of least energy.

    Args:
        cells: Geometry.
        sigma: Stress of the owned cells, of degree k in the sub-simplices, shape
            (owned, d+1, N_k, s).
        elastic: ``C eps(u^)`` of the owned cells [force/area], shape (owned, Q or 1,
            s).
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).

    Returns:
        The stress [force/area], of the same shape as sigma.
    """
    d, k = cells.d, cells.degree
    near, _, weights = macro_points(d, k)
    at_points, _ = _bubble_map(d, k)
    result = np.empty_like(sigma)
    for chunk in chunks(len(sigma)):
        here = sigma[chunk]
        P = piola(cells, chunk)
        values = np.matmul(near, here).reshape(len(here), -1, here.shape[3])
        difference = values - elastic[chunk]
        # Work of the difference on the bubbles, whose least energy is where it is zero.
        local = compliance[chunk] if len(compliance) > 1 else compliance
        strain = np.matmul(local, difference[..., None])[..., 0]
        dual = np.matmul(strain, P.transpose(0, 2, 1))
        dual *= cells.volume[chunk, None, None] * np.sqrt(weights)[:, None]
        work = np.tensordot(dual, at_points, axes=((1, 2), (1, 0)))
        inverse = _bubble_inverse(d, k, reference_metric(cells, chunk, compliance))
        amount = np.matmul(inverse, work[:, :, None])[..., 0]
        added = np.tensordot(amount, bubbles(d, k), axes=(1, 3))
        result[chunk] = here - np.matmul(added, P[:, None])
    return result


class ComplementaryEnergy:
    """Compute the complementary energy as a quadratic form of hierarchical moments.

    Args:
        cells: Geometry, n cells.
        owned: Number of owned cells, the first ones.
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).
    """

    def __init__(self, cells: CellGeometry, owned: int, compliance: np.ndarray) -> None:
        self.cells = cells
        self.owned = owned
        self.compliance = np.ascontiguousarray(compliance)
        self.table = macro_table(cells.d, cells.degree, compliance.shape[1] > 1)

    def __call__(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Compute the energy of moments x of the owned cells, and half its derivative.

        Moments and derivative have the shape (F, m, d).
        """
        half = np.zeros_like(x)
        energy = self._add(slice(0, self.owned), x, None, None, half)
        return energy, half

    def start(
        self, moment: np.ndarray, force: np.ndarray | None, elastic: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Compute ``|sigma^ - C eps(u^)|^2`` and half its derivative.

        They are those of the owned cells.         The map from moments to stresses
        reproduces constant stresses. So the mean of C eps(u^) in a cell is subtracted
        from its tractions.

        Args:
            moment: Hierarchical moments, shape (F, m, d).
            force: Coefficients of the body force times volume, shape (n, N_(k-1), d),
                or None.
            elastic: ``C eps(u^)`` of the owned cells, shape (owned, Q or 1, s).
        """
        cells = self.cells
        d = cells.d
        half = np.zeros_like(moment)
        if elastic.shape[1] == 1:
            mean = tensors(elastic[:, 0], d)
            return self._add(slice(0, self.owned), moment, mean, None, half), half
        _, _, weights = macro_points(d, cells.degree)
        square = 0.0
        for chunk in chunks(self.owned):
            means = weights @ elastic[chunk]
            # What C eps(u^) has beside its mean, pulled back to the reference simplex.
            deviation = np.matmul(self.table.from_points, means[:, None] - elastic[chunk])
            transposed = piola(cells, chunk).transpose(0, 2, 1)
            offset = np.linalg.solve(transposed, deviation.transpose(0, 2, 1)).transpose(0, 2, 1)
            if force is not None:
                inside = np.matmul(force[chunk], cells.inverse[chunk].transpose(0, 2, 1))
                offset = offset + np.tensordot(inside, self.table.body, axes=((1, 2), (2, 3)))
            offset = np.ascontiguousarray(offset)
            square += self._add(chunk, moment, tensors(means, d), offset, half)
        return square, half

    def _add(
        self,
        chunk: slice,
        x: np.ndarray,
        mean: np.ndarray | None,
        offset: np.ndarray | None,
        half: np.ndarray,
    ) -> float:
        """Add half the derivative of the energy of some cells; return their energy.

        In each cell the reference stress is ``A J^-1 (x - mean n) + offset``, with A
        the table's matrix, and the energy ``min_b |stress + bubbles b|^2`` in the
        metric ``|T| P C^-1 P^T`` of reference stresses.

        Args:
            chunk: Cells.
            x: Hierarchical moments on the first sides of the facets, shape (F, m, d).
            mean: A stress in each cell whose tractions are subtracted, shape (c, d, d),
                or None.
            offset: Reference stresses that are added, shape (c, Q, s), or None.
            half: Half the derivative, which the result is added to, shape (F, m, d).
        """
        cells = self.cells
        table = self.table
        compliance = self.compliance
        sizes = (cells.d, x.shape[1], chunk.start, chunk.stop)
        geometry = (cells.edges, cells.facets, cells.side)
        material = (compliance, len(compliance) > 1, compliance.shape[1])
        to_stress = (table.to_coefficients, table.count, *table.stress, *table.back)
        to_energy = (*table.weights, table.bubbles.shape[1], table.bubbles, table.products)
        fields = (x, mean, offset, half)
        return kernels()(
            "macro_energy", *sizes, *geometry, *material, *to_stress, *to_energy, *fields
        )
