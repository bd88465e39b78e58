"""Find the half of a bolt that contacts hold alone, and what acts on it.

If a cut parts a body in two, the half W on one side is in balance with the force F of
the cut, the loads, and the contacts. With the motion of this half along the axis,

    int r . d + f(d) + F(d) = -F    over the half,

so that the traction r of contacts tells the force of the cut, and the other way round.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.runtime import compiled
from erc_contact.model.motions import bodies_of_nodes
from erc_contact.model.preload import PreloadOnMesh


def motions_of_halves(
    model: Any, forces: Mapping[str, float]
) -> tuple[list[fem.Function], list[float]]:
    """Return motions of halves of bolts, and works on them; collective.

    Args:
        model: The scene on a mesh.
        forces: The force of each bolt by the name of its preload [force].

    Returns:
        Translations of halves that contacts alone hold, along the axis out of them [-].
        The work of the loads and of the force of the cut on them [force].
    """
    motions = []
    works = []
    for preload in model.preloads:
        half = _free_half(model, preload) if preload.name in forces else None
        if half is not None:
            motion, work = half
            motions.append(motion)
            works.append(work + forces[preload.name])
    return motions, works


def _free_half(model: Any, preload: PreloadOnMesh) -> tuple[fem.Function, float] | None:
    """Return the motion of a half and the work of the loads on it; collective.

    None if the cut parts no body, or supports or springs hold both halves.
    """
    body, count = bodies_of_nodes(model, preload.on_cut)
    of_first = preload.weights.any(axis=1)
    touching = preload.on_cut[model.vertices].any(axis=1)
    halves = []
    for cells in (of_first, touching & ~of_first):
        numbers = np.zeros(count, dtype=bool)
        nodes = model.nodes[cells].ravel()
        numbers[body[nodes[~preload.on_cut[nodes]]]] = True
        halves.append(np.logical_or.reduce(model.comm.allgather(numbers)))
    if (halves[0] & halves[1]).any():
        return None
    held = np.zeros(count, dtype=bool)
    held[body[(model.held_or_anchored & (preload.axis != 0.0)).any(axis=1)]] = True
    for spring in model.springs:
        held[body[spring.side.nodes.ravel()]] = True
    held = np.logical_or.reduce(model.comm.allgather(held))
    for half, sign in zip(halves, (1.0, -1.0), strict=True):
        if not (half & held).any():
            motion = model.function()
            motion.x.array.reshape(-1, model.d)[half[body]] = sign * preload.axis
            return motion, _work_of_loads(model, half[body], sign * preload.axis, motion)
    return None


def _work_of_loads(
    model: Any, is_of_half: np.ndarray, axis: np.ndarray, motion: fem.Function
) -> float:
    """Return the work of the loads on a half along an axis [force]; collective.

    Cells at the cut have their share of the loads, too.
    """
    indicator = model.indicator(is_of_half[model.nodes].any(axis=1))
    direction = compiled.constant(model.mesh, axis)
    work = 0.0
    loads = model.loads(indicator * direction)
    if loads is not None:
        work += fem.assemble_scalar(compiled.form(loads))
    if model.face_forces is not None:
        # Each of these forces is at the node of its owner alone.
        work += float(model.face_forces.x.array @ motion.x.array)
    return float(model.comm.allreduce(work, MPI.SUM))
