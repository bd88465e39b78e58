"""Take contact tractions that another solver has computed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from dolfinx import fem

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.model import Model
from erc_contact.newton.nodal_values import AnyField, nodal_values


def given_multipliers(model: Model, traction: Mapping[str, AnyField]) -> dict[str, fem.Function]:
    """Return given tractions as Functions [force/area], by the names of contacts.

    Args:
        model: The scene on a mesh.
        traction: Tractions on the parts that contacts are named after.

    Raises:
        InputError: If no contact has a name, or values do not fit the nodes.
    """
    if not isinstance(traction, Mapping):
        raise InputError(
            f"certify: traction is {checks.description(traction)}; give a mapping from the names of"
            " contacts, e.g. {'bottom': (points, values)}."
        )
    multipliers = {}
    names = {contact.name for contact in model.contacts}
    for name, values in traction.items():
        if name not in names:
            known = ", ".join(sorted(names)) or "none"
            raise InputError(f"certify: traction is for {name!r}; the contacts are {known}.")
        contact = model.contact(name)
        multiplier = model.function()
        nodal = multiplier.x.array.reshape(-1, model.d)
        nodes = np.unique(contact.trace.here.nodes)
        nodal[nodes] = contact.sign * _at_nodes(model, contact, nodes, values)
        if not np.isfinite(nodal).all():
            raise InputError(f"certify: the traction on {name!r} is not finite everywhere.")
        multipliers[name] = multiplier
    return multipliers


def _at_nodes(
    model: Model, contact: ContactOnMesh, nodes: np.ndarray, traction: AnyField
) -> np.ndarray:
    """Return a traction at nodes of this side of a contact, (nodes, d)."""
    what = f"certify: the traction on {contact.name!r}"
    # A Function is read at the nodes of this side, which is the softer body's.
    if isinstance(traction, fem.Function) and contact.is_exchanged:
        raise InputError(
            f"{what} is a Function, and must be the traction on the softer body; give a "
            "callable of points, or (points, values)."
        )
    return nodal_values(model, traction, nodes, what)
