"""Bodies at rest: nothing loads or moves them.

A motion without strain and without contact forces is then exact. Newton's method finds
round-off there, and what is measured of it later is round-off over round-off.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.mesh.simplex import lattice
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import BoundContact
from erc_contact.model.friction import PROPORTIONAL
from erc_contact.model.model import Model
from erc_contact.model.values import DATA_DEGREE

GAP_ROUND_OFF = 1e-14
"""Gap over the size of a body that counts as none [-]."""
PARALLEL = 1e-12
"""Difference of two unit normals that counts as none [-]."""


def displacement_at_rest(model: Model, loads: fem.Function) -> fem.Function | None:
    """Return the displacement of a body at rest [length]; collective.

    A body that has not slid yet has u = 0. One that has slid on a plane stays where it
    is when it is released: all of it moves by the mean of its slip. That is known where
    no support and no second plane can press it.

    Args:
        model: The scene on a mesh.
        loads: Nodal forces of its loads [force], not yet summed over ranks.

    Returns:
        The same vector at all nodes, as a new Function; None if the body is not known
        to be at rest.
    """
    moves = bool(loads.x.array.any() or model.prescribed.x.array.any())
    pushes = [_pushes(model, contact) for contact in model.contacts]
    if model.comm.allreduce(moves or any(pushes), MPI.LOR):
        return None
    slides = any(contact.trace.slip_before.any() for contact in model.contacts)
    rest = model.function()
    if model.comm.allreduce(bool(slides), MPI.LOR):
        if not _is_loose_on_a_plane(model):
            return None
        rest.x.array.reshape(-1, model.d)[:] = _mean_slip(model)
    return rest


def _pushes(model: Model, contact: BoundContact) -> bool:
    """Tell whether the gap of a contact pushes the body, on this rank.

    It does so below zero, and anywhere if the contact is bilateral.
    """
    if contact.gap is None:
        return False
    # The nodes are among these points.
    points = lattice(model.d - 1, DATA_DEGREE)
    gap = evaluate(contact.gap, model.mesh, points, contact.facets)
    allowed = GAP_ROUND_OFF * model.domain.extent
    if contact.bilateral:
        return bool((abs(gap) > allowed).any())
    return bool((gap < -allowed).any())


def _is_loose_on_a_plane(model: Model) -> bool:
    """Tell whether nothing but one plane can press the body; collective.

    All contacts then have one normal, friction needs pressure, and no support fixes any
    node.
    """
    pressed = bool(model.fixed.any())
    for contact in model.contacts:
        needs_pressure = contact.friction is None or contact.friction.dependence == PROPORTIONAL
        pressed = pressed or contact.bilateral or not needs_pressure
    normals = np.concatenate([contact.direction for contact in model.contacts])
    low = np.full(model.d, np.inf)
    high = np.full(model.d, -np.inf)
    if len(normals):
        low = normals.min(axis=0)
        high = normals.max(axis=0)
    lowest = np.min(model.comm.allgather(low), axis=0)
    highest = np.max(model.comm.allgather(high), axis=0)
    is_plane = bool(np.all(highest - lowest <= PARALLEL))
    return not model.comm.allreduce(pressed, MPI.LOR) and is_plane


def _mean_slip(model: Model) -> np.ndarray:
    """Return the mean slip of all contacts in the last step [length], shape (d,).

    It is the tangential displacement at the end of that step.
    """
    total = np.zeros(model.d + 1)
    for contact in model.contacts:
        side = contact.trace.here
        area = side.areas[side.owned]
        total[:-1] += area @ contact.trace.slip_before[side.owned].mean(axis=1)
        total[-1] += area.sum()
    total = model.comm.allreduce(total, MPI.SUM)
    return np.asarray(total[:-1] / total[-1])
