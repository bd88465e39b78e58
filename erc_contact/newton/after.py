"""What the next step of a loading history takes from a solution.

Friction acts on the tangential displacement since the last step. Points in slip go on
from where they are. Points in stick go on from where they stuck: Nitsche's method and
penalties keep them there up to the discretisation error only, and in many steps they
would creep. A multiplier keeps them there to round-off.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import la
from mpi4py import MPI

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.domain import Domain
from erc_contact.model.expressions import evaluate
from erc_contact.model.last_step import LastStep
from erc_contact.model.profile import STICK
from erc_contact.newton.solution import Solution
from erc_contact.scene.scene import Scene


def check_after(scene: Scene, domain: Domain, after: Any) -> None:
    """Check that a scene can follow after a solution.

    Raises:
        InputError: If it is no solution, one in another dimension or of other ranks, or
            one with other contacts.
    """
    if not isinstance(after, Solution):
        raise InputError(
            f"after is {checks.description(after)}; give the Solution of the last step, or None."
        )
    if after.domain.dim != domain.dim:
        raise InputError(
            f"after is a solution in {after.domain.dim}D, and the domain is in {domain.dim}D."
        )
    if MPI.Comm.Compare(after.domain.mesh.comm, domain.mesh.comm) not in (MPI.IDENT, MPI.CONGRUENT):
        raise InputError(
            "after is a solution of other ranks than the domain; give one of the same communicator."
        )
    names, known = ({contact.facets for contact in of.contacts} for of in (scene, after.scene))
    if names != known:
        told = [", ".join(map(repr, sorted(of))) or "no contact" for of in (names, known)]
        raise InputError(
            f"The scene has {told[0]} in contact, and that of after {told[1]}. All scenes of a history have the same "
            "contacts; one that must not touch yet can have a gap."
        )


def last_step(solution: Solution) -> LastStep:
    """The displacement that the next step counts from; collective.

    A node keeps the tangential displacement from which it was counted where the
    traction sticks on all its facets.
    """
    model, d = solution.model, solution.model.d
    u = solution.u.copy()
    if solution.method.multiplier:
        return LastStep(model, u)
    values = u.x.array.reshape(-1, d)
    for contact in model.contacts:
        if contact.friction is None:
            continue
        nodes = contact.trace.here.nodes
        trial = solution.method.projected(model, contact, solution.u)
        status = evaluate(contact.status(trial), model.mesh, model.facet_points, contact.facets)
        moves = model.function()
        own = contact.trace.here.owned
        np.add.at(
            moves.x.array.reshape(-1, d),
            nodes[own],
            np.where(status[own] < STICK, 1.0, 0.0)[..., None],
        )
        moves.x.scatter_reverse(la.InsertMode.add)
        moves.x.scatter_forward()
        stuck = moves.x.array.reshape(-1, d)[nodes] == 0.0
        n = contact.direction[:, None, :]
        along = (values[nodes] * n).sum(axis=-1, keepdims=True) * n
        values[nodes] = np.where(stuck, along + contact.trace.slip_before, values[nodes])
    return LastStep(model, u)
