"""Intervals of numbers of the exact solution, and integrals with bounds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from mpi4py import MPI

from erc_contact.model.data.quadrature import Integral
from namedmesh.base.html import table

ROUND_OFF = 1e-12
"""Numbers below this, relative to their scale, count as zero [-]."""


@dataclass(frozen=True)
class Bounds:
    """Hold an interval for a number of the exact solution.

    Attributes:
        value: Its middle; for the energy the value of u^.
        low: Least possible number.
        high: Greatest possible number.
        guaranteed: Whether the interval is proved (to round-off); otherwise it is an
            estimate.
        weighted: Whether a support or another contact fixes phi at the edge of the
            contact to another value than the direction. The interval is then for ``int
            r.phi``, where phi changes from the direction to this value across the
            facets at the edge. The rest of the resultant has no finite bound; it is
            smaller on finer meshes.
        unit: Unit of the number as it stands behind it; "" if the scene has none.

    Example:
        >>> bounds = ec.potential_energy(error)
        >>> f"{bounds.low:.3f} <= J(u) <= {bounds.high:.3f}"
        '0.119 <= J(u) <= 0.126'
        >>> print(bounds)
        0.12..., between 0.11... and 0.12... (...)
    """

    value: float
    low: float
    high: float
    guaranteed: bool
    weighted: bool = False
    unit: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        """Make all numbers numbers of Python, which print as people write them."""
        for name in ("value", "low", "high"):
            object.__setattr__(self, name, float(getattr(self, name)))
        for name in ("guaranteed", "weighted"):
            object.__setattr__(self, name, bool(getattr(self, name)))

    def _repr_html_(self) -> str:
        """Return the interval as a table in a notebook."""
        low, high, value = self._in_digits()
        rows = [("value", value), (self._kind, f"between {low} and {high}")]
        return table(rows)

    def __str__(self) -> str:
        """Write the interval with as many digits as tell its ends apart."""
        low, high, value = self._in_digits()
        return f"{value}, between {low} and {high} ({self._kind})"

    @property
    def _kind(self) -> str:
        """Say whether the interval is proved."""
        return "proved" if self.guaranteed else "estimated"

    def _in_digits(self) -> tuple[str, str, str]:
        """Return both ends and the value, in digits that tell the ends apart."""
        digits = 4
        width = self.high - self.low
        size = max(abs(self.low), abs(self.high))
        if 0.0 < width < size < np.inf:
            digits = min(max(4, 3 - int(np.floor(np.log10(width / size)))), 15)
        numbers = (self.low, self.high, self.value)
        low, high, value = (f"{number:.{digits}g}{self.unit}" for number in numbers)
        return low, high, value

    def narrowed(self, second: Bounds) -> Bounds:
        """Return what both intervals hold.

        It is the narrower interval if only one is proved, or if they do not meet.
        """
        low = max(self.low, second.low)
        high = min(self.high, second.high)
        if self.guaranteed != second.guaranteed or low > high:
            return min(self, second, key=lambda bounds: bounds.high - bounds.low)
        weighted = self.weighted or second.weighted
        return replace(self, value=(low + high) / 2, low=low, high=high, weighted=weighted)

    @property
    def relative(self) -> float:
        """Return half the width over the middle [-].

        It is infinite for a middle of zero, but 0 for a number that is known.
        """
        if self.low == self.high:
            return 0.0
        middle = abs(self.low + self.high) / 2
        return (self.high - self.low) / 2 / middle if middle > 0 else np.inf


@dataclass(frozen=True)
class BoundedNumber:
    """Hold a number with a bound of its error: an integral over all ranks.

    Attributes:
        value: Its value.
        bound: Bound or estimate of its error, see
            :class:`erc_contact.model.data.quadrature.Integral`.
        resolved: Whether ``bound`` is within the tolerance.
    """

    value: float
    bound: float = 0.0
    resolved: bool = True

    @classmethod
    def summed(cls, comm: MPI.Comm, integral: Integral) -> BoundedNumber:
        """Add up all integrals of all ranks; collective."""
        local = np.array([integral.value.sum(), integral.bound.sum()])
        value, bound = comm.allreduce(local, MPI.SUM)
        return cls(float(value), float(bound), bool(integral.resolved.all()))

    def __add__(self, other: BoundedNumber) -> BoundedNumber:
        resolved = self.resolved and other.resolved
        return BoundedNumber(self.value + other.value, self.bound + other.bound, resolved)

    def __sub__(self, other: BoundedNumber) -> BoundedNumber:
        return self + -1.0 * other

    def __rmul__(self, factor: float) -> BoundedNumber:
        return BoundedNumber(factor * self.value, abs(factor) * self.bound, self.resolved)
