"""Check a potential and its conjugate at samples: convex, and a pair by Fenchel.

Data without these properties would give an error that looks right and is wrong.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.law.point_law import Search
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.simplex import rule

SIZES = 10.0 ** np.arange(-6, 1)
"""Sizes of the strains at which a law is tried [-]."""
DIRECTIONS = 12
"""Number of strains of each size."""
MOST_CELLS = 200
"""Number of cells of a rank, spread over it, at whose middle a law is tried."""
PROMISE = 1e-8
"""Difference from what a law promises that counts as none, over its terms [-]."""
FLAT = 1e-12
"""Least curvature of the potential over the greatest one at a strain [-]."""


def check_potential(model: Model) -> None:
    """Check the potential of a model at samples; collective.

    From rest psi and psi' must be zero without strain. psi must be convex, and
    Fenchel's inequality hold, as an equality for a stress ``psi'(eps)``.

    Raises:
        InputError: If they do not.
    """
    space = model.space
    assert model.linearised is not None
    law = model.linearised.law
    name = type(model.scene.material).__name__
    cells = space.owned_cells[:: max(1, len(space.owned_cells) // MOST_CELLS)]
    middle, _ = rule(space.d, 1)
    x = space.cell_points(middle, cells)
    eps = _strains(len(law.rows))
    shape = (len(cells), *eps.shape)
    eps = np.broadcast_to(eps, shape)
    x = np.broadcast_to(x, (*shape[:2], space.d))

    psi = law.energy(eps, x, cells)
    stress = law.whole_stress(eps, x, cells)
    tangent = law.tangent(eps, x, cells)
    modulus = abs(tangent).max(axis=(-2, -1))
    if law.has_convexity:
        share = law.convexity(x, cells)[..., None, None]
        _check_convexity(space, name, tangent, share, modulus)
    in_body = stress[..., : len(law.rows)]
    psi_star, _ = law.complementary(in_body, Search(stress[..., -1]), x, cells)
    # Pairs of a strain and the stress of the next one are on no law.
    next_stress = np.roll(in_body, 1, axis=1)
    next_star = np.roll(psi_star, 1, axis=1)

    finite = all(np.isfinite(values).all() for values in (psi, stress, tangent, psi_star))
    worst = np.full(5, -np.inf)
    if finite and len(cells):
        curvature = np.linalg.eigvalsh(tangent)
        flat = FLAT * curvature[..., -1] - curvature[..., 0]
        work = (in_body * eps).sum(axis=-1)
        gap = abs(psi + psi_star - work) / (abs(psi) + abs(psi_star) + abs(work) + TINY)
        work_of_next = (next_stress * eps).sum(axis=-1)
        terms = abs(psi) + abs(next_star) + abs(work_of_next) + TINY
        below = -(psi + next_star - work_of_next) / terms
        at_rest = slice(0, 1)  # the first sample has no strain
        worst = np.array(
            [
                (abs(psi) / modulus)[:, at_rest].max(),
                (abs(in_body).max(axis=-1) / modulus)[:, at_rest].max(),
                (flat / modulus).max(),
                gap[:, 1:].max(),
                below[:, 1:].max(),
            ]
        )
    finite = space.comm.allreduce(bool(finite), MPI.LAND)
    worst = np.max(space.comm.allgather(worst), axis=0)
    if not finite:
        raise InputError(
            f"{name}: potential, its derivatives or conjugate are not finite for strains of 0 to"
            " 1. A square root or a power of zero has no derivative: write"
            " ufl.sqrt(ufl.max_value(q2, y**2)), or add a small number."
        )
    psi_at_rest, stress_at_rest, flat, gap, below = worst
    remembers = model.is_later_step and law.state is not None
    is_moved = remembers or bool(model.scene.strains)
    if max(psi_at_rest, stress_at_rest) > PROMISE * SIZES[0] and not is_moved:
        raise InputError(
            f"{name}: the potential or its derivative is not zero without strain: the body would"
            " have a stress at rest. Subtract both."
        )
    if flat > 0.0:
        raise InputError(
            f"{name}: the potential is not convex, or has no curvature, at some strain: its second"
            " derivative must be positive definite. Add a small share of an elastic energy."
        )
    if gap > PROMISE:
        raise InputError(
            f"{name}: the conjugate does not belong to the potential: psi(eps) + psi*(sigma) -"
            f" sigma : eps is {gap:.1e} of its terms for the stress sigma = psi'(eps), and must be"
            " zero. The error would be the error of another material; mend either of them."
        )
    if below > PROMISE:
        raise InputError(
            f"{name}: Fenchel's inequality fails: psi(eps) + psi*(sigma) - sigma : eps is"
            f" {-below:.1e} of its terms for some strain and stress. The conjugate is too small"
            " there."
        )


def _check_convexity(
    space: Space, name: str, tangent: np.ndarray, share: np.ndarray, modulus: np.ndarray
) -> None:
    """Check that a potential is as convex as it tells; collective.

    Args:
        space: The mesh.
        name: The law.
        tangent: psi'' at samples, the first one without strain [force/area], shape (n,
            q, s, s).
        share: Shares of the elasticity [-], shape (n, q, 1, 1).
        modulus: Sizes of the tangents [force/area], shape (n, q).

    Raises:
        InputError: If it is not.
    """
    least = space.comm.allreduce(float(share.min(initial=1.0)), MPI.MIN)
    if not least > 0.0:
        raise InputError(f"{name}: the convexity is {least:g}; it must be > 0, or be left out.")
    # What is not finite is told later.
    tangent = np.nan_to_num(tangent)
    beyond = np.linalg.eigvalsh(tangent - share * tangent[:, :1]).min(axis=-1)
    excess = float((-beyond / np.where(modulus > 0, modulus, 1.0)).max(initial=0.0))
    if space.comm.allreduce(excess, MPI.MAX) > FLAT:
        raise InputError(
            f"{name}: the convexity is too large: psi'' - a C is not positive semidefinite at some"
            " strain, with the elasticity C = psi''(0). Return a smaller share."
        )


TINY = np.finfo(float).tiny
"""Added to sums of terms that are divided by."""


def _strains(size: int) -> np.ndarray:
    """Return strains in Mandel components, zero first, shape (count, size)."""
    directions = np.random.default_rng(0).normal(size=(DIRECTIONS, size))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    strains = SIZES[:, None, None] * directions
    return np.vstack([np.zeros((1, size)), strains.reshape(-1, size)])
