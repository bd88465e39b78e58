"""The layer of cells at the contact, on whose nodes a body is condensed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.model.model import Model
from erc_contact.model.over_ranks import marked_by_any


@dataclass(frozen=True, eq=False)
class Layer:
    """Number the free unknowns L that the displacement of the cells at contacts has.

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
    coordinates = model.coordinates
    node_count = len(model.fixed)
    touching = np.zeros(node_count, dtype=bool)
    jumping = np.zeros(node_count, dtype=bool)
    layer = np.zeros(node_count, dtype=bool)
    for contact in model.contacts:
        # A foundation sees u, a contact between bodies the jump, which is x at a node.
        seen = touching if contact.trace.there is None else jumping
        seen[contact.trace.here.nodes] = True
        layer[model.nodes[contact.facets[:, 0]]] = True
    if not coordinates.is_identity:
        # Where more than two bodies meet, a jump is a sum of unknowns at all nodes.
        touching = coordinates.with_partners(touching) | jumping | coordinates.is_joint
        layer = coordinates.with_partners(layer) | coordinates.is_joint
        # A rank may have the cell of a contact facet without the cell that faces it.
        touching, layer = marked_by_any(model, touching, layer)

    dofs = np.flatnonzero((layer[:, None] & ~coordinates.fixed).ravel())
    at_contact = np.repeat(touching, model.d)[dofs]
    numbers = model.global_dofs(dofs)
    on_contact = np.unique(np.concatenate(model.comm.allgather(numbers[at_contact])))
    others = np.concatenate(model.comm.allgather(numbers[~at_contact]))
    # A node may be at the contact by a facet of another rank only.
    off_contact = np.setdiff1d(others, on_contact)

    all_numbers = np.concatenate([on_contact, off_contact])
    order = np.argsort(all_numbers)
    place = order[np.searchsorted(all_numbers, numbers, sorter=order)]
    return Layer(len(on_contact), all_numbers, dofs, place)
