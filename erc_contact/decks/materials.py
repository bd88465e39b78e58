"""Read materials and sections, and make the material of a scene of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.decks.heat import at_temperatures
from erc_contact.decks.orthotropic import CONSTANTS, STIFFNESSES, read_orthotropic
from erc_contact.decks.reading import (
    PLASTIC_STRAIN,
    DeckReading,
    MaterialCards,
    SolidSection,
    Tensor,
)
from erc_contact.decks.told import number_of, numbers_in
from erc_contact.scene.hardening import HardeningCurve
from erc_contact.scene.material import AXISYMMETRIC, PLANE_STRAIN, PLANE_STRESS, Elastic
from erc_contact.scene.orthotropic import OrthotropicElastic
from erc_contact.scene.plastic import Plastic
from namedmesh.for_solvers import Card, DeckSpace

HYPOTHESES = {"CPS": PLANE_STRESS, "CPE": PLANE_STRAIN, "CAX": AXISYMMETRIC}
"""Beginnings of the types of plane elements, and what they stand for."""
LEAST_HARDENING = 0.01
"""Hardening of a plastic law that has none, as a share of Young's modulus [-]."""
ISOTROPIC = ("", "ISO", "ISOTROPIC")
"""Values of TYPE of isotropic data."""


def read_material(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Begin a material."""
    name = card.get("NAME")
    material = MaterialCards(name, card)
    reading.materials[name.upper()] = material
    reading.current = material


def read_elastic(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read isotropic moduli, by temperature, or orthotropic moduli."""
    material = reading.below(card, MaterialCards, "MATERIAL")
    kind = card.get("TYPE").upper()
    if kind not in (*ISOTROPIC, *STIFFNESSES, *CONSTANTS):
        reading.told.refuse(
            card, f"TYPE={card.get('TYPE')}: isotropic and orthotropic elasticity are read."
        )
    elif material and kind not in ISOTROPIC:
        read_orthotropic(reading, card, material)
    elif material:
        material.elastic = [numbers_in(card, line) for line in range(len(card.lines))]


def read_expansion(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read coefficients of thermal expansion, by temperature."""
    material = reading.below(card, MaterialCards, "MATERIAL")
    if card.get("TYPE").upper() not in ISOTROPIC:
        reading.told.refuse(card, f"TYPE={card.get('TYPE')}: isotropic expansion alone is read.")
    elif material:
        material.expansion = [numbers_in(card, line) for line in range(len(card.lines))]
        material.zero = number_of(card, card.get("ZERO"))


def read_density(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read the mass per volume."""
    material = reading.below(card, MaterialCards, "MATERIAL")
    numbers = numbers_in(card)
    if material and numbers:
        material.density = numbers[0]


def read_plastic(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read von Mises plasticity: the yield stress by the plastic strain."""
    material = reading.below(card, MaterialCards, "MATERIAL")
    rows = [numbers_in(card, line) for line in range(len(card.lines))]
    hardening = card.get("HARDENING").upper()
    if hardening not in ("", "ISOTROPIC", "KINEMATIC"):
        reading.told.refuse(card, f"HARDENING={hardening}: ISOTROPIC and KINEMATIC are read.")
    elif any(len(row) > 2 and row[2] != rows[0][2] for row in rows):
        reading.told.refuse(card, "it depends on temperature; keep the lines of one temperature.")
    elif not rows:
        reading.told.refuse(card, "it has no line; give the yield stress and 0.")
    elif len(rows) > 2 and hardening == "KINEMATIC":
        reading.told.refuse(card, "kinematic hardening is linear; keep two lines near the curve.")
    elif material:
        material.kinematic = hardening == "KINEMATIC"
        try:
            if len(rows) > 2:
                _curve_of(rows)
            material.plastic = rows
        except InputError as reason:
            reading.told.refuse(card, f"it is no curve. {reason}")


def _curve_of(rows: list[list[float]]) -> HardeningCurve:
    """Return the curve of lines of yield stress and plastic strain.

    Raises:
        InputError: If they are no curve.
    """
    return HardeningCurve([row[1] for row in rows], [row[0] for row in rows])


def read_section(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Give elements their material, and plane elements their thickness."""
    elset = card.get("ELSET")
    cells = reading.mesh.cells(elset, space)
    thickness = (numbers_in(card) or [1.0])[0] or 1.0
    if not len(cells):
        reading.told.leave_out(card, f"ELSET={elset} has no solid element")
        return
    if not card.get("MATERIAL"):
        reading.told.refuse(card, "it names no MATERIAL.")
        return
    if card.has("COMPOSITE"):
        reading.told.refuse(card, "COMPOSITE layers are not read.")
        return
    names = card.get("MATERIAL").upper(), card.get("ORIENTATION").upper()
    section = SolidSection(elset, cells, names[0], thickness, card, names[1])
    reading.sections.append(section)


def hypothesis_of(reading: DeckReading) -> str:
    """Return the hypothesis of a plane body by the types of its elements."""
    found = {}
    for part in reading.mesh.blocks:
        if part.solid and part.block.dim == 2 and reading.mesh.d == 2:
            found[HYPOTHESES.get(part.kind[:3], part.kind)] = part.kind
    element_card = next(
        card for space in reading.mesh.spaces for card in space.cards if card.keyword == "ELEMENT"
    )
    unknown = [kind for hypothesis, kind in found.items() if hypothesis == kind]
    if unknown:
        reading.told.refuse(
            element_card, f"elements of type {unknown[0]}: CPS, CPE and CAX are read."
        )
    elif len(found) > 1:
        kinds = ", ".join(found.values())
        reading.told.refuse(element_card, f"it mixes elements of types {kinds}; keep one kind.")
    return next(iter(found), PLANE_STRAIN)


def thickness_of(reading: DeckReading, hypothesis: str) -> float:
    """Return the thickness of a plane body [length], the first of several; else 1.

    In plane stress a cell of another thickness is as stiff as a cell of this thickness
    whose moduli, density and pressures are times the share of its thickness.
    """
    reading.shares = np.ones(reading.mesh.body.count)
    if reading.mesh.d == 3 or hypothesis == AXISYMMETRIC:
        return 1.0
    values = {section.thickness: section.card for section in reading.sections}
    thickness = next(iter(values), 1.0)
    numbers = ", ".join(f"{value:g}" for value in values)
    card = list(values.values())[-1] if values else None
    if card and len(values) > 1 and hypothesis != PLANE_STRESS:
        reading.told.refuse(card, f"thicknesses {numbers}: in plane strain there is one.")
    elif card and len(values) > 1:
        reading.told.assume(
            card,
            f"thicknesses {numbers}: moduli, stresses, densities and pressures are times the "
            f"thickness over {thickness:g}",
        )
        for section in reading.sections:
            reading.shares[section.cells] = section.thickness / thickness
    if card and thickness != 1.0:
        reading.told.assume(
            values[thickness],
            f"forces and energies are per unit of thickness: times {thickness:g} they are of the "
            "body",
        )
    return thickness


def thickened(material: MaterialCards, share: float) -> MaterialCards:
    """Return a material of plane stress in cells with a share of the thickness."""
    elastic = [[E * share, *others] for E, *others in material.elastic]
    plastic = [[stress * share, *others] for stress, *others in material.plastic]
    density = None if material.density is None else material.density * share
    law: Any = material.orthotropic
    if law is not None:
        E, G = (tuple(share * modulus for modulus in moduli) for moduli in (law.E, law.G))
        law = replace(law, E=E, G=G)
    return replace(material, elastic=elastic, plastic=plastic, density=density, orthotropic=law)


def material_of(
    reading: DeckReading,
    material: MaterialCards,
    hypothesis: str,
    temperatures: np.ndarray | None,
) -> Any:
    """Return a material of a scene; None if it is refused."""
    told = reading.told
    if material.orthotropic is not None:
        if material.plastic:
            told.refuse(material.card, f"{material.name!r}: *PLASTIC is read of isotropic moduli.")
        return replace(material.orthotropic, hypothesis=hypothesis)
    if not material.elastic or not material.elastic[0]:
        told.refuse(material.card, f"{material.name!r} has no *ELASTIC; give E and nu.")
        return None
    if len(material.elastic) > 1:
        at = "the first temperature" if temperatures is None else "the last temperatures"
        told.assume(material.card, f"{material.name!r}: moduli are taken at {at}")
    E, nu, *_ = [*at_temperatures(reading.mesh, material.elastic, 2, temperatures), 0.0]
    if not material.plastic:
        return Elastic(E, nu, hypothesis=hypothesis)
    if hypothesis == PLANE_STRESS:
        told.refuse(material.card, f"{material.name!r}: *PLASTIC does not exist in plane stress.")
        return None
    return _plastic_of(reading, material, E, nu, hypothesis)


def _plastic_of(
    reading: DeckReading, material: MaterialCards, E: Any, nu: Any, hypothesis: str
) -> Plastic:
    """Return the plastic law of a material."""
    rows = material.plastic
    if len(rows) > 2:
        curve = _curve_of(rows)
        if curve.of_law() != curve:
            reading.told.assume(
                material.card,
                f"{material.name!r} hardens by a tenth of its yield stress per unit of plastic "
                "strain where *PLASTIC hardens less, as no error is certified without",
            )
        return Plastic(E, nu, hardening=curve, hypothesis=hypothesis)
    slope = 0.0
    if len(rows) == 2:
        slope = (rows[1][0] - rows[0][0]) / (rows[1][1] - rows[0][1])
        reading.told.assume(
            material.card, f"{material.name!r} hardens linearly, also beyond its last line"
        )
    if slope <= 0.0:
        slope = LEAST_HARDENING * material.elastic[0][0]
        reading.told.assume(
            material.card,
            f"{material.name!r} has no hardening: it hardens by {slope:g}, 1% of E, as no error is "
            "certified without",
        )
    hardening, kinematic = (0.0, slope) if material.kinematic else (slope, 0.0)
    return Plastic(E, nu, rows[0][0], hardening, kinematic, hypothesis=hypothesis)


def eigenstrains_of(
    reading: DeckReading, regions: Mapping[str, np.ndarray], materials: Mapping[str, Any]
) -> dict[str, Tensor]:
    """Return the strains that regions have before all steps.

    They are plastic strains of the deck, or ``-C^-1 s`` of a stress s of the deck: the
    stress of a body with this given strain is s where it is not strained.
    """
    result = {}
    for region, cells in regions.items():
        if int(cells[0]) not in reading.tensors:
            continue
        tensor, card = reading.tensors[int(cells[0])]
        if card.get("TYPE").upper() == PLASTIC_STRAIN:
            result[region] = tensor
            continue
        material = materials[region]
        if isinstance(material, OrthotropicElastic):
            reading.told.refuse(card, "its material is orthotropic.")
            continue
        if callable(material.E) or callable(material.nu):
            reading.told.refuse(card, "its material has moduli that vary in the body.")
            continue
        s = np.array(tensor)
        strain = (material.nu * np.trace(s) * np.eye(3) - (1.0 + material.nu) * s) / material.E
        result[region] = tuple(map(tuple, strain.tolist()))
    return result
