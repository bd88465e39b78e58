"""Give each card of a deck to the function that reads it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from erc_contact.decks import conditions, interfaces, materials, orthotropic
from erc_contact.decks.keywords import BY_NAME, HARMLESS, REFUSED, squeezed
from erc_contact.decks.reading import DeckReading
from erc_contact.decks.told import Told
from namedmesh.for_solvers import Card, DeckMesh, DeckSpace, shape_of

Reader = Callable[[DeckReading, Card, DeckSpace], None]
"""A function that reads a card."""

READERS: dict[str, Reader] = {
    "MATERIAL": materials.read_material,
    "ELASTIC": materials.read_elastic,
    "EXPANSION": materials.read_expansion,
    "DENSITY": materials.read_density,
    "PLASTIC": materials.read_plastic,
    "SOLID SECTION": materials.read_section,
    "ORIENTATION": orthotropic.read_orientation,
    "AMPLITUDE": conditions.read_amplitude,
    "STEP": conditions.read_step,
    "STATIC": conditions.read_static,
    "END STEP": conditions.read_end_step,
    "BOUNDARY": conditions.read_boundary,
    "TRANSFORM": conditions.read_transform,
    "CLOAD": conditions.read_cload,
    "DLOAD": conditions.read_dload,
    "DSLOAD": conditions.read_dsload,
    "TEMPERATURE": conditions.read_temperature,
    "INITIAL CONDITIONS": conditions.read_initial,
    "SURFACE INTERACTION": interfaces.read_interaction,
    "SURFACE BEHAVIOR": interfaces.read_behavior,
    "FRICTION": interfaces.read_friction,
    "CONTACT PAIR": interfaces.read_contact_pair,
    "TIE": interfaces.read_tie,
    "CLEARANCE": interfaces.read_clearance,
    "PRE-TENSION SECTION": interfaces.read_pretension,
    "RIGID BODY": interfaces.read_rigid_body,
    "COUPLING": interfaces.read_coupling,
    "KINEMATIC": interfaces.read_kinematic,
    "DISTRIBUTING": interfaces.read_distributing,
    "DISTRIBUTING COUPLING": interfaces.read_distributing_coupling,
}
"""Keyword -> the function that reads its cards."""
OF_THE_MESH = (
    *("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "SYSTEM", "INCLUDE"),
    *("PART", "END PART", "ASSEMBLY", "END ASSEMBLY", "INSTANCE", "END INSTANCE"),
)
"""Keywords that the mesh has read."""
_OF_PARTS = {"PART", "ENDPART", "INSTANCE", "ENDINSTANCE"}
_READERS = {squeezed(name): reader for name, reader in READERS.items()}
_OF_THE_MESH = {squeezed(name) for name in OF_THE_MESH}


def read_cards(mesh: DeckMesh, without: Sequence[str], penalty: str) -> DeckReading:
    """Read all cards of a deck.

    Args:
        mesh: Its mesh, with the cards.
        without: Cards that are left out, as "*EQUATION" or "*ELEMENT, TYPE=S4".
        penalty: "hard" or "kept".
    """
    reading = DeckReading(mesh, Told(), penalty)
    wanted_out = [squeezed(words) for words in without]
    for card in mesh.cards:
        if squeezed(card.keyword) in _OF_PARTS:
            reading.told.take(card)
    instances = mesh.spaces[1:]
    # What is said of instances is said before the rest needs it.
    for space in [*instances, mesh.spaces[0]]:
        for card in space.cards:
            if _is_left_out(card, wanted_out):
                reading.told.leave_out(card, "left out, as without= says")
                continue
            _read(reading, card, space)
    if reading.steps.is_inside:
        reading.steps.close()
    return reading


def _is_left_out(card: Card, wanted_out: Sequence[str]) -> bool:
    """Tell whether a user leaves a card out."""
    names = [f"*{squeezed(card.keyword)}"]
    for name, value in card.parameters.items():
        names.append(squeezed(f"*{card.keyword},{name}={value}"))
    return any(name in wanted_out for name in names)


def _read(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read a card, leave it out, or refuse it."""
    name = squeezed(card.keyword)
    keyword = BY_NAME.get(name)
    told = reading.told
    if keyword is None:
        told.refuse(card, "the keyword is not known; leave it out, or say so by without=.")
    elif keyword.fate == HARMLESS:
        told.leave_out(card, keyword.meaning)
    elif keyword.fate == REFUSED:
        told.refuse(card, f"{keyword.meaning}: {keyword.said}.")
    elif name in _OF_THE_MESH:
        told.take(card)
    else:
        told.take(card)
        _READERS[name](reading, card, space)
    if name == "ELEMENT":
        _check_elements(reading, card)


def _check_elements(reading: DeckReading, card: Card) -> None:
    """Tell of elements that are no solids."""
    kind = card.get("TYPE").upper()
    shape, _, is_solid = shape_of(kind)
    if is_solid or kind == interfaces.COUPLING_ELEMENT:
        return
    if shape is not None:
        # Programs write sides of solids so; those with a section are refused there.
        reading.told.leave_out(card, f"elements of type {kind} are no solids")
        return
    reading.told.refuse(
        card,
        f"elements of type {kind} are no solids; say without=['*ELEMENT, TYPE={kind}'] if the "
        "bodies do not need them.",
    )
