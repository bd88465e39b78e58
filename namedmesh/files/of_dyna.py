"""Read the mesh of decks of LS-DYNA (.k), with parts and sets of nodes and segments.

Lines of data have fields of fixed width, or words between commas. A tetrahedron, a
pyramid or a prism in the eight slots of a solid has nodes several times.

Source: LS-DYNA, Keyword User's Manual, volume I, *NODE, *ELEMENT_SOLID, *ELEMENT_SHELL,
*PART, *SET_NODE, *SET_SEGMENT, *SET_PART and *INCLUDE.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.abaqus_cards import Included
from namedmesh.files.beside import beside
from namedmesh.files.file_mesh import Block, ElementSet, FacetSet, FileMesh, NodeSet, members_of
from namedmesh.rows import places_of, rows_within

LINES_AFTER = {
    **{"SOLID": 0, "SOLID_ORTHO": 2, "SOLID_DOF": 1, "SOLID_TET4TOTET10": 0, "SOLID_H8TOH20": 0},
    **{"SOLID_H20": 0, "TSHELL": 0, "TSHELL_BETA": 1},
    **{"SHELL": 0, "SHELL_THICKNESS": 1, "SHELL_BETA": 1, "SHELL_MCID": 1, "SHELL_OFFSET": 1},
}
"""Lines after the nodes of each element by the words after ELEMENT_."""
PARTS = ("PART", "PART_INERTIA", "PART_CONTACT")
"""Keywords that give parts titles."""
MOVERS = ("INCLUDE_TRANSFORM", "NODE_TRANSFORM", "NODE_SCALED", "INCLUDE_COMPENSATION")
"""Beginnings of keywords that move nodes."""
WIDTHS = {"": 8, "%": 10, "+": 20}
"""Width of whole numbers of nodes and elements by the mark after a keyword."""
COORDINATE = 16
"""Width of a coordinate, if whole numbers are not wider."""
OF_SETS = 10
"""Width of the fields of other keywords, if whole numbers are not wider."""
SLOTS = 20
"""Greatest number of nodes of an element."""


@dataclass(frozen=True)
class _Keyword:
    """Hold a keyword in capitals, its lines of data, and the width of whole numbers."""

    name: str
    width: int
    lines: list[str]

    def rows(self, *widths: int) -> list[list[str]]:
        """Return the words of each line, whose fields have the widths."""
        return [_words(line, widths) for line in self.lines]


@dataclass
class _Keyfile:
    """Collect what a deck has.

    Attributes:
        nodes: Rows of number and coordinates.
        elements: Rows of number, part, and nodes padded by 0, by kind.
        titles: Title of each part by its number.
        node_sets: Name of each set, and first and last numbers of nodes.
        part_sets: Name and numbers of parts of each set.
        segments: Name and rows of four nodes of each set of segments.
        not_read: Keywords of elements and sets that are not read.
    """

    nodes: list[list[float]] = field(default_factory=list)
    elements: dict[str, list[list[int]]] = field(default_factory=dict)
    titles: dict[int, str] = field(default_factory=dict)
    node_sets: list[tuple[str, np.ndarray]] = field(default_factory=list)
    part_sets: list[tuple[str, list[int]]] = field(default_factory=list)
    segments: list[tuple[str, np.ndarray]] = field(default_factory=list)
    not_read: Counter[str] = field(default_factory=Counter)


def mesh_of_dyna(path: Path) -> FileMesh:
    """Read the mesh of a deck of LS-DYNA and of the files that it includes.

    Raises:
        InputError: If it has no nodes, or a keyword that moves nodes.
    """
    deck = _Keyfile()
    for keyword in _keywords(path, Included(path.resolve().parent), ()):
        _add(deck, keyword)
    if not deck.nodes:
        raise InputError("it has no *NODE; read the deck that includes the mesh, or the mesh.")
    nodes = np.array(deck.nodes)
    numbers = nodes[:, 0].astype(np.int64)
    blocks = []
    parts = []
    for kind, rows in deck.elements.items():
        table = np.array(rows, dtype=np.int64)
        for shape, chosen, width in _shapes(kind, table):
            blocks.append(Block(shape, places_of(numbers, chosen[:, 2 : 2 + width])))
            parts.append(chosen[:, 1])
    dim = max((block.dim for block in blocks), default=0)
    facet_sets = []
    for name, corners in deck.segments:
        facet_sets.append(FacetSet(name, places_of(numbers, corners[:, : 2 * (dim - 1)])))
    node_sets = [NodeSet(name, rows_within(numbers, ranges)) for name, ranges in deck.node_sets]
    notes = [f"*{name}, which is not read" for name in deck.not_read]
    return FileMesh(
        nodes[:, 1:],
        tuple(blocks),
        tuple(_element_sets(deck, parts)),
        tuple(facet_sets),
        tuple(node_sets),
        notes=tuple(notes),
    )


# -- the text
# ---------------------------------------------------------------------------------


def _keywords(path: Path, files: Included, above: tuple[Path, ...]) -> Iterator[_Keyword]:
    """Iterate over the keywords of a file and of the files that it includes.

    Args:
        path: The file.
        files: What reads it and the files that it includes.
        above: The files that include it, the first file first.

    Raises:
        InputError: If files include each other, or move nodes.
    """
    is_long = False
    for keyword in _of_lines(files.lines(path, above)):
        if keyword.name.startswith(MOVERS):
            raise InputError(
                f"it moves nodes by *{keyword.name}; let LS-PrePost write the deck in one file."
            )
        if keyword.name == "INCLUDE":
            # A name goes on in the next line after a blank and a plus.
            names = "\n".join(line.strip() for line in keyword.lines).replace(" +\n", "")
            for name in names.split("\n"):
                if name:
                    file = beside(path, name.strip("\"'"), files.top)
                    yield from _keywords(file, files, (*above, path))
        elif keyword.name == "KEYWORD":
            is_long = "LONG=Y" in "".join(keyword.lines).upper().replace(" ", "")
        else:
            yield keyword if not is_long else _Keyword(keyword.name, WIDTHS["+"], keyword.lines)


def _of_lines(lines: list[str]) -> Iterator[_Keyword]:
    """Iterate over the keywords of the lines of a file, without comments."""
    keyword = _Keyword("", 0, [])
    for line in lines:
        if line.startswith("$"):
            continue
        if not line.startswith("*"):
            keyword.lines.append(line.rstrip())
            continue
        if keyword.name:
            yield keyword
        name, _, others = line[1:].strip().upper().partition(" ")
        mark = (name + others.strip())[-1:]
        width = WIDTHS.get(mark, WIDTHS[""])
        # What stands behind *KEYWORD are its options.
        options = [others] if name == "KEYWORD" else []
        keyword = _Keyword(name.rstrip("%+-"), width, options)
        if name == "END":
            return
    if keyword.name:
        yield keyword


def _words(line: str, widths: Sequence[int]) -> list[str]:
    """Return the words of a line, between commas or in fields of given widths.

    The last width is the width of all further fields.
    """
    if "," in line:
        return [word.strip() for word in line.split(",")]
    words: list[str] = []
    begin = 0
    while begin < len(line):
        width = widths[min(len(words), len(widths) - 1)]
        words.append(line[begin : begin + width].strip())
        begin += width
    return words


def _number(word: str) -> float:
    """Return the number that a word is, 0 for none.

    Raises:
        InputError: If it is the name of a parameter.
    """
    if "&" in word:
        raise InputError(
            f"it has the parameter {word!r} in place of a number; let LS-PrePost write the mesh."
        )
    return float(word) if word else 0.0


def _integers(words: list[str]) -> list[int]:
    """Return the whole numbers that words are, 0 for none."""
    return [int(_number(word)) for word in words]


def _add(deck: _Keyfile, keyword: _Keyword) -> None:
    """Add what a keyword says to a deck."""
    wide = max(keyword.width, OF_SETS)
    name = keyword.name
    if name == "NODE":
        coordinate = max(keyword.width, COORDINATE)
        for words in keyword.rows(keyword.width, coordinate):
            if words:
                numbers = [_number(word) for word in words[:4]]
                deck.nodes.append(numbers + [0.0] * (4 - len(numbers)))
    elif name.startswith("ELEMENT_") and name.removeprefix("ELEMENT_") in LINES_AFTER:
        kind = name.removeprefix("ELEMENT_")
        rows = [_integers(words) for words in keyword.rows(keyword.width) if words]
        deck.elements.setdefault(kind.split("_")[0], []).extend(_elements(kind, rows))
    elif name in PARTS:
        # Options have further lines, after which no part follows.
        ends = len(keyword.lines) if name == "PART" else 2
        for title, line in zip(keyword.lines[:ends:2], keyword.lines[1:ends:2], strict=False):
            (number,) = _integers(_words(line, [wide])[:1])
            deck.titles[number] = title.strip()
    elif name.startswith("SET_"):
        _add_set(deck, keyword, wide)
    elif name.startswith("ELEMENT_"):
        deck.not_read[name] += 1


def _elements(kind: str, rows: list[list[int]]) -> Iterator[list[int]]:
    """Iterate over elements: number, part, and nodes padded by 0."""
    lines = iter(rows)
    for first in lines:
        number, part, *nodes = first
        if kind.startswith("SOLID") and not any(nodes):
            nodes = next(lines, [])[:10]
            if kind == "SOLID_H20":
                nodes += next(lines, [])[:10]
        for _ in range(LINES_AFTER[kind]):
            next(lines, None)
        yield [number, part, *nodes[:SLOTS], *[0] * (SLOTS - len(nodes))]


def _add_set(deck: _Keyfile, keyword: _Keyword, wide: int) -> None:
    """Add a set of nodes, of segments or of parts."""
    name = keyword.name.removeprefix("SET_")
    lines = [line for line in keyword.lines if line]
    title = lines.pop(0).strip() if name.endswith("_TITLE") else ""
    kind = name.removesuffix("_TITLE")
    head, *rows = [_words(line, [wide]) for line in lines] or [[""]]
    # Sets of nodes and of segments are numbered by themselves.
    called = title or f"{kind.split('_')[0].lower()} set {head[0]}"
    numbers = [number for row in rows for number in _integers(row[:8])]
    if kind in ("NODE", "NODE_LIST", "NODE_LIST_SMOOTH"):
        deck.node_sets.append((called, np.repeat(numbers, 2).reshape(-1, 2)))
    elif kind == "NODE_LIST_GENERATE":
        ranges = numbers[: len(numbers) // 2 * 2]
        deck.node_sets.append((called, np.array(ranges, dtype=np.int64).reshape(-1, 2)))
    elif kind in ("PART", "PART_LIST"):
        deck.part_sets.append((called, numbers))
    elif kind == "SEGMENT" and rows:
        padded = [[*_integers(row[:4]), 0, 0][:4] for row in rows]
        corners = np.array(padded, dtype=np.int64)
        # A triangle has its last corner twice, or none in its place.
        corners[:, 3] = np.where(corners[:, 3] > 0, corners[:, 3], corners[:, 2])
        deck.segments.append((called, corners))
    elif kind.startswith(("NODE", "SEGMENT")):
        deck.not_read[keyword.name] += 1


# -- the mesh
# ---------------------------------------------------------------------------------


def _shapes(kind: str, table: np.ndarray) -> Iterator[tuple[str, np.ndarray, int]]:
    """Iterate over the shapes among elements, their rows, and their number of nodes."""
    slots = table[:, 2:]
    if kind == "SHELL":
        # Beyond the corners there may be four nodes between them.
        slots[:, 3] = np.where(slots[:, 3] > 0, slots[:, 3], slots[:, 2])
        yield "quadrilateral", table, 4
        return
    of_ten = (slots[:, 9] > 0) & (slots[:, 10] == 0)
    if of_ten.any():
        yield "tetrahedron", table[of_ten], 10
    rows = table[~of_ten]
    if len(rows):
        # Empty slots stand for the corner before them.
        corners = rows[:, 2:10]
        for slot in range(1, 8):
            corners[:, slot] = np.where(corners[:, slot], corners[:, slot], corners[:, slot - 1])
        yield "hexahedron", rows, 20 if (rows[:, 21] > 0).any() else 8


def _element_sets(deck: _Keyfile, parts: list[np.ndarray]) -> list[ElementSet]:
    """Return the parts and the sets of parts; equal titles get the parts' numbers."""
    counts = Counter(deck.titles.values())
    sets = []
    for number in sorted({int(number) for of_block in parts for number in np.unique(of_block)}):
        title = deck.titles.get(number, "")
        several = f"{title} {number}" if counts[title] > 1 else title
        name = several if title else str(number)
        sets.append(ElementSet(name, members_of(parts, np.array([number])), number))
    for name, numbers in deck.part_sets:
        sets.append(ElementSet(name, members_of(parts, np.array(numbers)), weak=True))
    return sets
