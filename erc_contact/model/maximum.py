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
"""Values that differ by less, relative to the greatest, count as equal [-]. Of their
places the one with the least coordinates is taken."""


ROWS, SPAN, TAIL = 3, 4.0, 2.0
"""Least number of meshes that tell a trend, factor by which the elements at the maximum
must shrink over them, and over the last ones of them, which must have the same trend
[-].
"""
GROWTH = 0.2
"""Least exponent a of values h^-a at elements of size h that counts as growth [-]: 15%
with each halving. At the edges of clamped parts it was 0.22 to 0.29; maxima that were
resolved had less than 0.19.
"""


@dataclass(frozen=True, eq=False, repr=False)
class Maximum:
    """The greatest value of a quantity.

    That of a run knows the values on all meshes, for stress and contact traction. They
    tell whether it has a limit: at a sharp edge the stress of linear elasticity is
    infinite, and its greatest value tells the mesh, not the part::

        peak = history.maximum("von Mises")
        if peak.grows:
            print(peak)

    Attributes:
        value: The value, in the dimension of the quantity.
        place: Where it is [length], shape (d,).
        values: The greatest value on each mesh of a run; empty if it is not known.
        sizes: Size of the element or facet where it is [length], for each mesh.
    """

    value: float
    place: np.ndarray
    values: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()

    def __repr__(self) -> str:
        place = ", ".join(f"{x:.4g}" for x in self.place)
        if not self.values:
            return f"{self.value:.6g} at ({place})"
        trend = {
            True: "it grows: no limit is seen",
            False: "no growth is seen",
            None: "too few meshes for a trend",
        }
        values = ", ".join(f"{value:.4g}" for value in self.values)
        return f"{self.value:.6g} at ({place}); on the meshes {values}: {trend[self.grows]}"

    @property
    def grows(self) -> bool | None:
        """Tell whether the value grows with refinement; None if there are too few meshes to tell.

        It does if values on the last meshes, at least three, over which the size h of
        the elements at the maximum falls to a quarter, are like h^-a with a > 0.2, and
        so on those over which it falls to a half. A singularity that is weaker is not
        seen. A maximum that the meshes do not resolve yet grows, too.
        """
        exponents = [self._exponent(SPAN, ROWS), self._exponent(TAIL, 2)]
        known = [exponent for exponent in exponents if exponent is not None]
        return min(known) > GROWTH if len(known) == len(exponents) else None

    def _exponent(self, span: float, least: int) -> float | None:
        """Fit a to the last values, as many as have sizes of that span; None if there are not so many."""
        values, sizes = np.array(self.values), np.array(self.sizes)
        if not np.all(values > 0):
            return None
        for number in range(least, len(values) + 1):
            h = sizes[-number:]
            if h.max() >= span * h.min():
                return -float(np.polyfit(np.log(h), np.log(values[-number:]), 1)[0])
        return None


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
            - "pressure", "shear" [force/area], "slip" or "gap" [length]: absolute value
              at the points of the profiles of all contacts.
        displacement: Displacement [length].
        von_mises: Gives the von Mises stress of each owned cell [force/area], shape
            (owned,).
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
        x = np.concatenate(
            [np.column_stack([one[axis] for axis in "xyz"[: model.d]]) for one in along]
        )
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
