"""Find corners of bodies, and corners that move when two sides become a pair.

Where two sides are nearer to each other than a thousandth of their facets, they are
taken to be drawn in one place, and the corners of one side move to the other side. The
bodies are then the bodies of the mesh that results, which a message says.
"""

from __future__ import annotations

import numpy as np

from namedmesh.plain import PlainMesh
from namedmesh.simplex import outward_normals

CORNER = 0.1
"""Least eigenvalue of the mean of ``n n^T`` over the facets at a corner [-].

In the plane that is a turn of 0.65 rad. On the edge of a body in 3D it is zero.
"""
MOVED = 1e-7
"""Distance by which a corner moves unnoticed, over the size of the sides [-].

It is the accuracy of numbers of single precision, as files have them.
"""


def moved_corner(
    before: PlainMesh, after: PlainMesh, tags: tuple[int, int]
) -> tuple[np.ndarray, float] | None:
    """Find the corner of two sides that has moved farthest.

    Args:
        before: The mesh whose sides lie against each other.
        after: The mesh in which they are one.
        tags: Tags of the sides before.

    Returns:
        Where it was [length], shape (d,), and how far it moved [length]; None if all
        corners are where they were.
    """
    sides = np.argwhere(np.isin(before.tags, tags))
    points = np.unique(before.points_of(sides))
    corners = before.x[points[_sharpness(before)[points] > CORNER]]
    size = np.linalg.norm(np.ptp(before.x[points], axis=0))
    if len(corners) == 0:
        return None
    distance = np.array([np.linalg.norm(after.x - corner, axis=1).min() for corner in corners])
    farthest = int(np.argmax(distance))
    if distance[farthest] <= MOVED * size:
        return None
    return corners[farthest], float(distance[farthest])


def _sharpness(plain: PlainMesh) -> np.ndarray:
    """Return the least eigenvalue of the mean of ``n n^T`` at each point, shape (n,).

    The mean is over the facets of the boundary at the point; inside it is zero.
    """
    outer = np.argwhere(plain.is_outer)
    corners = plain.x[plain.cells[outer[:, 0]]]
    normals = outward_normals(corners, outer[:, 1])
    points = plain.points_of(outer)
    total = np.zeros((len(plain.x), plain.dim, plain.dim))
    products = normals[:, None, :, None] * normals[:, None, None, :]
    np.add.at(total, points, np.broadcast_to(products, (*points.shape, plain.dim, plain.dim)))
    number = np.bincount(points.ravel(), minlength=len(plain.x))
    mean = total / np.maximum(number, 1)[:, None, None]
    return np.linalg.eigvalsh(mean)[:, 0]
