"""Ask for single numbers of the solution in certified intervals.

The interval of a number comes from three admissible pairs
(:mod:`erc_contact.error.three_pairs`), for any t. Here t is chosen, and the interval is
that of all t tried: it is the intersection of theirs.

The width is about ``M^2/t + t d^2/4`` with M about ``e/sqrt(2)`` or less. Both squares
are sums over cells, so each cell has its share. A run that aims at the number refines
the cells of large share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError, NotConverged, NotHeldError
from erc_contact.base.percent import percent
from erc_contact.error.bounds import potential_energy, resultant
from erc_contact.error.bulk import data_vary
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.error.numbers import ROUND_OFF, BoundedNumber, Bounds
from erc_contact.error.question import LEAST_ERROR, Question
from erc_contact.error.questions import question_of
from erc_contact.error.three_pairs import Ends, ends_of
from erc_contact.scene.goal import Energy, Goal, Resultant
from erc_contact.scene.scene import Scene

PairOf = Callable[[Scene], Admissible]
"""Type of what solves a scene and makes an admissible pair."""

FACTOR = 10.0
"""Largest ratio of one t to the next that is tried [-]."""
LARGEST_COUNT = 6
"""Number of values of t that are tried at most."""
ROUGH_COUNT = 2
"""The same where the interval need not be the narrowest."""
NEAR = 1.5
"""Ratio of two t below which they are as good as each other [-]."""
NARROWER = 0.9
"""Width over that of the best t so far from which no other t is tried [-]."""
NEAR_GOAL = 4.0
"""Half width over that asked for below which a mesh gets the narrowest interval [-].

Else two values of t are tried, which costs four more solves a mesh.
"""


@dataclass(frozen=True, eq=False)
class GoalError:
    """Hold the interval of a goal, and what each cell contributes to its width.

    Attributes:
        bounds: The interval.
        shares: Estimated share of each owned cell in the width, shape (owned,).
    """

    bounds: Bounds
    shares: np.ndarray


def goal_error(
    error: ConstitutiveError, goal: Goal, pair_of: PairOf, *, search: bool = True
) -> GoalError:
    """Measure the interval of a goal; collective.

    Args:
        error: The error of an admissible pair.
        goal: The goal.
        pair_of: Solves a scene on the same mesh, and makes an admissible pair.
        search: Whether t is varied until the interval is hardly narrower.

    Raises:
        InputError: As :func:`interval`.
        NotConverged: If the moved scenes are not solved.
    """
    if isinstance(goal, Energy):
        return _energy(error)
    model = error.model
    if any(contact.trace.before is not None for contact in model.contacts):
        raise InputError("interval: a step of a history has none; solve its scene alone.")
    question = question_of(error, goal)
    if question.moved is None:
        return _told_by_loads(error, question.constant)
    tried = _tried(error, question, pair_of, LARGEST_COUNT if search else ROUGH_COUNT)
    if not tried:
        raise NotConverged("interval: the moved scenes were not solved; refine the mesh.", ())
    # Each interval holds, so their intersection does.
    ends = (
        question.sign * max(one.low for one in tried),
        question.sign * min(one.high for one in tried),
    )
    low = min(ends) + question.constant.value - question.constant.bound
    high = max(ends) + question.constant.value + question.constant.bound
    resolved = question.constant.resolved and all(one.resolved for one in tried)
    proved = error.guaranteed and resolved and not data_vary(model)
    best = min(tried, key=lambda one: one.width)
    squares = (error.scale * error.indicators) ** 2
    shares = squares / (2 * best.t) + best.t * best.d_squares / 4
    bounds = Bounds((low + high) / 2, low, high, proved)
    if search and isinstance(goal, Resultant):
        bounds = _with_lifting(error, goal, bounds)
    return GoalError(bounds, shares)


def _with_lifting(error: ConstitutiveError, goal: Resultant, bounds: Bounds) -> Bounds:
    """Return an interval narrowed by that of one lifting, on a contact; collective.

    Far from the solution, and with Coulomb friction, that one may be the narrower.
    """
    contacts: list[str] = []
    for contact in error.solution.scene.contacts:
        contacts += contact.sides
    if goal.part not in contacts:
        return bounds
    lifted = resultant(error, goal.part, goal.direction)
    return bounds if lifted.weighted else bounds.narrowed(lifted)


def _energy(error: ConstitutiveError) -> GoalError:
    """Return the interval of the potential energy; collective.

    Its width is ``e^2/2``, of which each cell has its part.
    """
    bounds = potential_energy(error)
    middle = (bounds.low + bounds.high) / 2
    shares = (error.scale * error.total_indicators) ** 2
    return GoalError(replace(bounds, value=middle), shares)


def _told_by_loads(error: ConstitutiveError, number: BoundedNumber) -> GoalError:
    """Return the interval of a number that equilibrium with the loads dictates."""
    value = number.value + 0.0  # no -0.0
    low = value - number.bound
    high = value + number.bound
    is_straight = error.geometry_error <= ROUND_OFF * error.scale
    bounds = Bounds(value, low, high, number.resolved and is_straight)
    return GoalError(bounds, (error.scale * error.indicators) ** 2)


def _tried(error: ConstitutiveError, question: Question, pair_of: PairOf, most: int) -> list[Ends]:
    """Return the intervals of several t; collective."""
    tried: list[Ends] = []
    best: Ends | None = None
    bad_t: float | None = None
    t = question.step
    least_t = t * min(1.0, LEAST_ERROR / max(error.relative, LEAST_ERROR))
    for _ in range(most):
        ends = _ends(error, question, pair_of, t)
        if ends is not None:
            tried.append(ends)
        if best is None or (ends is not None and ends.width < best.width):
            is_settled = bool(best and ends and ends.width > NARROWER * best.width)
            best = ends
            if is_settled:
                break
        else:
            # The motion has changed the contact set.
            bad_t = t
        if best is None:
            t /= FACTOR
        elif bad_t is None:
            t = float(np.clip(best.better_t, best.t / FACTOR, best.t * FACTOR))
        else:
            t = float(np.sqrt(best.t * bad_t))
        t = max(t, least_t)
        if best is not None and 1 / NEAR < t / best.t < NEAR:
            break
    return tried


def _ends(error: ConstitutiveError, question: Question, pair_of: PairOf, t: float) -> Ends | None:
    """Return the interval for a t, None if its scenes are not solved; collective."""
    assert question.moved is not None
    try:
        plus = pair_of(question.moved(t))
        minus = pair_of(question.moved(-t))
    except (NotConverged, NotHeldError):
        return None
    except InputError as conflict:
        raise InputError(
            "interval: what the number is of cannot move alone, because a support or a contact"
            f" holds a node of it. The moved scene says: {conflict}"
        ) from conflict
    psi = question.psi(error.admissible.displacement)
    ends = ends_of(error, psi, plus, minus, t)
    if not np.isfinite(ends.width):
        # A body that the load pulls off may have a displacement without end.
        return None
    if not question.varies:
        return ends
    # Of loads that the mesh carries this is exactly zero, however small t is.
    carried = constitutive_error(plus).oscillations.loads == 0.0
    return replace(ends, resolved=ends.resolved and carried)


# -- runs


class Aim:
    """Hold what a run knows of its goal; members are collective.

    It knows the last mesh only, so that a run that goes on from a folder makes the same
    meshes.

    Args:
        goal: The number.
        accuracy: Half of the interval that is asked for, over the number [-].
    """

    def __init__(self, goal: Goal, accuracy: float) -> None:
        self._goal = goal
        self._accuracy = accuracy
        self._last: GoalError | None = None

    @property
    def bounds(self) -> Bounds | None:
        """Return the interval on the last mesh; None where there is none."""
        return None if self._last is None else self._last.bounds

    def measure(self, error: ConstitutiveError, pair_of: PairOf) -> None:
        """Measure the interval on a mesh.

        Args:
            error: The error on the mesh.
            pair_of: Solves a scene on the mesh, and makes an admissible pair.
        """
        try:
            rough = goal_error(error, self._goal, pair_of, search=False)
            is_near = rough.bounds.relative < NEAR_GOAL * self._accuracy
            self._last = goal_error(error, self._goal, pair_of) if is_near else rough
        except NotConverged:
            # The scene moved has no solution on this mesh; the next one is finer.
            self._last = None

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
        if self.bounds is None:
            return f"{self._goal!r} has no interval yet"
        kind = "proved" if self.bounds.guaranteed else "an estimate"
        half = percent(self.bounds.relative)
        return f"{self._goal!r} = {self.bounds.value:.6g} to {half}, {kind}"
