"""The layer of cells at the contact, on whose nodes a body is condensed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.base.ranks import distinct_rows, of_all
from erc_contact.model.model import Model
from erc_contact.model.over_ranks import marked_by_any


@dataclass(frozen=True, eq=False)
class Layer:
    """Number the free degrees of freedom L of the nodes of contacts and of their cells.

    Degrees of freedom of the contact nodes come first. Of two bodies in contact there
    are the cells of this side, and the contact nodes of both sides.

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
    touching = np.zeros(model.node_count, dtype=bool)
    layer = np.zeros(model.node_count, dtype=bool)
    for contact in model.contacts:
        touching[contact.trace.here.nodes] = True
        layer[model.nodes[contact.facets[:, 0]]] = True
    if model.connections.any:
        touching |= model.connections.is_paired
        # A rank may have the cell of a contact facet without the cell that faces it.
        (layer,) = marked_by_any(model, layer | model.connections.is_paired)

    dofs = np.flatnonzero((layer[:, None] & ~model.fixed).ravel())
    at_contact = np.repeat(touching, model.d)[dofs]
    numbers = model.global_dofs(dofs)
    on_contact = distinct_rows(model.comm, numbers[at_contact])
    (others,) = of_all(model.comm, numbers[~at_contact])
    # A node may be at the contact by a facet of another rank only.
    off_contact = np.setdiff1d(others, on_contact)

    all_numbers = np.concatenate([on_contact, off_contact])
    order = np.argsort(all_numbers)
    place = order[np.searchsorted(all_numbers, numbers, sorter=order)]
    return Layer(len(on_contact), all_numbers, dofs, place)
