"""Find the points at which bodies touch without a common facet, and say where.

Such a point, in space also such an edge, would be a hinge of the elements alone: in
elasticity it transmits no force, and no stress in equilibrium does. So a mesh is torn
there (:mod:`erc_contact.mesh.copies`), and messages about what nothing holds name it.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.base.ranks import distinct_rows

ROUND_OFF = 1e-12
"""Coordinate that is told as zero, over the size of the bodies [-]."""
TOLD = 3
"""Greatest number of points in a message."""


def touching(comm: MPI.Comm, x: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the points that belong to several groups; collective.

    Args:
        comm: The ranks.
        x: Points of this rank [length], shape (n, d).
        group: Group of each, shape (n,).

    Returns:
        The points, and the group of each, one row for each point and group; the same on
        all ranks.
    """
    rows = distinct_rows(comm, np.column_stack([x, group]))
    _, number, count = np.unique(rows[:, :-1], axis=0, return_inverse=True, return_counts=True)
    rows = rows[count[number.ravel()] > 1]
    return rows[:, :-1], rows[:, -1].astype(int)


def told(points: np.ndarray, size: float) -> str:
    """Return points (n, d) in words; what is round-off of a size [length] is zero."""
    points = np.unique(np.where(abs(points) < ROUND_OFF * size, 0.0, points), axis=0)
    words = [f"({', '.join(f'{value:.4g}' for value in point)})" for point in points[:TOLD]]
    more = len(points) - len(words)
    return ", ".join(words) + (f" and {more} more" if more else "")
