"""Put a scene on a mesh that is moved a little from one that is there already."""

from __future__ import annotations

from copy import copy

from erc_contact.model.contacts import bind_contact
from erc_contact.model.coordinates import Coordinates
from erc_contact.model.loads import bind_loads
from erc_contact.model.model import Model
from erc_contact.model.rigid_faces import face_forces
from erc_contact.model.supports import bind_supports
from erc_contact.scene.scene import Scene


def nearby_model(scene: Scene, near: Model) -> Model:
    """Return the model of a moved scene, which shares what is the same; collective.

    Args:
        scene: A scene with other loads, values of supports, or contacts. What has moved
            in a contact is in another object; the others are those of ``near``.
        near: The model of the scene that it is moved from.

    Raises:
        InputError: If supports contradict each other, or a load cannot be worked with.
    """
    model = copy(near)
    model.scene = scene
    supports = bind_supports(model, scene.supports)
    model.fixed = supports.fixed
    model.prescribed = supports.prescribed
    model.bcs = supports.bcs
    model.fixed_facets = supports.facets
    model.held = supports.held
    model.loose_faces = supports.loose_faces
    model.face_forces = face_forces(model, model.loose_faces)
    model.surface_loads, model.body_force = bind_loads(model, scene.loads)
    model.contacts = []
    entries = zip(scene.contacts, near.scene.contacts, near.contacts, strict=True)
    for entry, near_entry, contact in entries:
        # Forms with the contact of the other model serve this one, too.
        is_same = entry is near_entry
        model.contacts.append(contact if is_same else bind_contact(model, entry, model.modulus))
    traces = [contact.trace for contact in model.contacts]
    model.coordinates = Coordinates(model, traces, model.fixed, model.prescribed)
    return model
