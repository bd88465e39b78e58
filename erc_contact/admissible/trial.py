"""Tractions of the method on a contact, on their way to what the law allows.

Symbols: n normal of the foundation, r^ contact traction on the body, f facets, m number
of coefficients of a facet, which belong to its nodes, d dimension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from erc_contact.admissible.allowed import Allowed
from erc_contact.admissible.balance_parts import Motion, jump_of, weights_and_motions
from erc_contact.admissible.sampled import friction_at_samples, with_friction
from erc_contact.admissible.shift import Shift, shift_by_slip, shift_of_far_open
from erc_contact.admissible.traction import ContactTraction, is_kinked
from erc_contact.model.contact.contact_values import friction_parameters, spring_displacement
from erc_contact.model.contact.foundation import ContactOnMesh, pressures
from erc_contact.model.contact.friction import CONSTANT
from erc_contact.model.contact.turning import Turning, turning_of
from erc_contact.model.space import Space
from namedmesh.simplex import (
    at_nodes,
    averages,
    projection,
    rule,
)

SLIDES = 10.0
"""Slip over ``h/E |r^|`` beyond which a pressure may become uniform [-]."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Hold the traction of the method on one contact, and what limits it.

    Where the normals of a contact turn along its facets, all tractions here are about
    the middle normals of the facets (:mod:`erc_contact.model.contact.turning`).

    Attributes:
        best: Coefficients of the L2 projection of the method's traction [force/area],
            shape (f, m, d).
        mean: Its means ``int r B_m / int B_m`` with Bernstein polynomials B_m
            [force/area], shape (f, m, d).
        shift: Its shift by slip and opening.
        allowed: The tractions that the law allows.
        uniform: Which facets have a uniform pressure, shape (f,).
        is_kinked: Whether the normals jump. A polygon that slides along another one
            presses on one end of each facet, and a projection would change resultants.
        turning: How tractions turn with the normals, or None.
        off_axis: Which coefficients are off the axis of the body, where there is no
            traction, shape (f, m) or (1, 1).
        otherwise: The trial that takes the place of this one if the law does not allow
            a traction that does not turn, or None.
    """

    best: np.ndarray
    mean: np.ndarray
    shift: Shift
    allowed: Allowed
    uniform: np.ndarray
    is_kinked: bool
    turning: Turning | None
    off_axis: np.ndarray
    otherwise: Trial | None = None

    def turn(self, outside: bool) -> Trial:
        """Return the trial whose traction turns, if it is needed."""
        return self.otherwise if outside and self.otherwise is not None else self

    @property
    def contact(self) -> ContactOnMesh:
        """Return the contact."""
        return self.allowed.contact

    def limit(self) -> np.ndarray:
        """Limit the traction to what the law allows [force/area]; collective.

        It is not yet balanced. Round-off of the method's traction is shifted in the
        direction in which it does not increase e.

        Returns:
            Coefficients, shape (f, m, d).
        """
        allowed = self.allowed
        # A projection is cheaper than the limiter, and up to degree 1 as good without
        # kinks.
        if allowed.degree < 2 and not self.is_kinked:
            near = allowed.project(self.best)
        else:
            near = allowed.limited_by_mean(self.mean, self.best)
        shifted = near + self.shift.round_off(near)
        shifted = shifted * self.off_axis[..., None]
        return self.at_mean_pressure(allowed.project(shifted))

    def at_mean_pressure(self, values: np.ndarray) -> np.ndarray:
        """Return tractions whose pressure is uniform where it is to be; collective."""
        if not self.contact.sampled:
            return values
        uniform_values = self.allowed.at_mean_pressure(values, self.shift.slip)
        return np.where(self.uniform[:, None, None], uniform_values, values)

    def becomes_uniform(self, values: np.ndarray) -> np.ndarray:
        """Tell which facets have a smaller error with a uniform pressure; collective.

        They slide far, and the estimated decrease of the contact part of e^2 is larger
        than the estimated increase of the bulk part.

        Args:
            values: Coefficients of the traction so far, shape (f, m, d).

        Returns:
            Booleans, shape (f,).
        """
        friction = self.contact.friction
        # A uniform pressure gains nothing where b is linear in the pressure with the
        # same slope on the whole facet, or does not depend on it.
        if friction is None or friction.convex or friction.dependence == CONSTANT:
            return np.zeros(len(values), dtype=bool)
        path = self.shift.path.mean(axis=1)
        bound, used = friction_at_samples(self.allowed.space, self.contact_traction(values))
        saved = 2 * np.maximum(bound - used, 0.0).mean(axis=1) * path
        change = values - self.allowed.at_mean_pressure(values, self.shift.slip)
        added = (change**2).sum(axis=2).mean(axis=1)
        size = np.linalg.norm(values, axis=2).max(axis=1, initial=0.0)
        far = path > SLIDES * size
        far &= self.off_axis.all(axis=1)
        return ~self.uniform & far & (saved > added)

    def lower(self, factor: np.ndarray, become: np.ndarray) -> Trial:
        """Return the trial with less friction, or with a uniform pressure.

        Args:
            factor: Factor of the friction of each facet [-], shape (f,).
            become: Facets whose pressure becomes uniform, shape (f,). Their friction
                starts again with factor 1.
        """
        factor = np.where(become, 1.0, factor)
        total = np.where(become, 1.0, self.allowed.factor * factor)
        return replace(
            self,
            best=with_friction(self.contact, self.best, factor),
            mean=with_friction(self.contact, self.mean, factor),
            allowed=replace(self.allowed, factor=total),
            uniform=self.uniform | become,
        )

    def weights_and_motions(
        self, space: Space, motions: Sequence[Motion]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the weights of the coefficients, and motions there.

        They are as :func:`weights_and_motions` returns them, for the tractions of the
        trial.
        """
        weight, of_nodes = self._weights_and_motions(space, motions)
        return weight, of_nodes * self.off_axis[..., None, None]

    def _weights_and_motions(
        self, space: Space, motions: Sequence[Motion]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return :meth:`weights_and_motions`, on the axis, too."""
        if self.turning is None:
            return weights_and_motions(space, self.contact, motions)
        trace = self.contact.trace
        # A motion is linear: its values at the nodes are also its coefficients.
        turned = [self.turning.means(jump_of(self.contact, motion)) for motion in motions]
        weight = trace.here.owned_areas / turned[0].shape[1]
        return weight[:, None], np.stack(turned, axis=-1)

    def contact_traction(self, values: np.ndarray) -> ContactTraction:
        """Return the contact traction with these coefficients (f, m, d); collective.

        Its friction bound follows the law, without the factors of the trial.
        """
        if self.turning is not None:
            values = self.turning.tractions(values)
        return contact_traction(self.allowed.space, self.contact, values)


def trial_of(space: Space, contact: ContactOnMesh, solution: Any, *, turned: bool = True) -> Trial:
    """Return the traction of the method on a contact, not yet limited; collective.

    Args:
        space: The mesh.
        contact: The contact.
        solution: The solution of the contact problem.
        turned: Whether the traction turns with normals that turn. Otherwise its
            coefficients are about the middle normals, and whether the law allows it is
            to be seen.
    """
    turning = turning_of(contact.trace) if turned else None
    degree = space.degree if turning is None else turning.degree
    points, weights = rule(space.d - 1, space.contact_degree)
    project = projection(space.d - 1, degree, points, weights)
    average = averages(space.d - 1, degree, points, weights)
    since_last_step = contact.trace.since(solution.u.x.array)
    if contact.tangential_stiffness is not None:
        # The slip is the displacement without the deflection of the foundation.
        places = space.facet_points
        r = space.evaluate(solution.traction(contact), places, contact.facets)
        since_last_step = since_last_step - spring_displacement(space, contact, r, places)
    shift = shift_by_slip(space, contact, since_last_step, turning)
    sampled = space.evaluate(solution.traction(contact), points, contact.facets)
    if turning is None:
        values = np.matmul(project, sampled)
        means = np.matmul(average, sampled)
    else:
        values = turning.nearest(sampled, points, weights, project)
        means = turning.nearest(sampled, points, weights, average)
    opens = shift_of_far_open(space, contact, shift, since_last_step, values, turning)
    count = len(contact.facets)
    best, mean = values + opens, means + opens
    section = space.section
    off = section.off_axis(contact.trace.here.corners, degree)
    if turning is None:
        best = section.vanishing(best, off)
    return Trial(
        best=best * off[..., None],
        mean=mean * off[..., None],
        shift=shift,
        allowed=Allowed(space, contact, np.ones(count), degree),
        uniform=np.zeros(count, dtype=bool),
        is_kinked=is_kinked(space.comm, contact),
        turning=turning,
        off_axis=off,
    )


def contact_traction(space: Space, contact: ContactOnMesh, values: np.ndarray) -> ContactTraction:
    """Return the contact traction with coefficients of r^ (f, m, d); collective."""
    here = contact.trace.here
    matrix = at_nodes(space.d - 1, space.degree)
    pressure = pressures(np.matmul(matrix, values), contact.trace.normals)
    parameters = friction_parameters(space, contact, space.facet_points)
    nodal = contact.friction_bound(pressure, parameters)
    bound = np.maximum(contact.trace.coefficients(nodal), 0.0)
    return ContactTraction(contact, here.nodes, here.areas, values, bound)
