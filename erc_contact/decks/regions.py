"""Make regions of the sections and bodies of a deck, with the names of its sets."""

from __future__ import annotations

import numpy as np

from erc_contact.decks.materials import thickened
from erc_contact.decks.orthotropic import turned
from erc_contact.decks.reading import DeckReading, MaterialCards, Tensor


def regions_of(reading: DeckReading) -> tuple[dict[str, np.ndarray], dict[str, MaterialCards]]:
    """Return the cells and the material of each region.

    A region has one section and one stress at the beginning, and its cells are
    connected.

    Returns:
        The cells, and the materials, by the names of the regions.
    """
    mesh = reading.mesh
    section_of_cell = np.full(mesh.body.count, -1)
    for number, section in enumerate(reading.sections):
        section_of_cell[section.cells] = number
    cells = np.concatenate(mesh.body.numbers)
    without = cells[section_of_cell[cells] < 0]
    if len(without):
        card = next(
            card for space in mesh.spaces for card in space.cards if card.keyword == "ELEMENT"
        )
        reading.told.refuse(
            card, f"{len(without)} elements have no *SOLID SECTION; give them a material."
        )
        return {}, {}
    pieces = _pieces(reading)
    tensors = _numbers_of_tensors(reading)
    keys = np.column_stack([section_of_cell[cells], pieces[cells], tensors[cells]])
    found, region_of_cell = np.unique(keys, axis=0, return_inverse=True)
    members = [np.sort(cells[region_of_cell.ravel() == i]) for i in range(len(found))]
    names = _names(reading, [int(section) for section in found[:, 0]], members)
    regions = dict(zip(names, members, strict=True))
    materials = {}
    made: dict[tuple[str, float, str], MaterialCards] = {}
    for name, number in zip(names, found[:, 0], strict=True):
        section = reading.sections[number]
        material = reading.materials.get(section.material)
        if material is None:
            reading.told.refuse(section.card, f"no *MATERIAL is called {section.material!r}.")
            return {}, {}
        share = float(reading.shares[regions[name][0]])
        axes = section.orientation if material.orthotropic else ""
        key = (section.material, share, axes)
        if key not in made:
            made[key] = turned(reading, thickened(material, share), section)
        materials[name] = made[key]
    return regions, materials


def _numbers_of_tensors(reading: DeckReading) -> np.ndarray:
    """Return a number of the tensor that each cell has at the beginning, 0 without."""
    numbers = np.zeros(reading.mesh.body.count, dtype=np.int64)
    known: dict[Tensor, int] = {}
    for cell, (tensor, _) in reading.tensors.items():
        numbers[cell] = known.setdefault(tensor, len(known) + 1)
    return numbers


def _pieces(reading: DeckReading) -> np.ndarray:
    """Return the number of the connected piece of each cell; cuts separate pieces."""
    mesh = reading.mesh
    cuts = [np.empty(0, dtype=np.int64)]
    sides = []
    for pretension in reading.pretensions:
        faces = mesh.surface(pretension.surface)
        if faces is None or not len(faces):
            reading.told.refuse(
                pretension.card, f"no surface is called {pretension.surface!r}; mend the name."
            )
            continue
        cuts.append(faces)
        sides.append(mesh.cells_of_surface(pretension.surface))
    pieces = mesh.pieces(np.concatenate(cuts))
    for cells, faces in zip(sides, cuts[1:], strict=True):
        beside = np.setdiff1d(mesh.cells_at(faces), cells)
        # A cut through one of two legs separates nothing: its layer of cells does.
        if np.isin(pieces[beside], pieces[cells]).any():
            pieces[cells] = pieces.max() + 1
    return pieces


def _names(reading: DeckReading, sections: list[int], members: list[np.ndarray]) -> list[str]:
    """Return the names of regions: of a set with their cells, else of their section."""
    exact = _sets_by_cells(reading)
    names: list[str] = []
    for section, cells in zip(sections, members, strict=True):
        elset = reading.sections[section].elset
        several = [reading.sections[i].elset for i in sections].count(elset) > 1
        candidates = [name for name in exact.get(cells.tobytes(), []) if name not in names]
        if not several and elset not in names:
            candidates = [elset]
        number = 1
        name = candidates[0] if candidates else f"{elset} {number}"
        while name in names:
            number += 1
            name = f"{elset} {number}"
        names.append(name)
    return names


def _sets_by_cells(reading: DeckReading) -> dict[bytes, list[str]]:
    """Return the names of the sets of elements, and of instances, by their cells."""
    result: dict[bytes, list[str]] = {}
    for space in reading.mesh.spaces:
        for name in space.element_sets:
            cells = np.sort(reading.mesh.cells(name, space)).astype(np.int64)
            result.setdefault(cells.tobytes(), []).append(space.spelling.get(name, name))
        if space.name and space.element_rows:
            cells = reading.mesh.cells_of_space(space)
            result.setdefault(cells.tobytes(), []).insert(0, space.name)
    return result
