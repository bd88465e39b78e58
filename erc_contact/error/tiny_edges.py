"""Tell where tiny edges beside long edges make the error large.

Such edges are what a mesher makes of a small detail of a CAD model. The iteration that
tightens sigma^ is slow there.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.base.logs import log_of
from erc_contact.model.space import Space
from namedmesh.base.percent import percent, place_words
from namedmesh.base.releases import cell_nodes

LARGE = 0.2
"""Error eps from which on it is asked for [-]."""
GRADED = 100.0
"""Ratio of the longest to the shortest edge at a vertex that counts as graded [-]."""
MOST = 0.5
"""Share of e^2 in cells at such vertices that is told [-]."""


def tell_tiny_edges(space: Space, cells_2: np.ndarray, error_2: float, scale_2: float) -> None:
    """Warn where cells with tiny edges have most of a large error; collective.

    Args:
        space: The mesh.
        cells_2: Shares of the owned cells in e^2 [force length].
        error_2: e^2 [force length].
        scale_2: Square of its scale [force length].
    """
    if error_2 <= LARGE**2 * scale_2:
        return
    comm = space.comm
    shortest, longest = _edges_at_cells(space, len(cells_2))
    of_graded = np.where(longest > GRADED * shortest, cells_2, 0.0)
    share = comm.allreduce(float(of_graded.sum()), MPI.SUM) / error_2
    if share <= MOST:
        return
    worst = None
    if of_graded.any():
        cell = int(np.argmax(of_graded))
        middle = space.cell_corners()[cell].mean(axis=0)
        place = place_words(middle, 3)
        worst = float(of_graded[cell]), float(shortest[cell]), float(longest[cell]), place
    of_ranks = [of_rank for of_rank in comm.allgather(worst) if of_rank is not None]
    _, least, most, where = max(of_ranks)
    log_of(comm).warning(
        f"{percent(share, 2)} of e^2 lie at edges from {least:.2g} to {most:.2g} near {where}: "
        "sigma^ is poor where so different edges meet. Leave out so small a detail of the body, "
        "or mesh finer around it."
    )


def _edges_at_cells(space: Space, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the shortest and the longest edge at the vertices of cells [length].

    Args:
        space: The mesh.
        count: Number of cells, the first ones.
    """
    corners = space.cell_corners()
    vertices = cell_nodes(space.mesh.geometry)[: len(corners)]
    first, second = np.triu_indices(space.d + 1, 1)
    edges = np.linalg.norm(corners[:, first] - corners[:, second], axis=2)
    nodes = len(space.mesh.geometry.x)
    shortest = np.full(nodes, np.inf)
    longest = np.zeros(nodes)
    for ends in (first, second):
        np.minimum.at(shortest, vertices[:, ends], edges)
        np.maximum.at(longest, vertices[:, ends], edges)
    at_vertices = vertices[:count]
    worst = np.argmax(longest[at_vertices] / shortest[at_vertices], axis=1)[:, None]
    chosen = np.take_along_axis(at_vertices, worst, axis=1)[:, 0]
    return shortest[chosen], longest[chosen]
