"""Find the body in the mesh of a file, and clean its cells.

What cannot be meant is left out and told; what cannot be worked with is refused by its
place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.base.percent import place_words
from namedmesh.files.file_mesh import SHAPES, Block, FileMesh
from namedmesh.graphs import components
from namedmesh.rows import row_numbers

FLAT = 1e-9
"""Thickness of a plane mesh that is round-off, as a share of its extent [-]."""
COLLAPSED = (0, 1, 2, 2, 3, 3, 3, 3)
"""Corner of a tetrahedron at each corner of a hexahedron."""
TOGETHER = 1e-12
"""Distance of corners of a cell that is none, by its longest edge [-]."""


@dataclass(frozen=True, eq=False)
class Body:
    """Hold the cells of a body.

    Attributes:
        x: Points [length], shape (n, d), all points of the file.
        blocks: Numbers of the blocks of the file that are cells of the body.
        cells: Corners of the cells of each of these blocks.
        numbers: Numbers of these cells. The cells of the blocks, also cells that are
            left out, are numbered one block after the other.
        count: How many cells the blocks have.
        same: Point with which each point of the file is one, shape (n,).
        notes: What was left out or changed, in words.
    """

    x: np.ndarray
    blocks: tuple[int, ...]
    cells: tuple[Block, ...]
    numbers: tuple[np.ndarray, ...]
    count: int
    same: np.ndarray
    notes: tuple[str, ...]


def body_of(mesh: FileMesh) -> Body:
    """Find the body in the mesh of a file, and clean its cells.

    Raises:
        InputError: If there is none, or its points are not finite or not in the plane
            (x, y).
    """
    dim = mesh.dim
    if dim < 2:
        others = ", ".join(f"{number} of type {kind}" for kind, number in mesh.left_out.items())
        raise InputError(
            "there are no cells of a solid: tetrahedra, hexahedra, prisms or pyramids, or in the "
            "plane triangles or quadrilaterals."
            + (f" It has elements that are no solids: {others}." if others else "")
        )
    notes = [*mesh.notes]
    for kind, number in mesh.left_out.items():
        notes.append(f"{number} elements of type {kind}, which are no solids")
    numbers = tuple(i for i, block in enumerate(mesh.blocks) if block.dim == dim)
    blocks = [mesh.blocks[number] for number in numbers]
    used = np.unique(np.concatenate([block.corners.ravel() for block in blocks]))
    _check_rows(mesh, used)
    x = _in_body_space(mesh.points, used, dim)
    same = _merge(x, blocks)
    moved = int((same != np.arange(len(same))).sum())
    if moved:
        notes.append(f"{moved} points in the place of another corner of the same cell")
    cells = []
    kept = []
    begin = 0
    doubled = 0
    collapsed = 0
    for block in blocks:
        corners = _tetrahedra_as_collapsed(same[block.corners])
        whole = np.flatnonzero(_different(corners) > dim)
        first = whole[_first_of_each(corners[whole])]
        collapsed += len(corners) - len(whole)
        doubled += len(whole) - len(first)
        cells.append(Block(block.shape, corners[first]))
        kept.append(begin + first)
        begin += len(corners)
    if collapsed:
        notes.append(f"{collapsed} cells that have a point twice and no volume")
    if doubled:
        notes.append(f"{doubled} cells that are there twice")
    if not sum(map(len, kept)):
        raise InputError("all its cells have collapsed, and no volume is left.")
    return Body(x, numbers, tuple(cells), tuple(kept), begin, same, tuple(notes))


def _check_rows(mesh: FileMesh, used: np.ndarray) -> None:
    """Check that the points of cells exist and are finite.

    Raises:
        InputError: If they are not.
    """
    if used[0] < 0 or used[-1] >= len(mesh.points):
        raise InputError(
            f"a cell has a point that is not in the file, of whose {len(mesh.points)} points the "
            "cells use some; the file is cut off or damaged."
        )
    bad = used[~np.isfinite(mesh.points[used]).all(axis=1)]
    if len(bad):
        raise InputError(
            f"{len(bad)} points of cells have coordinates that are no numbers, the first is point "
            f"{bad[0] + 1} at {place_words(mesh.points[bad[0]], 6)}; look how the file was written."
        )


def _in_body_space(points: np.ndarray, used: np.ndarray, dim: int) -> np.ndarray:
    """Return the points in the space of the body [length], shape (n, dim).

    Raises:
        InputError: If the cells are a surface that is not in the plane (x, y).
    """
    if dim == 3:
        return points
    thickness = np.ptp(points[used], axis=0)
    if thickness[2] <= FLAT * thickness.max():
        return points[:, :2]
    for axis, (first, second) in ((1, "xz"), (0, "yz")):
        if thickness[axis] <= FLAT * thickness.max():
            order = [0, 2, 1] if axis == 1 else [1, 2, 0]
            raise InputError(
                f"the mesh lies in the plane ({first}, {second}); a plane body lies in (x, y). "
                "Swap the coordinates: mesh = meshio.read(path); mesh.points = "
                f"mesh.points[:, {order}]; mesh.write(path)."
            )
    raise InputError(
        "the mesh is a surface in 3D, a shell; allowed are a surface in the plane (x, y) or a "
        "volume. Shells are not solved; mesh the volume."
    )


def _merge(x: np.ndarray, blocks: Sequence[Block]) -> np.ndarray:
    """Return for each point the least point of a common cell that is in its place.

    Args:
        x: Points [length], shape (n, d).
        blocks: The cells.
    """
    pairs = [np.empty((0, 2), dtype=np.int64)]
    for block in blocks:
        ends = edges_of(block.shape)
        corners = x[block.corners].transpose(1, 2, 0).copy()
        length = np.array([abs(corners[a] - corners[b]).max(axis=0) for a, b in ends])
        edge, cell = np.nonzero(length <= TOGETHER * length.max(axis=0))
        a, b = ends[edge].T
        pairs.append(np.column_stack([block.nodes[cell, a], block.nodes[cell, b]]))
    links = np.unique(np.concatenate(pairs), axis=0)
    links = links[links[:, 0] != links[:, 1]]
    return components(len(x), links) if len(links) else np.arange(len(x))


def edges_of(shape: str) -> np.ndarray:
    """Return the pairs of corners of the edges of a shape, shape (edges, 2)."""
    edges = set()
    for face in SHAPES[shape].faces:
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            edges.add((min(a, b), max(a, b)))
    return np.array(sorted(edges))


def _tetrahedra_as_collapsed(corners: np.ndarray) -> np.ndarray:
    """Return corners of cells; four different corners of a hexahedron in one order.

    LS-DYNA gives a tetrahedron as a hexahedron whose last five corners are one, and its
    first side would have four corners that are not in a plane.
    """
    if corners.shape[1] != len(COLLAPSED):
        return corners
    of_four = np.flatnonzero(_different(corners) == 4)
    result = corners.copy()
    ordered = np.sort(corners[of_four], axis=1)
    is_new = np.column_stack([np.full(len(of_four), True), np.diff(ordered, axis=1) > 0])
    result[of_four] = ordered[is_new].reshape(-1, 4)[:, COLLAPSED]
    return result


def _different(rows: np.ndarray) -> np.ndarray:
    """Count the different numbers in each row."""
    return 1 + (np.diff(np.sort(rows, axis=1), axis=1) > 0).sum(axis=1)


def _first_of_each(rows: np.ndarray) -> np.ndarray:
    """Return the rows that have not been there before, in their order."""
    (numbers,) = row_numbers(rows)
    _, first = np.unique(numbers, return_index=True)
    return np.sort(first)
