"""The friction bound between the nodes of a facet.

The bound may vary there, or be nonlinear in the pressure. A traction that is allowed at
the nodes may then exceed the bound between them. The bound is sampled on each facet,
and where a traction exceeds it, the friction of the facet is lowered.

Symbols: r^ contact traction on the body, f facets, m number of coefficients of a facet,
q samples of a facet, d dimension.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.traction import ContactTraction
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.space import Space

MARGIN = 0.2
"""Share of the sampled deviation that is added for those between samples [-]."""
ROOM = 0.02
"""Share of the bound, and of the traction, that is enough room between samples [-]."""
ROUND_OFF_SHARE = 1e-14
"""Excess over the bound that is round-off, over the greatest friction [-]."""


def friction_at_samples(space: Space, traction: ContactTraction) -> tuple[np.ndarray, np.ndarray]:
    """Sample the friction bound and what of it r^_t needs [force/area]; collective.

    Returns:
        The bound and the gauge of r^_t, shape (f, q) each.
    """
    points = space.facet_samples
    parameters = friction_parameters(space, traction.contact, points)
    pressure, tangential = traction.at_points(points)
    bound = traction.contact.friction_bound(np.maximum(pressure, 0.0), parameters)
    n = traction.contact.trace.normals_at(points)
    return bound, traction.contact.friction_set.gauge(tangential, n)


def is_inside(space: Space, traction: ContactTraction) -> bool:
    """Tell whether r^ lies inside the cone at all samples, with room; collective.

    The room is for what is between the samples. No pressure with no friction is inside.
    """
    pressure, tangential = traction.at_points(space.facet_samples)
    bound, used = friction_at_samples(space, traction)
    size = np.maximum(pressure.max(axis=1), np.linalg.norm(tangential, axis=-1).max(axis=1))
    peak = space.comm.allreduce(float(size.max(initial=0.0)), MPI.MAX)
    acts = size > ROUND_OFF_SHARE * peak
    presses = pressure.min(axis=1) > ROOM * size
    holds = (used <= (1 - ROOM) * bound).all(axis=1)
    return bool(space.comm.allreduce(bool((~acts | (presses & holds)).all()), MPI.LAND))


def lowering(space: Space, traction: ContactTraction) -> np.ndarray:
    """Compute the factor of friction that makes r^ allowed [-]; collective.

    Allowed means at all points of a facet. It is 1 where r^ is allowed at all samples.

    Returns:
        The factor of each facet, shape (f,).
    """
    if not traction.contact.sampled:
        return np.ones(len(traction.nodes))
    bound, used = friction_at_samples(space, traction)
    # The ratio of two numbers that are round-off means nothing.
    peak = space.comm.allreduce(float(used.max(initial=0.0)), MPI.MAX)
    excess = used > bound + ROUND_OFF_SHARE * peak
    ratio = np.divide(bound, used, out=np.ones_like(used), where=excess).min(axis=1)
    lowered = np.maximum(ratio - MARGIN * (1 - ratio), 0.0)
    return np.where(ratio < 1.0, lowered, 1.0)


def with_friction(contact: ContactOnMesh, values: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Multiply the tangential part of tractions (f, m, d) by a factor of each facet.

    It is the part across the middle normal of a facet.
    """
    n = contact.direction[:, None, :]
    normal = (values * n).sum(axis=-1, keepdims=True) * n
    return normal + factor[:, None, None] * (values - normal)
