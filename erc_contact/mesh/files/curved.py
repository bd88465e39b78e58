"""Measure how far the curved sides of cells of higher order lie from flat sides."""

from __future__ import annotations

import numpy as np

from erc_contact.mesh.files.cleaning import Body, edges_of
from erc_contact.mesh.files.file_mesh import FileMesh

STRAIGHT = 1e-6
"""Distance of a node from its edge that is none, by the length of the edge [-]."""
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
        # Each node is measured in the first cell that has it.
        nodes, first = np.unique(middle, return_index=True)
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
