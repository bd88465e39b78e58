"""Find the points where more than two bodies meet, and order the nodes there.

At such a point each body has a node of its own, and the nodes form a *group*. One node
of the group is its base. The unknowns of the solver are the displacement of the base
and the jumps of the other nodes against it. Two nodes are a group, too, if one contact
names them in one order and another contact in the other order.

The base is the node with most supported components, so that a support of the group is a
support of an unknown. Where a support fixes a component at another node alone, that one
stands in for the base (:mod:`erc_contact.model.coordinates` calls this *swapped*).

Symbols: n nodes of all groups, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.model.trace import dofs_of

NOBODY = -1
"""Stands for no node of a group."""


@dataclass(frozen=True, eq=False)
class Joints:
    """Hold the nodes of all groups, the same on all ranks.

    Nodes are told by their place among them.

    Attributes:
        numbers: Global numbers of the nodes, ascending, shape (n,).
        is_base: Which of them are bases, shape (n,).
        partner: The node whose unknown the displacement depends on, beside its own, for
            each component: the base, and for the base the node that stands in for it,
            shape (n, d).
        reference: The node against which the jump of each component is, shape (n, d).
        mates: Pairs of different nodes of the same group, in both orders, shape (p, 2).
        is_swapped: At the base and at the node that stands in for it: which components
            are swapped, shape (n, d).
    """

    numbers: np.ndarray
    is_base: np.ndarray
    mates: np.ndarray
    partner: np.ndarray
    reference: np.ndarray
    is_swapped: np.ndarray

    def couplings(self, low: int, high: int, d: int) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and columns of a matrix that couple the nodes of each group.

        Args:
            low: First degree of freedom of this rank.
            high: First one of the next rank.
            d: The dimension.
        """
        rows, columns = self.numbers[self.mates].T
        of_rank = (rows * d >= low) & (rows * d < high)
        return dofs_of(rows[of_rank], d), dofs_of(columns[of_rank], d)


def find_joints(comm: MPI.Comm, pairs: np.ndarray, fixed: np.ndarray, first: int) -> Joints | None:
    """Find the groups of nodes that are in several pairs; collective.

    Args:
        comm: The ranks.
        pairs: Pairs of nodes that this rank sees face each other, each once: global
            numbers of those of side 1 and of side 2, shape (p, 2).
        fixed: Which components supports prescribe at each node of this rank, shape
            (owned nodes, d).
        first: Global number of the first of these nodes.

    Returns:
        The groups; None where all pairs are of nodes of their own.
    """
    # The ranks that own a cell at a node have all pairs of the node.
    several = len(np.unique(pairs)) < pairs.size
    if not comm.allreduce(bool(several), MPI.LOR):
        return None
    all_pairs = np.unique(np.concatenate(comm.allgather(pairs)), axis=0)
    numbers, places = np.unique(all_pairs, return_inverse=True)
    places = places.reshape(-1, 2)
    group = components(len(numbers), places)

    pairs_of_group = np.bincount(group[places[:, 0]], minlength=len(numbers))
    in_joint = pairs_of_group[group] > 1
    is_first = np.zeros(len(numbers), dtype=bool)
    is_first[places[:, 0]] = True
    numbers = numbers[in_joint]
    _, group = np.unique(group[in_joint], return_inverse=True)
    fixed_of_joints = _fixed(comm, numbers, fixed, first)
    return _ordered(numbers, group, is_first[in_joint], fixed_of_joints)


def components(count: int, edges: np.ndarray) -> np.ndarray:
    """Return the connected component of each node, its least node, shape (count,).

    Args:
        count: Number of nodes.
        edges: Pairs of connected nodes, shape (p, 2).
    """
    component = np.arange(count)
    while True:
        least = component[edges].min(axis=1)
        changed = component.copy()
        np.minimum.at(changed, edges[:, 0], least)
        np.minimum.at(changed, edges[:, 1], least)
        if np.array_equal(changed, component):
            return component
        component = changed


def _fixed(comm: MPI.Comm, numbers: np.ndarray, fixed: np.ndarray, first: int) -> np.ndarray:
    """Gather which components supports prescribe at nodes (n, d); collective."""
    count, d = fixed.shape
    owned = (numbers >= first) & (numbers < first + count)
    table = np.zeros((len(numbers), d), dtype=np.int8)
    table[owned] = fixed[numbers[owned] - first]
    return np.asarray(comm.allreduce(table, MPI.SUM)) > 0


def _ordered(
    numbers: np.ndarray, group: np.ndarray, is_first: np.ndarray, fixed: np.ndarray
) -> Joints:
    """Choose the bases of groups, and what stands in for them.

    Args:
        numbers: Global numbers of the nodes, ascending, shape (n,).
        group: The group of each node, shape (n,).
        is_first: Which nodes are of side 1 of some pair, shape (n,).
        fixed: Which components supports prescribe, shape (n, d).
    """
    count, d = fixed.shape
    # The best node of each group comes first. A base that is on side 2 of its pairs
    # leaves the jumps of these pairs unknowns of their own.
    order = np.lexsort((numbers, is_first, -fixed.sum(axis=1), group))
    _, first = np.unique(group[order], return_index=True)
    base_of_group = order[first]
    base = base_of_group[group]
    is_base = base == np.arange(count)

    another = np.full(len(first), NOBODY)
    another[group[~is_base]] = np.flatnonzero(~is_base)
    partner = np.repeat(np.where(is_base, another[group], base)[:, None], d, axis=1)
    reference = partner.copy()
    is_swapped = np.zeros((count, d), dtype=bool)
    for k in range(d):
        supported = np.flatnonzero(fixed[:, k])[::-1]
        deputy = np.full(len(first), NOBODY)
        deputy[group[supported]] = supported
        deputy[fixed[base_of_group, k]] = NOBODY
        deputy_here = deputy[group]
        has_deputy = deputy_here != NOBODY
        is_deputy = deputy_here == np.arange(count)
        is_swapped[:, k] = has_deputy & (is_base | is_deputy)
        partner[:, k] = np.where(has_deputy & is_base, deputy_here, partner[:, k])
        reference[:, k] = np.where(has_deputy & ~is_deputy, deputy_here, partner[:, k])
    return Joints(numbers, is_base, _mates(group), partner, reference, is_swapped)


def _mates(group: np.ndarray) -> np.ndarray:
    """Return the pairs of different nodes of the same group, in both orders.

    Args:
        group: The group of each node, shape (n,).
    """
    order = np.argsort(group, kind="stable")
    size = np.bincount(group)
    first = np.cumsum(size) - size
    of_order = group[order]
    number = np.arange(len(group)) - first[of_order]
    pairs = []
    for shift in range(1, int(size.max())):
        other = first[of_order] + (number + shift) % size[of_order]
        is_other = shift < size[of_order]
        pairs.append(np.column_stack([order, order[other]])[is_other])
    return np.concatenate(pairs)
