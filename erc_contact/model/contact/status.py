"""Decide which facets of a contact are open, slip or stick.

At a point that sticks nothing moves and the shear is below its bound; at a point that
slips something moves and the shear is at its bound. Of a computed solution neither
holds to round-off: beside the border of both zones the shear is a little below the
bound, and points move a little. So both are looked at together, as the augmented
Lagrangian does: a facet slips where the trial shear ``r_t - rho w_t`` is beyond the
bound in the mean. With the stiffness ``rho = E/h`` of the body at the facet a slip
counts as the shear that would hold it back. The exact solution has the same status for
every rho > 0.

Symbols: r contact traction, w displacement of a contact, w_t and r_t tangential parts,
f facets, q points of a facet, d dimension.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.model.contact.contact_values import slip_at
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import split
from erc_contact.model.space import Space

OPEN, SLIP, STICK, CLOSED = 0, 1, 2, 3
"""Codes of the status of a facet."""
ROUND_OFF_PRESSURE = 1e-10
"""Share of a contact's greatest pressure up to which a pressure is round-off [-]."""
ROUND_OFF_SHEAR = 1e-6
"""Share of the friction bound by which the shear of slip may be below it [-]."""


def facet_status(
    space: Space,
    contact: ContactOnMesh,
    u: fem.Function,
    r: np.ndarray,
    bound: np.ndarray,
    points: np.ndarray,
    weights: np.ndarray,
) -> np.ndarray:
    """Decide which facets of a contact are open, slip or stick; collective.

    A facet without pressure is ``OPEN``, except in a bilateral contact. A facet without
    friction is ``CLOSED``, and a tied facet, whose bound is infinite, is ``STICK``.
    Other facets are ``SLIP`` if the mean length of the trial shear ``r_t - rho w_t``
    reaches the mean friction bound, up to 1e-6, with ``rho = E/h``; else ``STICK``.

    Args:
        space: The mesh.
        contact: One of its contacts.
        u: Displacement [length].
        r: Contact traction at the points [force/area], shape (f, q, d).
        bound: Friction bound there [force/area], shape (f, q).
        points: Reference points on a facet, shape (q, d-1).
        weights: Shares of a facet's area of the points, shape (q,).

    Returns:
        OPEN, SLIP, STICK or CLOSED, shape (f,).
    """
    n = contact.trace.normals_at(points)
    r_n, r_t, _ = split(r, n)
    allowed = contact.friction_set
    rho = contact.trace.stiffness[:, None, None]
    trial = r_t - rho * allowed.opposing(slip_at(space, contact, u.x.array, r, points), n)
    trial_mean = allowed.gauge(trial, n) @ weights
    bound_mean = bound @ weights
    slips = trial_mean >= (1 - ROUND_OFF_SHEAR) * bound_mean
    with_friction = np.where(slips, SLIP, STICK)
    pressed = np.where(bound_mean > 0, with_friction, CLOSED)
    return np.where(is_open(space, contact, -r_n), OPEN, pressed)


def is_open(space: Space, contact: ContactOnMesh, pressure: np.ndarray) -> np.ndarray:
    """Tell which facets of a contact are open; collective.

    Args:
        space: The mesh.
        contact: One of its contacts.
        pressure: -r_n at points or nodes of the facets [force/area], shape (f, q).

    Returns:
        Shape (f,); no facet of a bilateral contact is open.
    """
    # The greatest pressure of all ranks, so that the status does not depend on them.
    peak = space.comm.allreduce(float(pressure.max(initial=0.0)), MPI.MAX)
    unpressed = pressure.max(axis=1, initial=0.0) <= ROUND_OFF_PRESSURE * peak
    return unpressed & (not contact.bilateral)
