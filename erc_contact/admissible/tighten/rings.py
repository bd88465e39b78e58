"""The rings of facets around the centres of patches: which facets they contain, and the geometry of each facet.

The centre of a patch is a vertex in 2D and an edge in 3D. Its ring is the facets and cells around it.

Symbols: d dimension, n cells, F facets, b = d(d-1)/2 edges of a facet. A pair (F, j) is facet F in the ring of the
centre that is opposite to node j of F.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.mesh.simplex import facet_vertices
from erc_contact.model.space import Space


def facet_edges(d: int) -> np.ndarray:
    """Nodes at the two ends of each edge of a facet, shape (b, 2)."""
    return np.array(list(combinations(range(d), 2)))


def rings(space: Space, cells: CellGeometry) -> tuple[np.ndarray, np.ndarray]:
    """The pairs of all centres of this rank, one ring after the other, and the sizes of the rings, ascending.

    A centre belongs to the rank that owns its node of least global number. That rank has all cells around it.

    Returns:
        The pairs as numbers j * F + facet, and the number of facets of each ring.
    """
    d, nodes = cells.d, cells.vertices_of_facets
    centres = np.concatenate([nodes[:, others] for others in facet_vertices(d - 1)])
    least = np.take_along_axis(centres, space.global_numbers(centres).argmin(axis=1)[:, None], axis=1)[:, 0]
    pairs = np.flatnonzero(np.tile(cells.side[0] >= 0, d) & (least < space.V.dofmap.index_map.size_local))
    key = centres[pairs] @ (space.node_count ** np.arange(d - 1, dtype=np.int64))
    _, centre, size = np.unique(key, return_inverse=True, return_counts=True)
    by_size = np.argsort(size, kind="stable")
    number = np.empty_like(by_size)
    number[by_size] = np.arange(len(size))
    return pairs[np.argsort(number[centre], kind="stable")], size[by_size]


def unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors along vectors of shape (d, ...)."""
    return vectors / np.sqrt((vectors * vectors).sum(axis=0))


def couples(slopes: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Weights ``g_j . g_l / |g_j|`` of the normal at node l in the couple about the centre opposite to node j.

    g_j is the part of slope j in the plane of the facet. Slopes are area vectors over the volume: the gradients of the
    barycentric coordinates of a cell, up to one factor that is the same everywhere.

    Args:
        slopes: Of the nodes of a facet, shape (d, d, n): component, node.
        normal: Unit normals of the facet, shape (d, n).

    Returns:
        Shape (d, d, n): j, l.
    """
    inside = slopes - normal[:, None] * (slopes * normal[:, None]).sum(axis=0)
    gram = (inside[:, :, None] * inside[:, None]).sum(axis=0)
    return gram / np.sqrt(np.einsum("jjn->jn", gram))[:, None]


def senses(cells: CellGeometry) -> np.ndarray:
    """Sense, +1 or -1, in which each cell passes through its facet f in the ring of pair (f, j), shape (d+1, d, n).

    It is the orientation of (centre, node j, the node of the cell that is not on the facet). The two facets of a cell
    at one centre have opposite senses, and so have the two cells of a facet.
    """
    d = cells.d
    parity = np.zeros((d + 1, d, 1))
    for f, vertices in enumerate(facet_vertices(d)):
        for j in range(d):
            centre = [v for v in vertices if v != vertices[j]]
            parity[f, j] = np.round(np.linalg.det(np.eye(d + 1)[[*centre, vertices[j], f]]))
    return np.sign(np.linalg.det(cells.J)) * parity
