"""Values of nodes and cells that ranks have in common."""

from __future__ import annotations

import numpy as np
from dolfinx import la

from erc_contact.model.space import Space


def marked_by_any(space: Space, *marks: np.ndarray) -> list[np.ndarray]:
    """Return which nodes any rank marks; collective.

    Args:
        space: The mesh.
        marks: Nodes of this rank that it marks, at most d times, shape (nodes,).
    """
    shared = space.function()
    columns = shared.x.array.reshape(-1, space.d)
    for column, of_rank in zip(columns.T, marks, strict=False):
        column[:] = of_rank
    shared.x.scatter_reverse(la.InsertMode.add)
    shared.x.scatter_forward()
    return [columns[:, i] > 0 for i in range(len(marks))]


def sums_of_cells(space: Space, values: np.ndarray) -> np.ndarray:
    """Add up the values that all ranks have for the owned cells; collective.

    Args:
        space: The mesh.
        values: Values of the cells of this rank, ghosts included, shape (cells,).

    Returns:
        The sums, shape (owned,).
    """
    if space.comm.size > 1:
        of_cells = space.domain.function("DG", 0)
        place = of_cells.function_space.dofmap.list[:, 0]
        of_cells.x.array[place] = values
        of_cells.x.scatter_reverse(la.InsertMode.add)
        values = of_cells.x.array[place]
    return values[: space.domain.owned_cells]
