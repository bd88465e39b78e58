"""The steps of a loading history in time: how long they are, and how far one step is from its halves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.run.time_row import TimeStep

HALVINGS = 8
"""How often a step is halved at most, one after the other."""
LONGER = 0.25
"""A step twice as long is tried where what it costs is below this share of what is allowed [-]."""


@dataclass(frozen=True)
class InTime:
    """What a history is asked for of the length of its steps, see :func:`erc_contact.evolve`.

    Attributes:
        path: Greatest difference of a step from its two halves [-], or None.
        accuracy_in_time: Greatest share of the dissipated energy of a step that its
            length leaves unknown [-], or None.
    """

    path: float | None
    accuracy_in_time: float | None


def until(begin: float, length: float, end: float) -> float:
    """Where a step of about this length ends, so that no short one remains before the end."""
    count = np.ceil((end - begin) / length * (1 - 1e-9)) if length < end - begin else 1.0
    return end if count <= 1 else begin + (end - begin) / count


def unknown_of_dissipation(row: TimeStep, before: TimeStep, accuracy: float) -> float:
    """What the length of a step leaves unknown of the energy that friction takes in it, over what is allowed [-].

    The friction part of e^2/2 is in both, and remains where a step is very short. So a
    step is short enough where it leaves less than twice that, the contact part of e^2.
    This ends the halving after a turn of the load, where friction takes little at
    first.

    Args:
        row: The row of the step.
        before: That of the step before it.
        accuracy: Share of the energy that may be unknown [-].
    """
    unknown = row.in_time - before.in_time
    of_mesh = (row.eps_contact * row.scale) ** 2
    allowed = max(accuracy * (row.dissipated - before.dissipated), of_mesh)
    return unknown / allowed if allowed > 0 else 0.0
