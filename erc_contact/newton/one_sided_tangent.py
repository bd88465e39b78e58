"""States of a contact that are pressed into the foundation by a tiny length.

Where a point touches without pressure the equations of a contact have a kink. The
tangent at the state and the one under pressure differ there, and the second one may be
singular alone. So both are looked at.
"""

from __future__ import annotations

from dolfinx import fem

from erc_contact.model.model import Model

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
