"""The quadratic part of the facet tractions: one small problem for each facet.

The problem is one of complementary energy. A traction of degree 2 is the sum of a
linear part, which balances the cells (:mod:`erc_contact.admissible.tighten.patches`),
and a part orthogonal to all linear functions on its facet. The latter does no work on
rigid motions, so it can be chosen freely on each facet.

Symbols as in :mod:`erc_contact.admissible.tighten.complementary`; j = m - d quadratic
moments a component.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.tighten.tables import stress_map, upper_entries


class Blocks:
    """Solve the minimisation for the quadratic moments of every facet of this rank.

    Args:
        cells: Geometry, n cells.
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).
        free: Components of facets whose traction is not given, shape (F, d).
        mine: Facets that this rank solves for; it has both cells of each. Shape (F,).

    Attributes:
        inverse: d times the inverse of the matrix of each facet, zero where nothing is
            free, shape (F, j d, j d).
    """

    def __init__(
        self, cells: CellGeometry, compliance: np.ndarray, free: np.ndarray, mine: np.ndarray
    ) -> None:
        table, j = _facet_table(cells.d, cells.degree)
        size = j * cells.d
        # A preconditioner needs the mean of the moduli of a cell only.
        mean = np.ascontiguousarray(compliance.mean(axis=1))
        of_cells = (len(cells.nodes), cells.edges, cells.facets)
        material = (mean, len(compliance) > 1)
        # The patches add up d corrections of each facet, as many as it has centres. The
        # blocks get the same weight.
        self.inverse = np.zeros((len(free), size, size))
        of_facets = (len(free), free, mine, self.inverse)
        kernels(cells.d)("facet_blocks", *of_cells, *material, table, *of_facets)

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Correct for the residual of the quadratic moments [length], (F, j, d)."""
        columns = r.reshape(*self.inverse.shape[:2], 1)
        return np.matmul(self.inverse, columns).reshape(r.shape)


@cache
def _facet_table(d: int, k: int) -> tuple[np.ndarray, int]:
    """Compute the energies of the quadratic moments of each facet of a cell.

    Returns:
        For each facet, and each two of its moments, a lower triangle row by row, the
        factors of the entries a <= b of the metric, shape (d+1, entries, s (s + 1)/2);
        and j.
    """
    quadratic = stress_map(d, k)[:, :, :, d:]  # (s, Q, d+1, j, d)
    unit = quadratic.reshape(*quadratic.shape[:3], -1)
    products = upper_entries(np.einsum("aqfx,bqfy->fxyab", unit, unit, optimize=True))
    row, column = np.tril_indices(unit.shape[3])
    return np.ascontiguousarray(products[:, row, column]), quadratic.shape[3]
