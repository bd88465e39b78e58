"""Bodies at rest: nothing loads or strains them.

A motion without strain and without contact forces is then exact. Newton's method finds
round-off there, and what is measured of it later is round-off over round-off.

In a history loads, supports and gaps that are round-off of the history so far are none.
A body that has slid may come back to rest, or keep a stress that friction holds: which
of the two it does is known when it is solved only.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.model.contact.contact_values import distance_at_nodes
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.friction import PROPORTIONAL
from erc_contact.model.contact.trace import split
from erc_contact.model.data.values import DATA_DEGREE
from erc_contact.model.model import Model
from erc_contact.model.motions.rigid_motions import nearest_motion, rigid_motions
from erc_contact.model.space import Space
from namedmesh.base.ranks import greatest
from namedmesh.for_solvers import spread
from namedmesh.simplex import lattice

REST_ROUND_OFF = 1e-14
"""Gap or displacement over the size of a body that counts as none [-]."""
HISTORY_ROUND_OFF = 1e-12
"""Load or displacement over the greatest of a history that counts as none [-]."""
SOLVED = 1e-10
"""Distance from a rigid motion that a solve may leave, over the same [-].

It is the accuracy of multigrid; a factor is better by orders.
"""
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
    if _is_loaded(model, loads, model.greatest_before.displacement) or _is_moved(model):
        return None
    slides = any(contact.trace.slip_before.any() for contact in model.contacts)
    displacement = model.space.function()
    if model.space.comm.allreduce(bool(slides), MPI.LOR):
        if not _is_loose_on_a_plane(model):
            return None
        displacement.x.array.reshape(-1, model.space.d)[:] = _mean_slip(model)
    return displacement


def displacement_back_at_rest(
    model: Model, loads: fem.Function, u: fem.Function
) -> fem.Function | None:
    """Return the displacement of a body that is back at rest [length]; collective.

    It is the rigid motion nearest to a solution that differs from it by round-off: of
    the history, or in a first step of the motion, by which supports and foundations
    move a body together. Nothing loads the body, no foundation is pressed, and no
    friction without pressure acts on it.

    Args:
        model: The scene on a mesh.
        loads: Nodal forces of its loads [force], not yet summed over ranks.
        u: The solution [length].

    Returns:
        A new Function; None if the body is not at rest.
    """
    space = model.space
    before = model.greatest_before.displacement
    moved = before or greatest(space.comm, u.x.array)
    if _is_loaded(model, loads, moved):
        return None
    # Supports that move tell a small strain from a motion before to more digits.
    share = HISTORY_ROUND_OFF if before > 0 and _is_moved(model) else SOLVED
    round_off = share * moved
    of_nodes = rigid_motions(space)
    motions = of_nodes.reshape(len(u.x.array), of_nodes.shape[2])
    displacement = space.function()
    displacement.x.array[:] = motions @ nearest_motion(space, motions, u.x.array)
    off = float(abs(displacement.x.array - u.x.array).max(initial=0.0))
    held = model.fixed.ravel()
    displacement.x.array[held] = model.prescribed.x.array[held]
    for spring in model.springs:
        _, stretched = spring.resist(displacement.x.array.reshape(-1, space.d, 1))
        off = max(off, float(abs(stretched).max(initial=0.0)))
    for contact in model.contacts:
        # A compliant foundation resists what closes more than its gap.
        closed = -distance_at_nodes(space, contact, displacement.x.array)
        pressed = abs(closed) if contact.bilateral else closed
        off = max(off, float(pressed.max(initial=0.0)))
        if contact.friction is not None and contact.friction.dependence != PROPORTIONAL:
            since = contact.trace.since(displacement.x.array)
            slip = split(since, contact.trace.normals).tangential
            off = max(off, float(abs(slip).max(initial=0.0)))
    return displacement if space.comm.allreduce(off, MPI.MAX) <= round_off else None


def load_size(space: Space, loads: fem.Function) -> float:
    """Return the sum of the sizes of nodal forces [force]; collective.

    Args:
        space: The mesh.
        loads: The forces, not yet summed over ranks.
    """
    return space.comm.allreduce(float(abs(loads.x.array).sum()), MPI.SUM)


def _is_loaded(model: Model, loads: fem.Function, moved: float) -> bool:
    """Tell whether loads are more than round-off; collective.

    Round-off is measured by the greatest load of the history, and by the force of a
    strain that a displacement over the size of the body is: a law that is linearised
    about the last step leaves so much.

    Args:
        model: The scene on a mesh.
        loads: Nodal forces of its loads [force], not yet summed over ranks.
        moved: The greatest displacement so far [length].
    """
    greatest_force = model.greatest_before.load
    if moved > 0:
        of_motion = model.stiffest() * model.domain.extent ** (model.space.d - 2) * moved
        greatest_force = max(greatest_force, of_motion)
    return load_size(model.space, loads) > HISTORY_ROUND_OFF * greatest_force


def _is_moved(model: Model) -> bool:
    """Tell whether a support or a gap moves the body; collective."""
    least = HISTORY_ROUND_OFF * model.greatest_before.displacement
    moves = bool(abs(model.prescribed.x.array).max(initial=0.0) > least)
    least_gap = max(least, REST_ROUND_OFF * model.domain.extent)
    pushes = [_pushes(model.space, contact, least_gap) for contact in model.contacts]
    return bool(model.space.comm.allreduce(moves or any(pushes), MPI.LOR))


def _pushes(space: Space, contact: ContactOnMesh, allowed: float) -> bool:
    """Tell whether the gap of a contact pushes the body, on this rank.

    It does so below zero, and anywhere if the contact is bilateral.
    """
    if contact.gap is None:
        return False
    # The nodes are among these points.
    points = lattice(space.d - 1, DATA_DEGREE)
    gap = space.evaluate(contact.gap, points, contact.facets)
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
    is_plane = spread(model.space.comm, normals) <= PARALLEL
    return not model.space.comm.allreduce(pressed, MPI.LOR) and is_plane


def _mean_slip(model: Model) -> np.ndarray:
    """Return the mean slip of all contacts in the last step [length], shape (d,).

    It is the tangential displacement at the end of that step.
    """
    total = np.zeros(model.space.d + 1)
    for contact in model.contacts:
        side = contact.trace.here
        area = side.areas[side.owned]
        total[:-1] += area @ contact.trace.slip_before[side.owned].mean(axis=1)
        total[-1] += area.sum()
    total = model.space.comm.allreduce(total, MPI.SUM)
    return np.asarray(total[:-1] / total[-1])
