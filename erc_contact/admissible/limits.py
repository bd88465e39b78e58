"""Limits of the normal displacement at the nodes of a contact.

If the gap varies along a facet, the limits are lowered until they are below the gap on
the whole facet, also at its kinks, cusps and jumps (:mod:`erc_contact.mesh.peaks`). An
asperity is found if it changes the gap at one of the first samples, 72 on a facet in 2D
and 352 in 3D.

Symbols: n normal of the contact, w its displacement (between two bodies the jump), g
gap, r^ admissible contact traction, m number of coefficients of a facet, which belong
to its nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.admissible.traction import ContactTraction
from erc_contact.mesh.peaks import upper_bounds
from erc_contact.mesh.quadrature import facet_pieces, polynomials
from erc_contact.model.contact_values import gap_at_nodes
from erc_contact.model.expressions import Everywhere
from erc_contact.model.foundation import BoundContact
from erc_contact.model.kinks import kinks_on_facets
from erc_contact.model.model import Model
from erc_contact.model.symbolic import varies_in_cells
from erc_contact.model.trace import Trace

POLYNOMIAL = 1e-14
"""Excess of a polynomial over the gap that is round-off, over its values [-]."""


@dataclass(frozen=True, eq=False)
class Limits:
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


def limits_of(model: Model, traction: ContactTraction) -> Limits:
    """Find the limits of a contact; collective.

    Their bounds are Bernstein coefficients of polynomials below the gap. In a bilateral
    contact these equal the gap at the nodes.
    """
    contact = traction.contact
    if contact not in model.gap_limits:
        model.gap_limits[contact] = _gap_limits(model, contact)
    gaps = model.gap_limits[contact]

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
    return Limits(nodes, partners, share, normals[first], bound, of_facet, groups)


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


def _gap_limits(model: Model, contact: BoundContact) -> np.ndarray:
    """Return coefficients of polynomials below the gap [length]; collective.

    Their shape is (f, m).
    """
    gaps = contact.trace.coefficients(gap_at_nodes(model, contact))
    if contact.gap is not None and varies_in_cells(contact.gap) and not contact.bilateral:
        gaps = gaps - _excess(model, contact, gaps)[:, None]
    return gaps


def _excess(model: Model, contact: BoundContact, gaps: np.ndarray) -> np.ndarray:
    """Bound the excess of polynomials over the gap on each facet [length]; collective.

    Args:
        model: The scene on a mesh.
        contact: The contact.
        gaps: Coefficients of the polynomials [length], shape (f, m).

    Returns:
        The bounds, shape (f,).
    """
    facets = contact.facets
    gap = Everywhere(contact.gap, model.mesh)
    size = np.zeros(len(facets))

    def above(facet: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape = polynomials(model.degree, places)
        polynomial = np.matmul(shape, gaps[facet][..., None])[..., 0]
        excess = polynomial - gap(x, facets[facet])
        np.maximum.at(size, facet, abs(excess).max(axis=1))
        return excess

    # A polynomial gap is met to round-off, which is no excess.
    round_off = POLYNOMIAL * abs(gaps).max(axis=1, initial=0.0)
    corners = contact.trace.here.corners
    kinks = kinks_on_facets(model, [contact.gap], facets)
    highest = upper_bounds(above, corners, facet_pieces(model.d - 1), round_off, kinks)
    return np.where(size > round_off, highest, 0.0)
