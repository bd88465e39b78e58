"""Collect points, elements, sets and surfaces of the text files of Abaqus and CalculiX.

Parts and their instances are put in their places.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.abaqus_cards import Card, integers_of, numbers_of
from namedmesh.files.file_mesh import Block, shape_with
from namedmesh.files.frames import Frame, frame_of, of_cylinder

SOLIDS = (
    (re.compile(r"(?:D?C3D|F3D|SC)(\d+)"), 3),
    (re.compile(r"(?:CP[SE]|CPEG|C?G?AX|DC2D|DCAX)(\d+)"), 2),
)
"""Patterns of the types of solids with their numbers of nodes, and dimensions."""
SIDES = (
    (re.compile(r"(?:DS|S|STRI|M3D|SFM3D|R3D)(\d+)"), 2),
    (re.compile(r"(?:T[23]D|R2D)(\d+)"), 1),
    (re.compile(r"B[23](\d)"), 1),
)
"""The same for types of elements that may lie on the sides of solids.

Programs write facets so. The numbers of beams are one less than their nodes.
"""
GENERATORS = (
    *("NGEN", "ELGEN", "NFILL", "NCOPY", "ELCOPY", "NMAP"),
    "SYMMETRIC MODEL GENERATION",
)
"""Keywords that compute a mesh."""
MOVERS = ("IMPERFECTION", "ADJUST", "MODEL CHANGE")
"""Keywords that move nodes or take elements away, which are not read."""


@dataclass
class DeckSpace:
    """Hold the numbers and sets of a part in the assembly, or of all of a file.

    Attributes:
        name: Name of the instance.
        node_rows: Number of each node -> its row.
        element_rows: Number of each element -> its row.
        node_sets: Rows of nodes by the name of the set in capitals.
        element_sets: Rows of elements by the name of the set in capitals.
        spelling: Names in capitals -> as the file spells them.
        hidden: Names of sets that are marked as internal, or serve a surface.
        listed: Names of sets that have a card of their own.
        inner: The instances of the assembly by their names in capitals.
        cards: The cards of the part, or outside of all parts.
    """

    name: str = ""
    node_rows: dict[int, int] = field(default_factory=dict)
    element_rows: dict[int, int] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    spelling: dict[str, str] = field(default_factory=dict)
    hidden: set[str] = field(default_factory=set)
    listed: set[str] = field(default_factory=set)
    inner: dict[str, DeckSpace] = field(default_factory=dict)
    cards: list[Card] = field(default_factory=list)

    def rows(self, word: str, *, nodes: bool) -> Sequence[int]:
        """Return the rows that a number or the name of a set means; none if unknown."""
        if word.isdigit():
            row = (self.node_rows if nodes else self.element_rows).get(int(word))
            return [] if row is None else [row]
        sets = self.node_sets if nodes else self.element_sets
        if word.upper() in sets:
            return sets[word.upper()]
        instance, dot, name = word.partition(".")
        if dot and instance.upper() in self.inner:
            return self.inner[instance.upper()].rows(name, nodes=nodes)
        return []


@dataclass(frozen=True)
class ElementCard:
    """Hold the elements of a card: type, row of the first, whether solids."""

    kind: str
    block: Block
    begin: int
    solid: bool


@dataclass
class Tables:
    """Collect points, elements and surfaces in the order of their rows."""

    points: list[np.ndarray] = field(default_factory=list)
    node_count: int = 0
    element_count: int = 0
    blocks: list[ElementCard] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    spaces: list[DeckSpace] = field(default_factory=list)
    surfaces: dict[str, list[tuple[np.ndarray, int | None]]] = field(default_factory=dict)
    node_surfaces: dict[str, list[int]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def tables_of(cards: list[Card]) -> Tables:
    """Collect the mesh of cards with its sets and surfaces.

    Raises:
        InputError: If there are no nodes, or a card computes them.
    """
    parts, assembly, outside = _sections(cards)
    mesh = Tables()
    for keyword in sorted({card.keyword for card in cards if card.keyword in MOVERS}):
        mesh.notes.append(f"*{keyword}, which changes the mesh, is not followed")
    root = DeckSpace()
    mesh.spaces.append(root)
    for name, (part, shift, own_cards) in assembly.items():
        space = DeckSpace(name)
        root.inner[name.upper()] = space
        mesh.spaces.append(space)
        _load(mesh, space, [*parts.get(part.upper(), []), *own_cards], shift)
    _load(mesh, root, outside, [])
    if not mesh.node_count:
        raise InputError(
            "it has no *NODE; read the file that has the mesh, which an *INCLUDE may name."
        )
    return mesh


Instance = tuple[str, list[str], list[Card]]
"""Name of its part, lines of its place, and its own cards."""


def _sections(cards: list[Card]) -> tuple[dict[str, list[Card]], dict[str, Instance], list[Card]]:
    """Take the cards of parts and of instances from the cards of the file.

    Returns:
        Cards of each part by its name in capitals, the instances by name, and the cards
        outside of both.
    """
    parts: dict[str, list[Card]] = {}
    instances: dict[str, Instance] = {}
    outside: list[Card] = []
    into = outside
    for card in cards:
        if card.keyword in GENERATORS:
            raise InputError(
                f"it computes its mesh by *{card.keyword}; let Abaqus or CalculiX write the mesh "
                "out, as .inp or as .frd, and read that file."
            )
        if card.keyword == "PART":
            into = parts.setdefault(card.get("NAME").upper(), [])
        elif card.keyword == "INSTANCE":
            into = []
            name = card.get("NAME") or f"instance {len(instances) + 1}"
            instances[name] = (card.get("PART"), card.lines, into)
        elif card.keyword in ("END PART", "END INSTANCE"):
            into = outside
        else:
            into.append(card)
    if not instances:  # a file of a part alone
        instances = {name: (name, [], []) for name in parts}
    return parts, instances, outside


def _load(mesh: Tables, space: DeckSpace, cards: list[Card], place: list[str]) -> None:
    """Add the cards of a part to a mesh."""
    space.cards = cards
    frame = None
    for card in cards:
        if card.keyword == "SYSTEM":
            frame = _frame(card)
        if card.keyword == "NODE":
            _add_nodes(mesh, space, card, frame, place)
    for card in cards:
        if card.keyword == "ELEMENT":
            _add_elements(mesh, space, card)
    for card in cards:
        if card.keyword in ("NSET", "ELSET"):
            _add_set(space, card)
    for card in cards:
        if card.keyword == "SURFACE":
            _add_surface(mesh, space, card)


def _frame(card: Card) -> Frame | None:
    """Return the system of a card in which the nodes below it are given.

    Its points are the origin, one on the axis x and one beside it. None stands for the
    system of the part.

    Raises:
        InputError: If its points are in a line.
    """
    numbers = [float(word) for row in card.rows for word in row if word]
    if not numbers:
        return None
    points = np.zeros((3, 3))
    points.ravel()[: len(numbers)] = numbers[:9]
    origin, on_axis, in_plane = points
    if len(numbers) <= 3:  # moved alone
        return Frame(origin, np.eye(3))
    along = on_axis - origin
    beside = in_plane - origin
    if len(numbers) <= 6:
        # The axis z stays, and x is projected on its plane.
        along[2] = 0.0
        beside = np.array([-along[1], along[0], 0.0])
    return frame_of(origin, along, beside, 0, "*SYSTEM")


def _add_nodes(
    mesh: Tables, space: DeckSpace, card: Card, frame: Frame | None, place: list[str]
) -> None:
    """Add the nodes of a card, put where an instance is.

    Raises:
        InputError: If they are in spherical coordinates.
    """
    table = numbers_of(card.lines, 4)
    x = table[:, 1:]
    system = card.get("SYSTEM").upper()[:1]
    if system == "C":
        x = of_cylinder(x)
    elif system not in ("", "R"):
        raise InputError(
            f"it has nodes with SYSTEM={card.get('SYSTEM')}, and R and C are read; let Abaqus "
            "write them in Cartesian coordinates."
        )
    if frame is not None:
        x = frame.place(x)
    x = _place(x, place)
    rows = range(mesh.node_count, mesh.node_count + len(x))
    space.node_rows.update(zip(table[:, 0].astype(np.int64).tolist(), rows, strict=True))
    mesh.points.append(x)
    mesh.node_count += len(x)
    _extend(space, space.node_sets, card.get("NSET"), rows)


def _place(x: np.ndarray, place: list[str]) -> np.ndarray:
    """Move points by the translation and the rotation about an axis of an instance.

    Args:
        x: Points [length], shape (n, 3).
        place: Lines of data: the translation; two points of the axis and the angle in
            degrees.
    """
    if place:
        x = x + numbers_of(place[:1], 3)[0]
    if len(place) > 1:
        numbers = numbers_of(place[1:2], 7)[0]
        start, axis = numbers[:3], numbers[3:6] - numbers[:3]
        axis = axis / np.linalg.norm(axis)
        angle = np.radians(numbers[6])
        arm = x - start
        along = np.outer(arm @ axis, axis)
        x = start + along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(axis, arm)
    return x


def _extend(space: DeckSpace, sets: dict[str, list[int]], name: str, rows: Sequence[int]) -> None:
    """Add rows to a set by its name, "" for none."""
    if name:
        space.spelling.setdefault(name.upper(), name)
        sets.setdefault(name.upper(), []).extend(rows)


def _add_elements(mesh: Tables, space: DeckSpace, card: Card) -> None:
    """Add the elements of a card, or count them if they are no solids."""
    kind = card.get("TYPE").upper()
    shape, width, solid = shape_of(kind)
    if shape is None:
        mesh.left_out[kind] += len(card.lines)
        return
    try:
        table = integers_of(card.lines, width + 1)
    except InputError:
        if solid:
            raise
        mesh.left_out[kind] += len(card.lines)
        return
    table[:, 1:] += int(card.get("OFFSET") or 0)
    known = space.node_rows
    nodes = [known.get(number, -1) for number in table[:, 1:].ravel().tolist()]
    rows = range(mesh.element_count, mesh.element_count + len(table))
    space.element_rows.update(zip(table[:, 0].tolist(), rows, strict=True))
    block = Block(shape, np.array(nodes, dtype=np.int64).reshape(-1, width))
    mesh.blocks.append(ElementCard(kind, block, rows.start, solid))
    mesh.element_count += len(table)
    _extend(space, space.element_sets, card.get("ELSET"), rows)


def shape_of(kind: str) -> tuple[str | None, int, bool]:
    """Return shape and number of nodes of a type, and whether it is a solid."""
    for solid, table in ((True, SOLIDS), (False, SIDES)):
        for pattern, dim in table:
            match = pattern.match(kind)
            if match:
                width = int(match.group(1)) + kind.startswith("B")
                shape = shape_with(dim, width)
                if shape is not None:
                    return shape, width, solid
    return None, 0, False


def _add_set(space: DeckSpace, card: Card) -> None:
    """Add a set of nodes or elements."""
    nodes = card.keyword == "NSET"
    name = card.get(card.keyword)
    space.listed.add(name.upper())
    sets = space.node_sets if nodes else space.element_sets
    instance = card.get("INSTANCE").upper()
    source = space.inner.get(instance, space)
    if card.has("GENERATE"):
        known = source.node_rows if nodes else source.element_rows
        for row in card.rows:
            first, last, *step = [int(word) for word in row if word]
            wanted = range(first, last + 1, step[0] if step and step[0] else 1)
            # There may be more numbers between than the file has.
            least = wanted if len(wanted) < len(known) else sorted(known)
            members = [known[n] for n in least if n in known and n in wanted]
            _extend(space, sets, name, members)
    else:
        for row in card.rows:
            for word in row:
                _extend(space, sets, name, source.rows(word, nodes=nodes) if word else [])
    if card.has("INTERNAL"):
        space.hidden.add(name.upper())


def _add_surface(mesh: Tables, space: DeckSpace, card: Card) -> None:
    """Add a surface of faces of elements, or of nodes."""
    name = card.get("NAME")
    by_nodes = card.get("TYPE").upper() == "NODE"
    for row in card.rows:
        if not row[0]:
            continue
        rows = space.rows(row[0], nodes=by_nodes)
        if by_nodes:
            mesh.node_surfaces.setdefault(name, []).extend(rows)
            continue
        label = row[1].upper() if len(row) > 1 else ""
        face = int(label[1:]) - 1 if re.fullmatch(r"S\d", label) else None
        if face is not None or not label:
            faces = mesh.surfaces.setdefault(name, [])
            faces.append((np.array(rows, dtype=np.int64), face))
        if not row[0].isdigit():
            # A set that serves a surface is no region of its own.
            space.hidden.add(row[0].upper())
