"""Find solutions that are rigid motions up to round-off. Their error is then zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.elastic import moduli
from erc_contact.admissible.pair import Admissible
from erc_contact.error.contact import contact_parts
from erc_contact.mesh.simplex import nodes
from erc_contact.model.motions import rigid_motions

RESOLUTION = 1e-12
"""Accuracy of a displacement over its size, which is that of the solver [-]."""
NOISE = 100.0
"""Where a rigid motion is the solution, energy norms below this multiple of their accuracy count as zero [-]."""


def round_off(admissible: Admissible) -> tuple[float, bool]:
    """Square of the accuracy of ``C eps(u)`` in the energy norm, and whether this square underflows.

    The accuracy of a displacement of size |u| is ``RESOLUTION |u|``, so that of its
    strain in a cell of size h is ``RESOLUTION |u|/h``.
    """
    model, cells = admissible.model, admissible.cell_geometry
    comm, owned = model.comm, model.domain.owned_cells
    size = comm.allreduce(float(abs(admissible.displacement.x.array).max(initial=0.0)), MPI.MAX)
    stiffness = moduli(model, cells, nodes(model.d, 0), owned)[:, 0].max(axis=(1, 2))
    volume = cells.volume[:owned]
    local = np.sum(stiffness * volume ** (1 - 2 / model.d))
    floor = float((RESOLUTION * size) ** 2 * comm.allreduce(float(local), MPI.SUM))
    return floor, size > 0.0 and floor == 0.0


def moves_rigidly(admissible: Admissible, floor_2: float) -> bool:
    """Tell whether a rigid motion is the solution up to round-off: no load, and it satisfies supports and gaps.

    The part of the motion that the supports leave free is taken from u^. A friction
    bound without pressure must do no work on it.
    """
    model, u = admissible.model, admissible.displacement.x.array
    comm, owned = model.comm, model.V.dofmap.index_map.size_local * model.d
    motions = rigid_motions(model).reshape(len(u), -1)
    free = np.column_stack(
        [motion.x.array for motion in model.free_motions] or [np.zeros((len(u), 0))]
    )
    fixed = model.fixed.ravel()

    def nearest(motions: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The combination of motions that is nearest to values, all ranks."""
        products = comm.allreduce(
            motions[:owned].T @ np.column_stack([motions, values])[:owned], MPI.SUM
        )
        return np.linalg.lstsq(products[:, :-1], products[:, -1], rcond=1e-10)[0]

    held = motions @ nearest(motions * fixed[:, None], model.prescribed.x.array * fixed)
    rigid = held + free @ nearest(free, u - held)
    wrong = [abs(rigid - model.prescribed.x.array)[fixed].max(initial=0.0)]
    friction = 0.0
    moved = model.function()
    moved.x.array[:] = rigid
    for t in admissible.tractions:
        beyond = np.einsum("fmi,fi->fm", t.contact.trace.of(rigid), t.contact.direction)
        beyond -= model.gap_at_nodes(t.contact)
        wrong.append((abs(beyond) if t.contact.bilateral else beyond).max(initial=0.0))
        friction += float(
            contact_parts(model, moved, replace(t, values=np.zeros_like(t.values))).sum()
        )
    loads = (
        admissible.solution.stiffness.load_vector().x.array
    )  # not summed over ranks: sizes are enough
    sizes = np.array([max(wrong), abs(loads).max(initial=0.0), abs(u).max(initial=0.0)])
    comm.Allreduce(MPI.IN_PLACE, sizes, MPI.MAX)
    friction = comm.allreduce(friction, MPI.SUM)
    return (
        sizes[0] <= RESOLUTION * sizes[2]
        and sizes[1] * sizes[2] <= floor_2 / RESOLUTION
        and friction <= floor_2
    )
