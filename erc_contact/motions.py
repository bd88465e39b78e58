"""Rigid motions of a body, and which of them its supports and contacts leave free."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.exceptions import NotHeldError

if TYPE_CHECKING:
    from erc_contact.model import Model


def free_motions(model: Model) -> list[fem.Function]:
    """Rigid motions that no support holds, Functions of V (orthonormal combinations); collective.

    Raises:
        NotHeldError: If contact does not hold one of them either.
    """
    motions, names = rigid_motions(model)
    owned = model.V.dofmap.index_map.size_local
    held = motions[:owned] * model.fixed[:owned, :, None]
    by_supports = model.comm.allreduce(np.einsum("ndi,ndj->ij", held, held), MPI.SUM)
    values, vectors = np.linalg.eigh(by_supports)
    free = vectors[:, values <= 1e-10 * max(values[-1], 1.0)]
    if not free.shape[1]:
        return []
    by_all = by_supports
    for contact in model.contacts:
        at = motions[model.facet_nodes(contact.facets)]
        along = np.einsum("fmdi,fd->fmi", at, contact.direction)[:, :, None, :]
        held = (at if contact.law is not None else along).reshape(-1, 1, at.shape[-1])
        by_all = by_all + model.comm.allreduce(np.einsum("ndi,ndj->ij", held, held), MPI.SUM)
    values, vectors = np.linalg.eigh(by_all)
    loose = vectors[:, values <= 1e-10 * max(values[-1], 1.0)]
    if loose.shape[1]:
        which = [names[i] for i in np.unique(abs(loose).argmax(axis=0))]
        raise NotHeldError(
            f"Nothing holds the body against: {', '.join(which)} (no support, and contact cannot hold it). "
            "Add a Displacement (None leaves a component free), or friction."
        )
    functions = []
    for column in free.T:
        motion = fem.Function(model.V)
        motion.x.array[:] = (motions @ column).ravel()
        functions.append(motion)
    return functions


def rigid_motions(model: Model) -> tuple[np.ndarray, list[str]]:
    """All rigid motions at the nodes, rotations about the centre and divided by the size: (nodes, d, m)."""
    x = model.V.tabulate_dof_coordinates()[:, : model.d]
    owned = model.V.dofmap.index_map.size_local
    total = model.comm.allreduce(x[:owned].sum(axis=0), MPI.SUM)
    x = (x - total / model.V.dofmap.index_map.size_global) / model.domain.size
    pairs = [(i, j) for i in range(model.d) for j in range(i + 1, model.d)]
    motions = np.zeros((*x.shape, model.d + len(pairs)))
    motions[:, range(model.d), range(model.d)] = 1.0
    for k, (i, j) in enumerate(pairs, start=model.d):
        motions[:, i, k], motions[:, j, k] = -x[:, j], x[:, i]
    axes = "xyz"
    names = [f"translation in {axes[i]}" for i in range(model.d)]
    names += [f"rotation in the plane {axes[i]}{axes[j]}" for i, j in pairs]
    return motions, names
