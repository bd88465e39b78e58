"""Contact tractions that the law allows, in balance with the loads.

They are allowed point-wise, not only at nodes: a traction whose Bernstein coefficients lie in a convex set lies in it
everywhere. Where the friction bound varies along a facet or is not one of ours, it is lowered by what a fine sampling
of the facet shows.

Symbols: n normal of the foundation, r^ contact traction on the body, p = -r^_n pressure, b(p) friction bound, m number
of coefficients of a facet, which belong to its nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.geometry import moments
from erc_contact.exceptions import NotHeldError
from erc_contact.expressions import evaluate
from erc_contact.foundation import BoundContact
from erc_contact.law import Coulomb
from erc_contact.methods import contact_degree
from erc_contact.model import Model
from erc_contact.simplex import at_nodes, bernstein, coefficients, lattice, mass, rule

SAMPLES = 12
"""Subdivisions of a facet's edge when a bound that varies along it is sampled."""
PASSES = 10
"""Limit of passes that shrink the friction bound where it must be sampled; one or two are usual."""
MARGIN = 0.2
"""Share of the sampled deviation that is added for what may lie between two samples [-]."""
LIMITER_STEPS = 20
"""Bisections of the limiter."""
LIMITER_TOLERANCE = 1e-3
"""Change by the projection that the limiter leaves alone, over the traction [-]; where friction varies, the projection
changes all that slips by a little."""
GROWTHS = (1.1, 2.0, 10.0)
"""Growth of a pressure that the cone which stands for a general law near it allows, tried in turn [-]."""


@dataclass(frozen=True, eq=False)
class ContactTraction:
    """The admissible traction r^ on one contact, of degree k on each facet.

    Attributes:
        contact: Where.
        nodes: Nodes of each facet (cell, local facet) of ``contact.facets``, ghosts included, shape (n, m).
        area: Facet areas [length^(d-1)], shape (n,).
        values: Bernstein coefficients of r^ at these nodes [force/area], values at the vertices, shape (n, m, d).
        bound: The friction bound b(p) of these [force/area], shape (n, m).
    """

    contact: BoundContact
    nodes: np.ndarray
    area: np.ndarray
    values: np.ndarray
    bound: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        """Normal component r^_n, coefficients [force/area], shape (n, m)."""
        return np.einsum("fmi,fi->fm", self.values, self.contact.direction)

    @property
    def tangential(self) -> np.ndarray:
        """Tangential part r^_t, coefficients [force/area], shape (n, m, d)."""
        return self.values - self.normal[..., None] * self.contact.direction[:, None, :]


def split(z: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normal component, tangential part and its length, of vectors (..., d) and unit normals of the same shape."""
    z_n = (z * n).sum(axis=-1)
    z_t = z - z_n[..., None] * n
    return z_n, z_t, np.linalg.norm(z_t, axis=-1)


def clip(z_t: np.ndarray, size: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Shorten tangential vectors of given lengths to a bound."""
    return np.divide(bound, size, out=np.ones_like(size), where=size > bound)[..., None] * z_t


def nearest_in_cone(z: np.ndarray, n: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """The point of the Coulomb cone that is nearest to z (Euclidean projection, non-expansive).

    Args:
        z: Tractions [force/area], shape (..., d).
        n: Unit normal of the foundation, of the same shape.
        mu: Friction coefficients, shape (...).
    """
    z_n, z_t, size = split(z, n)
    on_cone = np.maximum(mu * size - z_n, 0.0) / (1 + mu**2)
    inside = size <= -mu * z_n
    pressure = np.where(inside, -z_n, on_cone)
    return clip(z_t, size, np.where(inside, size, mu * on_cone)) - pressure[..., None] * n


@dataclass(frozen=True, eq=False)
class _Allowed:
    """The tractions that a law allows at the nodes of a contact.

    Attributes:
        factor: Factor of the friction bound of each facet.
        sharp: Whether the bound is that of each node; else the least one on the facet for the pressure of the node,
            which needs no sampling: it lies below the bound between the nodes where b is concave.
    """

    model: Model
    contact: BoundContact
    factor: np.ndarray
    sharp: bool = True

    @property
    def n(self) -> np.ndarray:
        return self.contact.direction[:, None, :]

    @cached_property
    def parameters(self) -> dict[str, np.ndarray]:
        """The law's parameters at the nodes, or at the samples of each facet."""
        points = self.model.facet_points if self.sharp else samples(self.model.d)
        return self.model.friction_parameters(self.contact, points)

    def bound(self, pressure: np.ndarray) -> np.ndarray:
        """Coefficients of the friction bound, interpolated at the nodes, for those of the pressure, shape (f, m)."""
        if self.sharp:
            d, k = self.model.d, self.model.degree
            bound = self.contact.friction_bound(pressure @ at_nodes(d - 1, k).T, self.parameters)
            return self.factor[:, None] * np.maximum(bound @ coefficients(d - 1, k).T, 0.0)
        many = len(pressure), len(samples(self.model.d))
        spread = [np.broadcast_to(p[:, None], many) for p in pressure.T]
        least = [self.contact.friction_bound(p, self.parameters).min(axis=1) for p in spread]
        return np.column_stack(least)

    def project(self, z: np.ndarray) -> np.ndarray:
        """The law's projection, first the normal part, then the tangential part."""
        z_n, z_t, size = split(z, self.n)
        r_n = z_n if self.contact.bilateral else np.minimum(z_n, 0.0)
        bound = self.bound(np.maximum(-r_n, 0.0))
        return clip(z_t, size, bound) + r_n[..., None] * self.n

    def limited(self, mean: np.ndarray, best: np.ndarray) -> np.ndarray:
        """The allowed traction nearest to ``best`` on the way from ``mean``, facet by facet: a limiter.

        Both have the same resultant on a facet, and the law allows ``mean``, so r^ keeps the resultant. Projected
        instead, the resultant of a facet with a kink is lost: 1.4% of the friction of a block at degree 2, whose e
        was 14% larger. At degree 1 there is no such difference, and the projection is the cheaper one.
        """
        size = abs(best).max(axis=(1, 2), initial=0.0)

        def at(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            values = mean + share[:, None, None] * (best - mean)
            allowed = self.project(values)
            return allowed, abs(allowed - values).max(axis=(1, 2), initial=0.0) <= LIMITER_TOLERANCE * size

        values, fits = at(np.ones(len(mean)))
        if fits.all():
            return values
        _, reaches = at(np.zeros(len(mean)))  # not on a coarse mesh whose friction varies
        high = np.ones(len(mean))
        low = np.where(fits | ~reaches, 1.0, 0.0)
        for _ in range(LIMITER_STEPS):
            middle = (low + high) / 2
            _, fits = at(middle)
            low, high = np.where(fits, middle, low), np.where(fits, high, middle)
        return at(low)[0]

    def nearest(self, start: np.ndarray, growth: float, peak: float) -> Any:
        """A projection z -> r on a convex set that the law allows for pressures up to growth times those of start.

        The Coulomb cone itself; for a bound without pressure a cylinder; for another law the cone of the slope
        ``b(p')/p'`` at p' = growth p, which lies below a concave bound for all lower pressures.
        """
        pressure = np.maximum(-(start * self.n).sum(axis=-1), 0.0)
        law = self.contact.law
        zero = np.zeros_like(pressure)
        if law is None or self.contact.bilateral or np.any(self.bound(zero) > 0):
            least = self.bound(zero)

            def cylinder(z: np.ndarray) -> np.ndarray:
                z_n, z_t, size = split(z, self.n)
                r_n = z_n if self.contact.bilateral else np.minimum(z_n, 0.0)
                return clip(z_t, size, least) + r_n[..., None] * self.n

            return cylinder
        if isinstance(law, Coulomb):
            slope = self.bound(zero + 1.0)
        else:
            above = growth * np.maximum(pressure, 1e-3 * peak)
            slope = np.divide(self.bound(above), above, out=zero, where=above > 0)
        return lambda z: nearest_in_cone(z, self.n, slope)


def admissible_tractions(model: Model, solution: Any, loads: np.ndarray) -> list[ContactTraction]:
    """r^: the method's traction, L2-projected on polynomials of degree k of each facet, and limited to what is allowed.

    What limits it are the means ``int r B_m / int B_m``: the law allows these where it allows r.

    Where no support holds a rigid motion, r^ must balance the work of the loads on it, shape (motions,), exactly: the
    least change within the allowed tractions does it. ``loads`` is that of the loads' projections, which sigma^ is to
    balance.

    Raises:
        NotHeldError: If no allowed traction balances the loads on a free motion.
    """
    points, weights = rule(model.d - 1, contact_degree(model))
    shape = bernstein(model.d - 1, model.degree, points)
    project = np.linalg.solve(mass(model.d - 1, model.degree, model.degree), shape.T * weights)
    average = shape.T * weights / (weights @ shape)[:, None]
    raw, means = [], []
    for contact in model.contacts:
        sampled = evaluate(solution.traction(contact), model.domain, points, contact.facets)
        means.append(np.matmul(average, sampled))
        values = np.matmul(project, sampled)
        nodes = model.facet_nodes(contact.facets)
        raw.append(ContactTraction(contact, nodes, model.facet_areas(contact.facets), values, np.zeros(nodes.shape)))
    allowed = [_Allowed(model, t.contact, np.ones(len(t.nodes))) for t in raw]
    for _ in range(PASSES):
        new = _projected(model, raw, means, allowed, loads)
        factors = [_shrink(model, t) for t in new]
        if not model.comm.allreduce(any(np.any(f < 1.0) for f in factors), MPI.LOR):
            return new
        allowed = [replace(a, factor=a.factor * f) for a, f in zip(allowed, factors, strict=True)]
        raw = [replace(t, values=_shrunk(t.contact, t.values, f)) for t, f in zip(raw, factors, strict=True)]
        means = [_shrunk(t.contact, mean, f) for t, mean, f in zip(raw, means, factors, strict=True)]
    return _projected(model, raw, means, [replace(a, sharp=False) for a in allowed], loads)


def _projected(
    model: Model, raw: list[ContactTraction], means: list[np.ndarray], allowed: list[_Allowed], loads: np.ndarray
) -> list[ContactTraction]:
    values = [
        a.project(t.values) if model.degree == 1 else a.limited(mean, t.values)
        for t, mean, a in zip(raw, means, allowed, strict=True)
    ]
    if model.free_motions:
        values = _balanced(model, raw, values, allowed, loads)
    new = []
    for t, v, a in zip(raw, values, allowed, strict=True):
        pressure = np.maximum(-np.einsum("fmi,fi->fm", v, t.contact.direction), 0.0)
        new.append(replace(t, values=v, bound=replace(a, factor=np.ones(len(v)), sharp=True).bound(pressure)))
    return new


def _shrink(model: Model, traction: ContactTraction) -> np.ndarray:
    """Factor of each facet by which the friction bound must shrink for r^ to be allowed between the nodes."""
    if not traction.contact.sampled:
        return np.ones(len(traction.nodes))
    at = samples(model.d)
    shape = bernstein(model.d - 1, model.degree, at)
    parameters = model.friction_parameters(traction.contact, at)
    allowed = traction.contact.friction_bound(np.maximum(-traction.normal @ shape.T, 0.0), parameters)
    used = np.linalg.norm(np.einsum("qm,fmi->fqi", shape, traction.tangential), axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(used > allowed * (1 + 1e-14), allowed / used, 1.0).min(axis=1)
    return np.where(ratio < 1.0, np.maximum(ratio - MARGIN * (1 - ratio), 0.0), 1.0)


def _shrunk(contact: BoundContact, values: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Tractions (f, m, d) with their tangential part times a factor of each facet."""
    n = contact.direction[:, None, :]
    normal = (values * n).sum(axis=-1, keepdims=True) * n
    return normal + factor[:, None, None] * (values - normal)


def _balanced(
    model: Model, raw: list[ContactTraction], start: list[np.ndarray], allowed: list[_Allowed], loads: np.ndarray
) -> list[np.ndarray]:
    """The allowed tractions nearest to those given that balance the loads on the free motions."""
    peak = model.comm.allreduce(max((float(abs(r).max(initial=0)) for r in start), default=0.0), MPI.MAX)
    for growth in GROWTHS:
        nearest = [a.nearest(s, growth, peak) for a, s in zip(allowed, start, strict=True)]
        values = _balance(model, raw, start, nearest, loads)
        moved = [float(abs(a.project(v) - v).max(initial=0.0)) for a, v in zip(allowed, values, strict=True)]
        inside = max(moved) <= 1e-12 * peak
        if model.comm.allreduce(inside, MPI.LAND):
            break
    return values


def _balance(
    model: Model, raw: list[ContactTraction], start: list[np.ndarray], nearest: list[Any], loads: np.ndarray
) -> list[np.ndarray]:
    """The tractions in convex sets nearest to those given that balance the loads on the free motions.

    The multiplier y of the balance has one component for each free motion m_k: ``r = P(r_0 + sum_k y_k q_k)``
    with q_k the facet-wise average of m_k, and y minimises the convex function

        phi(y) = sum over nodes a/2 (|z|^2 - |z - P(z)|^2) + loads.y,    z = r_0 + q y,  a = |F|/m,

    whose gradient is the imbalance ``int r(y).m_k + load(m_k)``: Newton with differences in at most six unknowns, its
    line search on phi, which sees through the kinks of P.
    """
    comm, motions, d = model.comm, model.free_motions, model.d
    weight, direction, share, own_area = [], [], [], 0.0
    for t in raw:
        of = [f.x.array.reshape(-1, d)[t.nodes] for f in motions]  # linear: coefficients are the values at the nodes
        moment = np.stack([moments(t.area, values, model.degree) for values in of], axis=-1)
        m = t.nodes.shape[1]
        owned = t.contact.facets[:, 0] < model.domain.owned_cells
        own_area += float(t.area[owned].sum())
        weight.append(moment * owned[:, None, None, None])
        direction.append(moment * (m / t.area)[:, None, None, None])
        share.append(np.where(owned, t.area / (2 * m), 0.0))

    def state(y: np.ndarray) -> tuple[list[np.ndarray], np.ndarray, float]:
        """Tractions, imbalance and phi."""
        z = [r + q @ y for r, q in zip(start, direction, strict=True)]
        r = [p(v) for p, v in zip(nearest, z, strict=True)]
        local = np.zeros(len(y) + 1)
        for w, a, v, p, s in zip(weight, share, z, r, start, strict=True):
            local[:-1] += np.einsum("fmik,fmi->k", w, p)
            # |z|^2 - |z - P|^2 less its value at y = 0, |r_0|^2, without cancellation of the large parts
            local[-1] += np.einsum("f,fmi->", a, (2 * v - p) * p - s * s)
        total = comm.allreduce(local, MPI.SUM)
        return r, total[:-1] + loads, float(total[-1] + loads @ y)

    peak = comm.allreduce(max((float(abs(r).max(initial=0)) for r in start), default=0.0), MPI.MAX)
    area = comm.allreduce(own_area, MPI.SUM)
    scale = float(np.linalg.norm(loads)) + peak * area
    y = np.zeros(len(motions))
    tractions, value, height = state(y)
    if scale == 0.0:
        return tractions
    step = 1e-6 * max(peak, float(np.linalg.norm(loads)) / area)
    for _ in range(100):
        if np.linalg.norm(value) <= 1e-15 * scale:
            break
        tangent = np.column_stack([state(y + step * e)[1] - state(y - step * e)[1] for e in np.eye(len(y))])
        tangent = 0.5 * (tangent + tangent.T) / (2 * step)
        tangent += 1e-12 * (np.trace(tangent) + area * 1e-6) * np.eye(len(y))
        search = -np.linalg.solve(tangent, value)
        length = 1.0
        new = state(y + search)
        while new[2] > height + 1e-4 * length * (value @ search) and np.linalg.norm(new[1]) > 0.5 * np.linalg.norm(
            value
        ):
            length /= 2
            if length < 1e-10:
                break
            new = state(y + length * search)
        if length < 1e-10:
            break
        y, (tractions, value, height) = y + length * search, new
    if np.linalg.norm(value) > 1e-12 * scale:
        raise NotHeldError(
            "No contact traction that the law allows, a polynomial on each facet, balances the loads on a rigid motion "
            f"that no support holds (imbalance {np.linalg.norm(value) / scale:.1e} of the forces). Look at the "
            "direction of the loads, add a Displacement or friction, or refine the mesh at the contact."
        )
    return tractions


def samples(d: int) -> np.ndarray:
    """Reference points of a fine sampling of a facet, its edges included, shape (q, d-1)."""
    return lattice(d - 1, SAMPLES)
