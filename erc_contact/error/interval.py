"""Ask for single numbers of the solution in certified intervals.

The interval of a number comes from three admissible pairs
(:mod:`erc_contact.error.three_pairs`), for any t. Here t is chosen, and the interval is
that of all t tried: it is the intersection of theirs.

The width is about ``M^2/t + t d^2/4`` with M about ``e/sqrt(2)`` or less. Both squares
are sums over cells, so each cell has its share. A run that aims at the number refines
the cells of large share.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.admissible.pair import Admissible, equilibrate
from erc_contact.base.exceptions import InputError, NotConverged, NotHeldError
from erc_contact.error.bounds import Bounds
from erc_contact.error.bulk import data_vary
from erc_contact.error.constitutive import ConstitutiveError, Run, error_of
from erc_contact.error.questions import Question, question_of
from erc_contact.error.three_pairs import Ends, ends_of
from erc_contact.newton.solve import solved
from erc_contact.scene.goal import Goal

FACTOR = 3.0
"""Ratio of one t to the next that is tried [-]."""
LARGEST_COUNT = 6
"""Number of values of t that are tried at most."""
NARROWER = 0.9
"""Width over that of the best t so far from which the next t is not tried [-]."""


@dataclass(frozen=True, eq=False)
class GoalError:
    """Hold the interval of a goal, and what each cell contributes to its width.

    Attributes:
        bounds: The interval.
        t: The best t, from which another mesh may begin.
        shares: Estimated share of each owned cell in the width, shape (owned,).
    """

    bounds: Bounds
    t: float
    shares: np.ndarray

    @property
    def relative(self) -> float:
        """Return half the width over the number [-]; infinite for a number of zero."""
        half = (self.bounds.high - self.bounds.low) / 2
        value = abs(self.bounds.value)
        return half / value if value > 0 else np.inf


def interval(error: ConstitutiveError | Run, goal: Goal) -> Bounds:
    """Bound a number of the solution by three admissible pairs; collective.

    For each of some values of t, two to six, the scene is solved twice more on the same
    mesh, from the known solution. The interval is of order 1.5 in e, and of order 2
    where the contact set is settled; that of :func:`erc_contact.resultant` is of order
    1.

    Args:
        error: The error of an admissible pair, or a history, whose error is taken.
        goal: :class:`erc_contact.Resultant` or :class:`erc_contact.MeanDisplacement`.

    Returns:
        The interval, around its middle [force], [length].

    Raises:
        InputError: If the scene has no such part, it cannot move alone, or the scene is
            a step of a history.

    Example:
        >>> bounds = ec.interval(error, ec.Resultant("top", (0.0, 1.0)))
        >>> bool(bounds.low <= bounds.value <= bounds.high)
        True
    """
    return goal_error(error_of(error), goal).bounds


def goal_error(error: ConstitutiveError, goal: Goal, first_t: float | None = None) -> GoalError:
    """Measure the interval of a goal; collective.

    Args:
        error: The error of an admissible pair.
        goal: The goal.
        first_t: The t that is tried first; None for a guess.

    Raises:
        InputError: As :func:`interval`.
        NotConverged: If the moved scenes are not solved.
    """
    model = error.model
    if any(contact.trace.before is not None for contact in model.contacts):
        raise InputError("interval: a step of a history has none; solve its scene alone.")
    question = question_of(error, goal)
    tried = _tried(error, question, first_t or question.step)
    if not tried:
        raise NotConverged("interval: the moved scenes were not solved; refine the mesh.", ())
    # Each interval holds, so their intersection does.
    ends = (
        question.sign * max(one.low for one in tried),
        question.sign * min(one.high for one in tried),
    )
    low = min(ends) + question.constant.value - question.constant.bound
    high = max(ends) + question.constant.value + question.constant.bound
    proved = error.guaranteed and question.constant.resolved and not data_vary(model)
    best = min(tried, key=lambda one: one.width)
    squares = (error.scale * error.indicators) ** 2
    shares = squares / (2 * best.t) + best.t * best.d_squares / 4
    return GoalError(Bounds((low + high) / 2, low, high, proved), best.t, shares)


def _tried(error: ConstitutiveError, question: Question, first_t: float) -> list[Ends]:
    """Return the intervals of several t, larger ones first; collective."""
    tried: list[Ends] = []
    for factor in (FACTOR, 1 / FACTOR):
        t = first_t if factor > 1 else first_t / FACTOR
        narrowest = min((one.width for one in tried), default=np.inf)
        while len(tried) < LARGEST_COUNT:
            ends = _ends(error, question, t)
            if ends is None:
                break
            tried.append(ends)
            if ends.width > NARROWER * narrowest:
                break
            narrowest = ends.width
            t *= factor
        # Where a larger t was better, a smaller one is not.
        if len(tried) > 2:
            break
    return tried


def _ends(error: ConstitutiveError, question: Question, t: float) -> Ends | None:
    """Return the interval for a t, None if its scenes are not solved; collective."""
    try:
        plus = _moved(error, question, t)
        minus = _moved(error, question, -t)
    except (NotConverged, NotHeldError):
        return None
    return ends_of(error, question, plus, minus, t)


def _moved(error: ConstitutiveError, question: Question, t: float) -> Admissible:
    """Return an admissible pair of the scene moved by t; collective."""
    solution = error.solution
    moved = solved(
        question.moved(t),
        error.domain,
        solution.method,
        degree=error.degree,
        after=None,
        start=solution,
        tolerance=None,
        solver="auto",
    )
    return equilibrate(moved)
