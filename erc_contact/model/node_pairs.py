"""Find the pairs of nodes that face each other at contacts between bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import la

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.model.foundation import BoundContact
from erc_contact.model.space import Space

NO_PARTNER = -1
"""Stands for the partner of a node that is in no pair."""


@dataclass(frozen=True, eq=False)
class NodePairs:
    """Hold the pairs of the nodes of this rank, ghosts included.

    Attributes:
        partner: Global number of the partner of each node, or :data:`NO_PARTNER`, shape
            (nodes,).
        is_here: Which nodes are those of side 1 of a pair, shape (nodes,).
        is_swapped: Which components a support fixes on side 1 alone, at both nodes of
            the pair, shape (nodes, d).
    """

    partner: np.ndarray
    is_here: np.ndarray
    is_swapped: np.ndarray


def no_pairs(space: Space) -> NodePairs:
    """Return the pairs of a mesh without contacts between bodies."""
    count = space.node_count
    is_swapped = np.zeros((count, space.d), dtype=bool)
    return NodePairs(np.full(count, NO_PARTNER), np.zeros(count, dtype=bool), is_swapped)


def node_pairs(space: Space, contacts: Sequence[BoundContact], fixed: np.ndarray) -> NodePairs:
    """Find the pairs of nodes of contacts between bodies; collective.

    A rank may have a node without the facets of its pair, so those that know it tell
    the others.

    Args:
        space: The mesh.
        contacts: The contacts.
        fixed: Which components supports prescribe at each node, shape (nodes, d).

    Raises:
        InputError: If a node is in two pairs.
    """
    here, there = _on_this_rank(space, contacts)
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
    partner = np.full(space.node_count, NO_PARTNER)
    partner[known] = np.rint(table[known, 1]).astype(partner.dtype)
    return NodePairs(partner, table[:, 2] > 0.5, table[:, 3:] > 0.5)


def _on_this_rank(space: Space, contacts: Sequence[BoundContact]) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of nodes of this rank, each once: sides 1 and 2; collective."""
    here = []
    there = []
    for contact in contacts:
        trace = contact.trace
        if trace.there is not None:
            here.append(trace.here.nodes.ravel())
            there.append(trace.partners.ravel())
    both = np.column_stack([np.concatenate(here), np.concatenate(there)])
    pairs = np.unique(both, axis=0)
    error = None
    if len(np.unique(pairs)) < pairs.size:
        error = InputError(
            "A node is in two pairs of contacts between bodies: three bodies meet there, or two "
            "contacts of the same bodies name them in another order. Name the same body first in "
            "both contacts, or end one of the contacts before the point."
        )
    raise_together(space.comm, error)
    return pairs[:, 0], pairs[:, 1]
