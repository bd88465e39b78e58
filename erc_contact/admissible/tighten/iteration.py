"""Tighten the admissible stress: minimise its complementary energy in equilibrium.

The bulk part of the error is ``|sigma^ - C eps(u^)|``. For a given u^ its square is
twice the complementary energy of sigma^, up to a constant. The minimisation of this
energy over stresses in equilibrium is called *tightening* in this package.

The stress sigma^ is linear in the moments of the facet tractions. Corrections of these
moments that leave every cell in equilibrium, and are zero where the traction is given,
lower the energy. They are found by conjugate gradients. The preconditioner adds up the
results of the same minimisation on small patches, and on facets for the quadratic part
of the tractions. The iteration may end
after any step. On other ranks round-off differs. Where many iterations let it grow, in
3D near incompressibility, e then differs by up to 1e-3 of it.

Source: Ladeveze, Leguillon, SIAM J. Numer. Anal. 20 (1983), for the energy of facet
tractions; the patches are ours.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.shared_moments import SharedMoments
from erc_contact.admissible.tighten.blocks import Blocks
from erc_contact.admissible.tighten.complementary import ComplementaryEnergy
from erc_contact.admissible.tighten.patches import Patches
from erc_contact.admissible.tighten.tables import hierarchical
from erc_contact.base.progress import at
from erc_contact.base.runtime.interrupts import check_interrupts
from erc_contact.model.space import Space

TIGHTEN = 600
"""Default limit of the iterations; :data:`REMAINDER` ends nearly all before.

Edges that differ by a factor of a thousand, as at a tiny chamfer, take 150 to 500.
"""
REMAINDER = 0.15
"""The iteration ends where k times the last gain, after k iterations, is below this
fraction of the square of the bulk part of the error. So as many iterations again, at
the present pace, would lower e by less than 8%. Where the gains fall fast, the present
pace is far too much; where they fall like 1/k^2, as near incompressibility, it is what
is left.
"""


class Ending(NamedTuple):
    """Say when iterations end.

    Attributes:
        limit: Greatest number of iterations, with those that there were before.
        remainder: What they may leave, as :data:`REMAINDER` says.
        begun: Number of iterations that there were before.
    """

    limit: int
    remainder: float
    begun: int = 0


def tighten_moments(
    space: Space,
    cells: CellGeometry,
    moment: np.ndarray,
    force: np.ndarray | None,
    free: np.ndarray,
    turning: np.ndarray | None,
    elastic: np.ndarray,
    compliance: np.ndarray,
    ending: Ending,
) -> tuple[np.ndarray, int, float]:
    """Tighten the moments of facet tractions that are in equilibrium; collective.

    Args:
        space: The mesh.
        cells: Geometry, n cells.
        moment: Moments on the first side of each facet [force], shape (F, m, d). The
            result may take their place.
        force: Body force times volume of each cell [force], shape (n, N_(k-1), d), or
            None.
        free: Components of facets whose traction is not given, shape (F, d).
        turning: See :class:`.Patches`.
        elastic: ``C eps(u^)`` of the owned cells [force/area], shape (owned, b,
            s).
        compliance: C^-1 [area/force], shape (n or 1, Q or 1, s, s).
        ending: When the iterations end.

    Returns:
        The moments, the number of iterations, and the square of the bulk part of the
        error with them [force length].
    """
    comm, d, m = space.comm, cells.d, moment.shape[1]
    shared = SharedMoments(space, cells)
    energy = ComplementaryEnergy(cells, space.domain.owned_cells, compliance)
    to_hierarchical = hierarchical(d, cells.degree)
    square, r = energy.start(
        moment if m == d else np.matmul(to_hierarchical, moment), force, elastic
    )
    square = comm.allreduce(square, MPI.SUM)
    patches = Patches(space, cells, compliance, free, turning)
    blocks = Blocks(cells, compliance, free, shared.mine) if m > d else None

    def precondition(r: np.ndarray) -> np.ndarray:
        z = patches(r)
        if blocks is not None:
            z[:, d:] = blocks(r[:, d:])
        return shared.total(z)

    r = shared.total(r)
    np.negative(r, out=r)
    # Linear moments are their own hierarchical ones.
    x = moment if m == d else np.zeros_like(r)
    done, square = minimise(shared, energy, precondition, x, r, square, ending)
    if m > d:
        x = moment + np.matmul(np.linalg.inv(to_hierarchical), x)
    return x, done, square


def minimise(
    shared: SharedMoments,
    energy: Callable[[np.ndarray], tuple[float, np.ndarray]],
    precondition: Callable[[np.ndarray], np.ndarray],
    x: np.ndarray,
    r: np.ndarray,
    square: float,
    ending: Ending,
) -> tuple[int, float]:
    """Minimise the complementary energy by conjugate gradients; collective.

    Args:
        shared: Sums and products over the ranks.
        energy: The energy of moments, and half its derivative.
        precondition: Returns the preconditioned residual, for all ranks.
        x: Moments, which are moved to the minimum in place, shape (F, m, d).
        r: Residual, the negative gradient; its array is overwritten.
        square: Square of the bulk part of the error.
        ending: When the iterations end.

    Returns:
        The number of iterations, and the square at their end.
    """
    comm = shared.comm
    p, rz, done = np.zeros_like(r), 1.0, 0
    while ending.begun + done < ending.limit:
        check_interrupts(comm)
        at(comm, f"tightening {ending.begun + done + 1} of at most {ending.limit}")
        z = precondition(r)
        new = shared.dot(r, z)
        # At the minimum, or where nothing is free, there is no step. The square may
        # end below zero, by round-off.
        if not new > np.finfo(float).eps ** 2 * max(square, 0.0):
            break
        p *= new / rz if done else 0.0
        p += z
        del z  # at most four vectors at a time
        rz = new
        curvature, image = energy(p)
        image = shared.total(image)
        step = rz / comm.allreduce(curvature, MPI.SUM)
        image *= step
        r -= image
        x += np.multiply(p, step, out=image)
        del image
        gain = step * rz
        square -= gain
        done += 1
        if (ending.begun + done) * gain < ending.remainder * square:
            break
    return done, square
