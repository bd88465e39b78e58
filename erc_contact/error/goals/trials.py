"""Try values of t for the interval of a number, and hold what each of them gives.

For any t the interval holds (:mod:`erc_contact.error.goals.difference_quotient`), and
so does the intersection of the intervals of several t.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError, NotBalanced, NotConverged, NotHeldError
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.error.goals.constants import COUNT_OF_T, FACTOR, GROWTH, LEAST_ERROR, POWER
from erc_contact.error.goals.difference_quotient import (
    Ends,
    Unmoved,
    ends_of,
    measure_unmoved,
    rough_ends,
)
from erc_contact.error.goals.perturbation import Perturbation
from erc_contact.error.numbers import Bounds
from erc_contact.scene.scene import Scene

PairOf = Callable[[Scene], Admissible]
"""Type of what solves a scene moved a little, and makes an admissible pair."""


@dataclass(frozen=True, eq=False)
class GoalError:
    """Hold the interval of a goal, and what each cell contributes to its width.

    Attributes:
        bounds: The interval.
        shares: Estimated share of each owned cell in the width, shape (owned,).
    """

    bounds: Bounds
    shares: np.ndarray


class Trials:
    """Try values of t for a perturbation; construction and members are collective.

    Args:
        error: The error of the pair of the scene.
        perturbation: What moves. Loads alone do not dictate its number.
        pair_of: Solves a scene moved a little, and makes an admissible pair.

    Attributes:
        tried: What the values of t gave, in the order in which they were tried.
        failure: Why the last scene that was not solved was not.
    """

    def __init__(
        self, error: ConstitutiveError, perturbation: Perturbation, pair_of: PairOf
    ) -> None:
        self.error = error
        self.perturbation = perturbation
        self.tried: list[Ends] = []
        self.failure = ""
        self._pair_of = pair_of
        self._plus: tuple[float, Admissible] | None = None
        least = min(1.0, LEAST_ERROR / max(error.relative, LEAST_ERROR))
        self.least_t = perturbation.step * least

    @cached_property
    def base(self) -> Unmoved:
        """Return what all values of t share."""
        return measure_unmoved(
            self.error, self.perturbation.psi(self.error.admissible.displacement)
        )

    @property
    def best(self) -> Ends | None:
        """Return the narrowest of the intervals, None if there is none."""
        return min(self.tried, key=lambda ends: ends.width, default=None)

    def rough(self, t: float) -> Ends | None:
        """Estimate the interval for a t from a scene moved to one side.

        None if that is not solved.
        """
        try:
            plus = self._pair_above(t)
        except (NotConverged, NotHeldError, NotBalanced):
            return None
        ends = rough_ends(self.base, plus, t)
        return ends if np.isfinite(ends.width) else None

    def attempt(self, t: float) -> Ends | None:
        """Compute the interval for a t; None if the moved scenes are not solved."""
        try:
            plus = self._pair_above(t)
            minus = self._make_pair(-t)
        except (NotConverged, NotHeldError, NotBalanced) as failure:
            self.failure = str(failure)
            return None
        ends = ends_of(self.base, plus, minus, t)
        if not np.isfinite(ends.width):
            # A body that the load pulls off may have a displacement without end.
            return None
        if self.perturbation.varies:
            # Zero, however small t is, for loads that the mesh represents exactly.
            carried = constitutive_error(plus).oscillations.loads == 0.0
            ends = replace(ends, resolved=ends.resolved and carried)
        self.tried.append(ends)
        return ends

    def _pair_above(self, t: float) -> Admissible:
        """Return the pair of the scene moved by t, the last one if it has this t."""
        if self._plus is None or self._plus[0] != t:
            self._plus = t, self._make_pair(t)
        return self._plus[1]

    def _make_pair(self, t: float) -> Admissible:
        """Return the pair of the scene moved by t."""
        assert self.perturbation.scene_at is not None
        try:
            return self._pair_of(self.perturbation.scene_at(t))
        except (NotHeldError, NotBalanced):
            # A smaller motion, or a finer mesh, may leave it held.
            raise
        except InputError as conflict:
            raise InputError(
                "interval: what the number is of cannot move alone, because a support or a contact"
                f" holds a node of it. The moved scene says: {conflict}"
            ) from conflict

    def bounds(self) -> Bounds:
        """Return what the intervals of all t share, around its middle."""
        # Each interval holds, so their intersection does.
        low = max(ends.low for ends in self.tried)
        high = min(ends.high for ends in self.tried)
        resolved = self.perturbation.constant.resolved and all(ends.resolved for ends in self.tried)
        return self._of_number(low, high, self.error.guaranteed and resolved)

    def estimate(self, rough: Ends) -> Bounds:
        """Return the interval of the number from a rough interval of Q."""
        return self._of_number(rough.low, rough.high, False)

    def better_t(self, ends: Ends, growth: float = GROWTH) -> float:
        """Return a t that should be better, at most so many times the t tried.

        It is the best one by :meth:`half_at`.
        """
        most = min(ends.better_t, growth * ends.t)
        least = max(ends.t / FACTOR, self.least_t)
        if most <= least:
            return least
        several = np.geomspace(least, most, COUNT_OF_T)
        return float(min(several, key=lambda t: self.half_at(ends, t)))

    def half_at(self, ends: Ends, t: float) -> float:
        """Return half of the width that another t should give.

        A part of what moves V apart at small t is of the mesh, and does not grow so.
        """
        growth = t / ends.t
        spread = max(ends.spread, 0.0) * (growth if growth > 1 else growth**POWER)
        # d is taken to be the same for all t.
        d = 2 * self.base.M / ends.better_t if self.base.M > 0 else 0.0
        return spread / 2 + self.base.beyond(d, t)

    def _of_number(self, low: float, high: float, proved: bool) -> Bounds:
        """Return the interval of the number from an interval of Q."""
        constant = self.perturbation.constant
        ends = sorted((self.perturbation.sign * low, self.perturbation.sign * high))
        least = max(ends[0] + constant.value - constant.bound, self.perturbation.least)
        most = max(ends[1] + constant.value + constant.bound, least)
        unit = self.perturbation.unit
        return Bounds((least + most) / 2, least, most, proved, unit=unit)

    def shares(self, ends: Ends) -> np.ndarray:
        """Return the share of each owned cell in the width of an interval.

        The width is about ``M^2/t + t d^2/4``. Both squares are sums over cells.
        """
        squares = (self.error.scale * self.error.indicators) ** 2
        return squares / (2 * ends.t) + ends.t * ends.d_squares / 4
