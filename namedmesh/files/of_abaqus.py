"""Read the text files of Abaqus and CalculiX, with their sets and surfaces.

Points, elements and sets are read, of parts and their instances, too. Elements that are
no solids are left out and counted.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.abaqus_cards import Card, cards_of, integers_of, numbers_of
from namedmesh.files.file_mesh import (
    SHAPES,
    Block,
    ElementSet,
    FacetSet,
    FileMesh,
    NodeSet,
    pad,
    shape_with,
)
from namedmesh.files.frames import Frame, frame_of, of_cylinder
from namedmesh.files.sets import list_names

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
GENERATORS = (
    *("NGEN", "ELGEN", "NFILL", "NCOPY", "ELCOPY", "NMAP"),
    "SYMMETRIC MODEL GENERATION",
)
"""Keywords that compute a mesh."""
MOVERS = ("IMPERFECTION", "ADJUST", "MODEL CHANGE")
"""Keywords that move nodes or take elements away, which are not read."""


@dataclass
class _Space:
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
    """

    name: str = ""
    node_rows: dict[int, int] = field(default_factory=dict)
    element_rows: dict[int, int] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    spelling: dict[str, str] = field(default_factory=dict)
    hidden: set[str] = field(default_factory=set)
    listed: set[str] = field(default_factory=set)
    inner: dict[str, _Space] = field(default_factory=dict)

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
class _ElementCard:
    """Hold the elements of a card: type, row of the first, whether solids."""

    kind: str
    block: Block
    begin: int
    solid: bool


@dataclass
class _Mesh:
    """Collect points, elements and surfaces in the order of their rows."""

    points: list[np.ndarray] = field(default_factory=list)
    node_count: int = 0
    element_count: int = 0
    blocks: list[_ElementCard] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    spaces: list[_Space] = field(default_factory=list)
    surfaces: dict[str, list[tuple[np.ndarray, int | None]]] = field(default_factory=dict)
    node_surfaces: dict[str, list[int]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def mesh_of_abaqus(path: Path) -> FileMesh:
    """Read a text file of Abaqus or CalculiX, with its sets and surfaces.

    Raises:
        InputError: If it has no nodes, or a card that computes them.
    """
    cards = list(cards_of(path))
    parts, assembly, outside = _sections(cards)
    mesh = _Mesh()
    for keyword in sorted({card.keyword for card in cards if card.keyword in MOVERS}):
        mesh.notes.append(f"*{keyword}, which changes the mesh, is not followed")
    root = _Space()
    mesh.spaces.append(root)
    for name, (part, shift, cards) in assembly.items():
        space = _Space(name)
        root.inner[name.upper()] = space
        mesh.spaces.append(space)
        _load(mesh, space, [*parts.get(part.upper(), []), *cards], shift)
    _load(mesh, root, outside, [])
    if not mesh.node_count:
        raise InputError(
            "it has no *NODE; read the file that has the mesh, which an *INCLUDE may name."
        )
    return _file_mesh(mesh)


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


def _load(mesh: _Mesh, space: _Space, cards: list[Card], place: list[str]) -> None:
    """Add the cards of a part to a mesh."""
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
    mesh: _Mesh, space: _Space, card: Card, frame: Frame | None, place: list[str]
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


def _extend(space: _Space, sets: dict[str, list[int]], name: str, rows: Sequence[int]) -> None:
    """Add rows to a set by its name, "" for none."""
    if name:
        space.spelling.setdefault(name.upper(), name)
        sets.setdefault(name.upper(), []).extend(rows)


def _add_elements(mesh: _Mesh, space: _Space, card: Card) -> None:
    """Add the elements of a card, or count them if they are no solids."""
    kind = card.get("TYPE").upper()
    shape, width, solid = _shape_of(kind)
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
    mesh.blocks.append(_ElementCard(kind, block, rows.start, solid))
    mesh.element_count += len(table)
    _extend(space, space.element_sets, card.get("ELSET"), rows)


def _shape_of(kind: str) -> tuple[str | None, int, bool]:
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


def _add_set(space: _Space, card: Card) -> None:
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


def _add_surface(mesh: _Mesh, space: _Space, card: Card) -> None:
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


def _file_mesh(mesh: _Mesh) -> FileMesh:
    """Return the mesh with all sets, whose rows are now numbers in blocks."""
    dim = max((part.block.dim for part in mesh.blocks if part.solid), default=0)
    left_out = Counter(mesh.left_out)
    blocks = []
    for part in mesh.blocks:
        fits = part.block.dim == dim - 1 or (part.solid and part.block.dim == dim)
        if not fits:
            left_out[part.kind] += len(part.block.nodes)
        # The numbers of the other blocks stay.
        blocks.append(part.block if fits else Block("vertex", part.block.nodes[:, :1]))
    begins = np.array([part.begin for part in mesh.blocks])
    facet_sets = []
    for name, faces in mesh.surfaces.items():
        for rows, face in faces:
            for block, elements in _members(begins, rows).items():
                facet_sets += _facets(name, blocks[block], elements, face)
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
        tuple(found for found in facet_sets if found.corners.shape[1] == 2 * (dim - 1)),
        tuple(node_sets),
        left_out,
        notes=(*mesh.notes, *notes),
    )


def _members(begins: np.ndarray, rows: Sequence[int] | np.ndarray) -> dict[int, np.ndarray]:
    """Return the numbers in blocks of elements that are given by their rows."""
    every = np.unique(np.asarray(rows, dtype=np.int64))
    block = np.searchsorted(begins, every, side="right") - 1
    return {int(b): every[block == b] - begins[b] for b in np.unique(block)}


def _sets(mesh: _Mesh, begins: np.ndarray) -> tuple[list[ElementSet], list[NodeSet]]:
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


def _names_of_several(spaces: Sequence[_Space]) -> set[str]:
    """Return the names that sets of several instances have."""
    counts: Counter[str] = Counter()
    for space in spaces:
        counts.update({*space.element_sets, *space.node_sets})
    return {name for name, count in counts.items() if count > 1}


def _name_of(space: _Space, name: str, several: set[str]) -> str:
    """Return the name of a set, with the name of its instance if several have it."""
    spelled = space.spelling.get(name, name)
    return f"{space.name}.{spelled}" if space.name and name in several else spelled


def _facets(name: str, block: Block, elements: np.ndarray, face: int | None) -> list[FacetSet]:
    """Return faces of elements by their number; None means all outer faces."""
    faces = FACES.get(block.shape, ())
    if face is not None:
        if face >= len(faces):
            return []
        return [FacetSet(name, pad(block.nodes[elements][:, faces[face]]))]
    result = []
    for corners in SHAPES[block.shape].faces:
        result.append(FacetSet(name, pad(block.nodes[elements][:, corners]), outer=True))
    return result
