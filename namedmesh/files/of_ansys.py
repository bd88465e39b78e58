"""Read archives of ANSYS Mechanical APDL (.cdb, ds.dat), with their components.

Nodes and elements are blocks of fields of fixed width, which a line before them tells.
The nodes of an element are slots: a prism, a pyramid or a tetrahedron in the slots of a
hexahedron has nodes several times.

Source: ANSYS, Mechanical APDL, commands NBLOCK, EBLOCK, CMBLOCK and ET, and the element
library.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.abaqus_cards import text_of
from namedmesh.files.file_mesh import Block, ElementSet, FileMesh, NodeSet, by_tags, members_of
from namedmesh.rows import places_of, rows_within

BRICKS = (
    *(5, 30, 45, 62, 64, 65, 69, 70, 90, 95, 96, 97, 107, 117, 120, 122, 147, 164, 185, 186),
    *(190, 215, 220, 226, 231, 236, 239, 278, 279),
)
"""Types of elements with the slots of hexahedra."""
TETRAHEDRA = (72, 87, 92, 98, 119, 123, 127, 148, 168, 187, 221, 227, 232, 237, 240, 285, 291)
"""Types of tetrahedra."""
PLANES = (
    *(2, 13, 25, 29, 35, 42, 53, 55, 75, 77, 78, 82, 83, 121, 141, 145, 162, 182, 183),
    *(222, 223, 230, 233, 238, 292, 293),
)
"""Types of plane elements, with the slots of quadrilaterals or triangles."""
SHELLS = (28, 41, 43, 57, 63, 91, 93, 99, 131, 132, 143, 157, 163, 181, 281)
"""Types of shells, with the same slots."""
ON_SIDES = {
    **{170: "TARGE170", 173: "CONTA173", 174: "CONTA174"},
    **{152: "SURF152", 154: "SURF154"},
}
"""Names of types of elements on sides of solids, with the same slots."""
MESH_ONLY = 200
"""Type of elements that are a mesh alone, whose first option tells their nodes."""
OF_OPTION = {
    **dict.fromkeys((4, 5, 6, 7), PLANES[0]),
    **dict.fromkeys((8, 9), TETRAHEDRA[0]),
    **dict.fromkeys((10, 11), BRICKS[0]),
}
"""A type with the same slots by this option."""
BRICK_FORMS = {
    "tetrahedron": ((0, 1, 2, 4), (8, 9, 11, 16, 17, 18)),
    "pyramid": ((0, 1, 2, 3, 4), (8, 9, 10, 11, 16, 17, 18, 19)),
    "prism": ((0, 1, 2, 4, 5, 6), (8, 9, 11, 12, 13, 15, 16, 17, 18)),
    "hexahedron": (tuple(range(8)), tuple(range(8, 20))),
}
"""Slots of corners and of nodes between them, of each shape in a hexahedron."""
FIELD = re.compile(r"(\d*)[iefg](\d+)(?:\.\d+(?:e\d+)?)?", re.IGNORECASE)
"""Fields of a format of Fortran: their number and width."""
MOST_FIELDS = 100
"""Greatest number of fields of a line."""
HEAD = 11
"""Fields of an element before its nodes."""
MATERIAL, TYPE, REAL, COUNT, NUMBER = 0, 1, 2, 8, 10
"""Fields of its material, type, real constants, number of nodes, and number."""
SLOTS = 20
"""Greatest number of nodes that are taken of an element."""
INNER = "_"
"""Beginning of names of components that ANSYS makes for its own use."""


@dataclass
class _Archive:
    """Collect what an archive has.

    Attributes:
        types: Number of each type in the archive -> its number in the library.
        options: Number of each type in the archive -> its first option.
        nodes: Rows of number and coordinates.
        elements: Rows of fields of elements, with nodes padded by 0.
        components: Name of each component, whether it has nodes, and ranges of numbers.
        left_out: Kind of elements that are not read -> their number.
    """

    types: dict[int, int] = field(default_factory=dict)
    options: dict[int, int] = field(default_factory=dict)
    nodes: list[list[float]] = field(default_factory=list)
    elements: list[list[int]] = field(default_factory=list)
    components: list[tuple[str, bool, np.ndarray]] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)


def mesh_of_ansys(path: Path) -> FileMesh:
    """Read an archive of ANSYS.

    Raises:
        InputError: If it has no block of nodes, or the nodes of an element are missing.
    """
    archive = _archive(text_of(path).splitlines())
    if not archive.nodes:
        raise InputError("it has no block of nodes (NBLOCK); let ANSYS write it by CDWRITE,DB.")
    nodes = np.array(archive.nodes)
    node_numbers = nodes[:, 0].astype(np.int64)
    table = np.array(archive.elements, dtype=np.int64).reshape(-1, HEAD + SLOTS)
    blocks: list[Block] = []
    numbers: list[np.ndarray] = []
    materials: list[np.ndarray] = []
    on_sides: dict[str, list[int]] = {}
    for tag in np.unique(table[:, TYPE]).tolist():
        of_type = table[table[:, TYPE] == tag]
        kind = archive.types.get(tag, 0)
        if kind == MESH_ONLY:
            kind = OF_OPTION.get(archive.options.get(tag, 0), kind)
        pieces = list(_pieces(kind, of_type))
        left = len(of_type) - sum(len(chosen) for _, chosen, _ in pieces)
        if left:
            archive.left_out[str(kind) if kind else "without ET"] += left
        for shape, chosen, slots in pieces:
            blocks.append(Block(shape, places_of(node_numbers, chosen[:, HEAD:][:, slots])))
            numbers.append(chosen[:, NUMBER])
            materials.append(chosen[:, MATERIAL] * (kind not in ON_SIDES))
        if kind in ON_SIDES:
            # The two sides of a contact have the same real constants.
            for real, number in of_type[:, [REAL, NUMBER]].tolist():
                on_sides.setdefault(f"{ON_SIDES[kind]} {real}", []).append(number)
    element_sets, node_sets = _sets(archive, numbers, node_numbers)
    if not element_sets:
        element_sets = [named for named in by_tags(tuple(blocks), materials, {}) if named.tag]
    for name, members in on_sides.items():
        found = members_of(numbers, np.array(members))
        element_sets.append(ElementSet(name, found, weak=True))
    return FileMesh(
        nodes[:, 1:],
        tuple(blocks),
        tuple(element_sets),
        node_sets=tuple(node_sets),
        left_out=archive.left_out,
    )


# -- the text
# ---------------------------------------------------------------------------------


def _archive(lines: list[str]) -> _Archive:
    """Read types, blocks and components of the lines of an archive."""
    archive = _Archive()
    for at, line in enumerate(lines):
        words = [word.strip() for word in line.partition("!")[0].split(",")]
        keyword = words[0].upper()
        if keyword == "ET" and len(words) > 2:
            _add_type(archive, words[1], words[2])
        elif keyword == "ETBLOCK":
            for row in _rows(lines, at + 1)[1]:
                _add_type(archive, *row.split()[:2])
        elif keyword in ("KEYOP", "KEYOPT", "KEYO") and words[1].isdigit() and words[2] == "1":
            archive.options[int(words[1])] = int(float(words[3] or 0))
        elif keyword == "NBLOCK":
            archive.nodes += _nodes(lines, at + 1)
        elif keyword == "EBLOCK":
            widths, rows = _rows(lines, at + 1)
            if "SOLID" in [word.upper() for word in words]:
                archive.elements += _elements(widths[0], rows)
            else:
                archive.left_out["EBLOCK without SOLID"] += len(rows)
        elif keyword == "CMBLOCK" and words[2].upper() in ("NODE", "ELEM"):
            widths, rows = _rows(lines, at + 1)
            numbers = [number for row in rows for number in _integers(row, widths[0])]
            archive.components.append((words[1], words[2].upper() == "NODE", _ranges(numbers)))
    return archive


def _add_type(archive: _Archive, number: str, name: str) -> None:
    """Add a type, which is called by its number in the library or by its name."""
    found = re.search(r"\d+$", name)
    # A number may be the name of a parameter.
    if number.isdigit() and found:
        archive.types[int(number)] = int(found[0])


def _rows(lines: list[str], at: int) -> tuple[list[int], list[str]]:
    """Return the widths of the fields of a block, and its lines.

    Args:
        lines: The lines of the archive.
        at: The line with the format. Lines of numbers follow, up to a line with -1 or
            with a command.

    Raises:
        InputError: If it is no format.
    """
    widths: list[int] = []
    for count, width in FIELD.findall(lines[at] if at < len(lines) else ""):
        widths += [int(width)] * min(int(count or 1), MOST_FIELDS)
    if not widths or min(widths) < 1:
        raise InputError(f"line {at + 1} is no format of a block, as (3i9,6e21.13e3).")
    end = at + 1
    while end < len(lines):
        word = lines[end].strip()
        if word == "-1" or not word or not (word[0].isdigit() or word[0] in "-+."):
            break
        end += 1
    return widths, lines[at + 1 : end]


def _nodes(lines: list[str], at: int) -> list[list[float]]:
    """Return the number and the coordinates of the nodes of a block.

    Coordinates that are zero may be missing at the end of a line. Angles follow them.
    """
    widths, rows = _rows(lines, at)
    ends = np.cumsum(widths).tolist()
    # Whole numbers come before three coordinates, and all coordinates are as wide.
    first = next(i for i, width in enumerate(widths) if width == widths[-1])
    nodes = []
    for row in rows:
        words = [row[end - widths[-1] : end].strip() for end in ends[first : first + 3]]
        nodes.append([float(row[: ends[0]]), *(float(word) if word else 0.0 for word in words)])
    return nodes


def _elements(width: int, rows: list[str]) -> list[list[int]]:
    """Return the fields of elements, whose nodes may go on in further lines.

    Raises:
        InputError: If nodes are missing.
    """
    elements = []
    lines = iter(rows)
    for line in lines:
        fields = _integers(line, width)
        count = fields[COUNT]
        while len(fields) < HEAD + count:
            more = _integers(next(lines, ""), width)
            if not more:
                raise InputError(
                    f"element {fields[NUMBER]} has {len(fields) - HEAD} nodes of {count}; the file "
                    "is cut off."
                )
            fields += more
        # Elements on sides may have one more node, off the side.
        fields = fields[: HEAD + min(count, SLOTS)]
        elements.append(fields + [0] * (HEAD + SLOTS - len(fields)))
    return elements


def _integers(line: str, width: int) -> list[int]:
    """Return the whole numbers of a line, whose fields have a width."""
    text = line.rstrip()
    return [int(text[begin : begin + width] or 0) for begin in range(0, len(text), width)]


def _ranges(numbers: list[int]) -> np.ndarray:
    """Return the ranges of a component, shape (n, 2); a number below zero ends one."""
    ranges: list[list[int]] = []
    for number in numbers:
        if number < 0 and ranges:
            ranges[-1][1] = -number
        else:
            ranges.append([number, number])
    return np.array(ranges, dtype=np.int64).reshape(-1, 2)


# -- the mesh
# ---------------------------------------------------------------------------------


def _pieces(kind: int, table: np.ndarray) -> Iterator[tuple[str, np.ndarray, list[int]]]:
    """Iterate over the shapes among elements of a type, their rows, and their slots."""
    if kind in BRICKS:
        yield from _bricks(table)
    elif kind in TETRAHEDRA:
        yield "tetrahedron", table, _with_middles(table, (0, 1, 2, 3), tuple(range(4, 10)))
    elif kind in PLANES or kind in SHELLS or kind in ON_SIDES:
        yield from _planes(table)


def _bricks(table: np.ndarray) -> Iterator[tuple[str, np.ndarray, list[int]]]:
    """Iterate over the shapes among elements with the slots of hexahedra."""
    _, _, k, level, m, n, o, p = table[:, HEAD : HEAD + 8].T
    is_apex = (m == n) & (n == o) & (o == p)
    is_triangle = k == level
    forms = {
        "tetrahedron": is_apex & is_triangle,
        "pyramid": is_apex & ~is_triangle,
        "prism": ~is_apex & is_triangle & (o == p),
    }
    forms["hexahedron"] = ~(forms["tetrahedron"] | forms["pyramid"] | forms["prism"])
    for shape, chosen in forms.items():
        if chosen.any():
            yield shape, table[chosen], _with_middles(table[chosen], *BRICK_FORMS[shape])


def _planes(table: np.ndarray) -> Iterator[tuple[str, np.ndarray, list[int]]]:
    """Iterate over triangles and quadrilaterals among elements."""
    slots = table[:, HEAD:]
    count = table[:, COUNT]
    of_triangle = (count == 3) | (count == 6)
    repeated = ~of_triangle & (count >= 4) & (slots[:, 2] == slots[:, 3])
    for chosen, middles in ((of_triangle, (3, 4, 5)), (repeated, (4, 5, 7))):
        if chosen.any():
            yield "triangle", table[chosen], _with_middles(table[chosen], (0, 1, 2), middles)
    chosen = (count >= 4) & ~of_triangle & ~repeated
    if chosen.any():
        # A fifth node lies off the side.
        rows = table[chosen]
        has_middles = (rows[:, COUNT] >= 8).any()
        yield "quadrilateral", rows, list(range(8 if has_middles else 4))


def _with_middles(
    table: np.ndarray, corners: tuple[int, ...], middles: tuple[int, ...]
) -> list[int]:
    """Return the slots of corners, and of nodes between them if an element has any."""
    has_middles = (table[:, HEAD:][:, middles] > 0).any()
    return [*corners, *middles] if has_middles else [*corners]


def _sets(
    archive: _Archive, element_numbers: list[np.ndarray], node_numbers: np.ndarray
) -> tuple[list[ElementSet], list[NodeSet]]:
    """Return the components that a user has named."""
    element_sets = []
    node_sets = []
    for name, of_nodes, ranges in archive.components:
        if name.startswith(INNER):
            continue
        if of_nodes:
            node_sets.append(NodeSet(name, rows_within(node_numbers, ranges)))
        else:
            found = [rows_within(numbers, ranges) for numbers in element_numbers]
            members = {block: rows for block, rows in enumerate(found) if len(rows)}
            element_sets.append(ElementSet(name, members))
    return element_sets, node_sets
