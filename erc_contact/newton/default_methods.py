"""Choose the contact method where the user names none."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.model import Model
from erc_contact.newton.ladder import NODAL
from erc_contact.newton.methods import DEFAULT, Method


def method_beside_faces(model: Model, method: Method | None) -> Method:
    """Return the method of a contact solve; collective.

    Nitsche's method reads the stress of the cells at the contact. Where a node of such
    a cell is on a loose face, its displacement is none of the condensed unknowns. The
    augmented Lagrangian reads displacements and reactions of contact nodes alone.

    Args:
        model: The scene on a mesh.
        method: The method that the user names; None for the default.

    Raises:
        InputError: If the user names a method that reads the stress, and a cell
            touches both.
    """
    if not model.loose_faces:
        return method or DEFAULT
    on_faces = np.zeros(model.node_count, dtype=bool)
    for face in model.loose_faces:
        on_faces[face.nodes] = True
    touching = False
    for contact in model.contacts:
        cells = [contact.facets[:, 0]]
        if contact.trace.there is not None:
            cells.append(contact.trace.there.facets[:, 0])
        touching = touching or bool(on_faces[model.nodes[np.concatenate(cells)]].any())
    if not model.comm.allreduce(touching, MPI.LOR):
        return method or DEFAULT
    if method is None:
        return NODAL
    if not method.multiplier:
        raise InputError(
            f"A cell touches both a contact and Rigid({model.loose_faces[0].name!r}) with free"
            f" motions, and {method} reads its stress; refine the mesh between them, or take"
            " method=ec.AugmentedLagrangian()."
        )
    return method
