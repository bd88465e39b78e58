"""Limits of the normal displacement at the nodes of a contact.

They are Bernstein coefficients of polynomials that are not above the gap anywhere on
their facets (:mod:`erc_contact.admissible.below`).

Symbols: n normal of the contact, w its displacement (between two bodies the jump), g
gap, r^ admissible contact traction, m number of coefficients of a facet, which belong
to its nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.admissible.traction import ContactTraction
from erc_contact.model.contact.trace import NOBODY, Trace
from erc_contact.model.model import Model


@dataclass(frozen=True, eq=False)
class Limits:
    """Hold the limits of the normal displacement at the nodes of a contact.

    There is one for each node and each of its normals.

    Attributes:
        nodes: Node of each limit, shape (c,).
        partners: The facing node of the other body, ``NOBODY`` on a foundation, shape
            (c,).
        share: Share of a change of the jump that the node takes, its partner takes the
            rest [-], shape (c,). Without a partner it takes all.
        normal: Normal of each limit, shape (c, d).
        bound: Limit of u_n [length], shape (c,).
        facet: Number in the contact of a facet of each limit, shape (c,).
        of_facet: Number of the limit of each node of each facet, shape (f, m).
        groups: Groups of limits, each by their numbers. No node is twice in one group.
    """

    nodes: np.ndarray
    partners: np.ndarray
    share: np.ndarray
    normal: np.ndarray
    bound: np.ndarray
    facet: np.ndarray
    of_facet: np.ndarray
    groups: list[np.ndarray]

    def jump(self, values: np.ndarray, group: np.ndarray) -> np.ndarray:
        """Return the displacement w at the limits of a group [length], shape (c, d).

        Args:
            values: Coefficients of u [length], shape (nodes, d).
            group: Numbers of limits.
        """
        jump = values[self.nodes[group]]
        is_pair, partners = self._pairs(group)
        jump[is_pair] -= values[partners]
        return jump

    def normal_displacement(self, values: np.ndarray, group: np.ndarray) -> np.ndarray:
        """Return w_n at the limits of a group [length], see :meth:`jump`."""
        return (self.jump(values, group) * self.normal[group]).sum(axis=1)

    def mobile(self, free: np.ndarray, group: np.ndarray) -> np.ndarray:
        """Tell which components of w supports do not fix, shape (c, d).

        Args:
            free: Components of u that supports do not fix, shape (nodes, d).
            group: Numbers of limits.
        """
        mobile = free[self.nodes[group]]
        is_pair, partners = self._pairs(group)
        mobile[is_pair] |= free[partners]
        return mobile

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
        is_pair, partners = self._pairs(group)
        # A foundation is fixed.
        free_there = np.zeros(change.shape, dtype=bool)
        free_there[is_pair] = free[partners]
        share = np.where(free_there, self.share[group, None], 1.0)
        share = np.where(free[nodes], share, 0.0)
        values[nodes] += share * change
        of_there = (1 - share) * change
        values[partners] -= of_there[is_pair]

    def _pairs(self, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tell which limits of a group have a partner, shape (c,), and the partners."""
        partners = self.partners[group]
        is_pair = partners != NOBODY
        return is_pair, partners[is_pair]

    def sum_up(self, of_facets: np.ndarray) -> np.ndarray:
        """Sum values (f, m) over the facets of each limit, shape (c,)."""
        return np.bincount(self.of_facet.ravel(), of_facets.ravel(), len(self.nodes))


def limits_of(model: Model, traction: ContactTraction, gaps: np.ndarray) -> Limits:
    """Find the limits of a contact; collective.

    Args:
        model: The scene on a mesh.
        traction: r^ on the contact.
        gaps: Coefficients of the gap, or of polynomials below it [length], shape (f,
            m).
    """
    contact = traction.contact

    # One limit for each pair of a node and a normal, and the least gap of its facets.
    normals = np.broadcast_to(contact.trace.normals, traction.values.shape)
    normals = normals.reshape(-1, model.space.d)
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
    facet = first // traction.nodes.shape[1]
    partners = contact.trace.nodes_there.ravel()[first]
    share = _share_of_node(contact.trace, len(model.fixed))[nodes]
    return Limits(nodes, partners, share, normals[first], bound, facet, of_facet, groups)


def _share_of_node(trace: Trace, node_count: int) -> np.ndarray:
    """Return the share of a change of the jump that each node of this side takes [-].

    The softer body takes more: the shares are in proportion to the compliances. Shape
    (nodes,).
    """
    stiffness = np.zeros((2, node_count))
    for of_side, side in zip(stiffness, (trace.here, trace.there), strict=True):
        nodes = trace.here.nodes[: len(side.facets)]
        np.maximum.at(of_side, nodes, side.stiffness[:, None])
    total = stiffness.sum(axis=0)
    return np.divide(stiffness[1], total, out=np.ones(node_count), where=total > 0)
