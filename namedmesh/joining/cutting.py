"""Cut triangles by a fan, so that points on their sides become vertices.

The triangles may be the cells of a mesh in the plane or a surface in 3D. One with
points on a single side is cut from the opposite vertex. One with points on several
sides first gets a vertex in its middle, so that each of three triangles has one such
side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from namedmesh.tags import NO_TAG


@dataclass(frozen=True, eq=False)
class CutTriangles:
    """Hold triangles that were cut.

    Attributes:
        x: Points [length], the new ones last, shape (n, d).
        triangles: Points of each triangle, shape (m, 3).
        tags: Tag of each side, shape (m, 3); the cuts have none.
        parents: The triangle in which each lies, shape (m,).
    """

    x: np.ndarray
    triangles: np.ndarray
    tags: np.ndarray
    parents: np.ndarray


def cut(
    x: np.ndarray,
    triangles: np.ndarray,
    tags: np.ndarray,
    sides: np.ndarray,
    points: np.ndarray,
) -> CutTriangles:
    """Cut triangles so that points on their sides become vertices.

    Args:
        x: Points [length], shape (n, d).
        triangles: Points of each triangle, shape (m, 3).
        tags: Tag of each side, shape (m, 3).
        sides: Side (triangle, local number) of each new vertex, shape (k, 2).
        points: The point that becomes the vertex, shape (k,).
    """
    whole = CutTriangles(x, triangles, tags, np.arange(len(triangles)))
    if not len(points):
        return whole
    different = np.unique(sides, axis=0)
    count = np.bincount(different[:, 0], minlength=len(triangles))
    halved, sides = _with_middles(whole, np.flatnonzero(count > 1), sides)
    return _fans(halved, sides, points)


def _with_middles(
    whole: CutTriangles, chosen: np.ndarray, sides: np.ndarray
) -> tuple[CutTriangles, np.ndarray]:
    """Cut triangles in three from their middles, and find the sides again."""
    count = len(chosen)
    middles = len(whole.x) + np.arange(count)
    x = np.concatenate([whole.x, whole.x[whole.triangles[chosen]].mean(axis=1)])
    # Child i of a triangle has its side i, and the middle in place of vertex i.
    children = np.repeat(whole.triangles[chosen][:, None], 3, axis=1)
    tags = np.full((count, 3, 3), NO_TAG, dtype=whole.tags.dtype)
    each = np.arange(3)
    children[:, each, each] = middles[:, None]
    tags[:, each, each] = whole.tags[chosen]

    first_child = np.full(len(whole.triangles), -1)
    first_child[chosen] = len(whole.triangles) + 3 * np.arange(count)
    moved = first_child[sides[:, 0]] >= 0
    triangle = np.where(moved, first_child[sides[:, 0]] + sides[:, 1], sides[:, 0])
    # The cut triangles stay in place here, as no side belongs to them: see _fans.
    result = CutTriangles(
        x,
        np.concatenate([whole.triangles, children.reshape(-1, 3)]),
        np.concatenate([whole.tags, tags.reshape(-1, 3)]),
        np.concatenate([whole.parents, np.repeat(chosen, 3)]),
    )
    keep = np.ones(len(result.triangles), dtype=bool)
    keep[chosen] = False
    number = np.cumsum(keep) - 1
    kept = CutTriangles(x, result.triangles[keep], result.tags[keep], result.parents[keep])
    return kept, np.column_stack([number[triangle], sides[:, 1]])


def _fans(whole: CutTriangles, sides: np.ndarray, points: np.ndarray) -> CutTriangles:
    """Cut triangles from the vertex opposite to the only side with new vertices."""
    triangle, local = sides.T
    corners = whole.triangles[triangle[:, None], (local[:, None] + np.arange(3)) % 3]
    x = whole.x
    along = x[corners[:, 2]] - x[corners[:, 1]]
    place = np.einsum("ij,ij->i", x[points] - x[corners[:, 1]], along)
    order = np.lexsort([place, triangle])
    triangle, local, corners, points = (rows[order] for rows in (triangle, local, corners, points))
    apex, start, end = corners.T
    first = np.concatenate([[True], np.diff(triangle) > 0])
    last = np.concatenate([np.diff(triangle) > 0, [True]])
    # A piece ends at each new vertex, and a last one at the end of the side.
    before = np.where(first, start, np.roll(points, 1))
    pieces = np.concatenate(
        [
            np.column_stack([apex, before, points]),
            np.column_stack([apex, points, end])[last],
        ]
    )
    of_row = np.concatenate([np.arange(len(points)), np.flatnonzero(last)])
    old_tags = whole.tags[triangle[:, None], (local[:, None] + np.arange(3)) % 3][of_row]
    tags = np.full((len(pieces), 3), NO_TAG, dtype=whole.tags.dtype)
    tags[:, 0] = old_tags[:, 0]
    at_end = np.arange(len(pieces)) >= len(points)
    at_start = np.concatenate([first, np.zeros(last.sum(), dtype=bool)])
    tags[at_end, 1] = old_tags[at_end, 1]
    tags[at_start, 2] = old_tags[at_start, 2]
    uncut = np.ones(len(whole.triangles), dtype=bool)
    uncut[triangle] = False
    return CutTriangles(
        whole.x,
        np.concatenate([whole.triangles[uncut], pieces]),
        np.concatenate([whole.tags[uncut], tags]),
        np.concatenate([whole.parents[uncut], whole.parents[triangle[of_row]]]),
    )
