"""Make the model of a scene that is a known scene moved a little."""

from __future__ import annotations

from copy import copy

from erc_contact.model.contacts import bind_contact
from erc_contact.model.model import Model
from erc_contact.scene.scene import Scene


def nearby_model(scene: Scene, near: Model) -> Model:
    """Return the model of a moved scene, which shares what is the same; collective.

    Args:
        scene: A scene with other loads, values of supports, shifts of preloads, given
            strains, or contacts. A contact is the object of ``near``, unless something
            has moved in it.
        near: The model of the scene that it is moved from.

    Raises:
        InputError: If supports contradict each other, or a load cannot be worked with.
        NotHeldError: If loads are not in balance on a motion that nothing holds.
    """
    model = copy(near)
    model.scene = scene
    model.bind_supports_and_loads(scene)
    if scene.ties != near.scene.ties or scene.strains != near.scene.strains:
        model.bind_strains(scene)
    model.contacts = []
    entries = zip(scene.contacts, near.scene.contacts, near.contacts, strict=True)
    for entry, near_entry, contact in entries:
        # Forms with the contact of the other model serve this one, too.
        is_same = entry is near_entry
        model.contacts.append(contact if is_same else bind_contact(model, entry, model.modulus))
    model.anchor()
    model.bind_connections()
    return model
