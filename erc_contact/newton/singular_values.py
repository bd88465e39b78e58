"""Tell whether the tangent at a solution is singular, on both sides of its kinks.

Where a point touches without pressure the equations of a contact have a kink. The
tangent at the state and the tangent under pressure differ there, and the second may be
singular alone. So both are looked at: a state is pressed into the foundation by a tiny
length.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from erc_contact.model.model import Model
from erc_contact.newton.linear.krylov import Apply, fgmres

REGULARITY_TOLERANCE = 1e-4
"""Tolerance of the linear solve that shows whether the tangent has an inverse [-]."""
NO_INVERSE = 1e-9
"""Least singular value that counts as none [-].

Beside the branch of demos/many_solutions.py the value is 1e-4 to 1e-1, on it 1e-15 to
1e-10.
"""
PRESSING = 1e-5
"""Length by which a state is pressed, over the size of the displacement [-]."""


def contact_normals(model: Model) -> fem.Function:
    """Return the displacement along all normals at the contacts [-]; collective.

    Between bodies it is the least one with the normals as jumps. It is zero elsewhere.
    """
    normals = model.function()
    for contact in model.contacts:
        contact.trace.assign(normals.x.array, contact.trace.normals)
    normals.x.scatter_forward()
    return model.connections.least_displacement(normals)


def least_singular_value(
    times: Apply,
    precondition: Apply,
    u: PETSc.Vec,
    *,
    stiffness: PETSc.Mat,
    fixed: np.ndarray,
    scale: float,
) -> float:
    """Estimate the least singular value of a tangent [-]; zero if singular; collective.

    The elastic diagonal scales it. It is the ratio of a force without structure to the
    displacement that this causes, as far as FGMRES solves for it. Without an inverse
    FGMRES does not converge, and the displacement grows to the inverse of round-off;
    where multigrid is only slow it does not.

    Args:
        times: The scaled tangent.
        precondition: About its inverse.
        u: A displacement that may be near [-], e.g. from another tangent; it becomes
            the displacement of this tangent.
        stiffness: The elastic stiffness K [force/length].
        fixed: Unknowns of this rank that supports fix.
        scale: What the tangent is divided by [force/length].
    """
    diagonal = stiffness.getDiagonal()
    force = u.duplicate()
    diagonal.sqrtabs()
    # A force without structure that does not depend on the number of ranks.
    force.array[:] = np.sin(1.0 + np.arange(*force.getOwnershipRange()) ** 2)
    force.array[fixed] = 0.0
    size = force.norm()
    force.pointwiseMult(force, diagonal)
    fgmres(times, precondition, force, u, REGULARITY_TOLERANCE)
    diagonal.pointwiseMult(diagonal, u)
    diagonal.array[fixed] = 0.0
    length = diagonal.norm()
    diagonal.destroy()
    force.destroy()
    value = 1.0
    if length > 0:
        value = size / length * scale
    return float(value) if value > NO_INVERSE else 0.0
