"""Displacements that do not enter the foundation, with the status of the traction.

The status is open, slip or stick. The displacement is outside the foundation at every
point, not only at nodes: if the Bernstein coefficients of a normal displacement are
below those of a bound, the displacement is below the bound. If the gap varies along a
facet, the bounds are lowered until they are below the gap on the whole facet, also at
its kinks, cusps and jumps (:mod:`erc_contact.mesh.peaks`). An asperity is found if it
changes the gap at one of the first samples, 72 on a facet in 2D and 352 in 3D.

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
from erc_contact.model.space import OnFacets
from erc_contact.model.symbolic import varies_in_cells
from erc_contact.model.trace import Trace, split

CORNER_PASSES = 100
"""Limit of the passes over nodes with several normals."""
SETTLED_EXCESS = 1e-15
"""Excess over a limit that ends the passes, over the largest displacement [-]."""
POLYNOMIAL = 1e-14
"""Excess of a polynomial over the gap that is round-off, over its values [-]."""


@dataclass(frozen=True, eq=False)
class _Limits:
    """Hold the limits of the normal displacement at the nodes of a contact.

    There is one for each node and each of its normals.

    Attributes:
        nodes: Node of each limit, shape (c,).
        partners: The facing node of the other body, shape (c,); None on a foundation.
        share: Share of a change of the jump that the node takes, its partner takes the
            rest [-], shape (c,).
        normal: Normal of each limit, shape (c, d).
        bound: Limit of u_n [length], shape (c,).
        of_facet: Number of the limit of each node of each facet, shape (f, m).
        groups: Groups of limits, each by their numbers. No node is twice in one group.
    """

    nodes: np.ndarray
    partners: np.ndarray | None
    share: np.ndarray
    normal: np.ndarray
    bound: np.ndarray
    of_facet: np.ndarray
    groups: list[np.ndarray]

    def jump(self, values: np.ndarray, group: np.ndarray) -> np.ndarray:
        """Return the displacement w at the limits of a group [length], shape (c, d).

        Args:
            values: Coefficients of u [length], shape (nodes, d).
            group: Numbers of limits.
        """
        if self.partners is None:
            return values[self.nodes[group]]
        return values[self.nodes[group]] - values[self.partners[group]]

    def normal_displacement(self, values: np.ndarray, group: np.ndarray) -> np.ndarray:
        """Return w_n at the limits of a group [length], see :meth:`jump`."""
        return (self.jump(values, group) * self.normal[group]).sum(axis=1)

    def mobile(self, free: np.ndarray, group: np.ndarray) -> np.ndarray:
        """Tell which components of w supports do not fix, shape (c, d).

        Args:
            free: Those of u, shape (nodes, d).
            group: Numbers of limits.
        """
        if self.partners is None:
            return free[self.nodes[group]]
        return free[self.nodes[group]] | free[self.partners[group]]

    def move(
        self, values: np.ndarray, free: np.ndarray, group: np.ndarray, change: np.ndarray
    ) -> None:
        """Change w at the limits of a group, in place.

        Between two bodies each takes its share, or all where the other is fixed.

        Args:
            values: Coefficients of u [length], shape (nodes, d).
            free: Components of u that no support fixes, shape (nodes, d).
            group: Numbers of limits.
            change: Change of w, zero where it is not mobile [length], shape (c, d).
        """
        nodes = self.nodes[group]
        if self.partners is None:
            values[nodes] += change
            return
        partners = self.partners[group]
        share = np.broadcast_to(self.share[group, None], change.shape)
        share = np.where(free[partners], share, 1.0)
        share = np.where(free[nodes], share, 0.0)
        values[nodes] += share * change
        values[partners] -= (1 - share) * change

    def summed(self, of_facets: np.ndarray) -> np.ndarray:
        """Sum values (f, m) over the facets of each limit, shape (c,)."""
        return np.bincount(self.of_facet.ravel(), of_facets.ravel(), len(self.nodes))


def admissible_displacement(
    model: Model, u: fem.Function, tractions: list[ContactTraction]
) -> fem.Function:
    """Limit the displacement u by the gap, and set it to the status of r^; collective.

    The status is set where this lowers the error. The contact part of e^2 is of first
    order in ``g - u_n`` where r^_n < 0, and in ``u_t - s`` where r^_t is inside the
    cone or does not oppose it. The bulk part is of second order in a change of u^. So a
    node is set to ``u_n = g``, or to ``u_t = s``, if this lowers the contact part by
    more than it may raise the bulk part. The contact part changes by ``2 sum |F|/m
    (...)`` over the facets of the node, the bulk part by about ``E h^(d-2)`` times the
    square of the change. (If r^ had to be strictly inside the cone on all facets of a
    node instead, nodes at the stick-slip transition would slip along the traction.)

    Args:
        model: The scene on a mesh.
        u: Displacement of the solution [length].
        tractions: r^ on each contact.

    Returns:
        u^ [length].
    """
    hat = model.function()
    hat.name = "displacement"
    hat.x.array[:] = u.x.array
    values = hat.x.array.reshape(-1, model.d)
    contacts = [traction.contact for traction in tractions]
    # Limits of Bernstein coefficients hold between the nodes, too.
    sides: list[OnFacets] = list(contacts)
    sides += [contact.trace.there for contact in contacts if contact.trace.there is not None]
    model.to_coefficients(values, sides)
    limits = [_limits(model, traction) for traction in tractions]
    free = ~model.fixed
    for traction, limit in zip(tractions, limits, strict=True):
        _set_status(model, values, free, traction, limit)
    _limit_normal(values, free, tractions, limits)
    model.to_coefficients(values, sides, back=True)
    hat.x.scatter_forward()
    return hat


def _set_status(
    model: Model,
    values: np.ndarray,
    free: np.ndarray,
    traction: ContactTraction,
    limit: _Limits,
) -> None:
    """Close and stick the nodes of a contact where this lowers the error, in place.

    Args:
        model: The scene on a mesh.
        values: Coefficients of u^ [length], shape (nodes, d).
        free: Components that no support fixes, shape (nodes, d).
        traction: r^ on the contact.
        limit: Its limits.
    """
    # The contact part of e^2 is a sum of these forces times displacements.
    weight = 2 * traction.area[:, None] / traction.nodes.shape[1]
    closing = limit.summed(-weight * traction.normal_component)
    friction = limit.summed(weight * traction.friction_bound)
    tangential = weight[..., None] * traction.tangential_part
    by_component = [limit.summed(tangential[..., i]) for i in range(model.d)]
    shear = np.column_stack(by_component)
    stiffness = _nodal_stiffness(model, traction)[limit.nodes]
    before = _slip_before(traction, limit)
    for group in limit.groups:
        n = limit.normal[group]
        open_by = limit.bound[group] - limit.normal_displacement(values, group)
        closes = closing[group] * open_by > stiffness[group] * open_by**2
        _move_normal(values, free, limit, group[closes | traction.contact.bilateral])
        _, slip, size = split(limit.jump(values, group) - before[group], n)
        gain = friction[group] * size + (shear[group] * slip).sum(axis=1)
        sticks = gain > stiffness[group] * size**2
        back = np.where(limit.mobile(free, group), -slip, 0.0)
        limit.move(values, free, group[sticks], back[sticks])


def _limit_normal(
    values: np.ndarray,
    free: np.ndarray,
    tractions: list[ContactTraction],
    limits: list[_Limits],
) -> None:
    """Lower normal displacements to their limits, in place.

    A node with several normals needs several passes, because a move along one of them
    changes the displacement along the others.
    """
    has_corners = len(tractions) > 1 or any(len(limit.groups) > 1 for limit in limits)
    for _ in range(CORNER_PASSES):
        worst = 0.0
        for traction, limit in zip(tractions, limits, strict=True):
            for group in limit.groups:
                excess = limit.normal_displacement(values, group) - limit.bound[group]
                violated = abs(excess) > 0 if traction.contact.bilateral else excess > 0
                worst = max(worst, float(abs(excess[violated]).max(initial=0.0)))
                _move_normal(values, free, limit, group[violated])
        if not has_corners or worst <= SETTLED_EXCESS * abs(values).max(initial=0.0):
            break


def _move_normal(values: np.ndarray, free: np.ndarray, limit: _Limits, group: np.ndarray) -> None:
    """Set ``w_n`` to the bound at the limits of a group, in place.

    Only components change that no support fixes.
    """
    n = limit.normal[group]
    direction = limit.mobile(free, group) * n
    reach = (direction * n).sum(axis=1)
    missing = limit.bound[group] - limit.normal_displacement(values, group)
    # Where supports fix all of the normal component, nothing can move.
    length = np.divide(missing, reach, out=np.zeros_like(reach), where=reach > 1e-12)
    limit.move(values, free, group, length[:, None] * direction)


def _slip_before(traction: ContactTraction, limit: _Limits) -> np.ndarray:
    """Return the tangential displacement of the last step at each limit [length].

    It is given by coefficients, shape (c, d).
    """
    of_facets = traction.contact.trace.coefficients(traction.contact.trace.slip_before)
    before = np.zeros(limit.normal.shape)
    before[limit.of_facet] = of_facets
    return before


def _nodal_stiffness(model: Model, traction: ContactTraction) -> np.ndarray:
    """Estimate the stiffness of a node, ``E h^(d-2)`` on the contact [force/length].

    It is 0 elsewhere; shape (nodes,).
    """
    of_facet = traction.contact.trace.stiffness * traction.area  # E/h h^(d-1)
    stiffness = np.zeros(len(model.fixed))
    np.maximum.at(stiffness, traction.nodes, of_facet[:, None])
    return stiffness


def _limits(model: Model, traction: ContactTraction) -> _Limits:
    """Find the limits of a contact; collective.

    Their bounds are Bernstein coefficients of polynomials below the gap. In a bilateral
    contact these equal the gap at the nodes.
    """
    contact = traction.contact
    gaps = contact.trace.coefficients(model.gap_at_nodes(contact))
    if contact.gap is not None and varies_in_cells(contact.gap) and not contact.bilateral:
        gaps = gaps - _excess(model, traction, gaps)[:, None]

    # One limit for each pair of a node and a normal, and the least gap of its facets.
    normals = np.broadcast_to(contact.direction[:, None, :], traction.values.shape)
    normals = normals.reshape(-1, model.d)
    key = np.column_stack([traction.nodes.ravel(), np.round(normals, 12)])
    _, first, of_facet = np.unique(key, axis=0, return_index=True, return_inverse=True)
    bound = np.full(len(first), np.inf)
    np.minimum.at(bound, of_facet.ravel(), gaps.ravel())

    # The limits are sorted by node: group k has the limit number k of every node.
    nodes = traction.nodes.ravel()[first]
    number = np.arange(len(nodes)) - np.searchsorted(nodes, nodes)
    most = int(number.max(initial=0))
    groups = [np.flatnonzero(number == k) for k in range(most + 1)]
    of_facet = of_facet.reshape(traction.nodes.shape)
    partners = None
    share = np.ones(len(first))
    if contact.trace.there is not None:
        partners = contact.trace.partners.ravel()[first]
        share = _share_of_node(contact.trace, len(model.fixed))[nodes]
    return _Limits(nodes, partners, share, normals[first], bound, of_facet, groups)


def _share_of_node(trace: Trace, node_count: int) -> np.ndarray:
    """Return the share of a change of the jump that each node of this side takes [-].

    The softer body takes more: the shares are in proportion to the compliances. Shape
    (nodes,).
    """
    assert trace.there is not None
    stiffness = np.zeros((2, node_count))
    for of_side, side in zip(stiffness, (trace.here, trace.there), strict=True):
        np.maximum.at(of_side, trace.here.nodes, side.stiffness[:, None])
    total = stiffness.sum(axis=0)
    return np.divide(stiffness[1], total, out=np.ones(node_count), where=total > 0)


def _excess(model: Model, traction: ContactTraction, gaps: np.ndarray) -> np.ndarray:
    """Bound the excess of polynomials over the gap on each facet [length]; collective.

    Args:
        model: The scene on a mesh.
        traction: r^ on the contact.
        gaps: Coefficients of the polynomials [length], shape (f, m).

    Returns:
        The bounds, shape (f,).
    """
    facets = traction.contact.facets
    gap = Everywhere(traction.contact.gap, model.mesh)
    size = np.zeros(len(facets))

    def above(facet: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape = polynomials(model.degree, places)
        polynomial = np.matmul(shape, gaps[facet][..., None])[..., 0]
        excess = polynomial - gap(x, facets[facet])
        np.maximum.at(size, facet, abs(excess).max(axis=1))
        return excess

    # A polynomial gap is met to round-off, which is no excess.
    round_off = POLYNOMIAL * abs(gaps).max(axis=1, initial=0.0)
    corners = traction.contact.trace.here.corners
    highest = upper_bounds(above, corners, facet_pieces(model.d - 1), round_off)
    return np.where(size > round_off, highest, 0.0)
