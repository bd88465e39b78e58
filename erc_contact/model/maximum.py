"""Hold the greatest of values over all ranks, with its place and its trend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.model.space import Space
from namedmesh.base.percent import place_words
from namedmesh.base.ranks import of_all

EQUAL_MAXIMA = 1e-9
"""Relative difference up to which values count as equal to the greatest [-].

Of their places the one with the least coordinates is taken.
"""
TREND_MESHES = 3
"""Least number of meshes that tell a trend."""
TREND_SHRINKAGE = 4.0
"""Factor by which the elements at the maximum must shrink over these meshes [-]."""
LAST_MESHES = 2
"""Least number of last meshes that must have the same trend."""
LAST_SHRINKAGE = 2.0
"""Factor by which the elements at the maximum must shrink over the last meshes [-]."""
GROWTH_EXPONENT = 0.2
"""Least exponent a of values h^-a at elements of size h that counts as growth [-].

It is 15% with each halving. At the edges of clamped parts it was 0.22 to 0.29; maxima
that were resolved had less than 0.19.
"""


@dataclass(frozen=True, eq=False, repr=False)
class Maximum:
    """Hold the greatest value of a quantity.

    The maximum of a run knows the values on all meshes, for stress and contact
    traction. They tell whether it has a limit: at a sharp edge the stress of linear
    elasticity is infinite, and its greatest value tells the mesh, not the part::

        peak = history.maximum("von Mises")
        if peak.grows:
            print(peak)

    Attributes:
        value: The value, in the dimension of the quantity.
        place: Where it is [length], shape (d,).
        values: The greatest value on each mesh of a run; empty if it is not known.
        sizes: Size of the element or facet where it is [length], for each mesh.
        unit: Unit of the value as it stands behind it; "" if the scene has none.
        beside: Of a von Mises stress, at what its cell lies where the exact stress may
            be infinite, as "a re-entrant corner of 270 degrees"; empty elsewhere.
    """

    value: float
    place: np.ndarray
    values: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    unit: str = ""
    beside: str = ""

    def __repr__(self) -> str:
        """Return value, place and trend in words."""
        at_place = f"{self.value:.6g}{self.unit} at {place_words(self.place)}"
        if self.beside:
            at_place += f", beside {self.beside}, where the exact stress may be infinite"
        if not self.values:
            return at_place
        trend = {
            True: "it grows: no limit is seen",
            False: "no growth is seen",
            None: "too few meshes for a trend",
        }
        values = ", ".join(f"{value:.4g}" for value in self.values)
        return f"{at_place}; on the meshes {values}: {trend[self.grows]}"

    @property
    def grows(self) -> bool | None:
        """Tell whether the value grows with refinement; None if too few meshes tell.

        It does if values on the last meshes, at least three, over which the size h of
        the elements at the maximum falls to a quarter, are like h^-a with a > 0.2, and
        so on those over which it falls to a half. A singularity that is weaker is not
        seen. A maximum that the meshes do not resolve yet grows, too.
        """
        over_all = self._exponent(TREND_SHRINKAGE, TREND_MESHES)
        over_last = self._exponent(LAST_SHRINKAGE, LAST_MESHES)
        if over_all is None or over_last is None:
            return None
        return min(over_all, over_last) > GROWTH_EXPONENT

    def _exponent(self, shrinkage: float, least: int) -> float | None:
        """Fit the exponent a of values h^-a to the last meshes.

        Args:
            shrinkage: Factor between the sizes h of the meshes that are taken.
            least: Least number of these meshes.

        Returns:
            The exponent; None if the meshes do not have that span.
        """
        values = np.array(self.values)
        sizes = np.array(self.sizes)
        if not np.all(values > 0):
            return None
        for number in range(least, len(values) + 1):
            h = sizes[-number:]
            if h.max() >= shrinkage * h.min():
                slope, _ = np.polyfit(np.log(h), np.log(values[-number:]), 1)
                return -float(slope)
        return None


def greatest_of(space: Space, values: np.ndarray, x: np.ndarray, unit: str = "") -> Maximum:
    """Find the greatest of the values of all ranks, and its place; collective.

    Args:
        space: The mesh.
        values: Values of this rank, shape (n,).
        x: Their places [length], shape (n, d).
        unit: Unit of the values as it stands behind them.
    """
    top = space.comm.allreduce(float(values.max(initial=-np.inf)), MPI.MAX)
    (places,) = of_all(space.comm, x[values >= top - EQUAL_MAXIMA * abs(top)])
    # Rounded, so that the place does not depend on the ranks.
    rounded = (places / space.domain.extent).round(9)
    first = np.lexsort(rounded.T[::-1])[0]
    return Maximum(top, places[first] + 0.0, unit=unit)
