"""Read the text files of Abaqus, CalculiX and FrontISTR, with their sets and surfaces.

Points, elements and sets are read, of parts and their instances, too. Elements that are
no solids are left out and counted.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from namedmesh.files.abaqus_cards import Card, cards_of
from namedmesh.files.abaqus_tables import DeckSpace, Tables, tables_of
from namedmesh.files.file_mesh import SHAPES, Block, ElementSet, FacetSet, FileMesh, NodeSet, pad
from namedmesh.files.hecmw_cards import cards_of_hecmw
from namedmesh.files.sets import list_names

FACES = {
    "tetrahedron": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "hexahedron": (
        (0, 1, 2, 3),
        (4, 7, 6, 5),
        (0, 4, 5, 1),
        (1, 5, 6, 2),
        (2, 6, 7, 3),
        (3, 7, 4, 0),
    ),
    "prism": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
}
"""Corners of the faces S1, S2, ... of each shape."""
INNER = re.compile(r"_|internal", re.IGNORECASE)
"""Beginning of names of sets that programs make for their own use."""
ROUND = re.compile(r"C?G?AX|DCAX")
"""Pattern of the types of axisymmetric bodies."""


def mesh_of_abaqus(path: Path) -> FileMesh:
    """Read a text file of Abaqus or CalculiX, with its sets and surfaces.

    Raises:
        InputError: If it has no nodes, or a card that computes them.
    """
    return _mesh_of_cards(list(cards_of(path)))


def mesh_of_hecmw(path: Path) -> FileMesh:
    """Read a mesh of FrontISTR, whose cards are cards of Abaqus under other names.

    Raises:
        InputError: If it has no nodes, or a group of sides has no pairs.
    """
    return _mesh_of_cards(cards_of_hecmw(path))


def _mesh_of_cards(cards: list[Card]) -> FileMesh:
    """Return the mesh of cards, with its sets and surfaces."""
    mesh = tables_of(cards)
    # Sets and surfaces have rows of all elements, which become numbers in blocks.
    dim, blocks, left_out = blocks_of(mesh)
    begins = np.array([part.begin for part in mesh.blocks])
    lines: dict[tuple[str, bool, int], list[np.ndarray]] = {}
    for name, faces in mesh.surfaces.items():
        for rows, face in faces:
            for block, elements in _members(begins, rows).items():
                for corners in _facets(blocks[block], elements, face):
                    key = (name, face is None, corners.shape[1])
                    lines.setdefault(key, []).append(corners)
    # A surface may have a line for each face.
    facet_sets = []
    for (name, is_outer, width), tables in lines.items():
        if width == 2 * (dim - 1):
            facet_sets.append(FacetSet(name, np.concatenate(tables), outer=is_outer))
    element_sets, node_sets = _sets(mesh, begins)
    passed = []
    for space in mesh.spaces:
        hidden = [name for name in space.element_sets if name in space.hidden]
        passed += [space.spelling[name] for name in hidden if not INNER.match(name)]
    if passed:
        mesh.notes.append(
            f"sets of elements that surfaces have are no regions: {list_names(passed)}"
        )
    round_ = sorted({part.kind for part in mesh.blocks if ROUND.match(part.kind)})
    notes = [
        f"cells of type {kind} are axisymmetric: give the material hypothesis='axisymmetric'"
        for kind in round_
    ]
    return FileMesh(
        np.concatenate(mesh.points),
        tuple(blocks),
        tuple(element_sets),
        tuple(facet_sets),
        tuple(node_sets),
        left_out,
        notes=(*mesh.notes, *notes),
    )


def blocks_of(mesh: Tables) -> tuple[int, list[Block], Counter[str]]:
    """Return the dimension of the body, its cells and sides, and what is neither.

    Returns:
        The dimension, the blocks of the tables, of which blocks of other elements are
        points, and the number of these elements by their type.
    """
    dim = max((part.block.dim for part in mesh.blocks if part.solid), default=0)
    left_out = Counter(mesh.left_out)
    blocks = []
    for part in mesh.blocks:
        fits = part.block.dim == dim - 1 or (part.solid and part.block.dim == dim)
        if not fits:
            left_out[part.kind] += len(part.block.nodes)
        # The numbers of the other blocks stay.
        blocks.append(part.block if fits else Block("vertex", part.block.nodes[:, :1]))
    return dim, blocks, left_out


def _members(begins: np.ndarray, rows: Sequence[int] | np.ndarray) -> dict[int, np.ndarray]:
    """Return the numbers in blocks of elements that are given by their rows."""
    every = np.unique(np.asarray(rows, dtype=np.int64))
    block = np.searchsorted(begins, every, side="right") - 1
    return {int(b): every[block == b] - begins[b] for b in np.unique(block)}


def _sets(mesh: Tables, begins: np.ndarray) -> tuple[list[ElementSet], list[NodeSet]]:
    """Return the sets of elements and of nodes that a user has named."""
    element_sets = []
    node_sets = []
    root, *instances = mesh.spaces
    # The sets of an assembly stand for the sets of its parts.
    of_elements = [root] if root.element_sets else mesh.spaces
    of_nodes = [root] if root.node_sets else mesh.spaces
    several = _names_of_several(mesh.spaces)
    for space in of_elements:
        for name, rows in space.element_sets.items():
            if name not in space.hidden and not INNER.match(name):
                called = _name_of(space, name, several)
                weak = name not in space.listed
                element_sets.append(ElementSet(called, _members(begins, rows), weak=weak))
    for space in of_nodes:
        for name, rows in space.node_sets.items():
            if not INNER.match(name):
                called = _name_of(space, name, several)
                nodes = np.unique(np.asarray(rows, dtype=np.int64))
                node_sets.append(NodeSet(called, nodes, weak=name not in space.listed))
    instances = [space for space in instances if space.element_rows]
    if len(instances) > 1:
        for space in instances:
            members = _members(begins, list(space.element_rows.values()))
            element_sets.append(ElementSet(space.name, members, weak=True))
    for name, rows in mesh.node_surfaces.items():
        node_sets.append(NodeSet(name, np.unique(np.asarray(rows, dtype=np.int64))))
    return element_sets, node_sets


def _names_of_several(spaces: Sequence[DeckSpace]) -> set[str]:
    """Return the names that sets of several instances have."""
    counts: Counter[str] = Counter()
    for space in spaces:
        counts.update({*space.element_sets, *space.node_sets})
    return {name for name, count in counts.items() if count > 1}


def _name_of(space: DeckSpace, name: str, several: set[str]) -> str:
    """Return the name of a set, with the name of its instance if several have it."""
    spelled = space.spelling.get(name, name)
    return f"{space.name}.{spelled}" if space.name and name in several else spelled


def _facets(block: Block, elements: np.ndarray, face: int | None) -> list[np.ndarray]:
    """Return the corners of faces of elements by number; None means all their faces."""
    faces = FACES.get(block.shape, ())
    if face is None:
        sides = SHAPES[block.shape].faces
        return [pad(block.nodes[elements][:, corners]) for corners in sides]
    if face >= len(faces):
        return []
    return [pad(block.nodes[elements][:, faces[face]])]
