"""Make the scene of a deck at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl

from erc_contact.decks.affine import Affine, constant
from erc_contact.decks.histories import Key
from erc_contact.decks.plan import DeckJoint, DeckPlan, Plane, Radial, RigidPart, Shared
from erc_contact.scene.contact import Contact, Foundation, Symmetry
from erc_contact.scene.load import BodyForce, Traction
from erc_contact.scene.remote import RemoteForce
from erc_contact.scene.scene import Scene
from erc_contact.scene.strain import Eigenstrain, ThermalStrain
from erc_contact.scene.support import Displacement, Rigid
from erc_contact.scene.tied import Preload, Tied

Reached = Callable[[float, str], Sequence[Any]]
"""Displacement on a part that the step before a time has reached, d callables of x."""


def scene_of(plan: DeckPlan, t: float, reached: Reached) -> Scene:
    """Return the scene of a deck at a time.

    Args:
        plan: The deck.
        t: The time.
        reached: What steps have reached on parts that are fixed then.

    Raises:
        InputError: If the scene refuses what the deck says.
    """
    materials: dict[str, Any] = dict(plan.material)
    # A body of one material needs no regions.
    first = next(iter(materials.values()))
    is_one = all(of_region == first for of_region in materials.values())
    material: Any = first if is_one else materials
    supports: list[Any] = [*_displacements(plan, t, reached)]
    supports += [_rigid(plan, rigid, t) for rigid in plan.rigids]
    contacts = [_contact(joint) for joint in plan.joints if joint.kind == "contact"]
    contacts += [_plane(plane) for plane in plan.planes]
    contacts += [_radial_support(radial) for radial in plan.radials]
    ties = [_tie(plan, joint, t) for joint in plan.joints if joint.kind != "contact"]
    return Scene(
        material,
        supports,
        _loads(plan, t),
        contacts,
        _strains(plan, t),
        ties=ties,
    )


def _displacements(plan: DeckPlan, t: float, reached: Reached) -> list[Displacement]:
    """Return the prescribed displacements at a time."""
    fixed: dict[tuple[str, int], Any] = {}
    found: dict[tuple[str, int], dict[Key, Affine]] = {}
    for entry in plan.at("held", t):
        value = entry.what.value.times(entry.factor(t))
        for part in entry.what.parts:
            if entry.what.is_fixed:
                component = entry.what.component
                fixed[part, component] = reached(entry.begin, part)[component]
            by_key = found.setdefault((part, entry.what.component), {})
            before = by_key.pop(entry.key, None)
            # The key that is said last counts.
            by_key[entry.key] = value if before is None else before.plus(value)
    vectors: dict[str, list[Any]] = {}
    for (part, component), by_key in found.items():
        vector = vectors.setdefault(part, [None] * plan.d)
        *_, value = by_key.values()
        vector[component] = fixed.get((part, component), value.value)
    return [Displacement(part, vector) for part, vector in vectors.items()]


def _loads(plan: DeckPlan, t: float) -> list[Any]:
    """Return the loads at a time, without those that are zero."""
    loads: list[Any] = []
    tractions: dict[str, list[Affine]] = {}
    pressures: dict[str, Affine] = {}
    zero = constant(0.0, plan.d)
    fixed = _fixed_components(plan, t)
    for entry in plan.at("pushed", t):
        factor = entry.factor(t)
        for part in entry.what.parts:
            if entry.what.pressure is not None:
                pressure = entry.what.pressure.times(factor)
                pressures[part] = pressures.get(part, zero).plus(pressure)
            else:
                known = tractions.get(part, [zero] * plan.d)
                new = [value.times(factor) for value in entry.what.traction]
                carried = fixed.get(part, set())
                new = [zero if i in carried else value for i, value in enumerate(new)]
                tractions[part] = [a.plus(b) for a, b in zip(known, new, strict=True)]
    for part, pressure in pressures.items():
        if pressure != zero and len(fixed.get(part, set())) < plan.d:
            loads.append(Traction(part, pressure=pressure.value))
    for part, traction in tractions.items():
        if any(value != zero for value in traction):
            loads.append(Traction(part, tuple(value.value for value in traction)))
    return loads + _shared(plan, t) + _volumes(plan, t)


def _fixed_components(plan: DeckPlan, t: float) -> dict[str, set[int]]:
    """Return the components of parts that stay where a step has left them.

    Their support carries the loads along them.
    """
    result: dict[str, set[int]] = {}
    for entry in plan.at("held", t):
        if entry.what.is_fixed:
            for part in entry.what.parts:
                result.setdefault(part, set()).add(entry.what.component)
    return result


def _shared(plan: DeckPlan, t: float) -> list[RemoteForce]:
    """Return the forces that parts share at a time, without those that are zero."""
    found: dict[tuple[str, tuple[float, ...]], np.ndarray] = {}
    for entry in plan.at("shared", t):
        what: Shared = entry.what
        values = entry.factor(t) * np.array([*what.force, *what.moment])
        key = (what.part, what.at)
        found[key] = found.get(key, 0.0) + values
    loads = []
    for (part, at), values in found.items():
        if values.any():
            numbers = values.tolist()
            force, moment = numbers[: plan.d], numbers[plan.d :]
            loads.append(RemoteForce(part, force, moment=moment, at=at))
    return loads


def _volumes(plan: DeckPlan, t: float) -> list[BodyForce]:
    """Return the forces per volume at a time, without those that are zero."""
    loads: list[BodyForce] = []
    zero = constant(0.0, plan.d)
    volumes: dict[str | None, list[Affine]] = {}
    for entry in plan.at("volume", t):
        new = [value.times(entry.factor(t)) for value in entry.what.value]
        known = volumes.get(entry.what.region, [zero] * plan.d)
        volumes[entry.what.region] = [a.plus(b) for a, b in zip(known, new, strict=True)]
    for region, volume in volumes.items():
        if any(value != zero for value in volume):
            loads.append(BodyForce(tuple(value.value for value in volume), region))
    for entry in plan.at("inside", t):
        factor = entry.factor(t)
        if factor:
            loads.append(BodyForce(tuple(value.times(factor) for value in entry.what.value)))
    return loads


def _strains(plan: DeckPlan, t: float) -> list[Any]:
    """Return the strains of the beginning, and the strain of heat at a time."""
    strains: list[Any] = [Eigenstrain(plan.eigenstrains)] if plan.eigenstrains else []
    if not any(plan.alphas.values()):
        return strains
    linear = constant(0.0, plan.d)
    changes: list[Any] = []
    for entry in plan.at("heat", t):
        change = entry.what.change.times(entry.factor(t))
        if isinstance(change, Affine):
            linear = linear.plus(change)
        elif entry.factor(t):
            changes.append(change)
    if linear != constant(0.0, plan.d):
        changes.append(linear.value)
    values = set(plan.alphas.values())
    alpha: Any = values.pop() if len(values) == 1 else dict(plan.alphas)
    return strains + [ThermalStrain(alpha, change) for change in changes]


def _contact(joint: DeckJoint) -> Contact:
    """Return a contact of two parts."""
    foundation = None
    tangential = joint.tangential if joint.friction else None
    if joint.normal is not None or tangential is not None:
        foundation = Foundation(joint.normal, tangential)
    return Contact(
        joint.here,
        against=joint.there,
        friction=joint.friction,
        gap=joint.gap if joint.drawn is None else joint.drawn,
        foundation=foundation,
    )


def _tie(plan: DeckPlan, joint: DeckJoint, t: float) -> Tied:
    """Return a tied joint, or a preload with its force or shortening at a time."""
    if joint.kind == "tied":
        return Tied(joint.here, joint.there)
    if any(entry.key == (joint.node,) for entry in plan.at("locked", t)):
        return Preload(joint.here, joint.there, locked=True)
    values = {"force": 0.0, "shortening": 0.0}
    given = set()
    for kind, name in (("grip force", "force"), ("grip", "shortening")):
        for entry in plan.at(kind, t):
            number, component = entry.key
            if (number, component) == (joint.node, 1):
                values[name] += joint.sign * entry.what * entry.factor(t)
                given.add(name)
    if "shortening" in given:
        return Preload(joint.here, joint.there, shortening=values["shortening"])
    return Preload(joint.here, joint.there, force=values["force"] / plan.thickness)


def _plane(plane: Plane) -> Contact:
    """Return a plane of symmetry."""
    if plane.normal is None:
        return Symmetry(plane.part)
    return Contact(plane.part, normal=plane.normal, bilateral=True)


class _RadialNormal:
    """Point outward from the axis of a cylinder."""

    def __init__(self, radial: Radial) -> None:
        self.radial = radial

    def __call__(self, x: Any) -> Any:
        """Return the direction of the radius at a position, UFL."""
        origin = ufl.as_vector(self.radial.origin)
        axis = ufl.as_vector(self.radial.axis)
        arm = x - origin
        across = arm - ufl.dot(arm, axis) * axis
        return across / ufl.sqrt(ufl.dot(across, across))


def _radial_support(radial: Radial) -> Contact:
    """Return a support along the radius of a cylinder."""
    return Contact(radial.part, normal=_RadialNormal(radial), bilateral=True)


def _rigid(plan: DeckPlan, rigid: RigidPart, t: float) -> Rigid:
    """Return a rigid face with the motion and the force of its node at a time."""
    d = plan.d
    count = 6 if d == 3 else 3
    motions: list[float | None] = [None] * count
    resultants = [0.0] * count
    for kind in ("grip", "grip force"):
        for entry in plan.at(kind, t):
            number, component = entry.key
            freedom = _freedom(rigid, number, component, d)
            if freedom is None:
                continue
            value = entry.what * entry.factor(t)
            if kind == "grip":
                motions[freedom] = (motions[freedom] or 0.0) + value
            else:
                resultants[freedom] += value / plan.thickness
    forces = [None if motion is not None else resultants[i] for i, motion in enumerate(motions)]
    rotation: Any = motions[d:]
    moment: Any = forces[d:]
    if d == 2:
        rotation, moment = rotation[0], moment[0]
    return Rigid(rigid.part, motions[:d], rotation, forces[:d], moment, rigid.about)


def _freedom(rigid: RigidPart, number: int, component: int, d: int) -> int | None:
    """Return the number of a freedom of a rigid face; None if it is not of the face."""
    if number == rigid.reference and component <= d:
        return component - 1
    turn = component - 3 if number == rigid.reference else None
    if number == rigid.rotation:
        turn = component
    if turn is None or not 1 <= turn <= 3:
        return None
    if d == 2:
        return 2 if turn == 3 else None
    return 2 + turn
