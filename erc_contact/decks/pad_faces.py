"""Choose the faces that stand for points of a body.

Points on an edge of the body lie on two of its sides. A rigid pad around the edge would
clamp it, and a pad that lies flat on one side turns with it, as the points do.
"""

from __future__ import annotations

import numpy as np

from namedmesh.for_solvers import DeckMesh, components

SMOOTH = 0.87
"""Cosine of the greatest angle between normals on one side of a body [-]."""
DIGITS = 6
"""Digits to which sides are compared."""


def pads_at(
    mesh: DeckMesh, nodes: np.ndarray, free: np.ndarray, along: np.ndarray
) -> list[np.ndarray]:
    """Return the faces around nodes, side by side, the best side first.

    The best side is across what the nodes hold, as a bearing is; of several it is the
    side with the least area. Where no side has all nodes it is all faces around.

    Args:
        mesh: The mesh.
        nodes: The points.
        free: Faces that may be in a pad.
        along: 1 for each component that is held, else 0, shape (d,).
    """
    corners = mesh.corners_near(nodes)
    around = free[np.isin(mesh.corners(free), corners).any(axis=1)]
    if not len(around):
        return []
    normals = mesh.normals(around)
    side = _sides(normals)
    found = []
    for number in np.unique(side):
        on_side = side == number
        faces = around[on_side]
        if np.isin(corners, mesh.corners(faces)).all():
            across = float((normals[on_side] ** 2 @ along).mean())
            area = float(mesh.measures(faces).sum())
            found.append((-round(across, DIGITS), float(f"{area:.{DIGITS}g}"), faces))
    found.sort(key=lambda entry: entry[:2])
    return [faces for *_, faces in found] or [around]


def _sides(normals: np.ndarray) -> np.ndarray:
    """Return the number of the smooth side of each face, by its normal."""
    different, which = np.unique(np.round(normals, DIGITS), axis=0, return_inverse=True)
    links = np.argwhere(different @ different.T > SMOOTH)
    return components(len(different), links)[which.ravel()]
