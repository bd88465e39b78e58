"""Take meshes of FrontISTR (.msh of HEC-MW) apart, into cards of Abaqus.

Their cards are the cards of Abaqus under other names: groups of nodes, of elements and
of sides are its sets and surfaces, whose sides have the same numbers.

Source: FrontISTR, manual, "Single domain mesh data" and "Element library".
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from namedmesh.base.exceptions import InputError
from namedmesh.files.abaqus_cards import Card, cards_of, integers_of

TYPES = {
    **{"231": "CPS3", "232": "CPS6", "241": "CPS4", "242": "CPS8"},
    **{"341": "C3D4", "342": "C3D10", "351": "C3D6", "352": "C3D15"},
    **{"361": "C3D8", "362": "C3D20", "371": "C3D5", "372": "C3D13"},
}
"""Types of Abaqus by the numbers of types.

Nodes between corners have other places in a row, which play no role.
"""
SETS = {"NGROUP": "NSET", "EGROUP": "ELSET"}
"""Keywords of Abaqus by the keywords of groups."""
PARAMETERS = {"NGRP": "NSET", "EGRP": "ELSET", "SGRP": "NAME"}
"""Parameters of Abaqus by the parameters that name groups."""


def cards_of_hecmw(path: Path) -> list[Card]:
    """Return the cards of Abaqus that say what a mesh of FrontISTR says.

    Raises:
        InputError: If a group of sides has no pairs, or an included file is missing.
    """
    cards: list[Card] = []
    for card in cards_of(path, "!"):
        cards += _of_abaqus(card)
    return cards


def _of_abaqus(card: Card) -> Iterator[Card]:
    """Iterate over the cards of Abaqus that say what a card says."""
    parameters = {PARAMETERS.get(name, name): value for name, value in card.parameters.items()}
    if card.keyword == "ELEMENT":
        parameters["TYPE"] = TYPES.get(card.get("TYPE"), card.get("TYPE"))
    if card.keyword in ("NODE", "ELEMENT", *SETS):
        keyword = SETS.get(card.keyword, card.keyword)
        yield Card(keyword, parameters, card.lines, card.place)
    if card.keyword == "SGROUP":
        yield from _surface(card, card.get("SGRP"))


def _surface(card: Card, name: str) -> Iterator[Card]:
    """Iterate over the cards of a surface and of the sets of elements that it names.

    Raises:
        InputError: If the lines do not have pairs of an element and a side.
    """
    words = " ".join(card.lines).replace(",", " ").split()
    if len(words) % 2:
        raise InputError(
            f"the group of sides {name!r} ({card.place}) has {len(words)} numbers, and pairs of an "
            "element and a side are read."
        )
    pairs = integers_of(words, 1).reshape(-1, 2)
    sides = []
    for side in sorted(set(pairs[:, 1].tolist())):
        elements = pairs[pairs[:, 1] == side, 0]
        inner = f"_{name}_S{side}"
        yield Card("ELSET", {"ELSET": inner}, [str(number) for number in elements])
        sides.append(f"{inner}, S{side}")
    yield Card("SURFACE", {"NAME": name}, sides)
