"""What a goal moves in a scene, and how its number follows from the energy.

A goal is the derivative of the energy by data of the scene, a load or the place of
supports (:mod:`erc_contact.error.three_pairs`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ROUND_OFF, ConstitutiveError
from erc_contact.error.given_bounds import contacts_with_given_bounds
from erc_contact.error.works import BoundedNumber, elastic_work, load_work
from erc_contact.mesh.simplex import coefficients
from erc_contact.mesh.tags import listed
from erc_contact.model.model import Model
from erc_contact.model.rigid_faces import RigidFace
from erc_contact.scene.goal import Goal, MeanDisplacement, Resultant
from erc_contact.scene.load import Traction
from erc_contact.scene.rigid import Rigid
from erc_contact.scene.scene import Scene
from erc_contact.scene.support import Displacement


@dataclass(frozen=True, eq=False)
class Question:
    """Hold what a goal moves, and how its number follows from Q.

    Attributes:
        moved: Makes the scene moved by t, with the friction bounds of the pair.
        psi: ``psi(u)`` of a displacement.
        sign: Factor of Q in the number [-].
        constant: What is added to it.
        step: A first t.
    """

    moved: Callable[[float], Scene]
    psi: Callable[[fem.Function], float]
    sign: float
    constant: BoundedNumber
    step: float


def question_of(error: ConstitutiveError, goal: Goal) -> Question:
    """Return what a goal moves; collective."""
    pair = error.admissible
    model = pair.model
    soft = [contact.name for contact in model.contacts if contact.stiffness is not None]
    if soft:
        raise InputError(
            f"{goal!r}: no interval with a compliant foundation ({listed(soft)}); take"
            " ec.resultant for a force of a contact."
        )
    a = np.asarray(goal.direction, dtype=float)
    if a.shape != (model.d,) or not np.isfinite(a).all() or not a.any():
        raise InputError(f"{goal!r}: give {model.d} finite numbers, not all zero.")
    largest = float(abs(pair.displacement.x.array).max(initial=0.0))
    length = model.comm.allreduce(largest, MPI.MAX) or 1.0
    energy = elastic_work(pair, pair.displacement, pair.displacement).value
    norm = float(np.sqrt(max(energy, 0.0))) or 1.0
    e = max(error.absolute, ROUND_OFF * norm)
    size = float(np.linalg.norm(a))
    scene = replace(model.scene, contacts=contacts_with_given_bounds(pair))
    if isinstance(goal, MeanDisplacement):
        return _mean_displacement(model, scene, goal, a, e * norm / (length * size))
    return _resultant(model, scene, goal, a, e / norm * length / size)


def _mean_displacement(
    model: Model, scene: Scene, goal: MeanDisplacement, a: np.ndarray, step: float
) -> Question:
    """Return the question of a mean displacement: a load on the part moves by t."""
    for face in model.loose_faces:
        if face.name == goal.part:
            return _motion(model, scene, goal, face, a, step)
    facets = model.domain.facets(goal.part)
    owned = model.owned(facets)
    areas = np.where(owned, model.facet_areas(facets), 0.0)
    area = model.comm.allreduce(float(areas.sum()), MPI.SUM)
    taken = [support.facets for support in scene.supports]
    for contact in scene.contacts:
        taken += contact.sides
    if goal.part in taken and goal.part not in [load.facets for load in scene.loads]:
        raise InputError(
            f"{goal!r}: the part has a support or a contact; ask for the Resultant there, or for "
            "the mean displacement of a free or loaded part."
        )
    density = a / area

    def moved(t: float) -> Scene:
        load = Traction(goal.part, tuple(float(value) for value in t * density))
        return replace(scene, loads=(*scene.loads, load))

    def psi(u: fem.Function) -> float:
        values = u.x.array.reshape(-1, model.d)[model.facet_nodes(facets)]
        means = np.einsum("m,fmi->fi", _mean_weights(model), values)
        return float(model.comm.allreduce(float(areas @ (means @ density)), MPI.SUM))

    return Question(moved, psi, 1.0, BoundedNumber(0.0), step)


def _motion(
    model: Model,
    scene: Scene,
    goal: MeanDisplacement,
    face: RigidFace,
    a: np.ndarray,
    step: float,
) -> Question:
    """Return the question of the motion of a rigid face: its force grows by t."""
    d = model.d
    if a[~face.free[:d]].any():
        raise InputError(
            f"{goal!r}: this displacement of the rigid face is given; ask for the other"
            " components, or for the Resultant of the part."
        )

    def moved(t: float) -> Scene:
        supports = list(scene.supports)
        for place, support in enumerate(supports):
            if isinstance(support, Rigid) and support.facets == face.name:
                forces = support.resultants[:d]
                force = tuple(map(_shifted, forces, (t * a).tolist()))
                supports[place] = replace(support, force=force)
        return replace(scene, supports=supports)

    def psi(u: fem.Function) -> float:
        motion = face.motion(u.x.array.reshape(-1, d))
        return float(a @ motion[:d])

    return Question(moved, psi, 1.0, BoundedNumber(0.0), step)


def _mean_weights(model: Model) -> np.ndarray:
    """Return the weights of nodal values in the mean over a facet, shape (m,)."""
    matrix = coefficients(model.d - 1, model.degree)
    return np.asarray(matrix.mean(axis=0))


def _resultant(model: Model, scene: Scene, goal: Resultant, a: np.ndarray, step: float) -> Question:
    """Return the question of a force: supports move by t.

    The force of the only contact is that of all supports and loads, by equilibrium.
    """
    parts = [support.facets for support in scene.supports]
    contacts = [contact.facets for contact in scene.contacts]
    sign = -1.0
    constant = BoundedNumber(0.0)
    if goal.part in parts:
        parts = [goal.part]
        _check_reaction(scene, goal, a)
    elif contacts == [goal.part] and not scene.springs and scene.contacts[0].against is None:
        # int r.a = -(forces of all supports).a - loads.a
        sign = 1.0
        translation = model.function()
        translation.x.array.reshape(-1, model.d)[:] = a
        constant = -1.0 * load_work(model, translation)
    else:
        raise InputError(
            f"{goal!r}: give a part with a support, or the only contact with a foundation of a "
            f"scene without springs. This scene has the supports {listed(parts)} and the contacts "
            f"{listed(contacts)}."
        )

    def moved(t: float) -> Scene:
        supports = []
        for support in scene.supports:
            shift = t * a if support.facets in parts else 0 * a
            supports.append(_moved(support, shift))
        return replace(scene, supports=supports)

    return Question(moved, lambda u: 0.0, sign, constant, step)


def _check_reaction(scene: Scene, goal: Resultant, a: np.ndarray) -> None:
    """Check that the force of a rigid face is asked of where it is not given."""
    for support in scene.supports:
        if support.facets == goal.part and isinstance(support, Rigid):
            given = [force is not None for force in support.resultants[: len(a)]]
            if a[given].any():
                raise InputError(
                    f"{goal!r}: this force of the rigid face is given; ask for the other"
                    " components, or for the MeanDisplacement of the part."
                )


def _moved(support: Displacement | Rigid, shift: np.ndarray) -> Displacement | Rigid:
    """Return a support whose prescribed displacements are moved by a shift [length]."""
    if isinstance(support, Rigid):
        given = support.motions[: len(shift)]
        return replace(support, displacement=tuple(map(_shifted, given, shift.tolist())))
    return Displacement(support.facets, tuple(map(_shifted, support.value, shift)))


def _shifted(value: Any, shift: float) -> Any:
    """Return a component of a support moved by a shift [length]."""
    if value is None or shift == 0:
        return value
    if callable(value):
        return lambda x: value(x) + float(shift)
    return float(value + shift)
