"""Bound the round-off of strains, and find solutions that have no other stress.

They are rigid motions, and free expansions by given strains. Their relative error is
zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.elastic import greatest_moduli, strain_digits
from erc_contact.admissible.pair import Admissible
from erc_contact.error.contact import contact_parts
from erc_contact.model.contact.contact_values import gap_at_nodes
from erc_contact.model.contact.trace import split
from erc_contact.model.model import Model
from erc_contact.model.motions.rigid_motions import nearest_motion, rigid_motions

RESOLUTION = 1e-12
"""Accuracy of the solver: error of a displacement over its size [-]."""
SAME_MOTION = 1e-14
"""Difference of a motion to supports and gaps that is round-off, over its size [-]."""
RIGID_NOISE = 100.0
"""Multiple of the accuracy of energy norms below which they count as zero [-].

It is used where a rigid motion is the solution.
"""


def strain_round_off(admissible: Admissible) -> np.ndarray:
    """Bound the round-off of ``C eps(u^)`` in the energy norm of each owned cell.

    Returns:
        The norms [sqrt(force length)], shape (owned,).
    """
    model = admissible.model
    cells = admissible.cell_geometry
    owned = model.domain.owned_cells
    digits = strain_digits(cells, admissible.displacement, owned)
    # The largest entry of the moduli bounds the energy of a strain, up to a constant.
    energies = greatest_moduli(model, cells, owned) * cells.volume[:owned]
    return np.asarray(digits * np.sqrt(energies))


def round_off(admissible: Admissible) -> tuple[float, bool]:
    """Estimate the accuracy of ``C eps(u)`` in the energy norm; collective.

    The accuracy of a displacement of size |u| is ``RESOLUTION |u|``, so the accuracy of
    its strain in a cell of size h is ``RESOLUTION |u|/h``.

    Returns:
        Its square [force length], and whether it underflows.
    """
    model = admissible.model
    cells = admissible.cell_geometry
    comm = model.space.comm
    owned = model.domain.owned_cells
    largest = float(abs(admissible.displacement.x.array).max(initial=0.0))
    size = comm.allreduce(largest, MPI.MAX)
    volume = cells.volume[:owned]
    local = np.sum(greatest_moduli(model, cells, owned) * volume ** (1 - 2 / model.space.d))
    floor = float((RESOLUTION * size) ** 2 * comm.allreduce(float(local), MPI.SUM))
    return floor, size > 0.0 and floor == 0.0


def is_free(admissible: Admissible, floor_2: float) -> bool:
    """Tell whether a motion without stress is the solution up to round-off; collective.

    With given strains it is one where no load acts: a stress that is round-off of the
    strains then is zero.

    Args:
        admissible: The pair.
        floor_2: Square of the accuracy of energy norms, see :func:`round_off`.
    """
    model = admissible.model
    if model.strains is None:
        return moves_rigidly(admissible, floor_2)
    return model.body_force is None and not model.surface_loads


def moves_rigidly(admissible: Admissible, floor_2: float) -> bool:
    """Tell whether a rigid motion is the solution up to round-off; collective.

    It is where no load acts and the motion satisfies supports and gaps. The part of the
    motion that the supports leave free is taken from u^. A friction bound without
    pressure must do no work on it, but on a slip that is round-off.

    Args:
        admissible: The pair.
        floor_2: Square of the accuracy of energy norms, see :func:`round_off`.
    """
    model = admissible.model
    space = model.space
    comm = space.comm
    u = admissible.displacement.x.array
    rigid = _nearest_motion(model, u)
    violation = abs(rigid - model.prescribed.x.array)[model.held.ravel()].max(initial=0.0)
    moved = space.function()
    moved.x.array[:] = rigid
    friction = slip = 0.0
    for traction in admissible.tractions:
        contact = traction.contact
        beyond = (contact.trace.of(rigid) * contact.trace.normals).sum(axis=-1)
        beyond -= gap_at_nodes(space, contact)
        if contact.bilateral:
            beyond = abs(beyond)
        violation = max(violation, beyond.max(initial=0.0))
        without_pressure = replace(traction, values=np.zeros_like(traction.values))
        friction += float(contact_parts(space, moved, without_pressure).sum())
        tangential = split(contact.trace.since(rigid), contact.trace.normals).tangential
        slip = max(slip, float(abs(tangential).max(initial=0.0)))
    # The loads are not summed over ranks: their sizes are enough.
    loads = admissible.solution.stiffness.load_vector().x.array
    sizes = np.array([violation, slip, abs(loads).max(initial=0.0), abs(u).max(initial=0.0)])
    comm.Allreduce(MPI.IN_PLACE, sizes, MPI.MAX)
    violation, slip, load, size = sizes
    friction = comm.allreduce(friction, MPI.SUM)
    # What supports leave free is as the solver has found it.
    same = RIGID_NOISE * RESOLUTION if model.free_motions else SAME_MOTION
    return (
        violation <= same * size
        and load * size <= floor_2 / RESOLUTION
        and (friction <= floor_2 or slip <= same * size)
    )


def _nearest_motion(model: Model, u: np.ndarray) -> np.ndarray:
    """Return the rigid motion nearest to the supports; collective.

    The part that they leave free is nearest to u.

    Args:
        model: The scene on a mesh.
        u: Nodal values of a displacement [length].
    """
    motions = rigid_motions(model.space).reshape(len(u), -1)
    columns = [motion.x.array for motion in model.free_motions]
    free = np.column_stack(columns or [np.zeros((len(u), 0))])
    fixed = model.held.ravel()
    held = motions * fixed[:, None]
    prescribed = motions @ nearest_motion(model.space, held, model.prescribed.x.array * fixed)
    return prescribed + free @ nearest_motion(model.space, free, u - prescribed)
