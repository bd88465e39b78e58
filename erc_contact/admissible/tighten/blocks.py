"""The quadratic part of the facet tractions: one small problem for each facet.

The problem is one of complementary energy. A traction of degree 2 is the sum of a
linear part, which balances the cells (:mod:`erc_contact.admissible.tighten.patches`),
and a part orthogonal to all linear functions on its facet. The latter does no work on
rigid motions, so it can be chosen freely on each facet.

Symbols as in :mod:`erc_contact.admissible.tighten.complementary`; j = m - d quadratic
moments a component.
"""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.macro import chunks, reference_metric
from erc_contact.admissible.tighten.tables import stress_map


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
        matrices = _facet_matrices(cells, compliance, len(free))
        size = matrices.shape[1]
        j = size // cells.d
        # Components without energy have no equation.
        keep = np.tile(free, j) & mine[:, None]
        keep &= np.einsum("nii->ni", matrices) > 0
        both = keep[:, :, None] & keep[:, None, :]
        inverse = np.linalg.inv(np.where(both, matrices, np.eye(size)))
        # The patches add up d corrections of each facet, as many as it has centres. The
        # blocks get the same weight.
        self.inverse = np.where(both, cells.d * inverse, 0.0)

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Correct for the residual of the quadratic moments [length], (F, j, d)."""
        columns = r.reshape(*self.inverse.shape[:2], 1)
        return np.matmul(self.inverse, columns).reshape(r.shape)


def _facet_matrices(cells: CellGeometry, compliance: np.ndarray, count: int) -> np.ndarray:
    """Assemble the energies of the quadratic moments of every facet.

    Args:
        cells: Geometry, n cells.
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).
        count: Number of facets.

    Returns:
        Matrices, shape (count, j d, j d).
    """
    d = cells.d
    quadratic = stress_map(d, cells.degree)[:, :, :, d:]  # (s, Q, d+1, j, d)
    s = len(quadratic)
    j = quadratic.shape[3]
    products = []
    for f in range(d + 1):
        unit = quadratic[:, :, f].reshape(s, -1, j * d)
        products.append(np.einsum("aQx,bQy->abxy", unit, unit).reshape(s * s, -1))
    mean = compliance.mean(axis=1, keepdims=True)
    matrices = np.zeros((count, j * d, j * d))
    for chunk in chunks(len(cells.nodes)):
        metric = reference_metric(cells, chunk, mean).reshape(-1, s * s)
        inverse = cells.inverse[chunk]
        for f in range(d + 1):
            # The Jacobian maps both moments: the columns first, then the rows.
            local = (metric @ products[f]).reshape(-1, j * d * j, d)
            local = np.matmul(local, inverse).reshape(-1, j, d, j * d).transpose(0, 1, 3, 2)
            local = np.matmul(local.reshape(len(local), -1, d), inverse)
            local = local.reshape(-1, j, j * d, d).transpose(0, 1, 3, 2)
            np.add.at(matrices, cells.facets[chunk, f], local.reshape(-1, j * d, j * d))
    return matrices
