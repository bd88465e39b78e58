"""The complementary energy of sigma^ - C eps(u^) as a quadratic form of facet moments.

On the reference simplex the stress is one sparse matrix times the moments of the facet
tractions (:mod:`erc_contact.admissible.tighten.tables`). A product passes once over the
cells, in compiled code. The stresses without tractions (the bubbles of degree 2) always
have the amounts of least energy. To find them takes most of such a pass. So where there
are bubbles, matrices of cells are kept, as many as :data:`MOST_KEPT` allows. A product
with them takes a quarter of a pass in the plane and in 3D, and a twentieth in 3D where
the moduli vary inside cells. Scaled to a diagonal of 1 they have 30 binary digits, in
half the memory of double precision.

Moments are taken against the linear functions on a facet and, for degree 2, against the
functions ``B_e - P B_e`` with P the L2 projection on linear functions. The linear part
alone balances a cell. These moments are called hierarchical.

Symbols: d dimension, s = d(d+1)/2, Q points in the sub-simplices of a cell, n cells, F
facets, m moments of a facet and component, c cells of a chunk.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.tighten.tables import elastic_table, macro_table

MOST_KEPT = 500_000_000
"""Memory for the matrices of cells of a rank, 45 000 tetrahedra of degree 2 [bytes]."""


def relax(
    cells: CellGeometry, sigma: np.ndarray, elastic: np.ndarray, compliance: np.ndarray
) -> np.ndarray:
    """Return the stress nearest to ``C eps(u^)`` with the same tractions, cell by cell.

    Its divergence is the same, too: the bubbles get their amounts of least energy.

    Args:
        cells: Geometry.
        sigma: Stress of the owned cells, of degree k in the sub-simplices, shape
            (owned, d+1, N_k, s). The result takes its place.
        elastic: ``C eps(u^)`` of the owned cells [force/area], shape (owned, b, s), see
            :func:`elastic_coefficients`.
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).

    Returns:
        The stress [force/area], of the same shape as sigma.
    """
    d, k = cells.d, cells.degree
    points = compliance.shape[1]
    table = macro_table(d, k, points)
    nodal_bubbles = macro_table(d, k, 1).bubbles
    nodes = sigma.shape[1] * sigma.shape[2]
    b = elastic.shape[1]
    sizes = (nodes, len(sigma))
    material = (np.ascontiguousarray(compliance), len(compliance) > 1, compliance.shape[1])
    bubbles = (nodal_bubbles.shape[1], nodal_bubbles, table.bubbles, table.transposed)
    tables = (table.count, *table.nodal, *table.weights, *bubbles, table.products)
    given = (b, np.ascontiguousarray(elastic), *elastic_table(d, k, points, b).rows)
    kernels(d)("relax_stresses", *sizes, cells.edges, *material, *tables, *given, sigma)
    return sigma


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
        self.table = macro_table(cells.d, cells.degree, compliance.shape[1])
        self._kept, self._of_kept = self._matrices()
        self._of_moments = self._bound(self._kept, None, None)

    def __call__(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Compute the energy of moments x of the owned cells, and half its derivative.

        Moments and derivative have the shape (F, m, d).
        """
        half = np.zeros_like(x)
        return self._of_kept(x, half) + self._of_moments(x, half), half

    def start(
        self, moment: np.ndarray, force: np.ndarray | None, elastic: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Compute ``|sigma^ - C eps(u^)|^2`` and half its derivative.

        Both are sums over the owned cells. The map from moments to stresses reproduces
        constant stresses. So the mean of C eps(u^) in a cell is subtracted from its
        tractions.

        Args:
            moment: Hierarchical moments, shape (F, m, d).
            force: Coefficients of the body force times volume, shape (n, N_(k-1), d),
                or None.
            elastic: ``C eps(u^)`` of the owned cells, shape (owned, b, s), see
                :func:`elastic_coefficients`.
        """
        half = np.zeros_like(moment)
        energy = self._bound(0, force, np.ascontiguousarray(elastic))
        return energy(moment, half), half

    def _matrices(self) -> tuple[int, Callable[[np.ndarray, np.ndarray], float]]:
        """Make the matrices of the first cells.

        Returns:
            The number of these cells, and their energy, a function as :meth:`_bound`
            returns it.
        """
        cells, table, compliance = self.cells, self.table, self.compliance
        m, bubbles = len(table.to_coefficients), table.bubbles.shape[1]
        inputs = (cells.d + 1) * m * cells.d
        entries = inputs * (inputs + 1) // 2
        library = kernels(cells.d)
        lanes = library("lane_count")
        most = MOST_KEPT // (4 * entries + 8 * inputs) if bubbles else 0
        kept = min(self.owned, most // lanes * lanes)
        padded = -(-kept // lanes) * lanes
        matrix, scale = np.empty(padded * entries, np.int32), np.empty(padded * inputs)
        geometry = (cells.edges, cells.facets, cells.side)
        material = (compliance, len(compliance) > 1, compliance.shape[1])
        tables = (table.count, bubbles, table.functions, table.products)
        library("energy_matrices", m, kept, *geometry, *material, *tables, matrix, scale)
        return kept, library.bound("matrix_energy", m, kept, cells.facets, matrix, scale)

    def _bound(
        self, begin: int, force: np.ndarray | None, elastic: np.ndarray | None
    ) -> Callable[[np.ndarray, np.ndarray], float]:
        """Return what computes the energy of moments, and adds half its derivative.

        In each cell the reference stress is ``A J^-1 (x - mean n) + offset``, with A
        the table's matrix, and the energy ``min_b |stress + bubbles b|^2`` in the
        metric ``|T| P C^-1 P^T`` of reference stresses. The offset is what the body
        force and C eps(u^), beside its mean, have there.

        Args:
            begin: The first cell that counts.
            force: Coefficients of the body force times volume, or None.
            elastic: A stress that is subtracted, shape (owned, b, s), or None.

        Returns:
            A function of the hierarchical moments x on the first sides of the facets,
            and of what half the derivative is added to, both of shape (F, m, d).
        """
        cells = self.cells
        table = self.table
        compliance = self.compliance
        sizes = (len(table.to_coefficients), begin, self.owned)
        geometry = (cells.edges, cells.facets, cells.side)
        material = (compliance, len(compliance) > 1, compliance.shape[1])
        to_stress = (table.to_coefficients, table.count, *table.stress, *table.back)
        bubbles = (table.bubbles.shape[1], table.bubbles, table.transposed, table.products)
        to_energy = (*table.weights, *bubbles)
        b = 1 if elastic is None else elastic.shape[1]
        mean, rows = elastic_table(cells.d, cells.degree, compliance.shape[1], b)
        of_elastic = (b, elastic, mean, *rows)
        forces = 0 if force is None else force.shape[1] * cells.d
        of_force = (forces, force, table.body)
        first = (*sizes, *geometry, *material, *to_stress, *to_energy, *of_elastic, *of_force)
        return kernels(cells.d).bound("macro_energy", *first)
