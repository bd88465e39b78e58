"""Move bodies that keep their shapes onto each other, for the glued mesh.

Sides that are paired across a clearance are one set of facets in the glued mesh, which
has one place for each point. It is refined there: the lengths of its edges decide which
ones are cut. So its bodies are bent as little as possible: of all places y of the
points it has the ones with the least ``int |grad (y - x)|^2`` over the bodies, where x
are the places that the bodies have. Each body moves as it likes, and bends only where
two sides differ in shape. The true places are kept for each corner of each cell.

Symbols: d dimension.
"""

from __future__ import annotations

from typing import Any

import numpy as np

CLOSED = 1e-10
"""Relative residual of the places of the glued mesh [-]."""


def close_bodies(x: np.ndarray, cells: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Return the places of the points of the glued mesh [length], shape (g, d).

    Args:
        x: Points of the bodies at their places [length], shape (n, d).
        cells: Points of their cells, shape (m, d+1).
        number: Number of each point in the glued mesh, 0 to g - 1, shape (n,).
    """
    from scipy import sparse  # type: ignore[import-untyped]  # noqa: PLC0415 - joints only
    from scipy.sparse.linalg import cg  # type: ignore[import-untyped]  # noqa: PLC0415

    count = number.max(initial=-1) + 1
    stiffness = _laplacian(x, cells)
    gather = sparse.csr_array(
        (np.ones(len(number)), (np.arange(len(number)), number)), (len(number), count)
    )
    matrix = (gather.T @ stiffness @ gather).tocsr()
    load = gather.T @ (stiffness @ x)
    # The mean of the places of the copies is where a point would be without its body.
    start = (gather.T @ x) / np.bincount(number, minlength=count)[:, None]
    inverse = sparse.diags_array(1 / matrix.diagonal())
    columns = []
    for right, first in zip(load.T, start.T, strict=True):
        # Constants are in the kernel, and the load does no work on them.
        residual = right - matrix @ first
        size = np.linalg.norm(abs(matrix) @ abs(first))
        change, _ = cg(matrix, residual, rtol=CLOSED, atol=CLOSED**1.5 * size, M=inverse)
        columns.append(first + change)
    return np.column_stack(columns)


def _laplacian(x: np.ndarray, cells: np.ndarray) -> Any:
    """Return the matrix of ``d! int grad u . grad v`` of linear functions, (n, n)."""
    from scipy import sparse  # noqa: PLC0415 - joints only

    corners = x[cells]
    edges = corners[:, 1:] - corners[:, :1]
    slopes = np.linalg.inv(edges).swapaxes(1, 2)
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    blocks = abs(np.linalg.det(edges))[:, None, None] * (slopes @ slopes.swapaxes(1, 2))
    rows = np.broadcast_to(cells[:, :, None], blocks.shape)
    columns = np.broadcast_to(cells[:, None, :], blocks.shape)
    size = (len(x), len(x))
    return sparse.coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), size).tocsr()
