"""Take the displacement from a file of results, at vertices and middles of simplices.

Quadrilaterals, hexahedra, prisms and pyramids are split. At the middles of their
diagonals, which are edges of simplices, stand the values that the shape functions of
the file have there.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
from mpi4py import MPI

from namedmesh.base.exceptions import InputError, on_rank, words_of
from namedmesh.base.ranks import from_first
from namedmesh.files.cleaning import edges_of
from namedmesh.files.file_mesh import SHAPES, Block, FileMesh
from namedmesh.files.reading import kind_of, read
from namedmesh.rows import row_numbers

NAMES = ("disp", "u", "depl")
"""Beginnings of the names of displacements, in small letters."""
OF_CORNERS = -0.25
"""Value of the shape function of a corner in the middle of a cell of order 2 [-]."""
BODY_DIAGONALS = ((0, 6), (1, 7), (2, 4), (3, 5))
"""Ends of the diagonals of a hexahedron through its middle."""
SAMPLE = 50
"""Number of cells whose nodes tell between which corners the nodes of a block lie."""


@dataclass(frozen=True, eq=False)
class FileField:
    """Hold a displacement at the nodes of simplices.

    Attributes:
        points: Vertices, then middles of edges [length], shape (n, 3).
        values: Displacements there [length], shape (n, 3).
        inward: Middle of the cells at each point, less the point [length], shape (n,
            3). It tells bodies apart that touch.
        vertices: How many points are vertices.
        degree: Degree of elements that carry it, 1 or 2.
        interpolated: Whether cells were split, which changes it inside them.
        time: Its time [time]; None if the file does not tell it.
    """

    points: np.ndarray
    values: np.ndarray
    inward: np.ndarray
    vertices: int
    degree: int
    interpolated: bool
    time: float | None


def displacement_of(mesh: FileMesh) -> FileField:
    """Return the displacement of a file of results.

    Raises:
        InputError: If the file has none, or several vectors of which none is called so.
    """
    u = _choose_vector(mesh)
    blocks = [block for block in mesh.blocks if block.dim == mesh.dim]
    used = np.unique(np.concatenate([block.corners.ravel() for block in blocks]))
    ends = []
    values = []
    middles = []
    split = False
    quadratic = False
    for block in blocks:
        second = block.nodes.shape[1] > block.corners.shape[1]
        quadratic |= second
        split |= block.shape not in ("triangle", "tetrahedron")
        middle = mesh.points[block.corners].mean(axis=1)
        for a, b, value in values_between(mesh, block, u, second=second):
            ends.append(np.column_stack([block.nodes[:, a], block.nodes[:, b]]))
            values.append(value)
            middles.append(middle)
    pairs = np.concatenate(ends)
    (numbers,) = row_numbers(pairs)
    _, first = np.unique(numbers, return_index=True)
    at_middle = 0.5 * (mesh.points[pairs[first, 0]] + mesh.points[pairs[first, 1]])
    between = np.concatenate(values)[first]
    points = np.vstack([mesh.points[used], at_middle])
    # Of each point the mean of the middles of its cells.
    row = np.full(len(mesh.points), -1)
    row[used] = np.arange(len(used))
    middle = np.concatenate(middles)
    sums = np.zeros((len(points), 3))
    weights = np.zeros(len(points))
    for rows in (row[pairs[:, 0]], row[pairs[:, 1]], len(used) + numbers):
        np.add.at(sums, rows, middle)
        np.add.at(weights, rows, 1.0)
    return FileField(
        points,
        np.vstack([u[used], between]),
        sums / weights[:, None] - points,
        len(used),
        2 if quadratic or split else 1,
        split,
        mesh.time,
    )


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


def values_between(
    mesh: FileMesh, block: Block, u: np.ndarray, *, second: bool
) -> list[tuple[int, int, np.ndarray]]:
    """Return pairs of corners of cells, and the values in their middles.

    The pairs are the edges and the diagonals of faces and of hexahedra.

    Args:
        mesh: The mesh.
        block: The cells.
        u: Values at its points, shape (n, ...).
        second: Whether the middles of edges are nodes.
    """
    shape = SHAPES[block.shape]
    corners = u[block.corners]
    on_edge = {}
    for a, b in edges_of(block.shape):
        on_edge[int(a), int(b)] = 0.5 * (corners[:, a] + corners[:, b])
    if second:
        for (a, b), column in edge_nodes(mesh, block).items():
            on_edge[a, b] = u[block.nodes[:, column]]
    result = [(a, b, value) for (a, b), value in on_edge.items()]
    faces = shape.faces if shape.dim == 3 else (tuple(range(shape.corners)),)
    for face in faces:
        if len(face) == 4:
            pairs = [(face[i], face[(i + 1) % 4]) for i in range(4)]
            of_edges = [on_edge[min(a, b), max(a, b)] for a, b in pairs]
            middle = _in_the_middle(corners[:, face], of_edges, second)
            result += [(face[0], face[2], middle), (face[1], face[3], middle)]
    if block.shape == "hexahedron":
        middle = _in_the_middle(corners, list(on_edge.values()), second)
        result += [(a, b, middle) for a, b in BODY_DIAGONALS]
    return result


def _in_the_middle(corners: np.ndarray, edges: list[np.ndarray], second: bool) -> np.ndarray:
    """Return the value in the middle of faces with four corners or of hexahedra.

    Args:
        corners: Values at the corners, shape (cells, corners, 3).
        edges: Values at the middles of the edges, shape (cells, 3) each.
        second: Whether these are nodes of their own.
    """
    if not second:
        return corners.mean(axis=1)
    # The shape functions of all nodes sum to 1.
    of_edges = (1.0 - OF_CORNERS * corners.shape[1]) / len(edges)
    return OF_CORNERS * corners.sum(axis=1) + of_edges * np.sum(edges, axis=0)


def edge_nodes(mesh: FileMesh, block: Block) -> dict[tuple[int, int], int]:
    """Return the column of the node of each edge of cells of second order.

    Files count these nodes each in their way, so that their places tell the edge.
    """
    ends = edges_of(block.shape)
    sample = block.nodes[:: max(1, len(block.nodes) // SAMPLE)]
    x = mesh.points[sample]
    middles = x[:, ends].mean(axis=2)
    count = block.corners.shape[1]
    gaps = np.linalg.norm(x[:, count:, None] - middles[:, None], axis=3).mean(axis=0)
    nearest = gaps.argmin(axis=0)
    return {(int(a), int(b)): count + int(nearest[i]) for i, (a, b) in enumerate(ends)}


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
