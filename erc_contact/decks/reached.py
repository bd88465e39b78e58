"""Keep the displacement that a solution has on a part, as a callable of x."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from erc_contact.decks.nodal import NodalTable
from erc_contact.newton.solution import Solution


def tables_on(solution: Solution, part: str) -> tuple[NodalTable, ...]:
    """Return the components of a displacement of degree 2 on a part; collective.

    Args:
        solution: The solution.
        part: Name of the part.
    """
    space = solution.model.space
    d = space.d
    cells = np.unique(space.domain.owned_facets(part)[:, 0])
    corners = np.vstack([np.zeros(d), np.eye(d)])
    middles = corners[list(combinations(range(d + 1), 2))].mean(axis=1)
    x = space.cell_points(corners, cells)
    places = space.cell_points(np.vstack([corners, middles]), cells)
    values = space.everywhere(solution.u)(places, cells)
    of_all = space.comm.allgather((x, values))
    x = np.concatenate([of_rank for of_rank, _ in of_all]).reshape(-1, d)
    values = np.concatenate([of_rank for _, of_rank in of_all])
    simplices = np.arange(len(x)).reshape(-1, d + 1)
    tables = []
    for i in range(d):
        at_corners = values[:, : d + 1, i].ravel()
        tables.append(NodalTable(x, simplices, at_corners, values[:, d + 1 :, i]))
    return tuple(tables)
