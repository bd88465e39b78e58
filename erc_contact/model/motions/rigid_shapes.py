"""Displacements of unit rigid motions."""

from __future__ import annotations

from itertools import combinations

import numpy as np


def translations_and_rotations(x: np.ndarray) -> np.ndarray:
    """Return the rigid motions of the plane or of space about the origin.

    Args:
        x: Positions, shape (n, d).

    Returns:
        Displacements at the positions, shape (n, d, motions): one translation along
        each axis, then one rotation for each pair of axes.
    """
    d = x.shape[1]
    pairs = list(combinations(range(d), 2))
    motions = np.zeros((*x.shape, d + len(pairs)))
    motions[:, range(d), range(d)] = 1.0
    for k, (i, j) in enumerate(pairs, start=d):
        motions[:, i, k] = -x[:, j]
        motions[:, j, k] = x[:, i]
    return motions


def motions_about_axes(x: np.ndarray) -> np.ndarray:
    """Return the rigid motions with the rotations about the axes, in their order.

    Args:
        x: Positions, shape (n, d).

    Returns:
        Displacements at the positions, shape (n, d, motions). In the plane the rotation
        is counterclockwise.
    """
    motions = translations_and_rotations(x)
    if x.shape[1] == 2:
        return motions
    in_xy, in_xz, in_yz = np.moveaxis(motions[:, :, 3:], 2, 0)
    rotations = np.stack([in_yz, -in_xz, in_xy], axis=2)
    return np.concatenate([motions[:, :, :3], rotations], axis=2)
