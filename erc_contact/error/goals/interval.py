"""Ask for a single number of the solution in a certified interval."""

from __future__ import annotations

from erc_contact.admissible.tighten.iteration import TIGHTEN
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.goal_error import goal_error
from erc_contact.error.goals.moved_pairs import moved_pairs
from erc_contact.error.numbers import Bounds
from erc_contact.error.runs import Run, error_of
from erc_contact.scene.goal import Goal
from erc_contact.scene.potential import BY_FORCE, refuse_potential


def interval(error: ConstitutiveError | Run, goal: Goal) -> Bounds:
    """Bound a number of the solution by three admissible pairs; collective.

    For each of some values of t, two to six, the scene is solved twice more on the
    same mesh, from the known solution. The interval is of order 2 in e where the
    contact set is settled, and of order 4/3 in the limit where it is free, 1.4 to 1.5
    on usual meshes; :func:`erc_contact.resultant` gives an interval of order 1. The
    force of a contact is in both: what they share is returned, if both are proved or
    both are estimates.

    Args:
        error: The error of an admissible pair, or a history, whose error is taken.
        goal: :class:`erc_contact.Resultant`, :class:`erc_contact.Moment`,
            :class:`erc_contact.MeanDisplacement`, :class:`erc_contact.Rotation`,
            :class:`erc_contact.Slip`, :class:`erc_contact.Opening`,
            :class:`erc_contact.BoltForce`, :class:`erc_contact.Shortening`,
            :class:`erc_contact.Functional`, or :class:`erc_contact.Energy`, which needs
            no further solve.

    Returns:
        The interval, around its middle [force], [force length], [length] or [rad].

    Raises:
        InputError: If the scene has no such part, it cannot move alone, other contacts
            with friction share its force, or the scene is a step of a history.

    Example:
        >>> bounds = ec.interval(error, ec.Resultant("top", (0.0, 1.0)))
        >>> bool(bounds.low <= bounds.value <= bounds.high)
        True
    """
    error = error_of(error)
    refuse_potential(error.solution.scene.material, "interval()", BY_FORCE)
    with moved_pairs(error, "auto", TIGHTEN) as pair_of:
        return goal_error(error, goal, pair_of).bounds
