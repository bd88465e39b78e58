"""Contact tractions that the law allows and that balance the loads.

The law allows them at every point, not only at nodes: if the Bernstein coefficients of
a traction lie in a convex set, its values lie in it, too. If the friction bound varies
along a facet or is given by the user, it is lowered until the traction is allowed at a
fine sampling of the facet (:mod:`erc_contact.admissible.sampled`).

Symbols: n normal of the foundation, r^ contact traction on the body, p = -r^_n
pressure, f facets, m number of coefficients of a facet, which belong to its nodes, d
dimension, K free motions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.allowed import Allowed
from erc_contact.admissible.balance import Part, balanced, largest_component
from erc_contact.admissible.balance_parts import raise_if_unbalanced, ray_part, weights_and_motions
from erc_contact.admissible.sampled import friction_at_samples, lowering, with_friction
from erc_contact.admissible.shift import Shift, shift_by_slip
from erc_contact.admissible.traction import ContactTraction, is_curved
from erc_contact.base.exceptions import NotHeldError
from erc_contact.mesh.simplex import averages, projection, rule
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import BoundContact, pressures
from erc_contact.model.friction import CONSTANT
from erc_contact.model.model import Model

CONTACT_PASSES = 10
"""Limit of the passes that lower the friction bound where it is sampled.

It is also the limit of those that balance the loads; one or two are usual.
"""
SETTLED_TRACTION = 1e-13
"""Change of tractions by the law after which they stay, over the largest one [-]."""
SLIDES = 10.0
"""Slip over ``h/E |r^|`` beyond which the pressure of a facet may be levelled [-]."""


@dataclass(frozen=True, eq=False)
class _Trial:
    """Hold the traction of the method on one contact, and what limits it.

    Attributes:
        traction: The L2 projection of the method's traction on degree k of each facet.
        mean: Its means ``int r B_m / int B_m`` with Bernstein polynomials B_m
            [force/area], shape (f, m, d).
        shift: Its shift by slip and opening.
        allowed: The tractions that the law allows.
        level: Which facets have a level pressure, shape (f,).
        is_curved: Whether the normals vary. A polygon that slides along another one
            presses on one end of each facet, and a projection would change resultants.
    """

    traction: ContactTraction
    mean: np.ndarray
    shift: Shift
    allowed: Allowed
    level: np.ndarray
    is_curved: bool

    def limited(self) -> np.ndarray:
        """Limit the traction to what the law allows [force/area]; collective.

        It is not yet balanced. Round-off of the method's traction is shifted in the
        direction in which it does not increase e.

        Returns:
            Coefficients, shape (f, m, d).
        """
        values = self.traction.values
        allowed = self.allowed
        # A projection is cheaper than the limiter, and for degree 1 as good on a plane.
        if allowed.model.degree == 1 and not self.is_curved:
            near = allowed.project(values)
        else:
            near = allowed.limited(self.mean, values)
        shifted = near + self.shift.round_off(near)
        return self.levelled(allowed.project(shifted))

    def levelled(self, values: np.ndarray) -> np.ndarray:
        """Level the pressure of tractions on the facets of ``level``; collective."""
        if not self.allowed.contact.sampled:
            return values
        level_values = self.allowed.level(values, self.shift.slip)
        return np.where(self.level[:, None, None], level_values, values)

    def becomes_level(self, traction: ContactTraction) -> np.ndarray:
        """Tell which facets have a smaller error with a level pressure; collective.

        They slide far, and the estimated decrease of the contact part of e^2 is larger
        than the estimated increase of the bulk part.

        Args:
            traction: r^ so far.

        Returns:
            Booleans, shape (f,).
        """
        friction = self.allowed.contact.friction
        values = traction.values
        # A level pressure gains nothing where b is linear in the pressure with the same
        # slope on the whole facet, or does not depend on it.
        if friction is None or friction.convex or friction.dependence == CONSTANT:
            return np.zeros(len(values), dtype=bool)
        path = self.shift.path.mean(axis=1)
        bound, used = friction_at_samples(self.allowed.model, traction)
        saved = 2 * np.maximum(bound - used, 0.0).mean(axis=1) * path
        change = values - self.allowed.level(values, self.shift.slip)
        added = (change**2).sum(axis=2).mean(axis=1)
        size = np.linalg.norm(values, axis=2).max(axis=1, initial=0.0)
        far = path > SLIDES * size
        return ~self.level & far & (saved > added)

    def lowered(self, factor: np.ndarray, become: np.ndarray) -> _Trial:
        """Return the trial with less friction, or with a level pressure.

        Args:
            factor: Factor of the friction of each facet [-], shape (f,).
            become: Facets whose pressure becomes level, shape (f,). Their friction
                starts again with factor 1.
        """
        factor = np.where(become, 1.0, factor)
        total = np.where(become, 1.0, self.allowed.factor * factor)
        contact = self.traction.contact
        values = with_friction(contact, self.traction.values, factor)
        mean = with_friction(contact, self.mean, factor)
        return _Trial(
            replace(self.traction, values=values),
            mean,
            self.shift,
            replace(self.allowed, factor=total),
            self.level | become,
            self.is_curved,
        )

    def contact_traction(self, values: np.ndarray) -> ContactTraction:
        """Return the contact traction with these coefficients (f, m, d); collective.

        Its friction bound is that of the law, without the factors of the trial.
        """
        law = replace(self.allowed, factor=np.ones(len(values)), sharp=True)
        bound = law.bound(pressures(values, law.n))
        return replace(self.traction, values=values, friction_bound=bound)


def admissible_tractions(
    model: Model, solution: Any, loads: np.ndarray, forces: float
) -> list[ContactTraction]:
    """Make the tractions r^ from the tractions r of the method; collective.

    The L2 projection of r on degree k of each facet is limited to what the law allows.
    For degree 2 the limiter uses the means ``int r B_m / int B_m``, which the law
    allows where it allows r.

    Where no support holds a rigid motion, r^ must balance the work of the loads on this
    motion exactly. The least change within the allowed tractions gives the balance. A
    body at rest has none.

    Args:
        model: The scene on a mesh.
        solution: The solution of the contact problem.
        loads: Work on the free motions of the projected loads, which sigma^ will
            balance [force], shape (K,).
        forces: Sum of the sizes of the nodal forces of these loads [force].

    Raises:
        NotHeldError: If no allowed traction balances the loads on a free motion.
    """
    if solution.at_rest:
        return [_no_traction(model, contact) for contact in model.contacts]
    trials = [_trial(model, contact, solution) for contact in model.contacts]
    if not any(contact.sampled for contact in model.contacts):
        return _limited(model, trials, loads, forces, levels=False)
    try:
        return _limited(model, trials, loads, forces, levels=True)
    except NotHeldError:
        # On a coarse mesh level pressures may leave too little to balance with.
        return _limited(model, trials, loads, forces, levels=False)


def _trial(model: Model, contact: BoundContact, solution: Any) -> _Trial:
    """Return the traction of the method on a contact, not yet limited; collective."""
    points, weights = rule(model.d - 1, model.contact_degree)
    project = projection(model.d - 1, model.degree, points, weights)
    average = averages(model.d - 1, model.degree, points, weights)
    nodes = contact.trace.here.nodes
    area = contact.trace.here.areas
    since_last_step = contact.trace.since(solution.u.x.array)
    shift = shift_by_slip(model, contact, since_last_step)
    sampled = evaluate(solution.traction(contact), model.mesh, points, contact.facets)
    values = np.matmul(project, sampled)
    traction = ContactTraction(contact, nodes, area, values, np.zeros(nodes.shape))
    allowed = Allowed(model, contact, np.ones(len(nodes)))
    level = np.zeros(len(nodes), dtype=bool)
    mean = np.matmul(average, sampled)
    return _Trial(traction, mean, shift, allowed, level, is_curved(model.comm, contact))


def _no_traction(model: Model, contact: BoundContact) -> ContactTraction:
    """Return the traction of a contact that transmits nothing; collective.

    Its friction bound is that of no pressure.
    """
    nodes = contact.trace.here.nodes
    area = contact.trace.here.areas
    values = np.zeros((*nodes.shape, model.d))
    law = Allowed(model, contact, np.ones(len(nodes)))
    bound = law.bound(pressures(values, law.n))
    return ContactTraction(contact, nodes, area, values, bound)


def _limited(
    model: Model, trials: list[_Trial], loads: np.ndarray, forces: float, *, levels: bool
) -> list[ContactTraction]:
    """Limit tractions to what the law allows at all samples, and balance the loads.

    ``levels`` tells whether pressures may be levelled.
    """
    for _ in range(CONTACT_PASSES):
        tractions = _allowed_at_nodes(model, trials, loads, forces)
        changes = []
        is_changed = False
        for trial, traction in zip(trials, tractions, strict=True):
            factor = lowering(model, traction)
            become = trial.becomes_level(traction) & levels
            changes.append((factor, become))
            is_changed = is_changed or bool(np.any(factor < 1.0) or np.any(become))
        # All ranks go on together, because every pass is collective.
        if not model.comm.allreduce(is_changed, MPI.LOR):
            return tractions
        trials = [trial.lowered(*change) for trial, change in zip(trials, changes, strict=True)]
    # The passes do not settle: take the least bound on each facet, which is safe.
    safe = [replace(trial, allowed=replace(trial.allowed, sharp=False)) for trial in trials]
    return _allowed_at_nodes(model, safe, loads, forces)


def _allowed_at_nodes(
    model: Model, trials: list[_Trial], loads: np.ndarray, forces: float
) -> list[ContactTraction]:
    """Limit tractions at the nodes, and balance the loads; collective."""
    values = [trial.limited() for trial in trials]
    if model.free_motions:
        values = _balanced(model, trials, values, loads, forces)
    return [trial.contact_traction(r) for trial, r in zip(trials, values, strict=True)]


def _balanced(
    model: Model, trials: list[_Trial], start: list[np.ndarray], loads: np.ndarray, forces: float
) -> list[np.ndarray]:
    """Balance the loads on the free motions; collective.

    The result is the allowed tractions nearest to the shifted ones. A set of the
    balance is convex: it has the tangent of the friction bound at the last pressures.
    So the balance is repeated until the law allows its result.

    The tractions of facets with a level pressure are multiples of
    :meth:`Allowed.level`: one unknown, all nodes as one.
    """
    comm = model.comm
    constraints = [weights_and_motions(model, trial.traction) for trial in trials]
    values = start
    for _ in range(CONTACT_PASSES):
        peak = largest_component(comm, values)
        cone_parts = []
        ray_parts = []
        for trial, r, r_0, (weight, motions) in zip(
            trials, values, start, constraints, strict=True
        ):
            cones = trial.allowed.near(r, peak)
            shift = trial.shift(cones.slope)
            part = Part(cones, r_0, shift, weight, motions)
            cone_parts.append(part.on_facets(~trial.level))
            rays = trial.levelled(r)
            level = trial.level
            ray_parts.append(ray_part(rays[level], r_0[level], weight[level], motions[level]))
        tractions, imbalance, sizes = balanced(comm, cone_parts + ray_parts, loads)
        raise_if_unbalanced(imbalance, max(forces, sizes))

        values = []
        moved = 0.0
        count = len(trials)
        for trial, at_nodes, on_rays in zip(
            trials, tractions[:count], tractions[count:], strict=True
        ):
            r = np.empty_like(trial.mean)
            r[~trial.level] = at_nodes
            r[trial.level] = on_rays.reshape(-1, *r.shape[1:])
            values.append(r)
            is_level = trial.level[:, None, None]
            allowed = np.where(is_level, trial.levelled(r), trial.allowed.project(r))
            moved = max(moved, float(abs(allowed - r).max(initial=0.0)))
        if comm.allreduce(moved, MPI.MAX) <= SETTLED_TRACTION * peak:
            break
    return values
