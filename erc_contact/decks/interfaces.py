"""Read contact pairs and their laws, ties, cuts of bolts, and rigid faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.decks.reading import DeckReading, Facing, Grip, Interaction, Pretension
from erc_contact.decks.told import number_of, numbers_in
from namedmesh.for_solvers import Card, DeckSpace

ALL_COMPONENTS = (1, 2, 3, 4, 5, 6)
"""Displacements and rotations of a node."""
COUPLING_ELEMENT = "DCOUP3D"
"""Type of an element whose node loads a *DISTRIBUTING COUPLING."""
LOG_100 = float(np.log(100.0))
"""Logarithm of the pressure at overclosure 0 over the pressure at the distance c0."""


def read_interaction(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Begin the law of a contact."""
    interaction = Interaction(card)
    reading.interactions[card.get("NAME").upper()] = interaction
    reading.current = interaction


def read_behavior(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read the pressure over the overclosure."""
    interaction = reading.below(card, Interaction, "SURFACE INTERACTION")
    behavior = card.get("PRESSURE-OVERCLOSURE").upper() or "HARD"
    numbers = numbers_in(card)
    if interaction is None:
        return
    if behavior not in ("HARD", "LINEAR", "EXPONENTIAL", "TIED"):
        reading.told.refuse(
            card,
            f"PRESSURE-OVERCLOSURE={behavior}: HARD, LINEAR, EXPONENTIAL and TIED are read.",
        )
        return
    interaction.behavior = behavior
    if behavior == "LINEAR" and numbers:
        interaction.stiffness = numbers[0]
    if behavior == "EXPONENTIAL" and len(numbers) > 1:
        # p = p0 exp(log(100) overclosure/c0): its slope at p = p0.
        interaction.stiffness = LOG_100 * numbers[1] / numbers[0]
    if behavior in ("LINEAR", "EXPONENTIAL") and reading.penalty == "hard":
        reading.told.assume(
            card,
            f"{behavior}: a penalty for hard contact, taken as hard; penalty='kept' keeps its "
            "slope as a layer that gives way",
        )


def read_friction(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read the coefficient of Coulomb's friction."""
    interaction = reading.below(card, Interaction, "SURFACE INTERACTION")
    if any(card.has(name) for name in ("USER", "ANISOTROPIC", "ROUGH")):
        reading.told.refuse(card, f"{', '.join(card.parameters)}: one coefficient alone is read.")
    elif interaction:
        numbers = [*numbers_in(card), 0.0, 0.0]
        interaction.friction = numbers[0]
        if len(card.lines) and numbers[1] > 0:
            interaction.stick = numbers[1]
            if reading.penalty == "hard":
                reading.told.assume(card, "its stick slope is a penalty: what sticks does not slip")


def _pairs_of(
    reading: DeckReading, card: Card, space: DeckSpace, interaction: str, *, tied: bool
) -> None:
    """Read lines of a dependent and an independent surface."""
    word = card.get("ADJUST")
    adjust: float | None = np.inf if tied else None
    moved = None
    if word and word[0] in "0123456789.+-":
        adjust = number_of(card, word)
    elif word.upper() not in ("", "NO", "YES"):
        adjust = np.inf
        moved = reading.mesh.nodes(word, space)
    for row in card.rows:
        if len(row) < 2:
            reading.told.refuse(card, "a line has two surfaces, the slave first.")
            return
        reading.facings.append(Facing(row[0], row[1], interaction, adjust, moved, tied, card))


def read_contact_pair(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read pairs of surfaces in contact."""
    interaction = card.get("INTERACTION").upper()
    if not interaction:
        reading.told.refuse(card, "it names no INTERACTION.")
        return
    _pairs_of(reading, card, space, interaction, tied=False)


def read_tie(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read pairs of surfaces that are glued."""
    if card.has("CYCLICSYMMETRY") or card.has("MULTISTAGE"):
        reading.told.refuse(card, "cyclic symmetry is not read; take the whole body.")
        return
    _pairs_of(reading, card, space, "", tied=True)


def read_clearance(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read the distance of a pair that counts in place of the drawn distance."""
    sides = (card.get("SLAVE").upper(), card.get("MASTER").upper())
    reading.clearances[sides] = number_of(card, card.get("VALUE"))


def read_pretension(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read the cut through a bolt and the node of its force."""
    if not card.get("SURFACE"):
        reading.told.refuse(card, "a cut through solids is read: give SURFACE= and NODE=.")
        return
    node = reading.point(card, "NODE", space)
    if card.lines:
        reading.told.assume(card, "the force acts along the mean normal of the cut")
    if node is not None:
        normal = tuple(numbers_in(card))
        reading.pretensions.append(Pretension(card.get("SURFACE"), node, normal, card))


def read_rigid_body(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read nodes or elements that move as a rigid body."""
    name = card.get("NSET") or card.get("ELSET")
    nodes = reading.mesh.nodes(name, space)
    if not card.get("NSET"):
        nodes = reading.mesh.nodes_of_cells(reading.mesh.cells(name, space))
    reference = reading.point(card, "REFNODE", space)
    rotation = reading.point(card, "ROTNODE", space) if card.has("ROTNODE") else None
    if reference is not None:
        grip = Grip(name, nodes, "", reference, rotation, True, ALL_COMPONENTS, card)
        reading.grips.append(grip)


def read_coupling(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read a surface that a node moves or loads; the next card says which."""
    reference = reading.point(card, "REFNODE", space)
    name = card.get("SURFACE")
    if reference is not None:
        nodes = np.empty(0, dtype=np.int64)
        reading.current = Grip(name, nodes, name, reference, None, True, (), card)


def read_kinematic(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read which components of a coupled surface move with its node."""
    _finish_coupling(reading, card, rigid=True)


def read_distributing(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read that a coupled surface shares the forces on its node."""
    _finish_coupling(reading, card, rigid=False)


def read_distributing_coupling(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read that nodes share a force by weights, the force on the node of an element.

    Its place does not matter: the force acts in the mean of the nodes.
    """
    elset = card.get("ELSET").upper()
    elements: list[list[str]] = []
    for known in space.cards:
        is_coupling = known.get("TYPE").upper() == COUPLING_ELEMENT
        if is_coupling and known.get("ELSET").upper() == elset:
            elements += known.rows
    if len(elements) != 1 or len(elements[0]) != 2 or not card.rows:
        reading.told.refuse(
            card, f"give an ELSET with one element of type {COUPLING_ELEMENT}, and nodes."
        )
        return
    nodes = []
    weights = []
    for row in card.rows:
        nodes.append(reading.mesh.nodes(row[0], space))
        weight = number_of(card, row[1]) if len(row) > 1 else 1.0
        weights.append(np.full(len(nodes[-1]), weight))
    every = np.concatenate(nodes)
    if not len(every):
        reading.told.refuse(card, f"there is no node or set {card.rows[0][0]!r}; mend the name.")
        return
    x = reading.mesh.mesh.points[every]
    place = np.average(x, axis=0, weights=np.concatenate(weights))
    reference = int(reading.mesh.nodes(elements[0][1], space)[0])
    name = card.rows[0][0] if len(card.rows) == 1 else elset
    grip = Grip(name, np.unique(every), "", reference, None, False, ALL_COMPONENTS, card)
    reading.grips.append(replace(grip, place=tuple(map(float, place))))


def _finish_coupling(reading: DeckReading, card: Card, *, rigid: bool) -> None:
    """Complete the coupling to which a card belongs."""
    coupling = reading.below(card, Grip, "COUPLING")
    if coupling is None:
        return
    components: list[int] = []
    for line in range(len(card.lines)):
        numbers = [int(number) for number in numbers_in(card, line)]
        if numbers:
            components += range(numbers[0], numbers[-1] + 1)
    named = tuple(components) or ALL_COMPONENTS
    reading.grips.append(replace(coupling, rigid=rigid, components=named, card=card))
