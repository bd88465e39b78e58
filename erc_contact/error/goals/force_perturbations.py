"""Perturbations of forces and moments: supports move by t, the number is their work.

See :mod:`erc_contact.error.goals.perturbation`. Let W be a rigid motion: the direction
of a force, or the rotation about the axis of a moment. The number is ``int sigma n .
W`` on a part. If the supports of the part move by t W, the energy grows by t times the
work of what they exert. The work of loads on components that they leave free is added.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.error.goals.contact_perturbations import contact_perturbation
from erc_contact.error.goals.perturbation import BaseScene, Perturbation, no_load
from erc_contact.error.goals.virtual_motion import VirtualMotion
from erc_contact.error.load_work import load_work
from erc_contact.error.numbers import BoundedNumber
from erc_contact.model.motions.rigid_faces import RigidFace, bind_rigid, centroid
from erc_contact.scene.goal import Moment, Resultant
from erc_contact.scene.scene import Scene
from erc_contact.scene.support import Rigid
from namedmesh.base.names import listed


def resultant(base: BaseScene, goal: Resultant, a: np.ndarray) -> Perturbation:
    """Return the perturbation for a force."""
    return _work_of_part(base, goal, VirtualMotion.along(a))


def moment(base: BaseScene, goal: Moment, axis: np.ndarray) -> Perturbation:
    """Return the perturbation for a moment."""
    model = base.model
    centre = centroid(model.space, model.domain.facets(goal.part))
    if goal.about is not None:
        centre = np.array(goal.about, dtype=float)
    return _work_of_part(base, goal, VirtualMotion(np.zeros(model.space.d), axis, centre))


def _work_of_part(base: BaseScene, goal: Resultant | Moment, motion: VirtualMotion) -> Perturbation:
    """Return the perturbation for ``int sigma n . W`` on a part; collective.

    Raises:
        InputError: If the part is neither, or its number cannot be told.
    """
    scene = base.scene
    parts = [support.facets for support in scene.supports]
    contacts: list[str] = []
    for contact in scene.contacts:
        contacts += contact.sides
    if goal.part in parts:
        return _support_perturbation(base, goal, motion)
    if goal.part not in contacts:
        raise InputError(
            f"{goal!r}: give a part with a support or in contact. This scene has the supports"
            f" {listed(parts)} and the contacts {listed(contacts)}."
        )
    perturbation = contact_perturbation(base, goal.part, motion)
    if perturbation is None:
        raise InputError(
            f"{goal!r}: other contacts with friction, or springs, share the force of the bodies"
            " on either side of this contact, so that supports and loads do not tell it. A contact"
            " without friction needs no such condition."
        )
    return perturbation


def _support_perturbation(
    base: BaseScene, goal: Resultant | Moment, motion: VirtualMotion
) -> Perturbation:
    """Return the perturbation for ``int sigma n . W`` on a support; collective."""
    model = base.model
    scene = base.scene
    of_loads = load_work(model, motion.nodal(model.space), goal.part)
    constant = of_loads + _given_work(base, goal, motion)

    moving = []
    for support in scene.supports:
        moving.append(support.facets == goal.part and motion.moves(model.space, support))

    def scene_at(t: float) -> Scene:
        supports = []
        for support, is_moved in zip(scene.supports, moving, strict=True):
            supports.append(motion.move(model.space, support, t) if is_moved else support)
        return replace(scene, supports=supports)

    step = base.step_of(motion.size(model.space))
    return Perturbation(scene_at if any(moving) else None, no_load, -1.0, constant, step)


def _given_work(base: BaseScene, goal: Resultant | Moment, motion: VirtualMotion) -> BoundedNumber:
    """Return the work of given resultants of the part on the motion; collective.

    Raises:
        InputError: If the number is asked for where it is given.
    """
    for support in base.scene.supports:
        if support.facets == goal.part and isinstance(support, Rigid):
            return _work_of_face(goal, bind_rigid(base.model.space, support), motion)
    return BoundedNumber(0.0)


def _work_of_face(
    goal: Resultant | Moment, face: RigidFace, motion: VirtualMotion
) -> BoundedNumber:
    """Return the work of the given resultants of a rigid face on the motion."""
    d = len(face.about)
    amounts = motion.freedoms(face.about)
    if isinstance(goal, Moment):
        # A moment about a point other than the point of the face has a share of its
        # force.
        if motion.rotation[face.free[d:]].any():
            raise InputError(
                f"{goal!r}: this moment of the rigid face is given; ask for the Rotation of the"
                " part."
            )
    elif motion.translation[face.free[:d]].any():
        raise InputError(
            f"{goal!r}: this force of the rigid face is given; ask for the other"
            " components, or for the MeanDisplacement of the part."
        )
    return BoundedNumber(float(amounts[face.free] @ face.resultants[face.free]))
