"""Tractions that a friction law allows at the nodes of a contact, and projections.

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
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.foundation import ContactOnMesh, pressures
from erc_contact.model.contact.friction import PROPORTIONAL
from erc_contact.model.contact.trace import split
from erc_contact.model.space import Space
from namedmesh.simplex import at_nodes, coefficients, nodes

LIMITER_STEPS = 20
"""Number of bisections of the limiter."""
LIMITER_TOLERANCE = 1e-3
"""Change by the projection that the limiter accepts, over the traction [-].

Where friction varies, the projection changes every traction that slips by a little.
"""
PRESSURE_STEP = 1e-6
"""Step of pressure for the slope of a law's bound, over the largest pressure [-]."""


@dataclass(frozen=True, eq=False)
class Allowed:
    """Hold the law that limits the tractions at the nodes of a contact.

    Attributes:
        space: The mesh.
        contact: The contact.
        factor: Factor of the friction bound on each facet [-], shape (f,).
        degree: Degree of the tractions.
        sharp: Whether the bound of a node uses the parameters at this node. Otherwise
            it is the least bound on the facet for the pressure of the node. Where b is
            concave, this is below the bound between the nodes, too.
    """

    space: Space
    contact: ContactOnMesh
    factor: np.ndarray
    degree: int
    sharp: bool = True

    @property
    def n(self) -> np.ndarray:
        """Return the middle normals of the facets, shape (f, 1, d)."""
        return self.contact.direction[:, None, :]

    @cached_property
    def parameters(self) -> dict[str, np.ndarray]:
        """Return the law's parameters at the nodes, or at the samples of each facet."""
        points = self.space.facet_samples
        if self.sharp:
            points = nodes(self.space.d - 1, self.degree)
        return friction_parameters(self.space, self.contact, points)

    def bound(self, pressure: np.ndarray) -> np.ndarray:
        """Return the friction bound, interpolated at the nodes [force/area].

        Args:
            pressure: Bernstein coefficients of the pressure [force/area], shape (f, m).

        Returns:
            Bernstein coefficients of the bound, shape (f, m).
        """
        if self.sharp:
            d, k = self.space.d, self.degree
            nodal = pressure @ at_nodes(d - 1, k).T
            bound = self.contact.friction_bound(nodal, self.parameters)
            return self.factor[:, None] * np.maximum(bound @ coefficients(d - 1, k).T, 0.0)
        # The pressure of each node in turn, with the parameters of all samples.
        shape = len(pressure), len(self.space.facet_samples)
        least = []
        for nodal in pressure.T:
            spread = np.broadcast_to(nodal[:, None], shape)
            bound = self.contact.friction_bound(spread, self.parameters)
            least.append(bound.min(axis=1))
        return np.column_stack(least)

    def project(self, z: np.ndarray) -> np.ndarray:
        """Project tractions (f, m, d) on the allowed tractions.

        The normal part is projected first, then the tangential one. This is the
        projection of the contact methods. It is not the Euclidean one
        (:meth:`Cones.nearest`).
        """
        z_n, z_t, _ = split(z, self.n)
        r_n = z_n if self.contact.bilateral else np.minimum(z_n, 0.0)
        bound = self.bound(np.maximum(-r_n, 0.0))
        size = self.contact.friction_set.gauge(z_t, self.n)
        return clip(z_t, size, bound) + r_n[..., None] * self.n

    def limited_by_mean(self, mean: np.ndarray, best: np.ndarray) -> np.ndarray:
        """Limit tractions, facet by facet.

        The result is the allowed traction nearest to ``best`` on the line from ``mean``
        to ``best``. Both have the same resultant on a facet, and the law allows
        ``mean``, so r^ keeps the resultant. A projection would change the resultant of
        a facet with a kink: it lost 1.4% of the friction of a block of degree 2, whose
        e was 14% larger. For degree 1 there is no such difference, and the projection
        is cheaper.

        Args:
            mean: Means against the Bernstein polynomials [force/area], shape (f, m, d).
            best: Coefficients of the L2 projection [force/area], shape (f, m, d).
        """
        size = abs(best).max(axis=(1, 2), initial=0.0)

        def projected(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """Project the point of the line; tell where this changes nothing."""
            values = mean + share[:, None, None] * (best - mean)
            allowed = self.project(values)
            change = abs(allowed - values).max(axis=(1, 2), initial=0.0)
            return allowed, change <= LIMITER_TOLERANCE * size

        values, fits = projected(np.ones(len(mean)))
        if fits.all():
            return values
        # On a coarse mesh where friction varies, the law may not allow even the mean.
        # Then no point of the line helps, and ``best`` is projected.
        _, mean_fits = projected(np.zeros(len(mean)))
        low = np.where(fits | ~mean_fits, 1.0, 0.0)
        high = np.ones(len(mean))
        for _ in range(LIMITER_STEPS):
            middle = (low + high) / 2
            _, fits = projected(middle)
            low = np.where(fits, middle, low)
            high = np.where(fits, high, middle)
        limited, _ = projected(low)
        return limited

    def at_mean_pressure(self, values: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Return tractions with the mean pressure of each facet that oppose the slip.

        Their friction is all that this pressure allows. If the pressure varies, so may
        the friction bound, which then is no polynomial, and r^ stays below it. The
        contact part of e^2 contains the difference times the slip. If the pressure is
        uniform, r^ follows the bound: exactly where the parameters of the law are
        polynomials on the facet.

        Args:
            values: Tractions with these mean pressures [force/area], shape (f, m, d).
            slip: Vectors opposite to the friction, of any length, shape (f, m, d).

        Returns:
            The tractions [force/area], shape (f, m, d).
        """
        pressure = np.maximum(-(values * self.n).sum(axis=2).mean(axis=1), 0.0)
        bound = self.bound(np.broadcast_to(pressure[:, None], values.shape[:2]))
        length = self.contact.friction_set.gauge(slip, self.n)[..., None]
        against = np.divide(slip, length, out=np.zeros_like(slip), where=length > 0)
        return -pressure[:, None, None] * self.n - bound[..., None] * against

    def tangent_cones(self, start: np.ndarray, peak: float) -> Cones:
        """Return a convex set near some tractions.

        Its friction bound is the tangent of b at the pressures of ``start``. The law
        allows a traction of the set that has these pressures. For other pressures the
        tangent is above b where b is concave.

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
            least = np.finfo(float).tiny / PRESSURE_STEP
            step = PRESSURE_STEP * np.maximum(np.maximum(pressure, peak), least)
            slope = np.maximum(self.bound(pressure + step) - bound, 0.0) / step
        # A tangent that is negative at pressure zero is replaced by the chord from
        # there.
        chord = np.divide(bound, pressure, out=np.zeros_like(bound), where=pressure > 0)
        slope = np.where(bound < slope * pressure, chord, slope)
        slope = np.where(bilateral, 0.0, slope)
        offset = np.maximum(bound - slope * pressure, 0.0)
        return Cones(self.n, slope, offset, bilateral)
