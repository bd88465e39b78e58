"""Move the foundation of a contact: slip counts against it, and the gap goes with it.

The law of a contact with a foundation that has moved by d is the law of a contact at
rest, for the displacement ``u - d``: ``u_n <= g + d_n``, and friction acts on
``u_t - d_t``. So d_n is in the gap, and d_t in the displacement that friction counts
from. In a history a step counts from ``s = u_before - d_before + d``: what the last
step leaves is the displacement relative to the foundation.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.mesh.simplex import lagrange, rule
from erc_contact.model.expressions import evaluate
from erc_contact.model.space import Space
from erc_contact.model.trace import Trace

INTERPOLATION_ROUND_OFF = 1e-12
"""Difference of a motion from its interpolant that is round-off, over its size [-]."""


def foundation_motion(
    space: Space, trace: Trace, motion: Ufl, what: str
) -> tuple[fem.Function, np.ndarray | None]:
    """Interpolate the motion of a foundation at the nodes of a contact; collective.

    Args:
        space: The mesh.
        trace: The displacement of the contact.
        motion: The motion [length], UFL of shape (d,).
        what: The contact, in words for messages.

    Returns:
        The displacement of the foundation [length], zero off the contact, and what
        facets do not carry of its tangential part, ``int_F |d_t - I d_t|^2``
        [length^(d+1)], shape (f,), or None where they carry all.

    Raises:
        InputError: If the motion is not finite.
    """
    facets = trace.here.facets
    at_nodes = evaluate(motion, space.mesh, space.facet_points, facets)
    if not np.isfinite(space.extremes(at_nodes)).all():
        raise InputError(f"{what}: the motion is not finite everywhere; look at it.")
    field = space.function()
    field.x.array.reshape(-1, space.d)[space.facet_nodes(facets)] = at_nodes
    points, weights = rule(space.d - 1, 2 * space.degree + 2)
    shape = lagrange(space.d - 1, space.degree, points)
    difference = evaluate(motion, space.mesh, points, facets) - np.matmul(shape, at_nodes)
    n = trace.normals_at(points)
    difference = difference - (difference * n).sum(axis=-1, keepdims=True) * n
    local = [abs(difference).max(initial=0.0), abs(at_nodes).max(initial=0.0)]
    greatest, size = (space.comm.allreduce(float(value), MPI.MAX) for value in local)
    if greatest <= INTERPOLATION_ROUND_OFF * size:
        return field, None
    return field, space.facet_areas(facets) * ((difference**2).sum(axis=-1) @ weights)


def counted_from(
    before: fem.Function | None,
    lost: np.ndarray | None,
    moved: fem.Function,
    lost_of_motion: np.ndarray | None,
) -> tuple[fem.Function, np.ndarray | None]:
    """Return the displacement that friction counts from, and what facets lose of it.

    Args:
        before: Displacement relative to the foundation at the end of the last step
            [length]; None without one.
        lost: What facets do not carry of its tangential part, or None.
        moved: Displacement of the foundation [length].
        lost_of_motion: What facets do not carry of it, or None.
    """
    if before is None:
        return moved, lost_of_motion
    total = before.copy()
    total.x.array[:] += moved.x.array
    if lost is None or lost_of_motion is None:
        return total, lost_of_motion if lost is None else lost
    # Both may point along each other.
    return total, (np.sqrt(lost) + np.sqrt(lost_of_motion)) ** 2
