"""The steps of a loading history in time: how long they are, and how far one step is from its halves."""

from __future__ import annotations

import numpy as np

from erc_contact.error.works import assembled
from erc_contact.newton.solution import Solution
from erc_contact.newton.solve import solve
from erc_contact.run.plan import Plan

HALVINGS = 8
"""How often a step is halved at most, one after the other."""
LONGER = 0.25
"""A step twice as long is tried where its difference from its halves is below this share of what is allowed [-]."""


def until(begin: float, length: float, end: float) -> float:
    """Where a step of about this length ends, so that no short one remains before the end."""
    count = np.ceil((end - begin) / length * (1 - 1e-9)) if length < end - begin else 1.0
    return end if count <= 1 else begin + (end - begin) / count


def difference_from_halves(plan: Plan, last: Solution, halves: Solution) -> float:
    """The difference of one step from its two halves, relative in the energy norm [-]; collective.

    Args:
        plan: What the step is asked for; its scene is that of the end.
        last: The solution at its beginning.
        halves: The solution at its end, after two halves; the step is made again on its mesh.
    """
    given = plan.scene, halves.domain, plan.method
    whole = solve(*given, degree=plan.degree, solver=plan.solver, after=last, start=halves)
    rest = halves.u.copy()
    rest.x.array[:] -= whole.u.x.array
    square, size = (assembled(halves.model, halves.model.stiffness(v, v)) for v in (rest, halves.u))
    return float(np.sqrt(square / size)) if size > 0 else 0.0
