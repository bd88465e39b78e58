"""The layer of cells at the contact, on whose nodes a body is condensed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.mesh.simplex import local_facet_nodes
from erc_contact.model.model import Model


@dataclass(frozen=True, eq=False)
class Layer:
    """Number the free degrees of freedom L of the cells at the contact.

    Those of the contact nodes come first.

    Attributes:
        contact_size: Number of degrees of freedom at contact nodes.
        numbers: Global numbers of L in order, the same on all ranks, shape (L,).
        local: Degrees of freedom of this rank (with ghosts) that are in L, shape (n,).
        place: Their places in L, shape (n,).
    """

    contact_size: int
    numbers: np.ndarray
    local: np.ndarray
    place: np.ndarray


def contact_layer(model: Model) -> Layer:
    """Find the layer of all contacts of a model; collective."""
    facets = np.vstack([contact.facets for contact in model.contacts])
    node_count = len(model.fixed)
    nodes = model.nodes[facets[:, 0]]
    on_facet = local_facet_nodes(model.d, model.degree)[facets[:, 1]]
    touching = np.zeros(node_count, dtype=bool)
    touching[np.take_along_axis(nodes, on_facet, axis=1)] = True
    layer = np.zeros(node_count, dtype=bool)
    layer[nodes] = True

    dofs = np.flatnonzero((layer[:, None] & ~model.fixed).ravel())
    at_contact = np.repeat(touching, model.d)[dofs]
    numbers = model.global_dofs(dofs)
    contact = np.unique(np.concatenate(model.comm.allgather(numbers[at_contact])))
    others = np.concatenate(model.comm.allgather(numbers[~at_contact]))
    # A node may be at the contact by a facet of another rank only.
    off_contact = np.setdiff1d(others, contact)

    all_numbers = np.concatenate([contact, off_contact])
    order = np.argsort(all_numbers)
    place = order[np.searchsorted(all_numbers, numbers, sorter=order)]
    return Layer(len(contact), all_numbers, dofs, place)
