"""Tighten the admissible stress: less complementary energy, with every iterate in equilibrium.

The bulk part of the error is ``|sigma^ - C eps(u^)|``, and sigma^ is linear in the moments of the facet tractions.
Corrections of these moments that leave every cell in equilibrium, and are zero where the traction is given, lower it:
conjugate gradients, preconditioned by the same minimisation on small patches, all results added. The number of steps
is free, and any number gives the same on any number of ranks.

Source: Ladeveze, Leguillon, SIAM J. Numer. Anal. 20 (1983), for the energy of facet tractions; the patches are ours.
"""

from __future__ import annotations

import numpy as np
from dolfinx import la
from mpi4py import MPI

from erc_contact.admissible.energy import Energy
from erc_contact.admissible.geometry import Simplices
from erc_contact.admissible.patches import Patches, facet_nodes, global_nodes
from erc_contact.model import Model

GAIN = 0.02
"""The iteration ends after a step that lowers the bulk part of the error by less than this fraction of it. A step costs
about 2% of the run time of a mesh; spent on a finer mesh, that lowers the error by 1%, and the next step gains less."""


def tightened(
    model: Model,
    cells: Simplices,
    moment: np.ndarray,
    force: np.ndarray | None,
    free: np.ndarray,
    elastic: np.ndarray,
    compliance: np.ndarray,
    iterations: int,
) -> tuple[np.ndarray, int]:
    """Tighten the moments of facet tractions that are in equilibrium; collective.

    Args:
        model: The scene on a mesh.
        cells: Geometry, n cells.
        moment: Moments on the first side of each facet [force], shape (F, d, d).
        force: Total body force of each cell [force], shape (n, d), or None.
        free: Components of facets whose traction is not given, shape (F, d).
        elastic: ``C eps(u^)`` of the owned cells [force/area], shape (owned, q or 1, s).
        compliance: C^-1 [area/force], shape (n or 1, q or 1, s, s).
        iterations: At most so many.

    Returns:
        The moments, and the number of iterations.
    """
    comm, d = model.comm, cells.d
    facets = model.mesh.topology.index_map(d - 1)
    shared = la.vector(facets, d * d)
    nodes = facet_nodes(cells)
    order = np.argsort(global_nodes(model)[nodes], axis=1).T  # the ranks do not agree on the order of the nodes
    back = np.argsort(order, axis=0)

    def total(values: np.ndarray) -> np.ndarray:
        """Sum what the ranks have for each facet."""
        if comm.size > 1:
            sent = np.take_along_axis(values, order[None], axis=1)
            shared.array[:] = sent.reshape(d * d, -1).T.ravel()
            shared.scatter_reverse(la.InsertMode.add)
            shared.scatter_forward()
            sent = shared.array.reshape(-1, d * d).T.reshape(values.shape)
            values[:] = np.take_along_axis(sent, back[None], axis=1)
        return values

    def dot(a: np.ndarray, b: np.ndarray) -> float:
        owned = facets.size_local
        rows = zip(a.reshape(d * d, -1), b.reshape(d * d, -1), strict=True)
        return comm.allreduce(float(sum(np.vdot(x[:owned], y[:owned]) for x, y in rows)), MPI.SUM)

    energy = Energy(cells, model.domain.owned_cells, compliance)
    square, r = energy.start(moment, force, elastic)
    square = comm.allreduce(square, MPI.SUM)
    patches = Patches(model, energy, free)
    r = -total(r)
    x, p, rz, done = np.zeros_like(r), np.zeros_like(r), 1.0, 0
    while done < iterations:
        z = total(patches(r))
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
    return moment + x.transpose(2, 1, 0), done
