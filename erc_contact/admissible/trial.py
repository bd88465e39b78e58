"""Tractions of the method on a contact, on their way to what the law allows.

Symbols: n normal of the foundation, r^ contact traction on the body, f facets, m number
of coefficients of a facet, which belong to its nodes, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from erc_contact.admissible.allowed import Allowed
from erc_contact.admissible.sampled import friction_at_samples, with_friction
from erc_contact.admissible.shift import Shift, shift_by_slip, shift_of_far_open
from erc_contact.admissible.traction import ContactTraction, is_curved
from erc_contact.mesh.simplex import averages, projection, rule
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import BoundContact, pressures
from erc_contact.model.friction import CONSTANT
from erc_contact.model.space import Space

SLIDES = 10.0
"""Slip over ``h/E |r^|`` beyond which the pressure of a facet may be levelled [-]."""


@dataclass(frozen=True, eq=False)
class Trial:
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
        if allowed.space.degree == 1 and not self.is_curved:
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
        bound, used = friction_at_samples(self.allowed.space, traction)
        saved = 2 * np.maximum(bound - used, 0.0).mean(axis=1) * path
        change = values - self.allowed.level(values, self.shift.slip)
        added = (change**2).sum(axis=2).mean(axis=1)
        size = np.linalg.norm(values, axis=2).max(axis=1, initial=0.0)
        far = path > SLIDES * size
        return ~self.level & far & (saved > added)

    def lowered(self, factor: np.ndarray, become: np.ndarray) -> Trial:
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
        return Trial(
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


def trial_of(space: Space, contact: BoundContact, solution: Any) -> Trial:
    """Return the traction of the method on a contact, not yet limited; collective."""
    points, weights = rule(space.d - 1, space.contact_degree)
    project = projection(space.d - 1, space.degree, points, weights)
    average = averages(space.d - 1, space.degree, points, weights)
    nodes = contact.trace.here.nodes
    area = contact.trace.here.areas
    since_last_step = contact.trace.since(solution.u.x.array)
    shift = shift_by_slip(space, contact, since_last_step)
    sampled = evaluate(solution.traction(contact), space.mesh, points, contact.facets)
    values = np.matmul(project, sampled)
    opens = shift_of_far_open(space, contact, shift, since_last_step, values)
    values = values + opens
    traction = ContactTraction(contact, nodes, area, values, np.zeros(nodes.shape))
    allowed = Allowed(space, contact, np.ones(len(nodes)))
    level = np.zeros(len(nodes), dtype=bool)
    mean = np.matmul(average, sampled) + opens
    return Trial(traction, mean, shift, allowed, level, is_curved(space.comm, contact))
