"""Read decks of Nastran by gmsh, with nodes in the coordinate systems of the deck.

gmsh takes all coordinates for Cartesian. So the cards that define systems, and the
nodes that are given in them, are read here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.file_mesh import FileMesh
from namedmesh.files.frames import Frame, as_given, frame_of, of_cylinder, of_sphere
from namedmesh.files.of_gmsh import mesh_of_gmsh
from namedmesh.files.of_meshio import mesh_of_meshio

WANTED = re.compile(r"\s*(GRID|GRDSET|CORD[123][A-Z]|INCLUDE)\b", re.IGNORECASE)
"""Beginning of the cards that are read here."""
EXPONENT = re.compile(r"(?<=[\d.])([-+]\d+)$")
"""Exponent of a number that has no letter before it, as 1.0-3."""
STRAIGHT: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "R": as_given,
    "C": of_cylinder,
    "S": of_sphere,
}
"""Function that makes Cartesian coordinates, by the last letter of a card."""
BASIC = Frame(np.zeros(3), np.eye(3))
"""The basic system."""


@dataclass
class _Deck:
    """Hold the nodes and the coordinate systems of a deck.

    Attributes:
        nodes: Number of each node -> number of its system and its coordinates.
        systems: Number of each system -> its card and the fields of the card.
        includes: Names of the files that it includes.
        known: The systems that are found.
    """

    nodes: dict[int, tuple[int, np.ndarray]] = field(default_factory=dict)
    systems: dict[int, tuple[str, list[str]]] = field(default_factory=dict)
    includes: list[str] = field(default_factory=list)
    known: dict[int, Frame] = field(default_factory=lambda: {0: BASIC})

    def place(self, node: int) -> np.ndarray:
        """Return the place of a node [length], shape (3,)."""
        if node not in self.nodes:
            raise InputError(f"a coordinate system has the node {node}, which is not there.")
        number, x = self.nodes[node]
        return self.frame(number).place(x[None])[0]

    def frame(self, number: int) -> Frame:
        """Return the coordinate system of a number.

        Raises:
            InputError: If it is not there, or not of a kind that is read.
        """
        if number in self.known:
            return self.known[number]
        # It is found while it is looked for if systems are defined by each other.
        card, fields = self.systems.pop(number, ("", []))
        what = f"the coordinate system {number}"
        if card not in ("CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S"):
            given = f"is given by {card}, which is not read" if card else "is not in the file"
            raise InputError(
                f"{what}, in which nodes or other systems are given, {given}; let Nastran's "
                "preprocessor write the nodes in the basic system."
            )
        if card.startswith("CORD1"):
            points = np.array([self.place(int(word)) for word in fields[1:4]])
        else:
            numbers = [_number(word) for word in fields[2:11]]
            numbers += [0.0] * (9 - len(numbers))
            points = self.frame(_integer(fields[1])).place(np.reshape(numbers, (3, 3)))
        origin, on_axis, in_plane = points
        found = frame_of(origin, on_axis - origin, in_plane - origin, 2, what)
        self.known[number] = replace(found, straight=STRAIGHT[card[-1]])
        return self.known[number]


def mesh_of_nastran(path: Path, *, numbered: bool) -> FileMesh:
    """Read a deck of Nastran, in a process of its own.

    Args:
        path: The file.
        numbered: As in :func:`namedmesh.files.of_gmsh.grouped`.

    Raises:
        InputError: If nodes are in a coordinate system that is not there.
    """
    deck = _deck(path)
    moved = {}
    for node, (system, _) in deck.nodes.items():
        if system:
            moved[node] = deck.place(node)
    notes = []
    if deck.includes:
        notes.append(f"files that it includes are not read: {', '.join(deck.includes)}")
    try:
        mesh = mesh_of_gmsh(path, numbered=numbered, ending=".bdf", moved=moved)
    except Exception:  # gmsh's errors are of no class of their own
        if moved:
            raise
        mesh = mesh_of_meshio(path, kind="nastran")
    return replace(mesh, notes=(*mesh.notes, *notes))


def _deck(path: Path) -> _Deck:
    """Read the nodes and the coordinate systems of a deck."""
    deck = _Deck()
    default = 0
    rows = []
    for name, given in _cards(path):
        fields = given + [""] * (8 - len(given))
        if name == "GRDSET":
            default = _integer(fields[1])
        elif name == "GRID":
            rows.append(fields)
        elif name == "INCLUDE":
            deck.includes.append(" ".join(fields).strip(" '\""))
        elif name.startswith("CORD1"):
            deck.systems[_integer(fields[0])] = (name, fields[:4])
            if fields[4]:
                deck.systems[_integer(fields[4])] = (name, fields[4:8])
        else:
            deck.systems[_integer(fields[0])] = (name, fields)
    for fields in rows:
        system = _integer(fields[1]) if fields[1] else default
        x = np.array([_number(word) for word in fields[2:5]])
        deck.nodes[_integer(fields[0])] = (system, x)
    return deck


def _cards(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Iterate over names and fields of the cards that are wanted."""
    name = ""
    fields: list[str] = []
    for line in path.read_text("latin-1").splitlines():
        text = line.split("$")[0].rstrip().expandtabs(8)
        if not text:
            continue
        head, words = _fields(text)
        if name and (head[:1] in ("+", "*") or not head):
            fields += words
            continue
        if name:
            yield name, fields
        name = ""
        if WANTED.match(text):
            name = head.rstrip("*").upper()
            fields = words
            if name.startswith("INCLUDE"):
                name, fields = "INCLUDE", [text.strip()[7:]]
    if name:
        yield name, fields


def _fields(text: str) -> tuple[str, list[str]]:
    """Return the first field of a line, and the other fields.

    They are separated by commas, of 8 characters each, or of 16 after an asterisk. A
    field that tells how the line goes on is left out.
    """
    if "," in text:
        head, *words = [word.strip() for word in text.split(",")]
        # Free lines of a large card have four numbers.
        width = 4 if head.endswith("*") or head.startswith("*") else 8
        return head, words[:width] + [""] * (width - len(words))
    head = text[:8].strip()
    width, count = (16, 4) if "*" in head else (8, 8)
    ends = range(8, 8 + width * count, width)
    return head, [text[begin : begin + width].strip() for begin in ends]


def _integer(word: str) -> int:
    """Return a whole number, 0 for none."""
    return int(word) if word else 0


def _number(word: str) -> float:
    """Return a number as Nastran writes it, 0 for none."""
    return float(EXPONENT.sub(r"e\1", word.upper().replace("D", "E"))) if word else 0.0
