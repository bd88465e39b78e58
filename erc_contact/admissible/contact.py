"""Contact tractions that the law allows and that balance the loads.

The law allows them at every point, not only at nodes: if the Bernstein coefficients of
a traction lie in a convex set, its values lie in it, too. If the friction bound varies
along a facet or is given by the user, it is lowered until the traction is allowed at a
fine sampling of the facet (:mod:`erc_contact.admissible.sampled`).

Symbols: r^ contact traction on the body, K motions on which tractions balance all other
forces.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.balance import balance, largest_component
from erc_contact.admissible.balance_parts import (
    OtherForces,
    TooCoarse,
    check_balance,
    moduli,
    ray_part,
    spring_give,
)
from erc_contact.admissible.cones import Cones
from erc_contact.admissible.nearest import BalancePart
from erc_contact.admissible.sampled import is_inside, lowering
from erc_contact.admissible.traction import ContactTraction
from erc_contact.admissible.trial import Trial, contact_traction, trial_of
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.model import Model
from erc_contact.model.space import Space

CONTACT_PASSES = 10
"""Limit of the passes that lower the friction bound where it is sampled.

It is also the limit of those that balance the loads; one or two are usual.
"""
SETTLED_TRACTION = 1e-13
"""Change of tractions by the law after which they stay, over the largest one [-]."""


def admissible_tractions(model: Model, solution: Any, others: OtherForces) -> list[ContactTraction]:
    """Make the tractions r^ from the tractions r of the method; collective.

    The L2 projection of r on degree k of each facet is limited to what the law allows.
    For degree 2 the limiter uses the means ``int r B_m / int B_m``, which the law
    allows where it allows r.

    Where no support and no spring holds a rigid motion, r^ must balance the work of the
    other forces on this motion exactly. Where springs alone hold it, they take up what
    is left, at the cost of their error. The least change within the allowed tractions
    gives the balance.

    Args:
        model: The scene on a mesh.
        solution: The solution of the contact problem.
        others: The other forces on motions that no support holds.

    Returns:
        r^ on each contact.

    Raises:
        TooCoarse: If no allowed traction balances the other forces on a free motion.
            Who asks may have less to balance.
    """
    trials = [_trial(model.space, contact, solution) for contact in model.contacts]
    if any(contact.sampled for contact in model.contacts):
        # On a coarse mesh uniform pressures may leave too little to balance with.
        with suppress(TooCoarse):
            return _limit(model.space, trials, others, uniform=True)
    return _limit(model.space, trials, others, uniform=False)


def _trial(space: Space, contact: ContactOnMesh, solution: Any) -> Trial:
    """Return the traction of the method, not yet limited; collective.

    Where normals turn and all of a contact sticks, or is open, any polynomial of degree
    k may be allowed: also a constant stress, whose traction does not turn.
    """
    if contact.trace.corner_normals is not None and contact.friction is not None:
        trial = trial_of(space, contact, solution, turned=False)
        if is_inside(space, trial.contact_traction(trial.best)):
            return replace(trial, otherwise=trial_of(space, contact, solution))
    return trial_of(space, contact, solution)


def no_traction(space: Space, contact: ContactOnMesh) -> ContactTraction:
    """Return the traction of a contact that transmits nothing; collective.

    Its friction bound is the bound at zero pressure.
    """
    values = np.zeros((*contact.trace.here.nodes.shape, space.d))
    return contact_traction(space, contact, values)


def _limit(
    space: Space, trials: list[Trial], others: OtherForces, *, uniform: bool
) -> list[ContactTraction]:
    """Limit tractions to what the law allows at all samples, and balance other forces.

    ``uniform`` tells whether pressures may become uniform on facets.
    """
    for _ in range(CONTACT_PASSES):
        values = _allowed_at_nodes(space, trials, others)
        tractions = _contact_tractions(trials, values)
        outside = [
            trial.otherwise is not None and not is_inside(space, traction)
            for trial, traction in zip(trials, tractions, strict=True)
        ]
        if any(outside):
            # The balance has moved them to where only turned tractions are allowed.
            trials = [trial.turn(out) for trial, out in zip(trials, outside, strict=True)]
            continue
        changes = []
        is_changed = False
        for trial, r, traction in zip(trials, values, tractions, strict=True):
            factor = lowering(space, traction)
            become = trial.becomes_uniform(r) & uniform
            changes.append((factor, become))
            is_changed = is_changed or bool(np.any(factor < 1.0) or np.any(become))
        # All ranks go on together, because every pass is collective.
        if not space.comm.allreduce(is_changed, MPI.LOR):
            return tractions
        trials = [trial.lower(*change) for trial, change in zip(trials, changes, strict=True)]
    # The passes do not settle: take the least bound on each facet, which is safe.
    safe = [replace(trial, allowed=replace(trial.allowed, sharp=False)) for trial in trials]
    return _contact_tractions(safe, _allowed_at_nodes(space, safe, others))


def _in_disc(
    trial: Trial,
    cones: Cones,
    start: np.ndarray,
    weight: np.ndarray,
    motions: np.ndarray,
    modulus: np.ndarray,
) -> BalancePart:
    """Return the balance of a contact, where the set of its friction is a disc.

    Args:
        trial: The traction of the method.
        cones: The sets of its nodes.
        start: Tractions r_0 [force/area], shape (f, m, d).
        weight: As :class:`BalancePart` has it.
        motions: Motions at the nodes, shape (f, m, d, K).
        modulus: As :class:`BalancePart` has it.
    """
    allowed = trial.contact.friction_set
    n = cones.n
    of_motions = allowed.from_disc(np.moveaxis(motions, -1, 0), n)
    return BalancePart(
        cones,
        allowed.to_disc(start, n),
        allowed.to_disc(trial.shift(cones.slope), n),
        weight,
        np.moveaxis(of_motions, 0, -1),
        modulus,
    )


def _contact_tractions(trials: list[Trial], values: list[np.ndarray]) -> list[ContactTraction]:
    """Return the contact tractions of trials with given coefficients; collective."""
    return [trial.contact_traction(r) for trial, r in zip(trials, values, strict=True)]


def _allowed_at_nodes(space: Space, trials: list[Trial], others: OtherForces) -> list[np.ndarray]:
    """Limit tractions at the nodes, and balance the other forces; collective.

    The result is the allowed tractions nearest to the shifted ones. A set of the
    balance is convex: it has the tangent of the friction bound at the last pressures.
    So the balance is repeated until the law allows its result.

    The tractions of facets with a uniform pressure are multiples of
    :meth:`Allowed.at_mean_pressure`: one unknown, all nodes as one.

    Returns:
        Their coefficients on each contact [force/area], shape (f, m, d).

    Raises:
        TooCoarse: If they do not balance the other forces.
    """
    start = [trial.limit() for trial in trials]
    if not others.motions:
        return start
    comm = space.comm
    constraints = [trial.weights_and_motions(space, others.motions) for trial in trials]
    of_facets = moduli(space, [trial.contact for trial in trials])
    give = spring_give(space, [trial.contact for trial in trials], others)
    values = start
    for _ in range(CONTACT_PASSES):
        peak = largest_component(comm, values)
        cone_parts = []
        ray_parts = []
        for trial, r, r_0, (weight, motions), modulus in zip(
            trials, values, start, constraints, of_facets, strict=True
        ):
            cones = trial.allowed.tangent_cones(r, peak)
            part = _in_disc(trial, cones, r_0, weight, motions, modulus)
            cone_parts.append(part.on_facets(~trial.uniform))
            rays = trial.at_mean_pressure(r)
            uniform = trial.uniform
            of_uniform = (r_0[uniform], weight[uniform], motions[uniform], modulus[uniform])
            ray_parts.append(ray_part(rays[uniform], *of_uniform))
        tractions, imbalance, sizes = balance(comm, cone_parts + ray_parts, others.works, give)
        values = []
        moved = 0.0
        count = len(trials)
        for trial, at_nodes, on_rays in zip(
            trials, tractions[:count], tractions[count:], strict=True
        ):
            r = np.empty_like(trial.mean)
            cones_at = np.flatnonzero(~trial.uniform)
            n = trial.contact.direction[cones_at, None]
            r[cones_at] = trial.contact.friction_set.from_disc(at_nodes, n, cones_at)
            r[trial.uniform] = on_rays.reshape(-1, *r.shape[1:])
            values.append(r)
            is_uniform = trial.uniform[:, None, None]
            allowed = np.where(is_uniform, trial.at_mean_pressure(r), trial.allowed.project(r))
            moved = max(moved, float(abs(allowed - r).max(initial=0.0)))
        by_contact = [(trial.allowed.contact, r) for trial, r in zip(trials, values, strict=True)]
        check_balance(space, by_contact, others, imbalance, max(others.size, sizes))
        if comm.allreduce(moved, MPI.MAX) <= SETTLED_TRACTION * peak:
            break
    return values
