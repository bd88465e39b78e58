"""Choose the length of the steps of a loading history, and measure what it costs."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from erc_contact.base import checks
from erc_contact.error.load_work import assemble_number
from erc_contact.error.numbers import ROUND_OFF
from erc_contact.newton.solution import Solution
from erc_contact.newton.solve import solve
from erc_contact.run.plan import Plan
from erc_contact.run.time_row import TimeStep

HALVINGS = 8
"""How often a step is halved at most, one after the other."""
LONGER = 0.25
"""Share of the allowed cost below which a step twice as long is tried [-]."""


@dataclass(frozen=True)
class InTime:
    """Hold what :func:`erc_contact.evolve` is asked for of the length of its steps.

    Attributes:
        path: Greatest difference of a step from its two halves [-], or None.
        accuracy_in_time: Greatest share of the dissipated energy of a step that its
            length leaves unknown [-], or None.
    """

    path: float | None
    accuracy_in_time: float | None

    @classmethod
    def checked(cls, path: float | None, accuracy_in_time: float | None) -> InTime:
        """Check both accuracies and return them.

        Raises:
            InputError: If an accuracy cannot be worked with.
        """
        if path is not None:
            path = checks.accuracy("path", path)
        if accuracy_in_time is not None:
            accuracy_in_time = checks.accuracy("accuracy_in_time", accuracy_in_time)
        return cls(path, accuracy_in_time)

    def arguments(self) -> dict[str, float | None]:
        """Return both accuracies by their names."""
        return asdict(self)


def until(begin: float, length: float, end: float) -> float:
    """Return where a step of about this length ends; no short one remains."""
    if length >= end - begin:
        return end
    # round-off must not add a step where the length divides the interval
    count = np.ceil((end - begin) / length * (1 - 1e-9))
    if count <= 1:
        return end
    return begin + (end - begin) / count


def unknown_of_dissipation(row: TimeStep, before: TimeStep, accuracy: float) -> float:
    """Compute what a step leaves unknown of its dissipation, over the limit [-].

    Unknown is what the length of the step costs of the energy that friction takes in
    it. The friction part of e^2/2 is in both, and remains where a step is very short.
    So a step is short enough where it leaves less than twice that, the contact part of
    e^2. This ends the halving after a turn of the load, where friction takes little at
    first.

    Args:
        row: The row of the step.
        before: The row of the step before it.
        accuracy: Share of the energy that may be unknown [-].
    """
    unknown = row.in_time - before.in_time
    of_mesh = (row.eps_contact * row.scale) ** 2
    round_off = ROUND_OFF * row.greatest_energy
    allowed = max(accuracy * (row.dissipated - before.dissipated), of_mesh, round_off)
    if allowed > 0:
        return unknown / allowed
    return 0.0


def difference_from_halves(
    plan: Plan, last: Solution, halves: Solution, greatest_energy: float
) -> float:
    """Compute the relative difference of a step from its two halves [-]; collective.

    The displacements at the end are compared, in the energy norm. Where they are small
    in the history, so that their difference may be round-off, it is relative to 1e-6 of
    the greatest ones.

    Args:
        plan: What the step is asked for; its scene is the scene at the end.
        last: The solution at its beginning.
        halves: The solution at its end, after two halves; the step is made again on its
            mesh.
        greatest_energy: The greatest energy of the history [force length].
    """
    whole = solve(
        plan.scene,
        halves.domain,
        plan.method,
        degree=plan.degree,
        solver=plan.solver,
        after=last,
        start=halves,
    )
    difference = halves.u.copy()
    difference.x.array[:] -= whole.u.x.array
    model = halves.model
    square = assemble_number(model, model.stiffness(difference, difference))
    size = assemble_number(model, model.stiffness(halves.u, halves.u))
    size = max(size, 2 * ROUND_OFF * greatest_energy)
    if size > 0:
        return float(np.sqrt(square / size))
    return 0.0
