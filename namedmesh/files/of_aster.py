"""Read meshes of code_aster as text (.mail), with their groups of cells and nodes.

Source: code_aster, U3.01.00, "Description of the mesh file of Code_Aster".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.abaqus_cards import text_of
from namedmesh.files.file_mesh import Block, ElementSet, FileMesh, NodeSet, members_of
from namedmesh.rows import in_space

CELLS = re.compile(r"(POI|SEG|TRIA|QUAD|TETRA|PYRAM|PENTA|HEXA)(\d{1,2})$")
"""Keyword of cells: its shape, and its number of nodes."""
SHAPE_NAMES = {
    "POI": "vertex",
    "SEG": "line",
    "TRIA": "triangle",
    "QUAD": "quadrilateral",
    "TETRA": "tetrahedron",
    "PYRAM": "pyramid",
    "PENTA": "prism",
    "HEXA": "hexahedron",
}
"""Shape by code_aster's word."""
POINTS = {"COOR_2D": 2, "COOR_3D": 3}
"""Dimension of space by the keyword of points."""
GROUPS = ("GROUP_NO", "GROUP_MA")
"""Keywords of groups of nodes and of cells."""
OPTION = re.compile(r"\b(NOM|NBOBJ|NBLIGE|NBLIGT|NUMIN|NUMAX|AUTEUR|DATE)\s*=\s*(\S*)")
"""What a keyword may say before its data. Only the name has a meaning."""


def mesh_of_aster(path: Path) -> FileMesh:
    """Read a mesh of code_aster.

    Raises:
        InputError: If it has no points, or rows of other lengths than its keywords say.
    """
    numbers: dict[str, int] = {}
    points = [np.empty((0, 3))]
    rows: list[tuple[str, np.ndarray]] = []
    groups: list[tuple[str, str, list[str]]] = []
    for keyword, name, words in _sections(text_of(path)):
        cells = CELLS.match(keyword)
        if keyword in POINTS:
            table = _table(keyword, words, POINTS[keyword])
            first = sum(map(len, points))
            numbers.update({word: first + i for i, word in enumerate(table[:, 0].tolist())})
            # Exponents of Fortran begin with a D.
            places = np.char.replace(np.char.upper(table[:, 1:]), "D", "E")
            points.append(in_space(places.astype(float)))
        elif cells:
            rows.append((cells[1], _table(keyword, words, int(cells[2]))))
        elif keyword in GROUPS and (name or words):
            members = words if name else words[1:]
            groups.append((keyword, name or words[0], members))
    if not numbers:
        raise InputError("it has no points (COOR_2D or COOR_3D).")
    blocks = []
    cell_names = []
    for kind, table in rows:
        nodes = [numbers.get(word, -1) for word in table[:, 1:].ravel()]
        shape = (len(table), table.shape[1] - 1)
        blocks.append(Block(SHAPE_NAMES[kind], np.array(nodes, dtype=np.int64).reshape(shape)))
        cell_names.append(table[:, 0])
    element_sets = []
    node_sets = []
    for keyword, name, members in groups:
        if keyword == "GROUP_MA":
            element_sets.append(ElementSet(name, members_of(cell_names, np.array(members))))
        else:
            known = [numbers[word] for word in members if word in numbers]
            node_sets.append(NodeSet(name, np.array(known, dtype=np.int64)))
    return FileMesh(
        np.concatenate(points), tuple(blocks), tuple(element_sets), node_sets=tuple(node_sets)
    )


def _sections(text: str) -> Iterator[tuple[str, str, list[str]]]:
    """Iterate over the keywords, the name that each gives, and its words of data."""
    keyword = ""
    name = ""
    words: list[str] = []
    for line in text.splitlines():
        content = line.partition("%")[0].strip()
        first = (content.split() or [""])[0].upper()
        if first == "FIN":
            return
        if first == "FINSF":
            yield keyword, name, words
            keyword = ""
        elif keyword:
            # An equals sign stands for a blank.
            words += OPTION.sub("", content).replace("=", " ").split()
        elif first:
            keyword = first
            name = dict(OPTION.findall(content)).get("NOM", "")
            words = []


def _table(keyword: str, words: list[str], columns: int) -> np.ndarray:
    """Return rows of a name and other words, shape (n, 1 + columns).

    Raises:
        InputError: If the rows are not whole.
    """
    if len(words) % (1 + columns):
        raise InputError(
            f"below {keyword} are {len(words)} words, and each row has a name and {columns} words; "
            "look at its lines."
        )
    return np.array(words, dtype=str).reshape(-1, 1 + columns)
