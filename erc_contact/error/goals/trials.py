"""Try values of t for the interval of a number, and hold what each of them gives.

For any t the interval holds (:mod:`erc_contact.error.goals.three_pairs`), and so does
the intersection of the intervals of several t.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError, NotBalanced, NotConverged, NotHeldError
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.error.goals.perturbation import LEAST_ERROR, Perturbation
from erc_contact.error.goals.three_pairs import Ends, Unmoved, ends_of, rough_ends, unmoved
from erc_contact.error.numbers import Bounds
from erc_contact.scene.scene import Scene

PairOf = Callable[[Scene], Admissible]
"""Type of what solves a scene moved a little, and makes an admissible pair."""

FACTOR = 10.0
"""Largest ratio of one t to the next that is tried [-]."""
GROWTH = 3.0
"""The same where a larger t is not tried at once [-]."""
POWER = 2
"""Power of t with which a motion that changes the contact set moves both V apart.

Where it moves the edge of a contact by t, the pressure is like the root of the distance
to the edge, and the gap like its third power.
"""
COUNT_OF_T = 60
"""Number of values of t among which the better one is chosen."""
NEAR = 1.5
"""Ratio of two t below which they are as good as each other [-]."""


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
        self._base: Unmoved | None = None
        least = min(1.0, LEAST_ERROR / max(error.relative, LEAST_ERROR))
        self.least_t = perturbation.step * least

    @property
    def base(self) -> Unmoved:
        """Return what all values of t share."""
        if self._base is None:
            psi = self.perturbation.psi(self.error.admissible.displacement)
            self._base = unmoved(self.error, psi)
        return self._base

    @property
    def best(self) -> Ends | None:
        """Return the narrowest of the intervals, None if there is none."""
        return min(self.tried, key=lambda ends: ends.width, default=None)

    def rough(self, t: float) -> Ends | None:
        """Estimate the interval for a t from a scene moved to one side.

        None if that is not solved.
        """
        try:
            plus = self._moved(t)
        except (NotConverged, NotHeldError, NotBalanced):
            return None
        self._plus = t, plus
        ends = rough_ends(self.base, plus, t)
        return ends if np.isfinite(ends.width) else None

    def attempt(self, t: float) -> Ends | None:
        """Compute the interval for a t; None if the moved scenes are not solved."""
        try:
            if self._plus is not None and self._plus[0] == t:
                plus = self._plus[1]
            else:
                plus = self._moved(t)
                self._plus = t, plus
            minus = self._moved(-t)
        except (NotConverged, NotHeldError, NotBalanced) as failure:
            self.failure = str(failure)
            return None
        ends = ends_of(self.base, plus, minus, t)
        if not np.isfinite(ends.width):
            # A body that the load pulls off may have a displacement without end.
            return None
        if self.perturbation.varies:
            # Of loads that the mesh carries this is exactly zero, however small t is.
            carried = constitutive_error(plus).oscillations.loads == 0.0
            ends = replace(ends, resolved=ends.resolved and carried)
        self.tried.append(ends)
        return ends

    def _moved(self, t: float) -> Admissible:
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
        return spread / 2 + self._loss(ends, t)

    def _loss(self, ends: Ends, t: float) -> float:
        """Return how far the ends are beyond V for a t, if d is the same there."""
        M = self.base.M
        d = 2 * M / ends.better_t if M > 0 else 0.0
        m = min(M, d * t / 2)
        return d * m + (M**2 - m**2) / t

    def _of_number(self, low: float, high: float, proved: bool) -> Bounds:
        """Return the interval of the number from an interval of Q."""
        constant = self.perturbation.constant
        ends = sorted((self.perturbation.sign * low, self.perturbation.sign * high))
        least = max(ends[0] + constant.value - constant.bound, self.perturbation.least)
        most = max(ends[1] + constant.value + constant.bound, least)
        return Bounds((least + most) / 2, least, most, proved)

    def shares(self, ends: Ends) -> np.ndarray:
        """Return the share of each owned cell in the width of an interval.

        The width is about ``M^2/t + t d^2/4``. Both squares are sums over cells.
        """
        squares = (self.error.scale * self.error.indicators) ** 2
        return squares / (2 * ends.t) + ends.t * ends.d_squares / 4
