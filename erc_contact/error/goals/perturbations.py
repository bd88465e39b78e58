"""Return the perturbation that a goal asks of a pair.

See :mod:`erc_contact.error.goals.perturbation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.bolt_perturbations import bolt_perturbation
from erc_contact.error.goals.constants import LEAST_ERROR
from erc_contact.error.goals.force_perturbations import moment, resultant
from erc_contact.error.goals.given_bounds import contacts_with_given_bounds
from erc_contact.error.goals.intensity_perturbation import stress_intensity
from erc_contact.error.goals.jump_perturbations import jump_perturbation
from erc_contact.error.goals.motion_perturbations import functional, mean_displacement, rotation
from erc_contact.error.goals.perturbation import BaseScene, Perturbation
from erc_contact.error.works import elastic_work
from erc_contact.mesh.tags import listed
from erc_contact.model.meridian import vertices_off_axis
from erc_contact.model.model import Model
from erc_contact.scene.goal import (
    BoltForce,
    Functional,
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


def perturbation_of(
    error: ConstitutiveError,
    goal: GoalOfPart | GoalOfContact | GoalOfBolt | Functional | StressIntensity,
) -> Perturbation:
    """Return what a goal moves; collective."""
    model = error.model
    soft = [contact.name for contact in model.contacts if contact.is_compliant]
    if soft:
        raise InputError(
            f"{goal!r}: no interval with a compliant foundation ({listed(soft)}); take"
            " ec.resultant for a force of a contact."
        )
    if isinstance(goal, Slip) and goal.direction is not None:
        _check_vector(goal, goal.direction, model.d)
    vector = np.zeros(0)
    if isinstance(goal, MeanDisplacement | Rotation | Moment | Resultant):
        vector = _checked_vector(goal, model.d)
        if model.axisymmetric:
            _check_on_rings(model, goal, vector)
    base = _base_scene(error)
    match goal:
        case Functional():
            perturbation = functional(base, goal)
        case StressIntensity():
            perturbation = stress_intensity(error, base, goal)
        case BoltForce() | Shortening():
            perturbation = bolt_perturbation(base, goal, error.admissible)
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
    return perturbation


def _check_on_rings(model: Model, goal: GoalOfPart, vector: np.ndarray) -> None:
    """Check that a goal exists for an axisymmetric body; collective."""
    if isinstance(goal, Moment | Rotation):
        raise InputError(
            f"{goal!r}: rings have no moments and no rotations, which hoop stresses balance; ask"
            " for a Resultant or a MeanDisplacement."
        )
    if isinstance(goal, MeanDisplacement) or vector[0] == 0.0:
        return
    corners = model.facet_corners(model.domain.facets(goal.part))
    meets_axis = not vertices_off_axis(model, corners).all()
    if model.comm.allreduce(meets_axis, MPI.LOR):
        raise InputError(
            f"{goal!r}: a part that meets the axis cannot move radially, so that its radial"
            " force has no interval; give direction=(0.0, 1.0)."
        )


def _base_scene(error: ConstitutiveError) -> BaseScene:
    """Return the scene of an error with its sizes; collective."""
    pair = error.admissible
    model = pair.model
    largest = float(abs(pair.displacement.x.array).max(initial=0.0))
    length = model.comm.allreduce(largest, MPI.MAX) or 1.0
    energy = elastic_work(pair, pair.displacement, pair.displacement).value
    norm = float(np.sqrt(max(energy, 0.0))) or 1.0
    e = max(error.absolute, LEAST_ERROR * norm)
    scene = replace(model.scene, contacts=contacts_with_given_bounds(pair))
    return BaseScene(model, scene, e, norm, length)


def _checked_vector(goal: GoalOfPart, d: int) -> np.ndarray:
    """Return the direction of a goal, or its axis: one number in the plane."""
    if isinstance(goal, Resultant | MeanDisplacement):
        return _check_vector(goal, goal.direction, d)
    if isinstance(goal, Moment) and goal.about is not None and len(goal.about) != d:
        raise InputError(f"{goal!r}: about has {len(goal.about)} numbers, but the mesh is {d}D.")
    if d == 3:
        if goal.axis is None:
            raise InputError(f"{goal!r}: give an axis in space, e.g. axis=(0.0, 0.0, 1.0).")
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
