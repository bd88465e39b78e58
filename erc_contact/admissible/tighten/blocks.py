"""The quadratic part of the facet tractions: one small problem of complementary energy for each facet.

A traction of degree 2 is the sum of a linear part, which balances the cells
(:mod:`erc_contact.admissible.tighten.patches`), and a part orthogonal to all linear functions on its facet. The latter
does no work on rigid motions, so it can be chosen freely on each facet.

Symbols as in :mod:`erc_contact.admissible.tighten.complementary`; j = m - d quadratic moments a component.
"""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.tighten.complementary import ComplementaryEnergy, chunks, stress_map, times


class Blocks:
    """Solves the minimisation for the quadratic moments of every facet of this rank.

    Args:
        energy: The complementary energy.
        free: Components of facets whose traction is not given, shape (F, d).
        mine: Facets that this rank solves for; it has both cells of each. Shape (F,).

    Attributes:
        inverse: Inverse of the matrix of each facet, zero where nothing is free, shape (F, d j, d j).
    """

    def __init__(self, energy: ComplementaryEnergy, free: np.ndarray, mine: np.ndarray) -> None:
        cells, d, m = energy.cells, energy.cells.d, energy.m
        size = d * (m - d)
        matrices = np.zeros((len(free), size, size))
        quadratic = stress_map(d, cells.degree)[:, :, :, d:]  # (s, Q, d, j, d+1)
        s = len(quadratic)
        for f in range(d + 1):
            unit = quadratic[..., f].reshape(s, -1, size)
            products = np.einsum("aQx,bQy->xyab", unit, unit).reshape(size * size, s * s)
            for some in chunks(len(cells.nodes), d):
                metric = energy.metric[..., some].mean(axis=2).reshape(s * s, -1)
                back = energy.inverse[..., some].transpose(1, 0, 2, 3)
                local = (products @ metric).reshape(d, m - d, size, -1)
                local = times(back, local).reshape(size, d, m - d, -1).transpose(1, 2, 0, 3)
                local = times(back, local).reshape(size, size, -1)
                np.add.at(matrices, energy.facets[f, some], local.transpose(2, 1, 0))
        keep = np.repeat(free, m - d, axis=1) & mine[:, None]
        keep &= np.einsum("nii->ni", matrices) > 0
        both = keep[:, :, None] & keep[:, None, :]
        self.inverse = np.where(both, np.linalg.inv(np.where(both, matrices, np.eye(size))), 0.0)

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Corrections for the residual r of the quadratic moments [length], shape (d, j, F)."""
        flat = r.reshape(self.inverse.shape[1], r.shape[-1])
        return np.matmul(self.inverse, flat.T[:, :, None])[..., 0].T.reshape(r.shape)
