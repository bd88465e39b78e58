"""Small problems of complementary energy on patches of cells.

They are the preconditioner of the tightening. The centre of a patch is a vertex in 2D
and an edge in 3D; the patch is the ring of facets and cells around it. A moment ``int_F
t phi_l`` is a force at node l of a facet. What is in balance on every cell of a ring is
a sum of

- the same force at a node of the centre on all facets of the ring, passed on from cell
  to cell;
- the same couple about the centre on all facets: ``(g_j . g_l)/|g_j| n`` at node l of a
  facet with normal n, where j is the node that is not on the centre and g are the
  gradients of the barycentric coordinates in the facet. None passes from a rigid face
  whose moment is given to another part of the boundary;
- opposite forces at the two ends of an edge of one facet, as a bar of a truss carries
  them.

So equilibrium holds by construction, to round-off. In 2D these are the degrees of
freedom of Airy's function in the space of Hsieh, Clough and Tocher. The factors of the
matrices of the patches are kept with 31 binary digits counted from the largest entry of
a row: in half the memory of double precision, and 100 times nearer to it than single
precision, so that the error does not depend on the number of ranks in more than its
last digits.

A patch has ``(d-1)d + 1`` forces and couples, and each facet ``d(d-1)/2`` bars.

Symbols: d dimension, F facets, H patches, m moments of a facet and component. A pair
``d * facet + j`` is the facet in the ring of the centre that is opposite to its node j.
A step of a ring is a number ``2 * pair + q``, with q = 1 if the first cell of the facet
comes after it in the ring, and q = 0 if the second cell does.

Source: Clough, Tocher (1965) for the space in 2D; the basis by forces, couples and bars
is ours.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.shared_moments import global_numbers
from erc_contact.admissible.tighten.tables import stress_map, upper_entries
from erc_contact.model.space import Space
from namedmesh.for_solvers import count_up
from namedmesh.simplex import facet_vertices, nodes


class Patches:
    """Solve the minimisation on each patch of this rank, and add up the results.

    The unknowns of a patch are d(d-1) forces at the nodes of its centre, the couple,
    and the bars of each facet.

    Args:
        space: The mesh.
        cells: Geometry, n cells.
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).
        free: Components of facets whose traction is not given, shape (F, d).
        turning: Number of the rigid face that turns freely at each facet, 0 elsewhere,
            shape (F,); None without any.

    Attributes:
        ring: Steps of all rings, see :func:`rings`.
        size: Number of facets of each ring, ascending, shape (H,).
        factor: Cholesky factors L of the scaled matrices of the patches, row by row, in
            whole numbers; some patches of one size side by side.
        unit: What 1 stands for in each row of the factors.
        scale: Factors of the inverses ``L^-T L^-1`` [force/length].
    """

    def __init__(
        self,
        space: Space,
        cells: CellGeometry,
        compliance: np.ndarray,
        free: np.ndarray,
        turning: np.ndarray | None = None,
    ) -> None:
        d = cells.d
        self.ring, self.size = rings(space, cells)
        sizes, counts = np.unique(self.size, return_counts=True)
        unknowns = (d - 1) * d + 1 + d * (d - 1) // 2 * sizes
        entries = unknowns * (unknowns + 1) // 2
        # The processor factorises as many patches of one size at once as it has lanes.
        lanes = kernels(d)("lane_count")
        batches = -(-counts // lanes)
        self.factor = np.empty(lanes * int(batches @ entries), dtype=np.int32)
        self.unit = np.empty(lanes * int(batches @ unknowns), dtype=np.float32)
        self.scale = np.empty(lanes * int(batches.sum()))
        patches = (len(self.size), self.ring, self.size)
        geometry = (cells.edges, cells.facets, cells.side)
        # A preconditioner needs the mean of the moduli of a cell only.
        mean = np.ascontiguousarray(compliance.mean(axis=1))
        material = (mean, len(compliance) > 1)
        factors = (self.factor, self.unit, self.scale)
        kernels(d)(
            "factor_patches",
            *patches,
            *geometry,
            len(free),
            free,
            turning,
            *material,
            _facet_pair(d),
            *factors,
        )
        m = len(nodes(d - 1, cells.degree))
        of_rings = (m, len(self.size), self.ring, self.size)
        if cells.images.more_nodes:
            self.scale[_in_batches(counts, lanes)] /= _turns_about(cells, self.ring, self.size)
        self._apply = kernels(d).bound(
            "apply_patches", *of_rings, cells.edges, cells.side, *factors
        )

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Sum the corrections of all patches for the residual r [length].

        Only the first d moments count; the others are linearly independent of them, and
        0 in the result. Residual and result have the shape (F, m, d).
        """
        z = np.zeros_like(r)
        self._apply(r, z)
        return z


def _in_batches(counts: np.ndarray, lanes: int) -> np.ndarray:
    """Return the place of each patch, of which as many of a size are side by side.

    Args:
        counts: Number of the patches of each size, shape (sizes,).
        lanes: Number of patches side by side.
    """
    begin = lanes * np.append(0, np.cumsum(-(-counts // lanes)))[:-1]
    return np.repeat(begin, counts) + count_up(counts)


def _turns_about(cells: CellGeometry, ring: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return how many motions between copies leave each ring in place, shape (H,).

    Such a ring is met once by each of them, and counts once.
    """
    d = cells.d
    facet, j = np.divmod(ring[np.cumsum(size) - size] // 2, d)
    centres = cells.vertices_of_facets[facet[:, None], facet_vertices(d - 1)[j]]
    return np.asarray(cells.images.turns_about(centres))


@cache
def _facet_pair(d: int) -> np.ndarray:
    """Compute the energies of moments on two facets of the reference simplex.

    The facets are d and d-1, the degree is 1.

    Returns:
        For each two of the moments, a lower triangle row by row, the factors of the
        entries a <= b of the metric, shape (d^2 (2 d^2 + 1), s (s + 1)/2).
    """
    unit = stress_map(d, 1)[:, :, [d, d - 1]].reshape(d * (d + 1) // 2, -1, 2 * d * d)
    products = upper_entries(np.einsum("aqx,bqy->xyab", unit, unit))
    return np.ascontiguousarray(products[np.tril_indices(2 * d * d)])


def rings(space: Space, cells: CellGeometry) -> tuple[np.ndarray, np.ndarray]:
    """Find the rings of this rank, in a row, the smallest rings first.

    A centre belongs to the rank that owns its node of least global number. That rank
    has all cells around it. Each ring is walked along, all in the same sense. It starts
    at the boundary if it ends there.

    Returns:
        The steps of all rings, and the number of facets of each, both of type int32.
    """
    d = cells.d
    nodes = cells.vertices_of_facets
    owned = space.V.dofmap.index_map.size_local
    number = global_numbers(space, cells, nodes)
    has_cell = cells.side[0] >= 0
    facets = np.arange(len(nodes))
    mine = np.empty(nodes.shape, dtype=bool)
    for j, centre in enumerate(facet_vertices(d - 1)):
        first = number[:, centre].argmin(axis=1)
        mine[:, j] = (nodes[facets, centre[first]] < owned) & has_cell
        mine[:, j] &= cells.images.are_own(nodes[:, centre])
    steps = int(mine.sum())
    ring, size = np.empty((2, steps), dtype=np.int32)
    count = kernels(d)(
        "find_rings", mine.size, cells.edges, cells.facets, cells.side, mine, ring, size
    )
    # Sort the rings by size: a step moves by the difference of the starts of its ring.
    size = size[:count]
    start = np.cumsum(size) - size
    by_size = np.argsort(size, kind="stable")
    size = size[by_size]
    new_start = np.cumsum(size) - size
    shift = np.repeat(start[by_size] - new_start, size)
    return ring[shift + np.arange(steps)], size
