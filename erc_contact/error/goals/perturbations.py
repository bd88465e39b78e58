"""Return the perturbation that a goal asks of a pair, and check goals before a solve.

See :mod:`erc_contact.error.goals.perturbation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.bolt_perturbations import bolt_perturbation, checked_preload
from erc_contact.error.goals.constants import LEAST_ERROR
from erc_contact.error.goals.force_perturbations import moment, resultant
from erc_contact.error.goals.given_bounds import contacts_with_given_bounds
from erc_contact.error.goals.intensity_perturbation import checked_crack, stress_intensity
from erc_contact.error.goals.jump_perturbations import jump_perturbation
from erc_contact.error.goals.motion_perturbations import functional, mean_displacement, rotation
from erc_contact.error.goals.perturbation import BaseScene, Perturbation
from erc_contact.error.works import elastic_work
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.newton.given_forces import with_free_jumps, with_locked_shifts, without_shifts
from erc_contact.scene.goal import (
    BoltForce,
    Energy,
    Functional,
    Goal,
    GoalOfBolt,
    GoalOfContact,
    GoalOfPart,
    MeanDisplacement,
    Moment,
    Opening,
    Resultant,
    Rotation,
    Shortening,
    Slip,
    StressIntensity,
)
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base.names import listed

SAME = 1e-9
"""Change of a number by a motion that counts as none, over its size [-]."""

type GoalOfScene = GoalOfPart | GoalOfContact | Functional
"""A goal whose perturbation needs no pair."""
type GoalOfPair = GoalOfScene | GoalOfBolt | StressIntensity
"""A goal that moves a scene."""


def perturbation_of(error: ConstitutiveError, goal: GoalOfPair) -> Perturbation:
    """Return what a goal moves; collective.

    Raises:
        InputError: If the scene has no such number, or rigid motions that nothing holds
            change it.
    """
    vector = _check(error.model, goal)
    base = _base_scene(error)
    match goal:
        case StressIntensity():
            perturbation = stress_intensity(error, base, goal)
        case BoltForce() | Shortening():
            perturbation = bolt_perturbation(base, goal, error.admissible)
        case _:
            perturbation = _of_scene(base, goal, vector)
    return replace(perturbation, unit=base.scene.unit(goal.dimension))


def check_goal(scene: Scene, domain: Domain, degree: int, goal: Goal) -> None:
    """Check that a scene has the number of a goal, before it is solved; collective.

    Raises:
        InputError: As :func:`perturbation_of`.
    """
    if isinstance(goal, Energy):
        return
    scene = with_locked_shifts(scene, None)
    model = Model(without_shifts(scene), domain, degree)
    vector = _check(model, goal)
    match goal:
        case StressIntensity():
            checked_crack(model, goal)
        case BoltForce() | Shortening():
            checked_preload(scene, goal)
        case _:
            # What is moved does not depend on the sizes of the solution.
            _of_scene(BaseScene(model, scene, 1.0, 1.0, 1.0), goal, vector)


def _of_scene(base: BaseScene, goal: GoalOfScene, vector: np.ndarray) -> Perturbation:
    """Return what a goal moves that needs no pair; collective."""
    match goal:
        case Functional():
            perturbation = functional(base, goal)
        case Slip() | Opening():
            perturbation = jump_perturbation(base, goal)
        case MeanDisplacement():
            perturbation = mean_displacement(base, goal, vector)
        case Rotation():
            perturbation = rotation(base, goal, vector)
        case Moment():
            perturbation = moment(base, goal, vector)
        case Resultant():
            perturbation = resultant(base, goal, vector)
    _check_known(base.model, goal, perturbation)
    return perturbation


def _check_known(model: Model, goal: GoalOfScene, perturbation: Perturbation) -> None:
    """Check that motions that nothing holds do not change a number; collective.

    They change no work of a given strain, and no shift or force of a bolt.
    """
    unheld = model.unheld
    for motion in unheld.functions:
        change = perturbation.psi(motion)
        # What the integral leaves unknown depends on the mesh.
        if abs(change.value) > SAME * perturbation.size + change.bound:
            raise InputError(
                f"{goal!r}: nothing holds the body against {unheld.words}, and these motions "
                "change the number. Ask for a Functional whose load is in balance, or hold the "
                "body."
            )


def _check(model: Model, goal: GoalOfPair) -> np.ndarray:
    """Check what all goals need, and return the vector of a goal of a part; collective.

    It is the direction, or the axis: one number in the plane, none without a part.
    """
    space = model.space
    soft = [contact.name for contact in model.contacts if contact.is_compliant]
    if soft:
        raise InputError(
            f"{goal!r}: no interval with a compliant foundation ({listed(soft)}); take"
            " ec.resultant for a force of a contact."
        )
    if isinstance(goal, Slip) and goal.direction is not None:
        _check_vector(goal, goal.direction, space.d)
    if not isinstance(goal, MeanDisplacement | Rotation | Moment | Resultant):
        return np.zeros(0)
    vector = _checked_vector(goal, space.d)
    if space.axisymmetric:
        _check_on_rings(space, goal, vector)
    return vector


def _check_on_rings(space: Space, goal: GoalOfPart, vector: np.ndarray) -> None:
    """Check that a goal exists for an axisymmetric body; collective."""
    if isinstance(goal, Moment | Rotation):
        raise InputError(
            f"{goal!r}: rings have no moments and no rotations, which hoop stresses balance; ask"
            " for a Resultant or a MeanDisplacement."
        )
    if isinstance(goal, MeanDisplacement) or vector[0] == 0.0:
        return
    corners = space.facet_corners(space.domain.facets(goal.part))
    meets_axis = bool(space.section.on_axis(corners).any())
    if space.comm.allreduce(meets_axis, MPI.LOR):
        raise InputError(
            f"{goal!r}: a part that meets the axis cannot move radially, so that its radial"
            " force has no interval; give direction=(0.0, 1.0)."
        )


def _base_scene(error: ConstitutiveError) -> BaseScene:
    """Return the scene of an error with its sizes; collective."""
    pair = error.admissible
    model = pair.model
    largest = float(abs(pair.displacement.x.array).max(initial=0.0))
    length = model.space.comm.allreduce(largest, MPI.MAX) or 1.0
    energy = elastic_work(pair, pair.displacement, pair.displacement).value
    norm = float(np.sqrt(max(energy, 0.0))) or 1.0
    e = max(error.absolute, LEAST_ERROR * norm)
    scene = replace(model.scene, contacts=contacts_with_given_bounds(pair))
    # The mean strain of a mean stress moves, too.
    scene = with_free_jumps(scene)
    return BaseScene(model, scene, e, norm, length)


def _checked_vector(goal: GoalOfPart, d: int) -> np.ndarray:
    """Return the direction of a goal, or its axis: one number in the plane."""
    if isinstance(goal, Resultant | MeanDisplacement):
        return _check_vector(goal, goal.direction, d)
    if isinstance(goal, Moment) and goal.about is not None and len(goal.about) != d:
        raise InputError(f"{goal!r}: about has {len(goal.about)} numbers, but the mesh is {d}D.")
    if d == 3:
        if goal.axis is None:
            raise InputError(f"{goal!r}: give an axis in 3D, e.g. axis=(0.0, 0.0, 1.0).")
        return _check_vector(goal, goal.axis, d)
    if goal.axis is not None:
        raise InputError(f"{goal!r}: in the plane the axis is the one out of it; leave axis out.")
    return np.ones(1)


def _check_vector(goal: GoalOfPart | Slip, vector: Sequence[float], d: int) -> np.ndarray:
    """Return a vector of a goal, of d finite numbers."""
    a = np.asarray(vector, dtype=float)
    if a.shape != (d,) or not np.isfinite(a).all() or not a.any():
        raise InputError(f"{goal!r}: give {d} finite numbers, not all zero.")
    return a
