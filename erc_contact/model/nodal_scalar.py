"""Make scalars on a contact from values at its nodes."""

from __future__ import annotations

import numpy as np

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.foundation import BoundContact
from erc_contact.model.space import Space


def nodal_scalar(
    space: Space, contact: BoundContact, values: np.ndarray, *, coefficients: bool = False
) -> Ufl:
    """Make a scalar, UFL, from its values at the nodes of a contact.

    Args:
        space: The mesh.
        contact: The contact.
        values: The values, shape (f, m).
        coefficients: Whether the nodal values of the scalar become the Bernstein
            coefficients of these values, instead of the values.
    """
    function = space.function()
    nodal = function.x.array.reshape(-1, space.d)
    nodal[contact.trace.here.nodes, 0] = values
    if coefficients:
        space.to_coefficients(nodal, [contact])
    return function[0]
