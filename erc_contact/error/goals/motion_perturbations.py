"""Perturbations of motions: a load or a resultant moves by t, the number is its work.

See :mod:`erc_contact.error.goals.perturbation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.error.goals.perturbation import BaseScene, Perturbation
from erc_contact.error.load_work import load_size, work_of_load
from erc_contact.error.numbers import BoundedNumber
from erc_contact.model.data.users import vector
from erc_contact.model.loads import area_weights
from erc_contact.model.motions.rigid_faces import RigidFace
from erc_contact.scene.goal import Functional, MeanDisplacement, Rotation
from erc_contact.scene.load import Load, Traction
from erc_contact.scene.scene import Scene
from erc_contact.scene.support import Rigid
from namedmesh.base.names import listed
from namedmesh.simplex import lagrange, rule


def mean_displacement(base: BaseScene, goal: MeanDisplacement, a: np.ndarray) -> Perturbation:
    """Return the perturbation for a mean displacement: a load there grows by t."""
    model = base.model
    space = model.space
    scene = base.scene
    for face in model.loose_faces:
        if face.name == goal.part:
            return _translation(base, goal, face, a)
    facets = model.domain.owned_facets(goal.part)
    points, weights = rule(space.d - 1, space.degree + 1)
    of_points = area_weights(space, goal.part, facets, points, weights)
    area = space.comm.allreduce(float(of_points.sum()), MPI.SUM)
    taken = [support.facets for support in scene.supports]
    for contact in scene.contacts:
        taken += contact.sides
    if goal.part in taken and goal.part not in [load.facets for load in scene.loads]:
        raise InputError(
            f"{goal!r}: the part has a support or a contact; ask for the Resultant there, or for "
            "the mean displacement of a free or loaded part."
        )
    density = a / area

    def scene_at(t: float) -> Scene:
        load = Traction(goal.part, tuple(float(value) for value in t * density))
        return replace(scene, loads=(*scene.loads, load))

    def psi(u: fem.Function) -> BoundedNumber:
        values = u.x.array.reshape(-1, space.d)[space.facet_nodes(facets)]
        at_points = np.matmul(lagrange(space.d - 1, space.degree, points), values)
        local = float(np.einsum("fq,fqi,i->", of_points, at_points, density))
        return BoundedNumber(float(space.comm.allreduce(local, MPI.SUM)))

    size = float(np.linalg.norm(a))
    step = base.e * base.norm / (base.length * size)
    return Perturbation(scene_at, psi, 1.0, BoundedNumber(0.0), step, size=size)


def _translation(
    base: BaseScene, goal: MeanDisplacement, face: RigidFace, a: np.ndarray
) -> Perturbation:
    """Return the perturbation for a translation of a rigid face: a force grows by t."""
    d = len(a)
    if a[~face.free[:d]].any():
        raise InputError(
            f"{goal!r}: this displacement of the rigid face is given, or the section slides along"
            " it; ask for the other components, or for the Resultant of the part."
        )
    return _motion(base, face, np.concatenate([a, np.zeros(len(face.free) - d)]))


def rotation(base: BaseScene, goal: Rotation, axis: np.ndarray) -> Perturbation:
    """Return the perturbation for a rotation of a rigid face: a moment grows by t."""
    model = base.model
    d = model.space.d
    faces = [face for face in model.loose_faces if face.name == goal.part]
    if not faces:
        loose = listed([face.name for face in model.loose_faces])
        raise InputError(
            f"{goal!r}: no rigid face with free motions is called {goal.part!r}. This scene has"
            f" {loose}."
        )
    face = faces[0]
    if axis[~face.free[d:]].any():
        raise InputError(
            f"{goal!r}: this rotation of the rigid face is given; ask for the Moment of the part."
        )
    return _motion(base, face, np.concatenate([np.zeros(d), axis]))


def _motion(base: BaseScene, face: RigidFace, amounts: np.ndarray) -> Perturbation:
    """Return the perturbation for a sum of motions of a rigid face.

    Its resultants grow by t.

    Args:
        base: The scene.
        face: The face.
        amounts: Factors of its motions in the sum, shape (freedoms,).
    """
    scene = base.scene
    d = base.model.space.d

    def scene_at(t: float) -> Scene:
        supports = list(scene.supports)
        for place, support in enumerate(supports):
            if isinstance(support, Rigid) and support.facets == face.name:
                grown = _grown(support.resultants, t * amounts)
                supports[place] = replace(support, force=grown[:d], moment=grown[d:])
        return replace(scene, supports=supports)

    def psi(u: fem.Function) -> BoundedNumber:
        return BoundedNumber(float(amounts @ face.motion(u.x.array.reshape(-1, d))))

    # A rotation by an angle moves the face by the angle times its size.
    size = float(np.linalg.norm(amounts / face.sizes))
    step = base.e * base.norm / (base.length * size)
    return Perturbation(scene_at, psi, 1.0, BoundedNumber(0.0), step, size=size)


@dataclass(frozen=True)
class _Scaled:
    """Represent a load times a factor; it has the parameters of the load."""

    load: Load
    factor: float

    @property
    def facets(self) -> str | None:
        """Return the name of the boundary part, None for the body."""
        return self.load.facets

    @property
    def parameters(self) -> tuple[str, ...]:
        """Return the names of the parameters of the load."""
        return self.load.parameters

    def density(self, x: Ufl, n: Ufl, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return the density of the load times the factor."""
        return self.factor * vector(self.load.density(x, n, *values, **parameters))

    def __getattr__(self, name: str) -> Any:
        """Return a parameter of the load."""
        if name.startswith("__"):
            # Copies ask for such names before they have the load.
            raise AttributeError(name)
        return getattr(self.load, name)


def functional(base: BaseScene, goal: Functional) -> Perturbation:
    """Return the perturbation for the work of a load: t times the load is added."""
    model = base.model
    scene = base.scene
    size, varies = load_size(model.space, goal.load)
    if size == 0:
        raise InputError(f"{goal!r}: the load is zero everywhere; give another one.")

    def scene_at(t: float) -> Scene:
        return replace(scene, loads=(*scene.loads, _Scaled(goal.load, t)))

    def psi(u: fem.Function) -> BoundedNumber:
        return work_of_load(model.space, goal.load, u)

    # A load on a support or in contact has no place in a scene, which says so.
    replace(scene, loads=(*scene.loads, goal.load))
    step = base.e * base.norm / (base.length * size)
    return Perturbation(scene_at, psi, 1.0, BoundedNumber(0.0), step, varies, size)


def _grown(resultants: Sequence[float | None], growth: np.ndarray) -> tuple[Any, ...]:
    """Return resultants of a rigid face that have grown; None where none is given."""
    grown: list[float | None] = []
    for resultant, more in zip(resultants, growth.tolist(), strict=True):
        grown.append(None if resultant is None else resultant + more)
    return tuple(grown)
