"""Hold the mesh of a deck of Abaqus or CalculiX, whose cards speak of its numbers.

A deck says where it holds and loads a body by sets of nodes, sets of elements, and
faces of elements. Here they become faces of the body, which have numbers; parts of the
boundary are made of faces, and regions of cells.

Symbols: d dimension, n points, f faces, c cells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path

import numpy as np
from mpi4py import MPI

from namedmesh.domain import Domain
from namedmesh.files.abaqus_cards import Card, cards_of
from namedmesh.files.abaqus_tables import DeckSpace, ElementCard, Tables, tables_of
from namedmesh.files.building import Built, build_simplices, faces_within, spread_from
from namedmesh.files.cleaning import Body, body_of
from namedmesh.files.displacements import edge_nodes, values_between
from namedmesh.files.faces import Faces, faces_of
from namedmesh.files.file_mesh import SHAPES, ElementSet, FacetSet, FileMesh
from namedmesh.files.of_abaqus import FACES, blocks_of
from namedmesh.files.simplices import Simplices, split
from namedmesh.graphs import components
from namedmesh.simplex import measures

MOST_FACES = 6
"""Greatest number of faces of an element."""


@dataclass(frozen=True, eq=False)
class DeckMesh:
    """Hold the cells and faces of a body, and what a deck calls them.

    Attributes:
        cards: All cards of the deck, in their order.
        tables: Points, elements, sets and surfaces of the deck.
        mesh: The mesh without sets.
        body: Its cells, corners alone.
        faces: Their faces.
    """

    cards: list[Card]
    tables: Tables
    mesh: FileMesh
    body: Body
    faces: Faces

    @classmethod
    def of(cls, cards: list[Card]) -> DeckMesh:
        """Make the cells and faces of the cards of a deck.

        Raises:
            InputError: If there are no nodes and no body, or its cells cannot be worked
                with.
        """
        tables = tables_of(cards)
        _, blocks, left_out = blocks_of(tables)
        points = np.concatenate(tables.points)
        notes = tuple(tables.notes)
        mesh = FileMesh(points, tuple(blocks), left_out=left_out, notes=notes)
        body = body_of(mesh)
        return cls(cards, tables, mesh, body, faces_of(body.cells, body.x))

    @property
    def d(self) -> int:
        """Return the dimension of the body."""
        return self.mesh.dim

    @property
    def x(self) -> np.ndarray:
        """Return the points [length], shape (n, d)."""
        return self.body.x

    @property
    def spaces(self) -> list[DeckSpace]:
        """Return the space of the deck and of each instance, each with its cards."""
        return self.tables.spaces

    @property
    def blocks(self) -> list[ElementCard]:
        """Return the elements of the deck, card by card."""
        return self.tables.blocks

    @cached_property
    def corner_count(self) -> np.ndarray:
        """Return in how many cells each point is a corner, shape (n,)."""
        corners = np.concatenate([block.nodes.ravel() for block in self.body.cells])
        return np.bincount(corners, minlength=len(self.x))

    @cached_property
    def node_is_used(self) -> np.ndarray:
        """Tell which points are corners or middles of cells, shape (n,)."""
        used = np.zeros(len(self.x), dtype=bool)
        for number in self.body.blocks:
            used[self.tables.blocks[number].block.nodes] = True
        return used

    @cached_property
    def ends(self) -> np.ndarray:
        """Return the corners between which each point lies, shape (n, 2).

        A corner is both of its ends; -1 stands for points that are on no edge.
        """
        ends = np.full((len(self.x), 2), -1)
        for number in self.body.blocks:
            block = self.tables.blocks[number].block
            if block.nodes.shape[1] > block.corners.shape[1]:
                for (a, b), column in edge_nodes(self.mesh, block).items():
                    ends[block.nodes[:, column]] = block.nodes[:, [a, b]]
        corners = np.flatnonzero(self.corner_count)
        ends[corners] = corners[:, None]
        return ends

    def corners_near(self, nodes: np.ndarray) -> np.ndarray:
        """Return the corners that nodes are, or between which they lie."""
        ends = self.ends[nodes]
        return np.unique(ends[ends >= 0])

    def nodes_of_faces(self, faces: np.ndarray) -> np.ndarray:
        """Return the corners of faces, and the middles of their edges."""
        is_corner = np.zeros(len(self.x) + 1, dtype=bool)
        is_corner[self.corners(faces)] = True
        return np.flatnonzero(is_corner[self.ends].all(axis=1))

    def nodes(self, word: str, space: DeckSpace) -> np.ndarray:
        """Return the points that a number or a set means, without repetition."""
        return np.unique(np.asarray(space.rows(word, nodes=True), dtype=np.int64))

    @cached_property
    def numbers(self) -> np.ndarray:
        """Return the number that the deck gives to each point, shape (n,)."""
        numbers = np.zeros(len(self.x), dtype=np.int64)
        for space in self.spaces:
            numbers[list(space.node_rows.values())] = list(space.node_rows)
        return numbers

    def cells(self, word: str, space: DeckSpace) -> np.ndarray:
        """Return the cells that a number or a set means; others are no cells."""
        rows = np.unique(np.asarray(space.rows(word, nodes=False), dtype=np.int64))
        cells = self._cell_of_row[rows]
        return cells[cells >= 0]

    def cells_of_space(self, space: DeckSpace) -> np.ndarray:
        """Return all cells of an instance, or of the deck."""
        rows = np.array(sorted(space.element_rows.values()), dtype=np.int64)
        cells = self._cell_of_row[rows]
        return np.sort(cells[cells >= 0])

    def cells_of_surface(self, name: str) -> np.ndarray:
        """Return the cells whose faces a surface lists."""
        found = [np.empty(0, dtype=np.int64)]
        for known, entries in self.tables.surfaces.items():
            if known.upper() == name.upper():
                found += [rows for rows, _ in entries]
        cells = self._cell_of_row[np.unique(np.concatenate(found))]
        return cells[cells >= 0]

    def cells_at(self, faces: np.ndarray) -> np.ndarray:
        """Return all cells beside some faces."""
        return np.unique(self._cell_of_face_row[np.isin(self.faces.number, faces)])

    def nodes_of_cells(self, cells: np.ndarray) -> np.ndarray:
        """Return the corners of cells."""
        found = [np.empty(0, dtype=np.int64)]
        for block, numbers in zip(self.body.cells, self.body.numbers, strict=True):
            found.append(block.nodes[np.isin(numbers, cells)].ravel())
        return np.unique(np.concatenate(found))

    @cached_property
    def _cell_of_row(self) -> np.ndarray:
        """Return the number of the cell of each element, -1 for none."""
        cell_of_row = np.full(self.tables.element_count, -1)
        begin = 0
        for number in self.body.blocks:
            part = self.tables.blocks[number]
            size = len(part.block.nodes)
            cell_of_row[part.begin : part.begin + size] = np.arange(begin, begin + size)
            begin += size
        kept = np.zeros(self.body.count + 1, dtype=bool)
        kept[np.concatenate(self.body.numbers)] = True
        return np.where(kept[cell_of_row], cell_of_row, -1)

    @cached_property
    def row_of_face(self) -> np.ndarray:
        """Return the first row of each face in the table of faces, shape (f,)."""
        whole = np.flatnonzero(self.faces.number >= 0)
        _, first = np.unique(self.faces.number[whole], return_index=True)
        return whole[first]

    @cached_property
    def cell_of_face(self) -> np.ndarray:
        """Return a cell of each face, shape (f,)."""
        return self._cell_of_face_row[self.row_of_face]

    @cached_property
    def _cell_of_face_row(self) -> np.ndarray:
        """Return the cell of each row of the table of faces."""
        counts = np.diff(self.faces.first)
        cells = []
        for numbers, count in zip(self.body.numbers, counts, strict=True):
            cells.append(np.repeat(numbers, count // max(len(numbers), 1)))
        return np.concatenate(cells)

    @cached_property
    def outer(self) -> np.ndarray:
        """Tell which faces are on the boundary, shape (f,)."""
        return self.faces.count == 1

    def corners(self, faces: np.ndarray) -> np.ndarray:
        """Return the points at the corners of faces, shape (., 2 or 4)."""
        return self.faces.corners[self.row_of_face[faces]]

    @cached_property
    def _faces_of_element(self) -> np.ndarray:
        """Return the faces S1, S2, ... of each element by its row, -1 for none."""
        table = np.full((self.tables.element_count, MOST_FACES), -1)
        entries = zip(
            self.body.blocks,
            self.body.numbers,
            self.faces.first[:-1],
            self.faces.first[1:],
            strict=True,
        )
        before = 0
        for number, cells, begin, end in entries:
            part = self.tables.blocks[number]
            sides = SHAPES[part.block.shape].faces
            places = {frozenset(corners): place for place, corners in enumerate(sides)}
            order = [places[frozenset(corners)] for corners in FACES[part.block.shape]]
            faces = self.faces.number[begin:end].reshape(-1, len(sides))[:, order]
            table[part.begin + cells - before, : len(order)] = faces
            before += len(part.block.nodes)
        return table

    def face_of_element(self, word: str, label: str, space: DeckSpace) -> np.ndarray:
        """Return the faces of elements that a label means, P1 for instance."""
        rows = np.asarray(space.rows(word, nodes=False), dtype=np.int64)
        return self._faces_at_label(rows, int(label[1:]) - 1)

    def surface(self, name: str) -> np.ndarray | None:
        """Return the faces of a surface by its name; None if it is not known."""
        for known, entries in self.tables.surfaces.items():
            if known.upper() == name.upper():
                found = [self._faces_at_label(rows, face) for rows, face in entries]
                return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *found]))
        for known, nodes in self.tables.node_surfaces.items():
            if known.upper() == name.upper():
                return self.within(np.asarray(nodes, dtype=np.int64))
        return None

    def _faces_at_label(self, rows: np.ndarray, label: int | None) -> np.ndarray:
        """Return faces of elements by their rows and the number of the face, from 0.

        Without a number they are all faces on the boundary.
        """
        faces = self._faces_of_element[rows]
        if label is None:
            faces = faces[faces >= 0]
            return faces[self.outer[faces]]
        faces = faces[:, label] if label < MOST_FACES else faces[:0, 0]
        return faces[faces >= 0]

    def within(self, nodes: np.ndarray) -> np.ndarray:
        """Return the faces of the boundary all of whose corners are in a set."""
        faces = faces_within(self.body, self.faces, nodes)
        return faces[self.outer[faces]]

    def around(self, nodes: np.ndarray) -> np.ndarray:
        """Return the faces of the boundary that have a corner in a set."""
        chosen = np.zeros(len(self.x), dtype=bool)
        chosen[self.body.same[nodes]] = True
        faces = np.flatnonzero(self.outer)
        return faces[chosen[self.corners(faces)].any(axis=1)]

    def simplices(self, faces: np.ndarray) -> np.ndarray:
        """Return edges or triangles of faces, shape (m, d); faces may have two."""
        if self.d == 2:
            return self.corners(faces)
        triangles = self.faces.triangles(self.row_of_face[faces]).reshape(-1, 3)
        different = (np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)
        return triangles[different]

    def owners_of_simplices(self, faces: np.ndarray) -> np.ndarray:
        """Return the place in ``faces`` of each of their edges or triangles, (m,)."""
        if self.d == 2:
            return np.arange(len(faces))
        triangles = self.faces.triangles(self.row_of_face[faces])
        different = (np.diff(np.sort(triangles, axis=2), axis=2) > 0).all(axis=2)
        return np.nonzero(different)[0]

    def measures(self, faces: np.ndarray) -> np.ndarray:
        """Return lengths or areas of edges or triangles of faces, shape (m,)."""
        return np.asarray(measures(self.x[self.simplices(faces)]))

    def centres(self, faces: np.ndarray) -> np.ndarray:
        """Return the middles of faces [length], shape (., d)."""
        return self.x[self.corners(faces)].mean(axis=1)

    def normals(self, faces: np.ndarray) -> np.ndarray:
        """Return outward unit normals of faces at their middles, shape (., d)."""
        corners = self.x[self.corners(faces)]
        if self.d == 2:
            along = corners[:, 1] - corners[:, 0]
            normals = np.column_stack([along[:, 1], -along[:, 0]])
        else:
            normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        inward = self.middles[self.cell_of_face[faces]] - corners.mean(axis=1)
        outward = np.einsum("fi,fi->f", normals, inward) < 0
        return np.where(outward[:, None], normals, -normals)

    @cached_property
    def middles(self) -> np.ndarray:
        """Return the middle of each cell [length], shape (c, d)."""
        middles = np.zeros((self.body.count, self.d))
        for block, numbers in zip(self.body.cells, self.body.numbers, strict=True):
            middles[numbers] = self.x[block.nodes].mean(axis=1)
        return middles

    @cached_property
    def simplicial(self) -> Simplices:
        """Return the simplices into which the cells are split."""
        return split(self.body, self.faces)

    def corners_of_cells(self, cells: np.ndarray) -> np.ndarray:
        """Return the corners of the simplices of cells [length], shape (m, d+1, d)."""
        inside = np.isin(self.simplicial.parents, cells)
        return self.simplicial.x[self.simplicial.cells[inside]]

    def with_values(self, values: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return what a field that is quadratic in the simplices is made of.

        Points inside cells that are split have the mean of the corners, and middles of
        edges of simplices the value of the cell there.

        Args:
            values: Values at the points of the deck, shape (n,).

        Returns:
            Points, corners of simplices, values at all points, and values at the
            middles of the edges of each simplex, in the order of
            ``itertools.combinations``.
        """
        simplices = self.simplicial
        of_cells = np.zeros(self.body.count)
        for block, numbers in zip(self.body.cells, self.body.numbers, strict=True):
            of_cells[numbers] = values[block.nodes].mean(axis=1)
        every = np.zeros(len(simplices.x))
        every[simplices.cells] = of_cells[simplices.parents][:, None]
        every[: len(values)] = values
        known, at_middle = self._values_between(values)
        ends = simplices.cells[:, list(combinations(range(self.d + 1), 2))]
        edges = self._edge_numbers(ends)
        place = np.searchsorted(known, edges).clip(max=len(known) - 1)
        between = np.where(known[place] == edges, at_middle[place], every[ends].mean(axis=2))
        return simplices.x, simplices.cells, every, between

    def _values_between(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return numbers of edges and diagonals of cells, sorted, and values there."""
        numbers = []
        at_middle = []
        for number in self.body.blocks:
            block = self.tables.blocks[number].block
            for a, b, value in values_between(self.mesh, block, values):
                numbers.append(self._edge_numbers(self.body.same[block.nodes[:, [a, b]]]))
                at_middle.append(value)
        known, first = np.unique(np.concatenate(numbers), return_index=True)
        return known, np.concatenate(at_middle)[first]

    def _edge_numbers(self, ends: np.ndarray) -> np.ndarray:
        """Return a number of each edge by its ends, shape (..., 2)."""
        return np.asarray(ends.min(axis=-1) * len(self.simplicial.x) + ends.max(axis=-1))

    @cached_property
    def bodies(self) -> np.ndarray:
        """Return the number of the connected body of each cell, shape (c,)."""
        return self.pieces(np.empty(0, dtype=np.int64))

    @cached_property
    def body_of_node(self) -> np.ndarray:
        """Return the number of the connected body of each point, -1 for none, (n,)."""
        body_of_node = np.full(len(self.x), -1)
        for part in self.blocks:
            cells = self._cell_of_row[part.begin : part.begin + len(part.block.nodes)]
            is_cell = cells >= 0
            body_of_node[part.block.nodes[is_cell]] = self.bodies[cells[is_cell]][:, None]
        return body_of_node

    def pieces(self, cut: np.ndarray) -> np.ndarray:
        """Return the number of the connected piece of each cell, shape (c,).

        Cells are connected by their common faces.

        Args:
            cut: Faces that connect nothing.
        """
        connects = (self.faces.count == 2) & ~np.isin(np.arange(len(self.faces.count)), cut)
        rows = np.flatnonzero((self.faces.number >= 0) & connects[self.faces.number])
        by_face = rows[np.argsort(self.faces.number[rows], kind="stable")]
        links = self._cell_of_face_row[by_face].reshape(-1, 2)
        _, numbers = np.unique(components(self.body.count, links), return_inverse=True)
        return np.asarray(numbers)

    def moved(self, points: np.ndarray, x: np.ndarray) -> DeckMesh:
        """Return the mesh with points at other places [length], shape (., d)."""
        everywhere = self.mesh.points.copy()
        everywhere[points, : self.d] = x
        mesh = replace(self.mesh, points=everywhere)
        body = replace(self.body, x=everywhere[:, : self.d])
        return replace(self, mesh=mesh, body=body)

    def named(self, regions: Mapping[str, np.ndarray], parts: Mapping[str, np.ndarray]) -> FileMesh:
        """Return the mesh with regions and parts.

        Args:
            regions: Name of each region -> its cells.
            parts: Name of each part -> its faces. No face is in two parts.
        """
        sizes = [len(self.mesh.blocks[number].nodes) for number in self.body.blocks]
        begins = np.cumsum([0, *sizes])
        element_sets = []
        for name, cells in regions.items():
            block = np.searchsorted(begins, cells, side="right") - 1
            members = {}
            for place, number in enumerate(self.body.blocks):
                members[number] = cells[block == place] - begins[place]
            element_sets.append(ElementSet(name, members))
        facet_sets = [FacetSet(name, self.corners(faces)) for name, faces in parts.items()]
        return replace(self.mesh, element_sets=tuple(element_sets), facet_sets=tuple(facet_sets))


def read_deck_mesh(path: Path) -> DeckMesh:
    """Read the mesh of a deck with its cards, on this rank.

    Raises:
        InputError: If it has no nodes, or its cells cannot be worked with.
    """
    return DeckMesh.of(list(cards_of(path)))


def domain_of(comm: MPI.Comm, mesh: FileMesh | None, subject: str) -> Domain:
    """Make a domain of a mesh on rank 0, which is None on other ranks; collective."""

    def make() -> Built:
        assert mesh is not None
        return build_simplices(mesh, numbered=False)

    return Domain(**spread_from(comm, 0, make, subject))
