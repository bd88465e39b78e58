"""Find the greatest value of a quantity in the body or on its contacts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import InputError
from erc_contact.model.maximum import Maximum, greatest_of
from erc_contact.model.model import Model
from erc_contact.model.singular import Part, singular_place

IN_BODY = ("displacement", "von Mises")
"""Quantities of the body."""
ON_CONTACT = ("pressure", "shear", "slip", "gap")
"""Quantities of contacts."""
REGULAR = 100.0
"""Angle up to which a roller or a contact without friction may end [degrees].

At a right angle it continues the body as a plane of symmetry does.
"""


def find_maximum(
    model: Model,
    quantity: str,
    displacement: fem.Function,
    von_mises: Callable[[], np.ndarray],
    profile: Callable[[str], np.ndarray],
) -> Maximum:
    """Find the greatest value of a quantity, and where it is; collective.

    All ranks get the same, for any number of ranks.

    Args:
        model: The scene on a mesh.
        quantity: One of

            - "displacement": length of the displacement at the nodes [length],
            - "von Mises": von Mises stress of a cell, at its middle [force/area],
            - "pressure", "shear" [force/area], "slip" or "gap" [length]: absolute value
              at the points of the profiles of all contacts.
        displacement: Displacement [length].
        von_mises: Gives the von Mises stress of each owned cell [force/area], shape
            (owned,).
        profile: Gives the profile of a contact by its name.

    Raises:
        InputError: If the quantity is another one, or the scene has no contact.
    """
    space = model.space
    quantities = (*IN_BODY, *ON_CONTACT)
    if quantity not in quantities:
        allowed = ", ".join(map(repr, quantities))
        raise InputError(f"maximum: the quantity is {quantity!r}; allowed are {allowed}.")
    if quantity in ON_CONTACT:
        if not model.contacts:
            raise InputError(f"maximum: {quantity!r} is of contacts, and this scene has none.")
        profiles = [profile(contact.name) for contact in model.contacts]
        values = np.concatenate([abs(table[quantity]) for table in profiles])
        axes = ["x", "y", "z"][: space.d]
        x = np.column_stack([np.concatenate([table[axis] for table in profiles]) for axis in axes])
    elif quantity == "displacement":
        owned = space.V.dofmap.index_map.size_local
        nodal = displacement.x.array.reshape(-1, space.d)[:owned]
        values = np.linalg.norm(nodal, axis=1)
        x = space.V.tabulate_dof_coordinates()[:owned, : space.d]
    else:
        values = von_mises()
        x = space.cell_corners()[: model.domain.owned_cells].mean(axis=1)
    dimension = "length" if quantity in ("displacement", "slip", "gap") else "force/area"
    greatest = greatest_of(space, values, x, model.scene.unit(dimension))
    if quantity != "von Mises":
        return greatest
    return replace(greatest, beside=singular_place(space, greatest.place, _parts(model)))


def _parts(model: Model) -> list[Part]:
    """Return the parts of supports, contacts and joints, which may end."""
    parts: list[Part] = []
    for support in model.scene.supports:
        is_roller = None in getattr(support, "value", ())
        limit = REGULAR if is_roller else 0.0
        parts.append((support.facets, f"the end of the support {support.facets!r}", limit))
    for contact in (*model.contacts, *model.ties):
        slides = contact not in model.ties and contact.friction is None
        for name in contact.side_names:
            words = f"the end of the part {name!r} of a contact"
            parts.append((name, words, REGULAR if slides else 0.0))
    return [part for part in parts if part[0] in model.domain.names]
