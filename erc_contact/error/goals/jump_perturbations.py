"""Perturbations of slip and opening: forces that drive them grow by t.

Opposite forces act on the two sides of a contact, beside its own traction r; on a
foundation the body alone has them. So ``sigma n = r + t psi`` there, r stays in the
cone of the law, and the energy has the further work ``- t int psi . w`` of the jump w.
Its derivative is the mean slip or, but for the sign and the mean gap, the mean opening.
See :mod:`erc_contact.error.goals.perturbation`.

The interval holds for any pair of the moved scene. So a method may take a part of ``t
psi`` for the traction of the contact, as Nitsche's does, which reads ``sigma n``: its u
is off by about ``t psi/gamma``. That widens the interval by less than 1%, as measured;
equations that know psi would be other ones for each t, and cost more.

Normals are the normals of the contact; where they vary between two bodies, they are the
normals of the flat facets, which both sides have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.error.contact_integral import contact_integral
from erc_contact.error.goals.perturbation import BaseScene, Perturbation
from erc_contact.error.load_work import load_size, work_of_load
from erc_contact.error.numbers import BoundedNumber
from erc_contact.model.contact.contact_values import ContactData
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.scene.goal import GoalOfContact, Opening, Slip
from erc_contact.scene.load import Drive
from erc_contact.scene.scene import Scene
from namedmesh.simplex import rule


def jump_perturbation(base: BaseScene, goal: GoalOfContact) -> Perturbation:
    """Return the perturbation for a mean slip or a mean opening; collective."""
    model = base.model
    space = model.space
    scene = base.scene
    contact = _contact(model, goal)
    area = _area(space, contact)
    drives = _drives(goal, contact, 1.0 / area)

    def scene_at(t: float) -> Scene:
        grown = [replace(drive, factor=t * drive.factor) for drive in drives]
        return replace(scene, loads=(*scene.loads, *grown))

    def psi(u: fem.Function) -> BoundedNumber:
        total = BoundedNumber(0.0)
        for drive in drives:
            total += work_of_load(space, drive, u)
        return total

    constant = BoundedNumber(0.0)
    least = -np.inf
    if isinstance(goal, Opening):
        constant = (1.0 / area) * _volume_of_gap(space, contact)
        if not (_has_facet_normals(contact) and contact.trace.corner_normals is not None):
            # Along its normals no admissible displacement has a distance below zero.
            least = 0.0
    elif contact.trace.before is not None:
        # A foundation that moves takes the body along without a slip.
        constant = -1.0 * psi(contact.trace.before)
    size, varies = load_size(space, drives[0])
    if size == 0:
        raise InputError(f"{goal!r}: the direction has no part along the contact.")
    step = base.e * base.norm / (base.length * size)
    return Perturbation(scene_at, psi, 1.0, constant, step, varies, size, least)


def _contact(model: Model, goal: GoalOfContact) -> ContactOnMesh:
    """Return the contact of a goal.

    Raises:
        InputError: If it has no slip or no opening, or a direction is missing.
    """
    contact = model.contact(goal.part)
    if contact not in model.contacts:
        raise InputError(f"{goal!r}: the part is in a tied joint, whose sides do not part.")
    if isinstance(goal, Opening):
        if contact.bilateral:
            raise InputError(f"{goal!r}: a bilateral contact does not open.")
    elif goal.direction is None and model.space.d == 3:
        raise InputError(f"{goal!r}: give a direction in 3D, e.g. (1.0, 0.0, 0.0).")
    return contact


def _drives(goal: GoalOfContact, contact: ContactOnMesh, factor: float) -> list[Drive]:
    """Return the forces whose work is the number, but for a constant.

    Args:
        goal: The goal.
        contact: Its contact.
        factor: One over the area of the contact [1/area].
    """
    drives = []
    for side, sign in zip(contact.side_names, (1.0, -1.0), strict=False):
        along: Callable[[Ufl], Ufl] = _inward
        if isinstance(goal, Slip):
            along = _turn
            if goal.direction is not None:
                of_part = 1.0 if side == goal.part else -1.0
                along = partial(_along, tuple(of_part * a for a in goal.direction))
        normal = None if _has_facet_normals(contact) else sign * contact.normal
        drives.append(Drive(side, factor, along, normal))
    return drives


def _has_facet_normals(contact: ContactOnMesh) -> bool:
    """Tell whether facets give the normals: both sides of two bodies have them."""
    return contact.against is not None and not isinstance(contact.normal, fem.Constant)


def _inward(n: Ufl) -> Ufl:
    """Return the normal into the body, UFL."""
    return -n


def _turn(n: Ufl) -> Ufl:
    """Return the outward normal turned counterclockwise, UFL."""
    return ufl.as_vector([-n[1], n[0]])


def _along(direction: tuple[float, ...], n: Ufl) -> Ufl:
    """Return the part of a direction across the normal, UFL."""
    vector = ufl.as_vector(direction)
    return vector - ufl.dot(vector, n) * n


def _area(space: Space, contact: ContactOnMesh) -> float:
    """Return the area of a contact, of rings if it is of rings; collective."""
    points, weights = rule(space.d - 1, space.degree + 1)
    facets = contact.facets[contact.trace.here.owned]
    local = float(space.facet_weights(facets, points, weights).sum())
    return float(space.comm.allreduce(local, MPI.SUM))


def _volume_of_gap(space: Space, contact: ContactOnMesh) -> BoundedNumber:
    """Return the integral of the gap of a contact; collective."""
    if contact.gap is None:
        return BoundedNumber(0.0)
    data = ContactData(contact, space.mesh)

    def volume(
        facet: np.ndarray, shape: np.ndarray, w: np.ndarray, n: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        return space.section.times(data.gap(facet, x), x)

    return BoundedNumber.summed(
        space.comm, contact_integral(space, contact, space.function(), volume)
    )
