"""Ask for single numbers of the solution in certified intervals.

The interval of a number comes from three admissible pairs
(:mod:`erc_contact.error.goals.difference_quotient`), for any t. Here several t are
tried, and the interval is the intersection of their intervals. Runs that aim at a
number choose t in another way (:mod:`erc_contact.error.goals.controller`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.error.bounds import potential_energy, resultant
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.constants import FACTOR, GROWTH, LARGEST_COUNT, NARROWER, NEAR
from erc_contact.error.goals.perturbation import Perturbation
from erc_contact.error.goals.perturbations import perturbation_of
from erc_contact.error.goals.trials import GoalError, PairOf, Trials
from erc_contact.error.numbers import ROUND_OFF, Bounds
from erc_contact.scene.goal import Energy, Goal, Resultant


def goal_error(
    error: ConstitutiveError,
    goal: Goal,
    pair_of: PairOf,
    t: float | None = None,
    count: int = LARGEST_COUNT,
) -> GoalError:
    """Measure the interval of a goal, for t that make it narrow; collective.

    Args:
        error: The error of an admissible pair.
        goal: The goal.
        pair_of: Solves a scene moved a little, and makes an admissible pair.
        t: The first t that is tried; None for the t of the perturbation.
        count: Number of values of t that are tried at most.

    Raises:
        InputError: As :func:`interval`.
        NotConverged: If the moved scenes are not solved.
    """
    perturbation = perturbation_or_number(error, goal)
    if isinstance(perturbation, GoalError):
        return perturbation
    trials = Trials(error, perturbation, pair_of)
    search(trials, perturbation.step if t is None else t, count)
    best = trials.best
    if best is None:
        raise NotConverged(
            "interval: no scene that is moved a little was solved, though the scene itself was;"
            f" refine the mesh. The last one: {trials.failure}",
            (),
        )
    bounds = with_lifting(error, goal, trials.bounds())
    return GoalError(bounds, trials.shares(best))


def perturbation_or_number(error: ConstitutiveError, goal: Goal) -> Perturbation | GoalError:
    """Return what a goal moves, or its interval if it needs no move; collective.

    Raises:
        InputError: As :func:`interval`.
    """
    if isinstance(goal, Energy):
        return _energy(error)
    if error.model.is_later_step:
        raise InputError("interval: a step of a history has none; solve its scene alone.")
    perturbation = perturbation_of(error, goal)
    if perturbation.scene_at is None:
        return _told_by_loads(error, perturbation)
    return perturbation


def with_lifting(error: ConstitutiveError, goal: Goal, bounds: Bounds) -> Bounds:
    """Narrow an interval on a contact by the lifting bound; collective.

    Far from the solution, and with Coulomb friction, the lifting bound may be better.
    """
    if not isinstance(goal, Resultant):
        return bounds
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


def _told_by_loads(error: ConstitutiveError, perturbation: Perturbation) -> GoalError:
    """Return the interval of a number that equilibrium with the loads dictates."""
    number = perturbation.constant
    value = number.value + 0.0  # no -0.0
    low = value - number.bound
    high = value + number.bound
    is_straight = error.geometry_error <= ROUND_OFF * error.scale
    proved = number.resolved and is_straight
    bounds = Bounds(value, low, high, proved, unit=perturbation.unit)
    return GoalError(bounds, (error.scale * error.indicators) ** 2)


def search(trials: Trials, t: float, count: int) -> None:
    """Try values of t until the interval is hardly narrower; collective.

    Args:
        trials: Where the intervals are kept.
        t: The first t.
        count: Number of values of t that are tried at most.
    """
    bad_t: float | None = None
    for _ in range(count):
        last = trials.best
        trials.attempt(t)
        best = trials.best
        if best is None:
            t = max(t / FACTOR, trials.least_t)
            continue
        if best is last:
            # The motion has changed the contact set.
            bad_t = t
        far_t = bad_t
        if last is not None and last is not best and best.width > NARROWER * last.width:
            if 1 / GROWTH < best.t / last.t < GROWTH:
                break
            # Between two t that are far apart there may be a far better one.
            far_t = last.t
        t = trials.better_t(best, FACTOR) if far_t is None else float(np.sqrt(best.t * far_t))
        t = max(t, trials.least_t)
        if 1 / NEAR < t / best.t < NEAR:
            break
