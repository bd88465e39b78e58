"""Tighten the admissible stress: less complementary energy, with every iterate in equilibrium.

The bulk part of the error is ``|sigma^ - C eps(u^)|``, and sigma^ is linear in the moments of the facet tractions.
Corrections of these moments that leave every cell in equilibrium, and are zero where the traction is given, lower it.
They are found by conjugate gradients. The preconditioner adds up the results of the same minimisation on small patches,
and of that on facets for their quadratic part. The iteration may end after any step. Its result is the same on any
number of ranks.

Source: Ladeveze, Leguillon, SIAM J. Numer. Anal. 20 (1983), for the energy of facet tractions; the patches are ours.
"""

from __future__ import annotations

import numpy as np
from dolfinx import la
from mpi4py import MPI

from erc_contact.admissible.cells import CellGeometry, facet_order
from erc_contact.admissible.tighten.blocks import Blocks
from erc_contact.admissible.tighten.complementary import ComplementaryEnergy, hierarchical
from erc_contact.admissible.tighten.patches import Patches
from erc_contact.model.space import Space

TIGHTEN = 10
"""Default limit of the iterations; except near incompressibility, GAIN ends them before."""
GAIN = 0.02
"""The iteration ends after a step that lowers the bulk part of the error by less than this fraction of it. A step costs
about 2% of the run time of a mesh; spent on a finer mesh, that lowers the error by 1%, and the next step gains less."""


def tightened(
    space: Space,
    cells: CellGeometry,
    moment: np.ndarray,
    force: np.ndarray | None,
    free: np.ndarray,
    elastic: np.ndarray,
    compliance: np.ndarray,
    iterations: int,
) -> tuple[np.ndarray, int]:
    """Tighten the moments of facet tractions that are in equilibrium; collective.

    Args:
        space: The mesh.
        cells: Geometry, n cells.
        moment: Moments on the first side of each facet [force], shape (F, m, d).
        force: Body force times volume of each cell [force], shape (n, N_(k-1), d), or None.
        free: Components of facets whose traction is not given, shape (F, d).
        elastic: ``C eps(u^)`` of the owned cells [force/area], shape (owned, Q or 1, s).
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).
        iterations: Limit of the iterations.

    Returns:
        The moments, and the number of iterations.
    """
    comm, d, m = space.comm, cells.d, moment.shape[1]
    facets = space.mesh.topology.index_map(d - 1)
    shared = la.vector(facets, d * m)
    vertices = space.global_numbers(cells.vertices_of_facets)
    order = facet_order(vertices, cells.degree).T  # the ranks do not agree on the order of the nodes
    back = np.argsort(order, axis=0)

    def total(values: np.ndarray) -> np.ndarray:
        """Sum of the values of all ranks for each facet."""
        if comm.size > 1:
            sent = np.take_along_axis(values, order[None], axis=1)
            shared.array[:] = sent.reshape(d * m, -1).T.ravel()
            shared.scatter_reverse(la.InsertMode.add)
            shared.scatter_forward()
            sent = shared.array.reshape(-1, d * m).T.reshape(values.shape)
            values[:] = np.take_along_axis(sent, back[None], axis=1)
        return values

    def dot(a: np.ndarray, b: np.ndarray) -> float:
        owned = facets.size_local
        rows = zip(a.reshape(d * m, -1), b.reshape(d * m, -1), strict=True)
        return comm.allreduce(float(sum(np.vdot(x[:owned], y[:owned]) for x, y in rows)), MPI.SUM)

    energy = ComplementaryEnergy(cells, space.domain.owned_cells, compliance)
    to_ours = hierarchical(d, cells.degree)
    square, r = energy.start(np.ascontiguousarray(np.matmul(to_ours, moment).transpose(2, 1, 0)), force, elastic)
    square = comm.allreduce(square, MPI.SUM)
    patches = Patches(space, energy, free)
    mine = np.take_along_axis(cells.vertices_of_facets, order[:1].T, axis=1)[:, 0] < space.V.dofmap.index_map.size_local
    blocks = Blocks(energy, free, mine) if m > d else None

    def precondition(r: np.ndarray) -> np.ndarray:
        z = patches(r[:, :d])
        return z if blocks is None else np.concatenate([z, blocks(r[:, d:])], axis=1)

    r = -total(r)
    x, p, rz, done = np.zeros_like(r), np.zeros_like(r), 1.0, 0
    while done < iterations:
        z = total(precondition(r))
        new = dot(r, z)
        if not new > np.finfo(float).eps ** 2 * square:  # at the minimum, or nothing is free
            break
        p *= new / rz if done else 0.0
        p += z
        rz = new
        image = total(energy(p))
        step = rz / dot(p, image)
        x += step * p
        r -= step * image
        before, square, done = square, square - step * rz, done + 1
        if square > (1 - GAIN) ** 2 * before:
            break
    return moment + np.matmul(np.linalg.inv(to_ours), x.transpose(2, 1, 0)), done
