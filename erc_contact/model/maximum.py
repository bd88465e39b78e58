"""The greatest value of a quantity in the body or on its contacts, and where it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.model import Model

IN_BODY = ("displacement", "von Mises")
"""Quantities of the body."""
ON_CONTACT = ("pressure", "shear", "slip", "gap")
"""Quantities of contacts."""
TIE = 1e-9
"""Values that differ by less, relative to the greatest, count as equal [-]. Of their places the one with the least
coordinates is taken."""


@dataclass(frozen=True, eq=False)
class Maximum:
    """The greatest value of a quantity.

    Attributes:
        value: The value, in the dimension of the quantity.
        place: Where it is [length], shape (d,).
    """

    value: float
    place: np.ndarray


def greatest(
    model: Model,
    quantity: str,
    displacement: fem.Function,
    von_mises: Callable[[], np.ndarray],
    profile: Callable[[str], np.ndarray],
) -> Maximum:
    """The greatest value of a quantity, and where it is; collective. All ranks get the same, for any number of ranks.

    Args:
        model: The scene on a mesh.
        quantity: One of

            - "displacement": length of the displacement at the nodes [length],
            - "von Mises": von Mises stress of a cell, at its middle [force/area],
            - "pressure", "shear" [force/area], "slip" or "gap" [length]: absolute value at the points of the profiles
              of all contacts.
        displacement: Displacement [length].
        von_mises: Gives the von Mises stress of each owned cell [force/area], shape (owned,).
        profile: Gives the profile of a contact by its name.

    Raises:
        InputError: If the quantity is another one, or the scene has no contact.
    """
    if quantity not in (*IN_BODY, *ON_CONTACT):
        allowed = ", ".join(map(repr, (*IN_BODY, *ON_CONTACT)))
        raise InputError(f"maximum: the quantity is {quantity!r}; allowed are {allowed}.")
    if quantity in ON_CONTACT:
        if not model.contacts:
            raise InputError(f"maximum: {quantity!r} is of contacts, and this scene has none.")
        along = [profile(contact.name) for contact in model.contacts]
        values = np.concatenate([abs(one[quantity]) for one in along])
        x = np.concatenate([np.column_stack([one[axis] for axis in "xyz"[: model.d]]) for one in along])
    elif quantity == "displacement":
        owned = model.V.dofmap.index_map.size_local
        values = np.linalg.norm(displacement.x.array.reshape(-1, model.d)[:owned], axis=1)
        x = model.V.tabulate_dof_coordinates()[:owned, : model.d]
    else:
        values, x = von_mises(), model.cell_corners()[: model.domain.owned_cells].mean(axis=1)
    top = model.comm.allreduce(float(values.max(initial=-np.inf)), MPI.MAX)
    near = x[values >= top - TIE * abs(top)]
    every = np.concatenate(model.comm.allgather(near))
    first = np.lexsort((every / model.domain.extent).round(9).T[::-1])[0]
    return Maximum(top, every[first] + 0.0)
