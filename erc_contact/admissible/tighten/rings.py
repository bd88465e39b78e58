"""The rings of facets around the centres of patches.

The centre of a patch is a vertex in 2D and an edge in 3D. Its ring is the facets and
cells around it.

Symbols: d dimension, F facets. A pair d * facet + j is the facet in the ring of the
centre that is opposite to its node j. A step of a ring is a number 2 * pair + q, with q
= 1 if the first cell of the facet comes after it in the ring, and q = 0 if the second
one does.
"""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.mesh.simplex import facet_vertices
from erc_contact.model.space import Space


def rings(space: Space, cells: CellGeometry) -> tuple[np.ndarray, np.ndarray]:
    """Find the rings of this rank, in a row, the smallest rings first.

    A centre belongs to the rank that owns its node of least global number. That rank
    has all cells around it. Each ring is walked along, all in the same sense. It starts
    at the boundary if it ends there.

    Returns:
        The steps of all rings, and the number of facets of each, both of type int32.
    """
    d = cells.d
    nodes = cells.vertices_of_facets
    number = space.global_numbers(nodes)
    owned = space.V.dofmap.index_map.size_local
    has_cell = cells.side[0] >= 0
    facets = np.arange(len(nodes))
    mine = np.empty(nodes.shape, dtype=bool)
    for j, centre in enumerate(facet_vertices(d - 1)):
        first = number[:, centre].argmin(axis=1)
        mine[:, j] = (nodes[facets, centre[first]] < owned) & has_cell
    steps = int(mine.sum())
    ring, size = np.empty((2, steps), dtype=np.int32)
    count = kernels(d)(
        "find_rings", mine.size, cells.edges, cells.facets, cells.side, mine, ring, size
    )
    # Sort the rings by size: a step moves by the difference of the starts of its ring.
    size = size[:count]
    start = np.cumsum(size) - size
    by_size = np.argsort(size, kind="stable")
    size = size[by_size]
    new_start = np.cumsum(size) - size
    shift = np.repeat(start[by_size] - new_start, size)
    return ring[shift + np.arange(steps)], size
