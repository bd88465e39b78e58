"""Check what supports and contacts share with loose rigid faces.

They may have nodes in common with a face where no free motion of it moves what they
hold. So no force that they exchange at a node changes a resultant of the face.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.rigid_faces import RigidFace
from erc_contact.model.space import Space

UNMOVED = 1e-9
"""Motion over the motion of the face that counts as none [-]."""


def check_neighbours(
    space: Space, faces: Sequence[RigidFace], held: np.ndarray, contacts: Sequence[ContactOnMesh]
) -> None:
    """Check that supports and contacts beside loose faces hold no motion of the faces.

    Collective.

    Args:
        space: The mesh.
        faces: The loose faces.
        held: Which components supports prescribe at each node, shape (nodes, d).
        contacts: The contacts.

    Raises:
        InputError: If a support or a contact holds a free motion of a face.
    """
    for face in faces:
        what = f"Rigid({face.name!r})"
        _check_beside(space, face, held, f"{what} and a support")
        for contact in contacts:
            _check_contact(space, face, contact, f"{what} and Contact({contact.name!r})")


def _check_contact(space: Space, face: RigidFace, contact: ContactOnMesh, words: str) -> None:
    """Check a contact beside a loose face; collective."""
    common = np.isin(contact.trace.here.nodes, face.nodes)
    common_there = False
    if contact.trace.there is not None:
        common_there = bool(np.isin(contact.trace.partners, face.nodes).any())
    error = None
    if common_there or (common.any() and contact.trace.there is not None):
        error = InputError(
            f"{words} have nodes in common: beside a contact between bodies all motions of the"
            " face must be given, or leave a facet between them."
        )
    elif common.any() and contact.friction is not None:
        error = InputError(
            f"{words} have nodes in common: beside a contact with friction all motions of the"
            " face must be given, or leave a facet between them, free or without friction."
        )
    raise_together(space.comm, error)
    # Without friction only the normal component is held.
    along = np.zeros((space.node_count, space.d))
    held = np.zeros((space.node_count, space.d), dtype=bool)
    normals = np.broadcast_to(contact.trace.normals, (*common.shape, space.d))
    np.maximum.at(along, contact.trace.here.nodes[common], abs(normals[common]))
    held[:] = along > UNMOVED
    _check_beside(space, face, held, words)


def _check_beside(space: Space, face: RigidFace, held: np.ndarray, words: str) -> None:
    """Check that a loose face does not move components that are held; collective.

    All nodes of its facets at a common node count: their tractions are exchanged.
    """
    of_facets = space.facet_nodes(face.facets)
    moved = np.zeros((space.node_count, space.d))
    moved[face.nodes] = (abs(face.shapes) / face.sizes)[:, :, face.free].max(axis=2, initial=0.0)
    beside = held[of_facets].any(axis=1)
    most = moved[of_facets].max(axis=1, initial=0.0)
    error = None
    if (beside & (most > UNMOVED)).any():
        error = InputError(
            f"{words} have nodes in common, and hold a component there in which the face moves:"
            " give this motion of the face, or leave a facet between them."
        )
    raise_together(space.comm, error)
