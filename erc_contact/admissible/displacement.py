"""Displacements that do not enter the foundation, with the status (open, slip, stick) of the admissible traction.

This holds at every point, not only at nodes: if the Bernstein coefficients of a normal
displacement are below those of a bound, the displacement is below the bound. If the gap
varies along a facet, the bounds are lowered until they are below the gap on the whole
facet, also at its kinks, cusps and jumps (:mod:`erc_contact.mesh.peaks`). An asperity
is found if it changes the gap at one of the first samples, 72 on a facet in 2D and 352
in 3D.

Symbols: n normal of the foundation, r^ admissible contact traction, g gap, u^
displacement, s tangential displacement at the end of the last step of a history (zero
without), m number of coefficients of a facet, which belong to its nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from erc_contact.admissible.traction import ContactTraction
from erc_contact.mesh.peaks import upper_bounds
from erc_contact.mesh.quadrature import facet_pieces, polynomials
from erc_contact.model.expressions import Everywhere
from erc_contact.model.model import Model
from erc_contact.model.symbolic import varies_in_cells
from erc_contact.model.trace import split


@dataclass(frozen=True, eq=False)
class _Limits:
    """Limits of the normal displacement at the nodes of a contact: one for each node and each of its normals.

    Attributes:
        nodes: Node of each limit, shape (c,).
        normal: Normal of each limit, shape (c, d).
        bound: Limit of u_n [length], shape (c,).
        of_facet: Number of the limit of each node of each facet, shape (f, m).
        groups: Groups of limits, each by their numbers. No node is twice in one group.
    """

    nodes: np.ndarray
    normal: np.ndarray
    bound: np.ndarray
    of_facet: np.ndarray
    groups: list[np.ndarray]


def admissible_displacement(
    model: Model, u: fem.Function, tractions: list[ContactTraction]
) -> fem.Function:
    """u^: the displacement u limited by the gap, and set to the status of r^ where this lowers the error; collective.

    The contact part of e^2 is of first order in ``g - u_n`` where r^_n < 0, and in
    ``u_t - s`` where r^_t is inside the cone or does not oppose it. The bulk part is of
    second order in a change of u^. So a node is set to ``u_n = g``, or to ``u_t = s``,
    if this lowers the contact part by more than it may raise the bulk part. The contact
    part changes by ``2 sum |F|/m (...)`` over the facets of the node, the bulk part by
    about ``E h^(d-2)`` times the square of the change. (If r^ had to be strictly inside
    the cone on all facets of a node instead, nodes at the stick-slip transition would
    slip along the traction.)

    Args:
        model: The scene on a mesh.
        u: Displacement of the solution [length].
        tractions: r^ on each contact.
    """
    hat = model.function()
    hat.name = "displacement"
    hat.x.array[:] = u.x.array
    values = hat.x.array.reshape(-1, model.d)
    contacts = [t.contact for t in tractions]
    model.to_coefficients(values, contacts)
    limits = [_limits(model, t) for t in tractions]
    mobile = ~model.fixed
    for t, limit in zip(tractions, limits, strict=True):
        weight = 2 * t.area[:, None] / t.nodes.shape[1]
        stiffness = _nodal_stiffness(model, t)[limit.nodes]
        closing = _sum(limit, -weight * t.normal_component)
        friction = _sum(limit, weight * t.friction_bound)
        before = _slip_before(t, limit)
        shear = np.column_stack(
            [_sum(limit, weight * t.tangential_part[..., i]) for i in range(model.d)]
        )
        for group in limit.groups:
            nodes, n = limit.nodes[group], limit.normal[group]
            open_by = limit.bound[group] - (values[nodes] * n).sum(axis=1)
            snaps = closing[group] * open_by > stiffness[group] * open_by**2
            _move_normal(values, mobile, limit, group[snaps | t.contact.bilateral])
            _, slip, size = split(values[nodes] - before[group], n)
            gain = friction[group] * size + (shear[group] * slip).sum(axis=1)
            sticks = gain > stiffness[group] * size**2
            values[nodes[sticks]] -= (mobile[nodes] * slip)[sticks]
    several = len(tractions) > 1 or any(len(limit.groups) > 1 for limit in limits)
    for _ in range(100):  # a node with several normals needs several passes
        worst = 0.0
        for t, limit in zip(tractions, limits, strict=True):
            for group in limit.groups:
                excess = (values[limit.nodes[group]] * limit.normal[group]).sum(
                    axis=1
                ) - limit.bound[group]
                violated = abs(excess) > 0 if t.contact.bilateral else excess > 0
                worst = max(worst, float(abs(excess[violated]).max(initial=0.0)))
                _move_normal(values, mobile, limit, group[violated])
        if not several or worst <= 1e-15 * abs(values).max(initial=0.0):
            break
    model.to_coefficients(values, contacts, back=True)
    hat.x.scatter_forward()
    return hat


def _move_normal(values: np.ndarray, mobile: np.ndarray, limit: _Limits, which: np.ndarray) -> None:
    """Set ``u_n`` to the bound of some limits, in place.

    Only ``mobile`` components change, which no support fixes.
    """
    nodes, n = limit.nodes[which], limit.normal[which]
    along = mobile[nodes] * n
    reach = (along * n).sum(axis=1)
    missing = limit.bound[which] - (values[nodes] * n).sum(axis=1)
    values[nodes] += (
        np.divide(missing, reach, out=np.zeros_like(reach), where=reach > 1e-12)[:, None] * along
    )


def _slip_before(traction: ContactTraction, limit: _Limits) -> np.ndarray:
    """The tangential displacement of the last step as coefficients, for each limit [length], shape (c, d)."""
    of_facets = traction.contact.trace.coefficients(traction.contact.trace.slip_before)
    before = np.zeros(limit.normal.shape)
    before[limit.of_facet] = of_facets
    return before


def _sum(limit: _Limits, of_facets: np.ndarray) -> np.ndarray:
    """Sums of values (f, m) over the facets of each limit, shape (c,)."""
    return np.bincount(limit.of_facet.ravel(), of_facets.ravel(), len(limit.nodes))


def _nodal_stiffness(model: Model, traction: ContactTraction) -> np.ndarray:
    """The approximate stiffness of a node, ``E h^(d-2)`` on the contact [force/length], else 0, shape (nodes,)."""
    of_facet = traction.contact.trace.stiffness * traction.area  # E/h h^(d-1)
    stiffness = np.zeros(len(model.fixed))
    np.maximum.at(stiffness, traction.nodes, of_facet[:, None])
    return stiffness


def _limits(model: Model, traction: ContactTraction) -> _Limits:
    """The limits of a contact; collective.

    Their bounds are Bernstein coefficients of polynomials below the gap. In a bilateral
    contact these equal the gap at the nodes.
    """
    contact, d = traction.contact, model.d
    at_nodes = contact.trace.coefficients(model.gap_at_nodes(contact))
    if contact.gap is not None and varies_in_cells(contact.gap) and not contact.bilateral:
        at_nodes = at_nodes - _excess(model, traction, at_nodes)[:, None]
    normals = np.broadcast_to(contact.direction[:, None, :], traction.values.shape).reshape(-1, d)
    key = np.column_stack([traction.nodes.ravel(), np.round(normals, 12)])
    _, first, of_facet = np.unique(key, axis=0, return_index=True, return_inverse=True)
    bound = np.full(len(first), np.inf)
    np.minimum.at(bound, of_facet.ravel(), at_nodes.ravel())
    nodes = traction.nodes.ravel()[first]
    times = np.arange(len(nodes)) - np.searchsorted(
        nodes, nodes
    )  # number of limits of the node before this one
    groups = [np.flatnonzero(times == k) for k in range(int(times.max(initial=0)) + 1)]
    return _Limits(nodes, normals[first], bound, of_facet.reshape(traction.nodes.shape), groups)


def _excess(model: Model, traction: ContactTraction, at_nodes: np.ndarray) -> np.ndarray:
    """Bound the excess over the gap of polynomials with coefficients (f, m) on each facet [length], shape (f,)."""
    facets = traction.contact.facets
    gap = Everywhere(traction.contact.gap, model.mesh)
    size = np.zeros(len(facets))

    def above(facet: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape = polynomials(model.degree, at)
        excess = np.matmul(shape, at_nodes[facet][..., None])[..., 0] - gap(x, facets[facet])
        np.maximum.at(size, facet, abs(excess).max(axis=1))
        return excess

    # A polynomial gap is met to round-off, which is no excess.
    round_off = 1e-14 * abs(at_nodes).max(axis=1, initial=0.0)
    highest = upper_bounds(
        above, traction.contact.trace.here.corners, facet_pieces(model.d - 1), round_off
    )
    return np.where(size > round_off, highest, 0.0)
