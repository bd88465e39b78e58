"""Take the displacement from a file of results, with the cells in which it lives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import cast

import numpy as np
from mpi4py import MPI

from namedmesh.base.exceptions import InputError, on_rank, words_of
from namedmesh.base.ranks import from_first
from namedmesh.files.cleaning import Body, body_of
from namedmesh.files.faces import faces_of
from namedmesh.files.file_mesh import SHAPES, Block, FileMesh
from namedmesh.files.reading import kind_of, read
from namedmesh.files.shape_functions import (
    CORNERS,
    SIMPLICES,
    WHOLE,
    ShapeFunctions,
    middle_groups,
)
from namedmesh.files.simplices import split
from namedmesh.graphs import components

NAMES = ("disp", "u", "depl")
"""Beginnings of the names of displacements, in small letters."""
NAMES_OF_FORCES = ("forc", "rf")
"""The same of forces on nodes, which are reactions and loads."""
DIAGONALS = {
    "quadrilateral": ((0, 2), (1, 3)),
    "hexahedron": ((0, 6), (1, 7), (2, 4), (3, 5)),
}
"""Ends of the diagonals of cells through their middles."""
SAMPLE = 50
"""Number of cells whose nodes tell between which corners the nodes of a block lie."""


@dataclass(frozen=True, eq=False)
class FieldBlock:
    """Hold cells of one shape in which a displacement lives.

    Attributes:
        corners: Rows of their corners, shape (m, corners).
        nodes: Rows of their nodes, shape (m, k).
        functions: The shape functions of the nodes.
        body: Number of the connected body of each cell, shape (m,).
    """

    corners: np.ndarray
    nodes: np.ndarray
    functions: ShapeFunctions
    body: np.ndarray


@dataclass(frozen=True, eq=False)
class FileField:
    """Hold a displacement in the cells of a file.

    Cells have straight edges between their corners, and the shape functions of all
    their nodes.

    Attributes:
        x: Points [length], then middles of cells that were split, shape (n, d).
        values: Displacements at the points of the file [length], shape (n, d).
        blocks: The cells.
        simplices: Corners of the simplices into which they are split, shape (s, d+1).
        block_of_simplex: Number of the block of the cell of each simplex, shape (s,).
        cell_of_simplex: Number of this cell in its block, shape (s,).
        time: The time of the displacement [time]; None if the file does not tell it.
        forces: Forces on the points [force], shape (n, d), None without.
    """

    x: np.ndarray
    values: np.ndarray
    blocks: tuple[FieldBlock, ...]
    simplices: np.ndarray
    block_of_simplex: np.ndarray
    cell_of_simplex: np.ndarray
    time: float | None
    forces: np.ndarray | None = None

    @property
    def degree(self) -> int:
        """Return the degree of elements on simplices that carry it best, 1 or 2."""
        return 1 if self.has_elements_of(1) else 2

    def has_elements_of(self, degree: int) -> bool:
        """Tell whether its cells are triangles or tetrahedra of a degree."""
        functions = [block.functions for block in self.blocks]
        return all(of.shape in SIMPLICES and of.order == degree for of in functions)

    @cached_property
    def factors(self) -> list[np.ndarray]:
        """Return the factors of the products in the cells of each block, (m, k, d)."""
        return [block.functions.factors(self.values[block.nodes]) for block in self.blocks]

    @property
    def body_of_simplex(self) -> np.ndarray:
        """Return the number of the connected body of each simplex, shape (s,)."""
        bodies = np.empty(len(self.simplices), dtype=np.int64)
        for number, block in enumerate(self.blocks):
            here = self.block_of_simplex == number
            bodies[here] = block.body[self.cell_of_simplex[here]]
        return bodies


def displacement_of(mesh: FileMesh) -> FileField:
    """Return the displacement of a file of results.

    Raises:
        InputError: If the file has none, or several vectors of which none is called so,
            or its cells cannot be worked with.
    """
    u = _choose_vector(mesh)
    forces = [
        values[:, : mesh.dim]
        for name, values in mesh.values.items()
        if name.lower().startswith(NAMES_OF_FORCES)
    ]
    body = body_of(mesh)
    simplices = split(body, faces_of(body.cells, body.x))
    begins = np.cumsum([0, *(len(mesh.blocks[number].nodes) for number in body.blocks)])
    connected = _connected(body)
    blocks = []
    # Of each cell the number in its block, without cells that were left out.
    row_of_cell = np.zeros(body.count, dtype=np.int64)
    entries = zip(body.blocks, body.cells, body.numbers, begins, strict=False)
    for number, cells, numbers, begin in entries:
        functions, columns = _functions_of(mesh, mesh.blocks[number])
        nodes = mesh.blocks[number].nodes[numbers - begin][:, columns]
        blocks.append(FieldBlock(cells.nodes, nodes, functions, connected[cells.nodes[:, 0]]))
        row_of_cell[numbers] = np.arange(len(numbers))
    return FileField(
        simplices.x,
        u[:, : mesh.dim],
        tuple(blocks),
        simplices.cells,
        np.searchsorted(begins, simplices.parents, side="right") - 1,
        row_of_cell[simplices.parents],
        mesh.time,
        next(iter(forces), None),
    )


def _connected(body: Body) -> np.ndarray:
    """Return the number of the connected body of each point, shape (n,)."""
    links = [np.empty((0, 2), dtype=np.int64)]
    for block in body.cells:
        for corner in block.nodes.T[1:]:
            links.append(np.column_stack([block.nodes[:, 0], corner]))
    return components(len(body.x), np.concatenate(links))


def _functions_of(mesh: FileMesh, block: Block) -> tuple[ShapeFunctions, list[int]]:
    """Return the shape functions of the cells of a block, and the columns of the nodes.

    Nodes in the middles of faces are left out of cells that have no node in their own.
    """
    corners = SHAPES[block.shape].corners
    places = np.array(CORNERS[block.shape], dtype=float)
    columns = list(range(corners))
    if block.nodes.shape[1] == corners:
        return ShapeFunctions(block.shape, places, 1), columns
    whole = block.nodes.shape[1] == WHOLE.get(block.shape)
    groups = middle_groups(block.shape, whole=whole)
    columns += columns_of_middles(mesh, block, groups)
    middles = [places[list(group)].mean(axis=0) for group in groups]
    return ShapeFunctions(block.shape, np.vstack([places, middles]), 2), columns


def _choose_vector(mesh: FileMesh) -> np.ndarray:
    """Return the vector that is the displacement [length], shape (n, 3).

    Raises:
        InputError: If there is none, or several of which none is called so.
    """
    found = {name: u for name, u in mesh.values.items() if len(u) == len(mesh.points)}
    called = [name for name in found if name.lower().startswith(NAMES)]
    if len(called) == 1 or (called and len(found) > 1):
        return found[called[0]]
    if len(found) == 1:
        return next(iter(found.values()))
    have = ", ".join(map(repr, found)) or "no vector at points"
    raise InputError(
        f"it has {have}; the displacement is the vector whose name begins with 'disp', 'u' or "
        "'depl', or the only vector."
    )


def columns_of_middles(mesh: FileMesh, block: Block, groups: list[tuple[int, ...]]) -> list[int]:
    """Return the column of the node in the middle of each group of corners.

    Files count nodes of second order each in their way, so that their places tell it.
    """
    sample = block.nodes[:: max(1, len(block.nodes) // SAMPLE)]
    x = mesh.points[sample]
    count = block.corners.shape[1]
    columns = []
    for group in groups:
        middle = x[:, list(group)].mean(axis=1)
        gaps = np.linalg.norm(x[:, count:] - middle[:, None], axis=2).mean(axis=0)
        columns.append(count + int(gaps.argmin()))
    return columns


def values_between(
    mesh: FileMesh, block: Block, u: np.ndarray
) -> list[tuple[int, int, np.ndarray]]:
    """Return pairs of corners of cells, and the values in their middles.

    The pairs are the edges and the diagonals of faces and of hexahedra.

    Args:
        mesh: The mesh.
        block: The cells.
        u: Values at its points, shape (n, ...).
    """
    functions, columns = _functions_of(mesh, block)
    pairs = [*middle_groups(block.shape, whole=False)]
    for face in SHAPES[block.shape].faces:
        if len(face) == 4:
            pairs += [(face[0], face[2]), (face[1], face[3])]
    pairs += DIAGONALS.get(block.shape, ())
    nodal = u[block.nodes[:, columns]]
    result = []
    for a, b in pairs:
        (shares,) = functions.at(functions.nodes[[a, b]].mean(axis=0, keepdims=True))
        result.append((a, b, np.tensordot(nodal, shares, axes=(1, 0))))
    return result


def edge_nodes(mesh: FileMesh, block: Block) -> dict[tuple[int, int], int]:
    """Return the column of the node of each edge of cells of second order."""
    ends = middle_groups(block.shape, whole=False)
    columns = columns_of_middles(mesh, block, ends)
    return {(a, b): column for (a, b), column in zip(ends, columns, strict=True)}


def from_file(comm: MPI.Comm, path: str | Path) -> FileField:
    """Read the displacement of a file of results; collective.

    Args:
        comm: Communicator.
        path: The file.

    Raises:
        InputError: On all ranks, if the file is missing, unreadable, or has no
            displacement at its points.
    """

    def read_field() -> FileField:
        try:
            file = Path(path)
            return displacement_of(read(file, kind_of(file), numbered=False))
        except Exception as reason:  # libraries raise errors of any class
            raise InputError(
                f"certify: the file {str(path)!r} cannot be used: {words_of(reason)}."
            ) from reason

    return cast("FileField", from_first(comm, on_rank(comm, 0, read_field)))
