"""Measure what is missing in the equilibrium of a stress of axisymmetric cells.

In each piece of a cell: the axial part of ``div S + c f``, and how far the hoop
component is from ``r div S . e_r``, which defines it. Between two pieces: the jumps of
``S n``. On each facet: S n less the traction of the facet. At nodes on the axis: S.
All are forces.

Symbols: n cells, N_k coefficients of a piece, m of a facet, b of degree k-1.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np

from erc_contact.admissible.axisymmetric.elements import Elements, on_pieces, times_linear
from erc_contact.admissible.axisymmetric.kernels import ring_kernels
from erc_contact.admissible.reference import named_nodes
from namedmesh.simplex import gradients, local_facet_nodes, node_vertices


def missing_forces(
    elements: Elements, stress: np.ndarray, forces: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the greatest missing force in each owned cell, and the greatest force.

    Args:
        elements: The cells with their body force.
        stress: Coefficients of the owned cells, shape (owned, 3, N_k, 4).
        forces: ``|F| t`` on their facets [force], shape (owned, 3, m, 2).

    Returns:
        Two arrays [force], shape (owned,).
    """
    owned = len(stress)
    cells = elements.cells
    k = cells.degree
    missing, size = np.empty((2, owned))
    ring_kernels()(
        "ring_missing",
        *(k, owned, elements.corners, elements.on_axis, cells.area),
        *(np.ascontiguousarray(local_facet_nodes(2, k), dtype=np.int32), _common_nodes(k)),
        *(
            np.ascontiguousarray(node_vertices(2, k), dtype=np.int32),
            np.ascontiguousarray(gradients(2, k)),
        ),
        *(times_linear(k), on_pieces(k), elements.force, np.ascontiguousarray(forces)),
        *(stress, missing, size),
    )
    return missing, size


@cache
def _common_nodes(k: int) -> np.ndarray:
    """Return the nodes that two pieces have in common, shape (3, 2, m).

    Pieces follow each other as 0 and 1, 0 and 2, 1 and 2; the nodes are of the first
    piece, then of the second.
    """
    pairs = []
    for first, second in combinations(range(3), 2):
        here = named_nodes(2, k, first, second)
        there = named_nodes(2, k, second, first)
        pairs.append([list(here.values()), [there[name] for name in here]])
    return np.array(pairs, dtype=np.int32)
