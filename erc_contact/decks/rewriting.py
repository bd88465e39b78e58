"""Write a deck with a finer mesh: its sets, surfaces and nodal data follow.

Cards that speak of nodes or elements by their numbers are written anew; names of sets
stay, and so do all other cards. What a node of the old mesh has, a prescribed value for
instance, the new nodes on the faces between such nodes have, too, interpolated. Forces
on nodes become the nodal forces of the traction as which a deck is read, so that force
and moment stay.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from io import StringIO

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.decks.affine import linear_traction
from erc_contact.decks.conditions import read_transform
from erc_contact.decks.loads import in_coordinates
from erc_contact.decks.reading import Axes, DeckReading
from erc_contact.decks.told import Told
from erc_contact.scene.remote import moments_of
from namedmesh.for_solvers import Card, FinerDeckMesh, components, shape_of
from namedmesh.simplex import lagrange, measures, node_between, rule

PER_LINE = 10
"""Numbers in a line: CalculiX reads at most 16."""
FACE = re.compile(r"P(\d)")
"""Label of a pressure on a face of elements."""
FAMILY = re.compile(r"[A-Z]*?(3D)?(?=\d+[A-Z]*$)")
"""Beginning of the type of an element, before the number of its nodes."""
OF_SPACE = ("NODE", "NSET", "ELSET", "SURFACE")
"""Cards of which the finer mesh has its own."""


def written_anew(finer: FinerDeckMesh) -> str:
    """Return the text of a deck on a finer mesh.

    Raises:
        InputError: If a card cannot follow, as parts of Abaqus and forces on nodes of
            rings.
    """
    return "\n".join(_Rewriting(finer).lines()) + "\n"


class _Rewriting:
    """Write the cards of a deck on a finer mesh."""

    def __init__(self, finer: FinerDeckMesh) -> None:
        self.finer = finer
        self.deck = finer.deck
        if len(self.deck.spaces) > 1:
            raise InputError(
                "refine: the deck has parts and instances, which CalculiX does not read; write a "
                "flat deck."
            )
        (self.space,) = self.deck.spaces
        self.writers: dict[str, Callable[[Card], Iterator[str]]] = {
            "BOUNDARY": self._boundary,
            "CLOAD": self._forces,
            "DLOAD": self._loads,
            "TEMPERATURE": self._temperatures,
            "INITIAL CONDITIONS": self._temperatures,
            "DISTRIBUTING COUPLING": _shares,
        }

    def lines(self) -> Iterator[str]:
        """Iterate over the lines of the deck."""
        yield from self._nodes()
        yield from self._elements()
        yield from self._sets()
        yield from self._surfaces()
        for card in self.deck.cards:
            is_of_mesh = card.keyword in OF_SPACE or (
                card.keyword == "ELEMENT" and shape_of(card.get("TYPE").upper())[2]
            )
            if is_of_mesh or card.keyword == "SYSTEM":
                continue
            writer = self.writers.get(card.keyword, _as_it_is)
            yield from writer(card)

    # --- the mesh

    def _nodes(self) -> Iterator[str]:
        """Write the nodes of the mesh, and nodes that belong to no cell."""
        finer = self.finer
        loose = np.flatnonzero(~self.deck.node_is_used)
        numbers = np.concatenate([finer.node_numbers, self.deck.numbers[loose]])
        x = np.vstack([finer.x, self.deck.x[loose]])
        yield "*NODE"
        yield _table(np.column_stack([numbers, x]), ["%d", *["%.12g"] * self.deck.d])

    def _elements(self) -> Iterator[str]:
        """Write the cells, for each type of the deck a simplex of its kind."""
        finer = self.finer
        numbers = finer.node_numbers[finer.cells]
        types = self._types_of_cells()
        for kind in np.unique(types):
            family = FAMILY.match(kind)
            assert family is not None
            yield f"*ELEMENT, TYPE={family.group()}{finer.cells.shape[1]}"
            cells = np.flatnonzero(types == kind)
            yield _table(np.column_stack([cells + 1, numbers[cells]]), "%d")

    def _types_of_cells(self) -> np.ndarray:
        """Return the type of the deck's cell of each new cell."""
        result = np.full(self.deck.body.count, "", dtype=object)
        begin = 0
        for number in self.deck.body.blocks:
            part = self.deck.blocks[number]
            result[begin : begin + len(part.block.nodes)] = part.kind
            begin += len(part.block.nodes)
        return np.asarray(result[self.finer.parents].astype(str))

    def _sets(self) -> Iterator[str]:
        """Write all sets of nodes and of elements."""
        space = self.space
        for key, rows in space.node_sets.items():
            yield f"*NSET, NSET={space.spelling.get(key, key)}"
            yield from _in_lines(self._numbers_of(np.asarray(rows, dtype=np.int64)))
        for key in space.element_sets:
            yield f"*ELSET, ELSET={space.spelling.get(key, key)}"
            yield from _in_lines(self._cells_of(key))

    def _numbers_of(self, nodes: np.ndarray) -> np.ndarray:
        """Return the numbers of the new nodes that nodes of the deck mean."""
        inside = self.finer.node_numbers[self.finer.nodes_within(nodes)]
        loose = nodes[~self.deck.node_is_used[nodes]]
        return np.unique(np.concatenate([inside, self.deck.numbers[loose]]))

    def _cells_of(self, word: str) -> np.ndarray:
        """Return the numbers of the new cells in an element or a set of the deck."""
        return np.flatnonzero(np.isin(self.finer.parents, self.deck.cells(word, self.space))) + 1

    def _surfaces(self) -> Iterator[str]:
        """Write all surfaces, of faces and of nodes."""
        for name in self.deck.tables.surfaces:
            yield f"*SURFACE, NAME={name}, TYPE=ELEMENT"
            faces = self.deck.surface(name)
            assert faces is not None
            yield from self._sides(faces, self.deck.cells_of_surface(name), "S{}")
        for name, rows in self.deck.tables.node_surfaces.items():
            yield f"*SURFACE, NAME={name}, TYPE=NODE"
            numbers = self._numbers_of(np.asarray(rows, dtype=np.int64))
            yield from (f"{number}," for number in numbers)

    def _sides(self, faces: np.ndarray, cells: np.ndarray, words: str) -> Iterator[str]:
        """Write sides on faces of the deck, of new cells in some of its cells."""
        cell, side = self.finer.sides_on(faces)
        here = np.isin(self.finer.parents[cell], cells)
        for number, which in zip(cell[here] + 1, side[here] + 1, strict=True):
            yield f"{number}, {words.format(which)}"

    # --- what is prescribed

    def _boundary(self, card: Card) -> Iterator[str]:
        """Write prescribed displacements, at nodes by their numbers anew."""
        yield _head(card)
        tables: dict[tuple[str, str], list[tuple[str, float]]] = {}
        for row in card.rows:
            word, first, *others = row
            if not word.isdigit():
                yield ", ".join(row)
                continue
            last = (others[0] if others else "") or first
            value = float(others[1]) if len(others) > 1 and others[1] else 0.0
            tables.setdefault((first, last), []).append((word, value))
        for (first, last), table in tables.items():
            for number, value in self._interpolated(table):
                yield f"{number}, {first}, {last}, {value:.9g}"

    def _temperatures(self, card: Card) -> Iterator[str]:
        """Write temperatures, at nodes by their numbers anew."""
        yield _head(card)
        table = []
        for row in card.rows:
            if row[0].isdigit():
                table.append((row[0], float(row[1])))
            else:
                yield ", ".join(row)
        for number, value in self._interpolated(table):
            yield f"{number}, {value:.9g}"

    def _interpolated(self, table: Sequence[tuple[str, float]]) -> Iterator[tuple[int, float]]:
        """Iterate over new nodes with the values of nodes of the deck."""
        nodes = np.concatenate(
            [np.empty(0, dtype=np.int64), *(self._rows(word) for word, _ in table)]
        )
        values = np.zeros(len(self.deck.x))
        values[nodes] = [value for word, value in table for _ in self._rows(word)]
        inside = self.finer.nodes_within(nodes)
        carried = self.finer.weights @ values
        yield from zip(
            self.finer.node_numbers[inside].tolist(), carried[inside].tolist(), strict=True
        )
        for node in nodes[~self.deck.node_is_used[nodes]]:
            yield int(self.deck.numbers[node]), float(values[node])

    def _rows(self, word: str) -> np.ndarray:
        """Return the nodes of the deck that a number or a set means."""
        return self.deck.nodes(word, self.space)

    def _loads(self, card: Card) -> Iterator[str]:
        """Write pressures on faces of elements anew, and other loads as they are."""
        yield _head(card)
        for row in card.rows:
            word, label, *others = row
            if FACE.fullmatch(label.upper()):
                faces = self.deck.face_of_element(word, label, self.space)
                cells = self.deck.cells(word, self.space)
                yield from self._sides(faces, cells, ", ".join(["P{}", *others]))
            elif word.isdigit():
                yield from (", ".join([str(n), label, *others]) for n in self._cells_of(word))
            else:
                yield ", ".join(row)

    def _forces(self, card: Card) -> Iterator[str]:
        """Write the nodal forces of a traction with the same force and moment."""
        yield _head(card)
        d = self.deck.d
        forces: dict[int, np.ndarray] = {}
        for row in card.rows:
            nodes = self._rows(row[0])
            loose = ~self.deck.node_is_used[nodes]
            if loose.any() or not 1 <= int(row[1]) <= d:  # a reference node
                yield ", ".join(row)
                continue
            for node in nodes.tolist():
                forces.setdefault(node, np.zeros(3))[int(row[1]) - 1] += float(row[2])
        if not forces:
            return
        nodes = np.array(list(forces))
        self._refuse_forces(card, nodes)
        x = self.deck.mesh.points[nodes, :d]
        given = in_coordinates(self._axes, nodes, x, np.array(list(forces.values())))
        total = np.zeros(self.finer.x.shape)
        for faces, here in self._faces_at(nodes):
            total += self._nodal_forces(faces, nodes[here], given[here])
        along_axes = self._in_local_axes(total)
        for node, axis in np.argwhere(along_axes != 0.0):
            yield f"{self.finer.node_numbers[node]}, {axis + 1}, {along_axes[node, axis]:.12g}"

    @cached_property
    def _axes(self) -> list[Axes]:
        """Return the local axes that nodes of the deck have."""
        reading = DeckReading(self.deck, Told(), "hard")
        for card in self.deck.cards:
            if card.keyword == "TRANSFORM":
                read_transform(reading, card, self.space)
        return reading.transforms

    def _in_local_axes(self, forces: np.ndarray) -> np.ndarray:
        """Return forces (n, d) on new nodes by components of their local axes."""
        result = forces.copy()
        for axes in self._axes:
            inside = self.finer.nodes_within(axes.nodes)
            local = axes.at(self.finer.x[inside])
            result[inside] = np.einsum("nki,ni->nk", local, forces[inside])[:, : self.deck.d]
        return result

    def _refuse_forces(self, card: Card, nodes: np.ndarray) -> None:
        """Refuse forces on nodes that cannot follow.

        Raises:
            InputError: If a body is axisymmetric, or a node is inside a body.
        """
        inside = np.setdiff1d(nodes, self.deck.nodes_of_faces(np.flatnonzero(self.deck.outer)))
        if len(inside):
            raise InputError(
                f"refine: *CLOAD ({card.place}) has forces on nodes inside a body, as "
                f"{self.deck.numbers[inside[0]]}, which are not carried to another mesh; give a "
                "force per volume (*DLOAD, GRAV)."
            )
        if any("AX" in part.kind for part in self.deck.blocks):
            raise InputError(
                f"refine: *CLOAD ({card.place}) in a deck with an axisymmetric body is not carried "
                "to another mesh; give a pressure (*DLOAD, *DSLOAD)."
            )

    def _faces_at(self, nodes: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Iterate over the faces on which forces on nodes act, as a deck is read.

        Yields:
            Faces that are connected, and which of the nodes act there.
        """
        deck = self.deck
        faces = deck.within(np.union1d(nodes, deck.corners_near(nodes)))
        left = np.ones(len(nodes), dtype=bool)
        corners = deck.corners(faces)
        links = np.concatenate([corners[:, [0, i]] for i in range(1, corners.shape[1])])
        group = components(len(deck.x), links)[corners[:, 0]]
        for number in np.unique(group):
            here = np.isin(nodes, deck.nodes_of_faces(faces[group == number])) & left
            left &= ~here
            if here.any():
                yield faces[group == number], here
        for i in np.flatnonzero(left):
            yield deck.around(deck.corners_near(nodes[i : i + 1])), np.arange(len(nodes)) == i

    def _nodal_forces(self, faces: np.ndarray, nodes: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return nodal forces with the force and moment of forces on nodes, (n, d).

        They are of a traction that is linear on faces of the deck.
        """
        deck, finer = self.deck, self.finer
        d = deck.d
        x = deck.mesh.points[nodes, :d]
        moment = moments_of(x, forces).sum(axis=0)
        old = deck.simplices(faces)
        traction = linear_traction(forces.sum(axis=0), moment, deck.x[old], deck.measures(faces))
        cell, side = finer.sides_on(faces)
        corners = finer.x[finer.corners_of_sides(cell, side)]
        on_sides = finer.nodes_of_sides(cell, side)
        degree = 1 if finer.cells.shape[1] == d + 1 else 2
        points, weights = rule(d - 1, degree + 1)
        shares = np.column_stack([1.0 - points.sum(axis=1), points])
        at = np.einsum("qk,mki->imq", shares, corners)
        density = np.stack([np.broadcast_to(t(at), at.shape[1:]) for t in traction], axis=-1)
        shape = lagrange(d - 1, degree, points)[:, _order(d, degree)]
        parts = np.einsum("q,qk,mqi->mki", weights, shape, density)
        result = np.zeros(finer.x.shape)
        np.add.at(result, on_sides, parts * measures(corners)[:, None, None])
        return result


def _order(d: int, degree: int) -> list[int]:
    """Return the places of the nodes of a side of Abaqus in a simplex.

    Abaqus has the middle of the first two corners first, then around.
    """
    between = node_between(d - 1, degree)
    middles = [int(between[i, (i + 1) % d]) for i in range(d)]
    # The two middles of an edge are one, and there are none (-1) of degree 1.
    return [*range(d), *(node for node in dict.fromkeys(middles) if node >= d)]


def _shares(card: Card) -> Iterator[str]:
    """Refuse shares of nodes: new nodes would have other shares.

    Raises:
        InputError: Always.
    """
    raise InputError(
        f"refine: *DISTRIBUTING COUPLING ({card.place}) has weights of nodes, which are not "
        "carried to another mesh; give *COUPLING with *DISTRIBUTING on a surface."
    )


def _as_it_is(card: Card) -> Iterator[str]:
    """Write a card as it is."""
    yield _head(card)
    yield from card.lines


def _head(card: Card) -> str:
    """Return the line with the keyword of a card."""
    words = [f"*{card.keyword}"]
    for name, value in card.parameters.items():
        words.append(f"{name}={value}" if value else name)
    return ", ".join(words)


def _table(rows: np.ndarray, formats: str | list[str]) -> str:
    """Write a table of numbers."""
    text = StringIO()
    np.savetxt(text, rows, fmt=formats, delimiter=", ")
    return text.getvalue().rstrip()


def _in_lines(numbers: np.ndarray) -> Iterator[str]:
    """Write numbers in lines."""
    for begin in range(0, len(numbers), PER_LINE):
        yield ", ".join(map(str, numbers[begin : begin + PER_LINE])) + ","
