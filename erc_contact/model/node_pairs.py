"""Find the pairs of nodes that face each other at contacts between bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import la

from erc_contact.model.joints import Joints, find_joints
from erc_contact.model.space import Space
from erc_contact.model.trace import Trace

NO_PARTNER = -1
"""Stands for the partner of a node that is in no pair."""


@dataclass(frozen=True, eq=False)
class NodePairs:
    """Hold the pairs of the nodes of this rank, ghosts included.

    Attributes:
        partner: Global number of the partner of each node for each component, or
            :data:`NO_PARTNER`, shape (nodes, d). Where more than two nodes meet, see
            :class:`.joints.Joints`.
        reference: That of the node against which the jump of each component is, shape
            (nodes, d).
        has_jump: Which nodes have a jump as unknown, those of side 1 of a pair, shape
            (nodes,).
        is_swapped: Which components a support fixes on side 1 alone, at both nodes of
            the pair, shape (nodes, d).
        is_joint: Which nodes are of a group that is no single pair, shape (nodes,).
        joints: These groups, None where there are none on any rank.
    """

    partner: np.ndarray
    reference: np.ndarray
    has_jump: np.ndarray
    is_swapped: np.ndarray
    is_joint: np.ndarray
    joints: Joints | None


def no_pairs(space: Space) -> NodePairs:
    """Return the pairs of a mesh without contacts between bodies."""
    count = space.node_count
    partner = np.full((count, space.d), NO_PARTNER)
    is_swapped = np.zeros((count, space.d), dtype=bool)
    nowhere = np.zeros(count, dtype=bool)
    return NodePairs(partner, partner, nowhere, is_swapped, nowhere, None)


def node_pairs(space: Space, traces: Sequence[Trace], fixed: np.ndarray) -> NodePairs:
    """Find the pairs of nodes of contacts between bodies; collective.

    A rank may have a node without the facets of its pair, so those that know it tell
    the others.

    Args:
        space: The mesh.
        traces: The displacements of the contacts.
        fixed: Which components supports prescribe at each node, shape (nodes, d).
    """
    pairs = _on_this_rank(traces)
    here, there = pairs.T
    # Number of ranks that know it, partner, whether it is of side 1, and swapped.
    shared = la.vector(space.V.dofmap.index_map, 3 + space.d)
    table = shared.array.reshape(space.node_count, 3 + space.d)
    table[here, 1] = space.global_numbers(there)
    table[there, 1] = space.global_numbers(here)
    table[here, 2] = 1.0
    for nodes in (here, there):
        table[nodes, 0] = 1.0
        table[nodes, 3:] = fixed[here] & ~fixed[there]
    shared.scatter_reverse(la.InsertMode.add)
    known = table[:, 0] > 0
    table[known] /= table[known, :1]
    shared.scatter_forward()
    known = table[:, 0] > 0
    partner = np.full((space.node_count, space.d), NO_PARTNER)
    partner[known] = np.rint(table[known, 1:2]).astype(partner.dtype)
    has_jump = table[:, 2] > 0.5
    is_swapped = table[:, 3:] > 0.5
    is_joint = np.zeros(space.node_count, dtype=bool)

    # What this says of nodes in several pairs is replaced.
    first, last = space.V.dofmap.index_map.local_range
    pairs_of_all = space.global_numbers(pairs.ravel()).reshape(-1, 2)
    joints = find_joints(space.comm, pairs_of_all, fixed[: last - first], first)
    reference = partner
    if joints is not None:
        local = space.V.dofmap.index_map.global_to_local(joints.numbers)
        visible = local >= 0
        nodes = local[visible]
        reference = partner.copy()
        partner[nodes] = joints.numbers[joints.partner[visible]]
        reference[nodes] = joints.numbers[joints.reference[visible]]
        has_jump[nodes] = ~joints.is_base[visible]
        is_swapped[nodes] = joints.is_swapped[visible]
        is_joint[nodes] = True
    return NodePairs(partner, reference, has_jump, is_swapped, is_joint, joints)


def pairs_of(trace: Trace) -> np.ndarray:
    """Return the pairs of nodes of a contact between bodies, each once, shape (p, 2).

    They are those of side 1 and of side 2.
    """
    both = np.column_stack([trace.here.nodes.ravel(), trace.partners.ravel()])
    return np.unique(both, axis=0)


def _on_this_rank(traces: Sequence[Trace]) -> np.ndarray:
    """Return the pairs of nodes of this rank, each once, shape (p, 2)."""
    pairs = []
    for trace in traces:
        if trace.there is not None:
            pairs.append(pairs_of(trace))
    return np.unique(np.concatenate(pairs), axis=0)
