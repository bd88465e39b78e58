"""Contact tractions in the friction cone, and displacements that do not enter the foundation.

Both hold point-wise, not only at nodes: a linear traction whose nodal values lie in a convex cone lies in it
everywhere, a linear normal displacement below a linear bound stays below it. Where the friction coefficient or
the gap vary along a facet, the nodal bounds are tightened by what a fine sampling of the facet shows.

Symbols: n normal of the foundation, r^ contact traction on the body, mu friction coefficient, g gap, u^ displacement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import basix
import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.geometry import moments
from erc_contact.exceptions import NotHeldError
from erc_contact.methods import CONTACT_DEGREE
from erc_contact.model import BoundContact, Model, barycentric, evaluate, facet_cell, facet_corners, facet_rule

SAMPLES = 12
"""Subdivisions of a facet's edge when a bound that varies along it is sampled."""
PASSES = 10
"""Limit of passes that shrink the friction bound where friction varies along a facet; one or two are usual."""
MARGIN = 0.2
"""Share of the sampled deviation that is added for what may lie between two samples [-]."""


@dataclass(frozen=True, eq=False)
class ContactTraction:
    """The admissible traction r^ on one contact, linear on each facet.

    Attributes:
        contact: Where.
        nodes: Nodes of each facet (cell, local facet) of ``contact.facets``, ghosts included, shape (n, d).
        area: Facet areas [length^(d-1)], shape (n,).
        values: r^ at these nodes [force/area], shape (n, d, d).
        friction: mu at these nodes, shape (n, d).
    """

    contact: BoundContact
    nodes: np.ndarray
    area: np.ndarray
    values: np.ndarray
    friction: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        """Normal component r^_n at the nodes [force/area], shape (n, d)."""
        return self.values @ self.contact.direction

    @property
    def tangential(self) -> np.ndarray:
        """Tangential part r^_t at the nodes [force/area], shape (n, d, d)."""
        return self.values - self.normal[..., None] * self.contact.direction


def project_on_cone(z: np.ndarray, n: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """The law's projection, first the normal part, then the tangential part, of nodal values.

    Args:
        z: Tractions [force/area], shape (..., d).
        n: Unit normal of the foundation, shape (d,).
        mu: Friction coefficients, shape (...).
    """
    pressure = np.maximum(-(z @ n), 0.0)
    t = z - (z @ n)[..., None] * n
    size, bound = np.linalg.norm(t, axis=-1), mu * pressure
    factor = np.divide(bound, size, out=np.ones_like(size), where=size > bound)
    return factor[..., None] * t - pressure[..., None] * n


def nearest_in_cone(z: np.ndarray, n: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """The point of the Coulomb cone that is nearest to z (Euclidean projection, non-expansive).

    Args:
        z: Tractions [force/area], shape (..., d).
        n: Unit normal of the foundation, shape (d,).
        mu: Friction coefficients, shape (...).
    """
    pressure = -(z @ n)
    t = z + pressure[..., None] * n
    size = np.linalg.norm(t, axis=-1)
    on_cone = np.maximum(pressure + mu * size, 0.0) / (1 + mu**2)
    inside = size <= mu * pressure
    new_pressure = np.where(inside, pressure, on_cone)
    with np.errstate(invalid="ignore", divide="ignore"):
        factor = np.where(inside, 1.0, np.where(size > 0, mu * on_cone / size, 0.0))
    return factor[..., None] * t - new_pressure[..., None] * n


def admissible_tractions(model: Model, method: Any, u: fem.Function, loads: np.ndarray) -> list[ContactTraction]:
    """r^: the method's traction, L2-projected on linear functions of each facet, then on the cone.

    Where no support holds a rigid motion, r^ must balance the work of the loads on it, shape (motions,), exactly: the
    least change within the cone does it. ``loads`` is that of the loads' projections, which sigma^ is to balance.

    Raises:
        NotHeldError: If no traction in the cone balances the loads on a free motion.
    """
    d = model.d
    points, weights, shape = facet_rule(d, CONTACT_DEGREE)
    mass = shape.T @ (weights[:, None] * shape)
    project = np.linalg.solve(mass, shape.T * weights)
    result = []
    for contact in model.contacts:
        sampled = evaluate(method.traction(model, contact, u), model.domain, points, contact.facets)
        values = np.einsum("mq,fqi->fmi", project, sampled)
        nodes = model.facet_nodes(contact.facets)
        mu = _friction(model, contact, facet_corners(d))
        result.append(ContactTraction(contact, nodes, model.facet_areas(contact.facets), values, mu))
    return _into_cone(model, result, loads)


def _into_cone(model: Model, raw: list[ContactTraction], loads: np.ndarray) -> list[ContactTraction]:
    """Project on the cones, in balance with the loads on free motions."""
    bounds = [t.friction for t in raw]
    for _ in range(PASSES):
        new = _projected(model, raw, bounds, loads)
        factors = [_shrink(model, t) for t in new]
        if not model.comm.allreduce(any(np.any(f < 1.0) for f in factors), MPI.LOR):
            return new
        bounds = [b * f[:, None] for b, f in zip(bounds, factors, strict=True)]
    # the least friction of each facet is a bound whatever the traction, only not a sharp one
    lattice = _lattice(model.d)
    least = [_friction(model, t.contact, lattice).min(axis=1, keepdims=True) for t in raw]
    return _projected(model, raw, [np.minimum(low, t.friction) for low, t in zip(least, raw, strict=True)], loads)


def _projected(
    model: Model, raw: list[ContactTraction], bounds: list[np.ndarray], loads: np.ndarray
) -> list[ContactTraction]:
    values = [project_on_cone(t.values, t.contact.direction, mu) for t, mu in zip(raw, bounds, strict=True)]
    if model.free_motions:
        values = _balanced(model, raw, values, bounds, loads)
    return [replace(t, values=v) for t, v in zip(raw, values, strict=True)]


def _shrink(model: Model, traction: ContactTraction) -> np.ndarray:
    """Factor of each facet by which the friction bound must shrink for r^ to lie in the cone between the nodes."""
    if not traction.contact.friction_varies:
        return np.ones(len(traction.nodes))
    lattice = _lattice(model.d)
    shape = barycentric(lattice)
    allowed = _friction(model, traction.contact, lattice) * (-traction.normal @ shape.T)
    used = np.linalg.norm(np.einsum("qm,fmi->fqi", shape, traction.tangential), axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(used > allowed * (1 + 1e-14), allowed / used, 1.0).min(axis=1)
    return np.where(ratio < 1.0, np.maximum(ratio - MARGIN * (1 - ratio), 0.0), 1.0)


def _balanced(
    model: Model, raw: list[ContactTraction], start: list[np.ndarray], bounds: list[np.ndarray], loads: np.ndarray
) -> list[np.ndarray]:
    """The tractions in the cones nearest to those given that balance the loads on the free motions.

    The multiplier y of the balance has one component for each free motion m_k: ``r = P(r_0 + sum_k y_k q_k)``
    with q_k the facet-wise average of m_k, and y solves ``int r(y).m_k = -load(m_k)``, a monotone equation
    in at most six unknowns: Newton with differences.
    """
    comm, motions = model.comm, model.free_motions
    weight, direction, own_area = [], [], 0.0
    for t in raw:
        m = np.stack([f.x.array.reshape(-1, model.d)[t.nodes] for f in motions], axis=-1)  # (f, d, d, k)
        moment = moments(t.area, m.reshape(*m.shape[:2], m.shape[2] * m.shape[3])).reshape(m.shape)
        owned = t.contact.facets[:, 0] < model.domain.owned_cells
        own_area += float(t.area[owned].sum())
        weight.append(moment * owned[:, None, None, None])
        direction.append(moment * (model.d / t.area)[:, None, None, None])

    def tractions(y: np.ndarray) -> list[np.ndarray]:
        return [
            nearest_in_cone(r + q @ y, t.contact.direction, mu)
            for t, r, q, mu in zip(raw, start, direction, bounds, strict=True)
        ]

    def imbalance(y: np.ndarray) -> np.ndarray:
        local = sum(np.einsum("fmik,fmi->k", w, r) for w, r in zip(weight, tractions(y), strict=True))
        return comm.allreduce(local, MPI.SUM) + loads

    peak = comm.allreduce(max((float(abs(r).max(initial=0)) for r in start), default=0.0), MPI.MAX)
    area = comm.allreduce(own_area, MPI.SUM)
    scale = float(np.linalg.norm(loads)) + peak * area
    if scale == 0.0:
        return tractions(np.zeros(len(motions)))
    unit = max(peak, float(np.linalg.norm(loads)) / area)
    y = np.zeros(len(motions))
    value = imbalance(y)
    for _ in range(100):
        if np.linalg.norm(value) <= 1e-15 * scale:
            break
        step = 1e-6 * unit
        tangent = np.column_stack([imbalance(y + step * e) - imbalance(y - step * e) for e in np.eye(len(y))])
        tangent = 0.5 * (tangent + tangent.T) / (2 * step)
        tangent += 1e-12 * (np.trace(tangent) + area * 1e-6) * np.eye(len(y))
        direction_y = -np.linalg.solve(tangent, value)
        length = 1.0
        trial = imbalance(y + direction_y)
        while np.linalg.norm(trial) > (1 - 1e-4 * length) * np.linalg.norm(value) and length > 1e-4:
            length /= 2
            trial = imbalance(y + length * direction_y)
        if np.linalg.norm(trial) >= np.linalg.norm(value):
            break
        y, value = y + length * direction_y, trial
    if np.linalg.norm(value) > 1e-12 * scale:
        raise NotHeldError(
            "No contact traction in the friction cone balances the loads on a rigid motion that no support holds "
            f"(imbalance {np.linalg.norm(value) / scale:.1e} of the forces). Look at the direction of the loads, or "
            "add a Displacement or friction."
        )
    return tractions(y)


def admissible_displacement(model: Model, u: fem.Function, tractions: list[ContactTraction]) -> fem.Function:
    """u^: u clipped at the gap, and snapped to the status that r^ shows where that lowers the error.

    The contact part of e^2 is of first order in ``g - u_n`` where r^_n < 0, and in u_t where r^_t is inside the cone
    or does not oppose it; the bulk part is only of second order in a change of u^. So a node is set to ``u_n = g``,
    or to ``u_t = 0``, where what the contact part gains, ``2 sum |F|/d (...)`` over the facets of the node, exceeds
    what the bulk part may lose, about ``E h^(d-2)`` times the square of the change. (Asking for r^ strictly inside the
    cone on all facets of a node instead leaves nodes at the stick-slip transition that slip along the traction.)
    """
    hat = fem.Function(model.V, name="displacement")
    hat.x.array[:] = u.x.array
    values = hat.x.array.reshape(-1, model.d)
    bounds = [_gap_bound(model, t) for t in tractions]
    mobile = ~model.fixed
    for t, bound in zip(tractions, bounds, strict=True):
        n, weight = t.contact.direction, 2 * t.area[:, None] / model.d
        stiffness = _nodal_stiffness(model, t)

        def total(density: np.ndarray, nodes: np.ndarray = t.nodes, weight: np.ndarray = weight) -> np.ndarray:
            return np.bincount(nodes.ravel(), (weight * density).ravel(), len(values))

        open_by = np.where(np.isfinite(bound), bound - values @ n, 0.0)
        gain = total(-t.normal * open_by[t.nodes])
        _move_normal(values, gain > stiffness * open_by**2, bound, n, mobile)

        slip = values - (values @ n)[:, None] * n
        size = np.linalg.norm(slip, axis=1)
        gain = total(t.friction * -t.normal * size[t.nodes] + np.einsum("fmi,fmi->fm", t.tangential, slip[t.nodes]))
        sticks = gain > stiffness * size**2
        values[sticks] -= (mobile * slip)[sticks]
    for _ in range(100):  # a node of two contacts needs several passes
        worst = 0.0
        for t, bound in zip(tractions, bounds, strict=True):
            n = t.contact.direction
            excess = np.where(np.isfinite(bound), values @ n - bound, -np.inf)
            worst = max(worst, float(excess.max(initial=-np.inf)))
            _move_normal(values, excess > 0, bound, n, mobile)
        if len(tractions) == 1 or worst <= 1e-15 * abs(values).max(initial=0.0):
            break
    hat.x.scatter_forward()
    return hat


def _move_normal(values: np.ndarray, where: np.ndarray, bound: np.ndarray, n: np.ndarray, mobile: np.ndarray) -> None:
    """Set ``u_n`` to the bound at some nodes, moving the components that no support fixes."""
    along = mobile * n
    reach = along @ n
    where = where & (reach > 1e-12)
    values[where] += ((bound - values @ n)[where] / reach[where])[:, None] * along[where]


def _nodal_stiffness(model: Model, traction: ContactTraction) -> np.ndarray:
    """About the elastic stiffness of a node of the contact, ``E h^(d-2)`` [force/length]; zero elsewhere."""
    middle = np.full((1, model.d), 1 / (model.d + 1))
    modulus = model.scene.material.modulus(**model.parameters)
    of_facet = evaluate(modulus, model.domain, middle, traction.contact.facets[:, 0])[:, 0]
    of_facet = of_facet * traction.area ** ((model.d - 2) / (model.d - 1))
    stiffness = np.zeros(len(model.fixed))
    np.maximum.at(stiffness, traction.nodes, of_facet[:, None])
    return stiffness


def _gap_bound(model: Model, traction: ContactTraction) -> np.ndarray:
    """Nodal values of a linear function below the gap, inf away from the contact, shape (nodes,)."""
    contact, d = traction.contact, model.d
    bound = np.full(len(model.fixed), np.inf)
    at_nodes = model.gap_at_nodes(contact)
    if contact.gap_varies:
        lattice = _lattice(d)
        shape = barycentric(lattice)
        deviation = at_nodes @ shape.T - evaluate(contact.gap, model.domain, lattice, contact.facets)
        excess = np.maximum(deviation.max(axis=1) + MARGIN * abs(deviation).max(axis=1), 0.0)
        at_nodes = (
            at_nodes - np.where(abs(deviation).max(axis=1) > 1e-14 * abs(at_nodes).max(axis=1), excess, 0.0)[:, None]
        )
    np.minimum.at(bound, traction.nodes, at_nodes)
    return bound


def _friction(model: Model, contact: BoundContact, points: np.ndarray) -> np.ndarray:
    if contact.friction is None:
        return np.zeros((len(contact.facets), len(points)))
    return evaluate(contact.friction, model.domain, points, contact.facets)


def _lattice(d: int) -> np.ndarray:
    return basix.create_lattice(facet_cell(d), SAMPLES, basix.LatticeType.equispaced, True)
