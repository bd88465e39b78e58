"""The tractions that a friction law allows at the nodes of a contact, and projections on them.

A law gives a friction bound b(p) for each pressure p. :class:`Allowed` knows the law
and finds allowed tractions near given ones. Where a convex set is needed,
:meth:`Allowed.near` gives the set with the tangent of b
(:mod:`erc_contact.admissible.cones`).

Symbols: n normal of the foundation, p = -r_n pressure, b(p) friction bound, f facets, m
nodes of a facet.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from erc_contact.admissible.cones import Cones, clip
from erc_contact.mesh.simplex import at_nodes, coefficients
from erc_contact.model.foundation import BoundContact, pressures
from erc_contact.model.friction import PROPORTIONAL
from erc_contact.model.model import Model
from erc_contact.model.trace import split

LIMITER_STEPS = 20
"""Number of bisections of the limiter."""
LIMITER_TOLERANCE = 1e-3
"""Change by the projection that the limiter accepts, over the traction [-]. Where
friction varies, the projection changes every traction that slips by a little."""
DIFFERENCE = 1e-6
"""Step of the pressure for the slope of a law's bound, over the largest pressure [-]."""


@dataclass(frozen=True, eq=False)
class Allowed:
    """The tractions that a law allows at the nodes of a contact.

    Attributes:
        model: The scene on a mesh.
        contact: The contact.
        factor: Factor of the friction bound on each facet [-], shape (f,).
        sharp: Whether the bound of a node uses the parameters at this node. Otherwise
            it is the least bound on the facet for the pressure of the node. Where b is
            concave, this is below the bound between the nodes, too.
    """

    model: Model
    contact: BoundContact
    factor: np.ndarray
    sharp: bool = True

    @property
    def n(self) -> np.ndarray:
        """Normals, shape (f, 1, d)."""
        return self.contact.direction[:, None, :]

    @cached_property
    def parameters(self) -> dict[str, np.ndarray]:
        """The law's parameters at the nodes, or at the samples of each facet."""
        points = self.model.facet_points if self.sharp else self.model.facet_samples
        return self.model.friction_parameters(self.contact, points)

    def bound(self, pressure: np.ndarray) -> np.ndarray:
        """Coefficients of the friction bound, interpolated at the nodes, from those of the pressure, shape (f, m)."""
        if self.sharp:
            d, k = self.model.d, self.model.degree
            bound = self.contact.friction_bound(pressure @ at_nodes(d - 1, k).T, self.parameters)
            return self.factor[:, None] * np.maximum(bound @ coefficients(d - 1, k).T, 0.0)
        many = len(pressure), len(self.model.facet_samples)
        spread = [np.broadcast_to(p[:, None], many) for p in pressure.T]
        least = [self.contact.friction_bound(p, self.parameters).min(axis=1) for p in spread]
        return np.column_stack(least)

    def project(self, z: np.ndarray) -> np.ndarray:
        """Project tractions (f, m, d) on the allowed ones: first the normal part, then the tangential part.

        This is the projection of the contact methods. It is not the Euclidean one
        (:meth:`Cones.nearest`).
        """
        z_n, z_t, size = split(z, self.n)
        r_n = z_n if self.contact.bilateral else np.minimum(z_n, 0.0)
        bound = self.bound(np.maximum(-r_n, 0.0))
        return clip(z_t, size, bound) + r_n[..., None] * self.n

    def limited(self, mean: np.ndarray, best: np.ndarray) -> np.ndarray:
        """The allowed traction nearest to ``best`` on the line from ``mean`` to ``best``, facet by facet: a limiter.

        Both have the same resultant on a facet, and the law allows ``mean``, so r^
        keeps the resultant. A projection would change the resultant of a facet with a
        kink: it lost 1.4% of the friction of a block of degree 2, whose e was 14%
        larger. For degree 1 there is no such difference, and the projection is cheaper.

        Args:
            mean: Means against the Bernstein polynomials [force/area], shape (f, m, d).
            best: Coefficients of the L2 projection [force/area], shape (f, m, d).
        """
        size = abs(best).max(axis=(1, 2), initial=0.0)

        def at(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            values = mean + share[:, None, None] * (best - mean)
            allowed = self.project(values)
            return allowed, abs(allowed - values).max(
                axis=(1, 2), initial=0.0
            ) <= LIMITER_TOLERANCE * size

        values, fits = at(np.ones(len(mean)))
        if fits.all():
            return values
        _, reaches = at(np.zeros(len(mean)))  # false on a coarse mesh where friction varies
        high = np.ones(len(mean))
        low = np.where(fits | ~reaches, 1.0, 0.0)
        for _ in range(LIMITER_STEPS):
            middle = (low + high) / 2
            _, fits = at(middle)
            low, high = np.where(fits, middle, low), np.where(fits, high, middle)
        return at(low)[0]

    def level(self, values: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Tractions with the mean pressure of each facet, which oppose the slip with all the friction that this allows.

        If the pressure varies, so may the friction bound, which then is no polynomial,
        and r^ stays below it. The contact part of e^2 contains the difference times the
        slip. If the pressure is level, r^ follows the bound: exactly where the
        parameters of the law are polynomials on the facet.

        Args:
            values: Tractions whose pressure is levelled [force/area], shape (f, m, d).
            slip: Vectors along the slip, of any length, shape (f, m, d).

        Returns:
            The tractions [force/area], shape (f, m, d).
        """
        pressure = np.maximum(-(values * self.n).sum(axis=2).mean(axis=1), 0.0)
        bound = self.bound(np.broadcast_to(pressure[:, None], values.shape[:2]))
        length = np.linalg.norm(slip, axis=2, keepdims=True)
        against = np.divide(slip, length, out=np.zeros_like(slip), where=length > 0)
        return -pressure[:, None, None] * self.n - bound[..., None] * against

    def near(self, start: np.ndarray, peak: float) -> Cones:
        """A convex set whose friction bound is the tangent of b at the pressures of ``start``.

        The law allows a traction of the set that has these pressures. For other
        pressures the tangent is above b where b is concave.

        Args:
            start: Tractions [force/area], shape (f, m, d).
            peak: Size of the largest traction over all ranks [force/area].
        """
        pressure = pressures(start, self.n)
        bilateral = np.full(pressure.shape, self.contact.bilateral)
        bound = self.bound(np.where(bilateral, 0.0, pressure))
        if self.contact.friction is not None and self.contact.friction.dependence == PROPORTIONAL:
            slope = self.bound(np.ones_like(pressure))
        else:
            step = DIFFERENCE * np.maximum(
                np.maximum(pressure, peak), np.finfo(float).tiny / DIFFERENCE
            )
            slope = np.maximum(self.bound(pressure + step) - bound, 0.0) / step
        chord = np.divide(bound, pressure, out=np.zeros_like(bound), where=pressure > 0)
        slope = np.where(bilateral, 0.0, np.where(bound < slope * pressure, chord, slope))
        return Cones(self.n, slope, np.maximum(bound - slope * pressure, 0.0), bilateral)
