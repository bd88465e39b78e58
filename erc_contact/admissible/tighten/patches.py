"""Small problems of complementary energy on patches of cells: the preconditioner of the tightening.

The centre of a patch is a vertex in 2D and an edge in 3D; the patch is the ring of
facets and cells around it. A moment ``int_F t phi_l`` is a force at node l of a facet.
What is in balance on every cell of a ring is a sum of

- the same force at a node of the centre on all facets of the ring, passed on from cell
  to cell;
- the same couple about the centre on all facets: ``(g_j . g_l)/|g_j| N`` at node l of a
  facet with normal N, where j is the node that is not on the centre and g are the
  gradients of the barycentric coordinates in the facet;
- opposite forces at the two ends of an edge of one facet, as a bar of a truss carries
  them.

So equilibrium holds by construction, to round-off. In 2D these are the degrees of
freedom of Airy's function in the space of Hsieh, Clough and Tocher. The factors of the
matrices of the patches are kept with 31 binary digits counted from the largest entry of
a row: in half the memory of double precision, and 100 times nearer to it than single
precision, so that the error does not depend on the number of ranks in more than its
last digits.

Symbols: d dimension, w = (d-1)d + 1 forces and couple of a patch, b = d(d-1)/2 bars of
a facet, F facets, H patches, m moments of a facet and component.

Source: Clough, Tocher (1965) for the space in 2D; the basis by forces, couples and bars
is ours.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.tighten.rings import rings
from erc_contact.admissible.tighten.tables import stress_map
from erc_contact.model.space import Space


class Patches:
    """Solves the minimisation on each patch of this rank, and adds up the results.

    The unknowns of a patch are d(d-1) forces at the nodes of its centre, the couple,
    and the bars of each facet.

    Args:
        space: The mesh.
        cells: Geometry, n cells.
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).
        free: Components of facets whose traction is not given, shape (F, d).

    Attributes:
        ring: Steps of all rings, see :func:`rings`.
        size: Number of facets of each ring, ascending, shape (H,).
        factor: Cholesky factors L of the scaled matrices of the patches, row by row, in
            whole numbers; some patches of one size side by side.
        unit: What 1 stands for in each row of the factors.
        scale: Factors of the inverses ``L^-T L^-1`` [force/length].
    """

    def __init__(
        self, space: Space, cells: CellGeometry, compliance: np.ndarray, free: np.ndarray
    ) -> None:
        self.cells, d = cells, cells.d
        self.ring, self.size = rings(space, cells)
        sizes, counts = np.unique(self.size, return_counts=True)
        lanes = kernels()("lane_count")
        unknowns, batches = (d - 1) * d + 1 + d * (d - 1) // 2 * sizes, -(-counts // lanes)
        self.factor = np.empty(
            lanes * int(batches @ (unknowns * (unknowns + 1) // 2)), dtype=np.int32
        )
        self.unit = np.empty(lanes * int(batches @ unknowns), dtype=np.float32)
        self.scale = np.empty(lanes * int(batches.sum()))
        kernels()(
            "factor_patches",
            *(
                d,
                len(self.size),
                self.ring,
                self.size,
                cells.edges,
                cells.facets,
                cells.side,
                len(free),
                free,
            ),
            *(np.ascontiguousarray(compliance.mean(axis=1)), len(compliance) > 1, _facet_pair(d)),
            *(self.factor, self.unit, self.scale),
        )

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Sum of the corrections of all patches for the residual r [length], shape (F, m, d).

        Only the first d moments count; the others are linearly independent of them, and
        0 in the result.
        """
        z = np.zeros_like(r)
        kernels()(
            "apply_patches",
            *(
                self.cells.d,
                r.shape[1],
                len(self.size),
                self.ring,
                self.size,
                self.cells.edges,
                self.cells.side,
            ),
            *(self.factor, self.unit, self.scale, r, z),
        )
        return z


@cache
def _facet_pair(d: int) -> np.ndarray:
    """Energies of moments on facets d and d-1 of the reference simplex, for degree 1.

    Returns:
        For each two of the moments, a lower triangle row by row, the factors of the
        entries a <= b of the metric, shape (d^2 (2 d^2 + 1), s (s + 1)/2).
    """
    unit = stress_map(d, 1)[:, :, [d, d - 1]].reshape(d * (d + 1) // 2, -1, 2 * d * d)
    a, b = np.triu_indices(len(unit))
    products = np.einsum("aqx,bqy->xyab", unit, unit)
    products = (products + products.transpose(0, 1, 3, 2))[..., a, b] / np.where(a == b, 2, 1)
    return np.ascontiguousarray(products[np.tril_indices(2 * d * d)])
