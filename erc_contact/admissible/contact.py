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
from erc_contact.admissible.balance import Part, balanced
from erc_contact.admissible.cells import moments
from erc_contact.admissible.cones import Cones
from erc_contact.admissible.sampled import friction_at_samples, lowering, with_friction
from erc_contact.admissible.shift import Shift, shift_by_slip
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.exceptions import NotHeldError
from erc_contact.mesh.simplex import averages, projection, rule
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import BoundContact, pressures
from erc_contact.model.friction import CONSTANT
from erc_contact.model.model import Model

PASSES = 10
"""Limit of the passes that lower the friction bound where it is sampled, and of those
that balance the loads; one or two are usual."""
SLIDES = 10.0
"""Slip over ``h/E |r^|`` beyond which the pressure of a facet may be levelled [-]."""
HELD = 1e-8
"""Imbalance that counts as none, over the forces [-]; 1e-15 to 1e-11 remains where an allowed traction exists."""


@dataclass(frozen=True, eq=False)
class _Trial:
    """The traction of the method on one contact, and what limits it.

    Attributes:
        traction: The L2 projection of the method's traction on degree k of each facet.
        mean: Its means ``int r B_m / int B_m`` with Bernstein polynomials B_m
            [force/area], shape (f, m, d).
        shift: Its shift by slip and opening.
        allowed: The tractions that the law allows.
        level: Which facets have a level pressure, shape (f,).
    """

    traction: ContactTraction
    mean: np.ndarray
    shift: Shift
    allowed: Allowed
    level: np.ndarray

    def limited(self) -> np.ndarray:
        """The traction limited to what the law allows, not yet balanced [force/area], shape (f, m, d); collective.

        Round-off of the method's traction is shifted in the direction in which it does
        not increase e.
        """
        values, allowed = self.traction.values, self.allowed
        near = (
            allowed.project(values)
            if allowed.model.degree == 1
            else allowed.limited(self.mean, values)
        )
        return self.levelled(allowed.project(near + self.shift.round_off(near)))

    def levelled(self, values: np.ndarray) -> np.ndarray:
        """Tractions (f, m, d) with the pressure levelled on the facets where it is level; collective."""
        if not self.allowed.contact.sampled:
            return values
        return np.where(
            self.level[:, None, None], self.allowed.level(values, self.shift.slip), values
        )

    def becomes_level(self, traction: ContactTraction) -> np.ndarray:
        """Which facets have a smaller error with a level pressure, shape (f,); collective.

        They slide far, and the estimated decrease of the contact part of e^2 is larger
        than the estimated increase of the bulk part.

        Args:
            traction: r^ so far.
        """
        friction = self.allowed.contact.friction
        values, path = traction.values, self.shift.path.mean(axis=1)
        if (
            friction is None or friction.convex or friction.dependence == CONSTANT
        ):  # no friction that pressure changes
            return np.zeros(len(values), dtype=bool)
        most, used = friction_at_samples(self.allowed.model, traction)
        saved = 2 * np.maximum(most - used, 0.0).mean(axis=1) * path
        added = (
            ((values - self.allowed.level(values, self.shift.slip)) ** 2).sum(axis=2).mean(axis=1)
        )
        far = path > SLIDES * np.linalg.norm(values, axis=2).max(axis=1, initial=0.0)
        return ~self.level & far & (saved > added)

    def lowered(self, factor: np.ndarray, become: np.ndarray) -> _Trial:
        """The trial with a factor (f,) of the friction of each facet, and a level pressure where it becomes level."""
        factor = np.where(become, 1.0, factor)
        contact = self.traction.contact
        return _Trial(
            replace(self.traction, values=with_friction(contact, self.traction.values, factor)),
            with_friction(contact, self.mean, factor),
            self.shift,
            replace(self.allowed, factor=np.where(become, 1.0, self.allowed.factor * factor)),
            self.level | become,
        )

    def made(self, values: np.ndarray) -> ContactTraction:
        """The contact traction with these coefficients (f, m, d), and its friction bound; collective."""
        law = replace(self.allowed, factor=np.ones(len(values)), sharp=True)
        return replace(
            self.traction, values=values, friction_bound=law.bound(pressures(values, law.n))
        )


def admissible_tractions(
    model: Model, solution: Any, loads: np.ndarray, forces: float
) -> list[ContactTraction]:
    """The tractions r^ of all contacts, from the tractions r of the method; collective.

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
    except NotHeldError:  # on a coarse mesh level pressures may leave too little to balance with
        return _limited(model, trials, loads, forces, levels=False)


def _no_traction(model: Model, contact: BoundContact) -> ContactTraction:
    """The traction of a contact that transmits nothing, with the friction bound of no pressure; collective."""
    nodes, area = contact.trace.here.nodes, contact.trace.here.areas
    values = np.zeros((*nodes.shape, model.d))
    law = Allowed(model, contact, np.ones(len(nodes)))
    return ContactTraction(contact, nodes, area, values, law.bound(pressures(values, law.n)))


def _trial(model: Model, contact: BoundContact, solution: Any) -> _Trial:
    """The traction of the method on a contact, with the friction bound of the law; collective."""
    points, weights = rule(model.d - 1, model.contact_degree)
    project = projection(model.d - 1, model.degree, points, weights)
    average = averages(model.d - 1, model.degree, points, weights)
    nodes, area = contact.trace.here.nodes, contact.trace.here.areas
    since = contact.trace.since(solution.u.x.array)
    shift = shift_by_slip(model, contact, since)
    sampled = evaluate(solution.traction(contact), model.mesh, points, contact.facets)
    traction = ContactTraction(
        contact, nodes, area, np.matmul(project, sampled), np.zeros(nodes.shape)
    )
    allowed = Allowed(model, contact, np.ones(len(nodes)))
    return _Trial(
        traction, np.matmul(average, sampled), shift, allowed, np.zeros(len(nodes), dtype=bool)
    )


def _limited(
    model: Model, trials: list[_Trial], loads: np.ndarray, forces: float, *, levels: bool
) -> list[ContactTraction]:
    """Tractions that the law allows at all samples, and that balance the loads.

    ``levels`` tells whether pressures may be levelled.
    """
    for _ in range(PASSES):
        new = _allowed(model, trials, loads, forces)
        factors = [lowering(model, traction) for traction in new]
        become = [
            trial.becomes_level(traction) & levels
            for traction, trial in zip(new, trials, strict=True)
        ]
        changes = any(np.any(factor < 1.0) for factor in factors) or any(
            np.any(facets) for facets in become
        )
        if not model.comm.allreduce(changes, MPI.LOR):
            return new
        trials = [
            trial.lowered(*change) for trial, *change in zip(trials, factors, become, strict=True)
        ]
    trials = [replace(trial, allowed=replace(trial.allowed, sharp=False)) for trial in trials]
    return _allowed(model, trials, loads, forces)


def _allowed(
    model: Model, trials: list[_Trial], loads: np.ndarray, forces: float
) -> list[ContactTraction]:
    """Tractions that the law allows at the nodes, and that balance the loads; collective."""
    values = [trial.limited() for trial in trials]
    if model.free_motions:
        values = _balanced(model, trials, values, loads, forces)
    return [trial.made(of) for trial, of in zip(trials, values, strict=True)]


def _balanced(
    model: Model, trials: list[_Trial], start: list[np.ndarray], loads: np.ndarray, forces: float
) -> list[np.ndarray]:
    """The allowed tractions nearest to the shifted ones that balance the loads on the free motions.

    The tractions of facets with a level pressure are multiples of
    :meth:`Allowed.level`: one unknown, all nodes as one.
    """
    comm, values = model.comm, start
    weights, motions = zip(
        *(_weights_and_motions(model, trial.traction) for trial in trials), strict=True
    )
    for _ in range(PASSES):
        peak = comm.allreduce(
            max((float(abs(r).max(initial=0.0)) for r in values), default=0.0), MPI.MAX
        )
        cones = [trial.allowed.near(r, peak) for trial, r in zip(trials, values, strict=True)]
        along = [trial.levelled(r) for trial, r in zip(trials, values, strict=True)]
        free = [
            Part(cone, r, trial.shift(cone.slope), *of).of(~trial.level)
            for trial, cone, r, *of in zip(trials, cones, start, weights, motions, strict=True)
        ]
        rays = [
            _rays(*(array[trial.level] for array in of))
            for trial, *of in zip(trials, along, start, weights, motions, strict=True)
        ]
        found, rest, sizes = balanced(comm, free + rays, loads)
        values = [np.empty_like(r) for r in start]
        for trial, r, nodes, ray in zip(
            trials, values, found[: len(trials)], found[len(trials) :], strict=True
        ):
            r[~trial.level], r[trial.level] = nodes, ray.reshape(-1, *r.shape[1:])
        if np.linalg.norm(rest) > HELD * max(forces, sizes):
            raise NotHeldError(
                "No contact traction that the law allows, a polynomial on each facet, balances the loads on a rigid "
                f"motion that no support holds (imbalance {np.linalg.norm(rest) / max(forces, sizes):.1e} of the "
                "forces). Look at the direction of the loads, add a Displacement or friction, or refine the mesh at "
                "the contact."
            )
        moved = 0.0
        for trial, r in zip(trials, values, strict=True):
            kept = np.where(trial.level[:, None, None], trial.levelled(r), trial.allowed.project(r))
            moved = max(moved, float(abs(kept - r).max(initial=0.0)))
        if comm.allreduce(moved, MPI.MAX) <= 1e-13 * peak:
            break
    return values


def _weights_and_motions(model: Model, traction: ContactTraction) -> tuple[np.ndarray, np.ndarray]:
    """``|F|/m`` of the facets that this rank owns, else 0, and the means of the free motions at the nodes.

    Returns:
        Shapes (f, 1) and (f, m, d, K), as :class:`Part` has them.
    """
    of = [
        traction.contact.trace.of(f.x.array) for f in model.free_motions
    ]  # linear: also the coefficients
    share = traction.area / traction.nodes.shape[1]
    moment = np.stack([moments(traction.area, values, model.degree) for values in of], axis=-1)
    weight = np.where(traction.contact.trace.here.owned, share, 0.0)[:, None]
    return weight, moment / share[:, None, None, None]


def _rays(along: np.ndarray, start: np.ndarray, weight: np.ndarray, motions: np.ndarray) -> Part:
    """Facets whose tractions are multiples >= 0 of given ones (f, m, d), all nodes of a facet as one long vector."""
    f, m, d = along.shape
    long = along.reshape(f, 1, m * d)
    size = np.linalg.norm(long, axis=2, keepdims=True)
    unit = np.divide(-long, size, out=np.zeros_like(long), where=size > 0)
    none = np.zeros((f, 1))
    cones = Cones(unit, none, none, none > 0)
    start = start.reshape(f, 1, m * d)
    return Part(
        cones, start, np.zeros_like(start), weight, motions.reshape(f, 1, m * d, motions.shape[-1])
    )
