"""Aim a run at a number: an interval where it may end, else an estimate to mark by.

On most meshes the interval cannot be narrow enough yet. There the scene is moved to one
side only: this tells the shares of the cells, and about how wide the interval would be.
Where it promises what is asked for, the scene is moved to the other side, too. t
follows from the t of the last mesh.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from erc_contact.base.exceptions import NotConverged
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.constants import CLOSE, COUNT, FACTOR, FIRST, GUESSES, LAST_COUNT, NEAR
from erc_contact.error.goals.difference_quotient import Ends
from erc_contact.error.goals.goal_error import goal_error, perturbation_or_number, with_lifting
from erc_contact.error.goals.moved_pairs import moved_pairs
from erc_contact.error.goals.trials import GoalError, Trials
from erc_contact.error.numbers import Bounds
from erc_contact.scene.goal import Goal
from namedmesh.base.percent import percent


class GoalController:
    """Hold what a run knows of its goal; members are collective.

    Args:
        goal: The number.
        accuracy: Half of the interval that is asked for, over the number [-].
        solver: As in :func:`erc_contact.newton.solve.solve`.
        tighten: Greatest number of iterations that tighten a stress.

    Attributes:
        before: What was carried to the last mesh. A run that goes on from its folder
            measures that mesh again with it, and then makes the same meshes.
    """

    def __init__(self, goal: Goal, accuracy: float, solver: str, tighten: int) -> None:
        self._goal = goal
        self._accuracy = accuracy
        self._solver = solver
        self._tighten = tighten
        self._last: GoalError | None = None
        self._is_rough = False
        self._carried: dict[str, float] = {}
        self.before: dict[str, float] = {}

    @property
    def bounds(self) -> Bounds | None:
        """Return the interval on the last mesh; None where there is none."""
        return None if self._last is None or self._is_rough else self._last.bounds

    def measure(self, error: ConstitutiveError, carried: dict[str, float] | None = None) -> None:
        """Measure the interval on a mesh, or estimate it.

        Args:
            error: The error on the mesh.
            carried: What an earlier process carried to this mesh; None for what this
                one did.
        """
        if carried is not None:
            self._carried = dict(carried)
        self.before = dict(self._carried)
        self._last = None
        self._is_rough = False
        perturbation = perturbation_or_number(error, self._goal)
        if isinstance(perturbation, GoalError):
            self._last = self._with_proved(perturbation)
            return
        with moved_pairs(error, self._solver, self._tighten) as pair_of:
            self._measure(Trials(error, perturbation, pair_of))

    def _measure(self, trials: Trials) -> None:
        """Estimate the interval on a mesh, and measure it if promising; collective."""
        t = max(self._first_t(trials), trials.least_t)
        rough: Ends | None = None
        for _ in range(GUESSES):
            last = trials.rough(t)
            if last is None:
                # The scene moved may have no solution on this mesh.
                t = max(t / FACTOR, trials.least_t)
                continue
            self._see_change(last)
            if rough is None or last.width < rough.width:
                rough = last
            wanted = self._accuracy * abs(trials.estimate(last).value)
            better_t = self._better_t(trials, last)
            if last.width / 2 <= wanted:
                self._try(trials, t)
            if trials.tried or trials.half_at(last, better_t) > wanted:
                break
            t = better_t
        if rough is None:
            return
        best = trials.best
        if best is not None:
            self._take(trials, best)
        else:
            self._carried |= {"t": self._better_t(trials, rough), "M": trials.base.M}
            self._is_rough = True
            self._last = GoalError(trials.estimate(rough), trials.shares(rough))

    def _take(self, trials: Trials, best: Ends) -> None:
        """Take the interval of a mesh, and carry what others need; collective."""
        self._carried |= {"t": self._better_t(trials, best), "M": trials.base.M}
        bounds = trials.bounds()
        if bounds.relative > self._accuracy:
            bounds = with_lifting(trials.error, self._goal, bounds)
        self._last = self._with_proved(GoalError(bounds, trials.shares(best)))

    def _try(self, trials: Trials, t: float) -> None:
        """Measure intervals, for other t as long as they may be enough; collective."""
        for count in range(COUNT):
            ends = trials.attempt(t)
            if ends is None:
                return
            self._see(ends)
            bounds = trials.bounds()
            half = (bounds.high - bounds.low) / 2
            wanted = self._accuracy * abs(bounds.value)
            better_t = self._better_t(trials, ends)
            # What changes all at once may not change at all for a smaller t.
            seen = replace(ends, spread=0.0) if ends.changes_contact_set else ends
            is_hopeful = trials.half_at(seen, better_t) <= wanted
            is_close = count == 0 and half <= CLOSE * wanted
            if half <= wanted or not (is_hopeful or is_close):
                return
            # Below the best t one end is often higher, though the width is not less.
            is_best = 1 / NEAR < better_t / t < NEAR
            t = t / NEAR if is_best else better_t

    def finish(self, error: ConstitutiveError) -> None:
        """Measure the interval on the last mesh of a run that has an estimate there."""
        if error.solution.at_rest or (self._last is not None and not self._is_rough):
            return
        self._is_rough = False
        # An estimate is no interval.
        self._last = None
        t = self._carried.get("t")
        with moved_pairs(error, self._solver, self._tighten) as pair_of, suppress(NotConverged):
            self._last = self._with_proved(goal_error(error, self._goal, pair_of, t, LAST_COUNT))

    def marked(self, error: ConstitutiveError) -> ConstitutiveError:
        """Return an error whose cells count by their share in the interval."""
        if self._last is None:
            return error
        return replace(error, total_indicators=np.sqrt(self._last.shares))

    @property
    def reached(self) -> bool:
        """Tell whether the interval is as narrow as asked for."""
        return self.bounds is not None and self.bounds.relative <= self._accuracy

    @property
    def words(self) -> str:
        """Say how far the number is known."""
        if self._last is None:
            return f"{self._goal!r} has no interval yet"
        bounds = self._last.bounds
        if self._is_rough:
            return f"{self._goal!r} is about {bounds.value:.6g}, no interval yet"
        kind = "proved" if bounds.guaranteed else "an estimate"
        return f"{self._goal!r} = {bounds.value:.6g} to {percent(bounds.relative)}, {kind}"

    def _first_t(self, trials: Trials) -> float:
        """Return the t with which a mesh begins.

        ``t = 2 M/d`` is best. M falls like e, and d like the root of it, as measured,
        or not at all.
        """
        M = self._carried.get("M", 0.0)
        if M > 0 and trials.base.M > 0:
            return self._below_change(self._carried["t"] * float(np.sqrt(trials.base.M / M)))
        return FIRST * trials.perturbation.step

    def _better_t(self, trials: Trials, ends: Ends) -> float:
        """Return a t that should be better than the t of an interval or estimate."""
        return self._below_change(trials.better_t(ends))

    def _see(self, ends: Ends) -> None:
        """Carry the least t that changed the contact set much, and a t that did not."""
        self._see_change(ends)
        keeping = self._carried.get("t that keeps", 0.0)
        if not ends.changes_contact_set:
            keeping = max(keeping, ends.t)
        self._carried["t that keeps"] = min(keeping, self._changing_t / NEAR)

    def _see_change(self, ends: Ends) -> None:
        """Carry the least t that changed the contact set much.

        An estimate sees it on one side only, so that it knows no t that did not.
        """
        if ends.changes_contact_set:
            self._carried["t that changes"] = min(self._changing_t, ends.t)

    def _below_change(self, t: float) -> float:
        """Return t, or a smaller t that should not change the contact set much.

        The smaller t is between a t that kept the contact set and the least t that
        changed it all at once. Both depend on the scene, and little on the mesh.
        """
        if "t that changes" not in self._carried:
            return t
        keeping = max(self._carried.get("t that keeps", 0.0), self._changing_t / FACTOR)
        return min(t, float(np.sqrt(keeping * self._changing_t)))

    @property
    def _changing_t(self) -> float:
        """Return the least t that changed the contact set, infinite before."""
        return float(self._carried.get("t that changes", np.inf))

    def _with_proved(self, last: GoalError) -> GoalError:
        """Return an interval narrowed by the proved intervals of the meshes before.

        All are of the number of one body, so that their intersection holds.
        """
        bounds = last.bounds
        if not bounds.guaranteed:
            return last
        if "low" in self._carried:
            low = self._carried["low"]
            high = self._carried["high"]
            before = replace(bounds, value=(low + high) / 2, low=low, high=high)
            bounds = bounds.narrowed(before)
        self._carried |= {"low": bounds.low, "high": bounds.high}
        return replace(last, bounds=bounds)
