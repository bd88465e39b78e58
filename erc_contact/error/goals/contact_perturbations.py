"""Perturbations of forces and moments on contacts: all that is beyond them moves by t.

See :mod:`erc_contact.error.goals.perturbation`. Let W be the rigid motion of the number
``int r . W``, and take a set of bodies that a contact alone joins to other bodies, or
to its foundation. By equilibrium the number is minus the work on W of loads, supports
and other contacts of the set. So the set moves by t W: its supports, and the
foundations and bodies beyond its other contacts. A frictionless contact does so by its
gap, which grows by ``t n . W``. With friction, W must not make it slide. Of a
frictionless contact the foundation alone may move, in the other sense: ``int r . W`` is
then the derivative of the energy by the gap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.traced import field_of
from erc_contact.base.ufl_types import Ufl
from erc_contact.error.goals.perturbation import BaseScene, Perturbation, no_load
from erc_contact.error.goals.virtual_motion import Shift, VirtualMotion, shift_value
from erc_contact.error.load_work import load_work
from erc_contact.error.numbers import BoundedNumber
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.scene.contact import Contact
from erc_contact.scene.scene import Scene
from namedmesh.base.ranks import union

NO_WORK = 1e-9
"""Jump of a motion on a contact that counts as none, over the motion [-]."""


@dataclass(frozen=True, eq=False)
class _Bodies:
    """Find which bodies nodes are on; construction and members are collective.

    Attributes:
        base: The scene.
        body: The body of each node of this rank, shape (nodes,).
    """

    base: BaseScene
    body: np.ndarray

    def at(self, nodes: np.ndarray) -> frozenset[int]:
        """Return the bodies of nodes of all ranks."""
        return frozenset(union(self.base.model.space.comm, self.body[nodes.ravel()].tolist()))

    def of_contact(self, contact: ContactOnMesh) -> tuple[frozenset[int], frozenset[int]]:
        """Return the bodies on this side of a contact, and on the other side.

        A foundation is no body.
        """
        return self.at(contact.trace.here.nodes), self.at(contact.trace.partners)

    def join(self, start: frozenset[int], without: ContactOnMesh) -> frozenset[int]:
        """Return bodies with all that contacts join them to, but for one contact."""
        pairs = []
        for contact in self.base.model.contacts:
            if contact is not without:
                here, there = self.of_contact(contact)
                pairs.append(here | there)
        bodies = start
        for _ in pairs:
            for pair in pairs:
                if pair & bodies:
                    bodies = bodies | pair
        return bodies


def contact_perturbation(base: BaseScene, part: str, motion: VirtualMotion) -> Perturbation | None:
    """Return the perturbation for ``int r . W`` on a side of a contact; collective.

    None if nothing can be moved that tells it.
    """
    model = base.model
    contact = model.contact(part)
    body, _ = model.bodies
    bodies = _Bodies(base, body)
    here, there = bodies.of_contact(contact)
    is_here = contact.side_names[0] == part
    if _can_move(contact) and not _works(base, motion, _normal_parts(base, contact, motion)):
        # Without friction there is no force along the contact.
        return Perturbation(None, no_load, 1.0, BoundedNumber(0.0), 1.0)
    # A moment of the opposite force is the opposite one if the sides have one place.
    apart = _working_jump(contact, motion.nodal(model.space).x.array)
    is_opposite = contact.against is not None and not _works(base, motion, apart)
    sides = [(here, there, is_here), (there, here, not is_here)]
    sides.sort(key=lambda side: not side[2])
    for side, opposite, is_of_part in sides:
        if not is_of_part and not is_opposite:
            continue
        sign = 1.0 if is_of_part else -1.0
        for moving in (bodies.join(side, contact), side):
            if not moving & opposite:
                perturbation = _of_set(bodies, contact, motion, moving, sign)
                if perturbation is not None:
                    return perturbation
    if not _can_move(contact) or not (is_here or is_opposite):
        return None
    return _of_gap(base, contact, motion, -1.0 if is_here else 1.0)


def _of_set(
    bodies: _Bodies,
    contact: ContactOnMesh,
    motion: VirtualMotion,
    moving: frozenset[int],
    sign: float,
) -> Perturbation | None:
    """Return the perturbation by the motion of a set of bodies; collective.

    None if something on it cannot move.

    Args:
        bodies: The bodies of the scene.
        contact: The contact.
        motion: W.
        moving: The set of bodies.
        sign: 1 if the part is on the set, -1 if it is on the other side.
    """
    base = bodies.base
    model = base.model
    scene = base.scene
    virtual = motion.nodal(model.space)
    outside = ~np.isin(bodies.body, list(moving))
    virtual.x.array.reshape(-1, model.space.d)[outside] = 0.0
    supports = []
    for support in scene.supports:
        held = bodies.at(model.space.facet_nodes(model.domain.facets(support.facets)))
        if held & moving and not held <= moving:
            return None
        supports.append(bool(held & moving) and motion.moves(model.space, support))
    for spring in model.springs:
        stiffest = max(spring.normal, spring.tangential)
        if _works(base, motion, spring.pull(virtual.x.array) / stiffest):
            return None
    factors = []
    for on_mesh in model.contacts:
        jump = _working_jump(on_mesh, virtual.x.array)
        if on_mesh is contact or not _works(base, motion, jump):
            factors.append(0.0)
            continue
        here, there = bodies.of_contact(on_mesh)
        moves_here = here <= moving and not there & moving
        moves_there = there <= moving and not here & moving
        if not (moves_here or moves_there) or not _can_move(on_mesh):
            return None
        factors.append(1.0 if moves_here else -1.0)

    def scene_at(t: float) -> Scene:
        new_supports = []
        for support, is_moved in zip(scene.supports, supports, strict=True):
            new_supports.append(motion.move(model.space, support, t) if is_moved else support)
        new_contacts = []
        for entry, on_mesh, factor in zip(scene.contacts, model.contacts, factors, strict=True):
            new_contacts.append(_with_gap(entry, on_mesh, motion, factor * t))
        return replace(scene, supports=new_supports, contacts=new_contacts)

    # int r.W = -(forces of supports and other contacts).W - loads.W
    constant = -sign * load_work(model, virtual)
    step = base.step_of(motion.size(model.space))
    is_told_by_loads = not any(supports) and not any(factors)
    return Perturbation(None if is_told_by_loads else scene_at, no_load, sign, constant, step)


def _of_gap(
    base: BaseScene, contact: ContactOnMesh, motion: VirtualMotion, sign: float
) -> Perturbation:
    """Return the perturbation by the gap of a frictionless contact; collective.

    Args:
        base: The scene.
        contact: The contact.
        motion: W.
        sign: Factor of Q in the number, -1 of this side.
    """
    scene = base.scene

    def scene_at(t: float) -> Scene:
        contacts = []
        for entry, on_mesh in zip(scene.contacts, base.model.contacts, strict=True):
            contacts.append(_with_gap(entry, on_mesh, motion, t if on_mesh is contact else 0.0))
        return replace(scene, contacts=contacts)

    step = base.step_of(motion.size(base.model.space))
    return Perturbation(scene_at, no_load, sign, BoundedNumber(0.0), step)


def _can_move(contact: ContactOnMesh) -> bool:
    """Tell whether its gap moves a contact: without friction, normal to facets."""
    return contact.friction is None and contact.given_normal is None


def _working_jump(contact: ContactOnMesh, values: np.ndarray) -> np.ndarray:
    """Return the part of the jump of a motion on which tractions can work."""
    jump = contact.trace.of(values)
    if contact.friction is not None:
        return jump
    return np.asarray((jump * contact.trace.normals).sum(axis=-1))


def _normal_parts(base: BaseScene, contact: ContactOnMesh, motion: VirtualMotion) -> np.ndarray:
    """Return ``n . W`` at the nodes of the facets of a contact, shape (f, m)."""
    model = base.model
    values = motion.nodal(model.space).x.array.reshape(-1, model.space.d)
    trace = contact.trace
    return np.asarray((values[trace.here.nodes] * trace.normals).sum(axis=-1))


def _works(base: BaseScene, motion: VirtualMotion, jump: np.ndarray) -> bool:
    """Tell whether a part of a motion is more than round-off; collective."""
    model = base.model
    largest = model.space.comm.allreduce(float(abs(jump).max(initial=0.0)), MPI.MAX)
    return bool(largest > NO_WORK * motion.size(model.space))


def _with_gap(entry: Contact, contact: ContactOnMesh, motion: VirtualMotion, t: float) -> Contact:
    """Return a contact whose gap has grown by ``t n . W``; collective."""
    if t == 0:
        return entry
    # A plane of symmetry has no gap that could be given.
    return Contact(
        entry.facets,
        friction=entry.friction,
        gap=shift_value(entry.gap, _normal_part(contact, motion, t)),
        normal=entry.normal,
        bilateral=entry.bilateral,
        against=entry.against,
    )


def _normal_part(contact: ContactOnMesh, motion: VirtualMotion, t: float) -> Shift:
    """Return ``t n . W``, a number where it is the same everywhere."""
    if isinstance(contact.normal, fem.Constant):
        return motion.component(np.asarray(contact.normal.value), t)
    return partial(_along_normals, contact, motion, t)


def _along_normals(contact: ContactOnMesh, motion: VirtualMotion, t: float, x: Ufl) -> Ufl:
    """Return ``t n . W`` with the normals of a contact, UFL."""
    n = contact.normal
    value: Ufl = 0.0
    for i, unit in enumerate(np.eye(len(motion.translation))):
        component = motion.component(unit, t)
        of_place = field_of(component, x) if callable(component) else component
        value = value + n[i] * of_place
    return value
