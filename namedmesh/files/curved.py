"""Measure how far curved and warped sides of cells lie from sides of simplices."""

from __future__ import annotations

import numpy as np

from namedmesh.files.cleaning import Body, edges_of
from namedmesh.files.faces import Faces, triangles_of
from namedmesh.files.file_mesh import SHAPES, FileMesh

STRAIGHT = 1e-6
"""Distance of a node from its edge that is none, by the length of the edge [-]."""
WARPED = 1e-5
"""Distance of a warped side from its triangles that is none, by a diagonal [-]."""
AT_ONCE = 20_000
"""Number of nodes that are measured at once, which bounds the memory."""


def note_of_curves(mesh: FileMesh, body: Body) -> list[str]:
    """Tell how far the nodes between corners lie from straight edges.

    Returns:
        A note, or none if the edges are straight.
    """
    greatest = 0.0
    share = 0.0
    for number in body.blocks:
        block = mesh.blocks[number]
        corners = block.corners
        middle = block.nodes[:, corners.shape[1] :]
        if not middle.size:
            continue
        ends = edges_of(block.shape)
        # Each node is measured in the first cell that has it; some cells may have none.
        nodes, first = np.unique(middle, return_index=True)
        nodes, first = nodes[nodes >= 0], first[nodes >= 0]
        cells = first // middle.shape[1]
        for begin in range(0, len(nodes), AT_ONCE):
            part = slice(begin, begin + AT_ONCE)
            x = body.x[body.same[corners[cells[part]]]]
            distance, length = _from_nearest_edge(body.x[nodes[part]], x[:, ends])
            on_edge = length > 0
            greatest = max(greatest, float(distance[on_edge].max(initial=0.0)))
            shares = distance[on_edge] / length[on_edge]
            share = max(share, float(shares.max(initial=0.0)))
    if share <= STRAIGHT:
        return []
    note = (
        "the cells have curved sides, of which the corners are taken: the sides move by up to "
        f"{greatest:.3g}, {share:.2%} of an edge"
    )
    return [note]


def _from_nearest_edge(points: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the distance of points from the edge with the nearest middle [length].

    Args:
        points: Points, shape (n, d).
        edges: Ends of edges of the cell of each point, shape (n, k, 2, d).

    Returns:
        Distances, and the lengths of these edges; 0 for nodes of faces and of cells.
    """
    middles = edges.mean(axis=2)
    gaps = np.linalg.norm(middles - points[:, None], axis=2)
    nearest = gaps.argmin(axis=1)
    rows = np.arange(len(points))
    start = edges[rows, nearest, 0]
    along = edges[rows, nearest, 1] - start
    length = np.linalg.norm(along, axis=1)
    unit = along / np.where(length == 0, 1.0, length)[:, None]
    arm = points - start
    distance = np.linalg.norm(arm - (arm * unit).sum(axis=1)[:, None] * unit, axis=1)
    # A node in the middle of a face or of a cell is far from all edges.
    return distance, np.where(gaps[rows, nearest] < length / 3, length, 0.0)


def note_of_warped(body: Body, faces: Faces, volume: float) -> list[str]:
    """Tell how far outer sides with four corners lie from their two triangles.

    A warped side is meant as the bilinear surface of its corners. The volume under it
    is the mean of the volumes under both pairs of triangles.

    Args:
        body: The body.
        faces: Its faces.
        volume: Volume of its simplices [length^3].

    Returns:
        A note, or none if the sides are flat.
    """
    outer = np.flatnonzero(faces.outer)
    if body.x.shape[1] < 3 or not len(outer):
        return []
    corners = faces.corners[outer]
    of_four = (np.diff(np.sort(corners, axis=1), axis=1) > 0).all(axis=1)
    outer = outer[of_four]
    corners = corners[of_four]
    a, b, c, d = body.x[corners].transpose(1, 0, 2)
    distance = np.linalg.norm(a - b + c - d, axis=1) / 4
    share = distance / np.linalg.norm(c - a, axis=1)
    if share.max(initial=0.0) <= WARPED:
        return []
    inside = _middles_by_faces(body)[outer]
    by_second = faces.by_second[faces.number[outer]]
    taken = _volumes(body.x, triangles_of(corners, by_second), inside)
    left = _volumes(body.x, triangles_of(corners, ~by_second), inside)
    # All cells may be turned inside out.
    outward = np.sign(taken + left)
    change = float((outward * (taken - left)).sum()) / 2
    note = (
        "sides with four corners are warped and become two triangles: the sides move by up to "
        f"{distance.max():.3g}, {share.max():.2%} of a diagonal, and the volume by "
        f"{change / (volume - change):+.2%}"
    )
    return [note]


def _middles_by_faces(body: Body) -> np.ndarray:
    """Return the middle of the cell of each face [length], shape (faces, 3)."""
    middles = []
    for block in body.cells:
        of_cells = body.x[block.nodes].mean(axis=1)
        middles.append(np.repeat(of_cells, len(SHAPES[block.shape].faces), axis=0))
    return np.concatenate(middles)


def _volumes(x: np.ndarray, triangles: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return the volumes between pairs of triangles and a point [length^3], shape (n,).

    Args:
        x: Points [length], shape (p, 3).
        triangles: Their corners, shape (n, 2, 3).
        inside: The point of each pair [length], shape (n, 3).
    """
    return np.linalg.det(x[triangles] - inside[:, None, None]).sum(axis=1) / 6
