"""Arrays of a mesh of simplices, with one numbering of a cell's vertices for everything that follows.

The vertices of each cell are sorted by node number. Then the nodes of a facet come in the same order
from both of its cells, and values on facets need no permutation.

Symbols: d dimension, T cell, F facet, facet i of T is opposite to vertex i, J Jacobian (columns x_i - x_0).
Arrays are of all cells of the rank, ghosts included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.model import Model


@dataclass(frozen=True, eq=False)
class Simplices:
    """Geometry and connectivity of the cells of a rank.

    Attributes:
        nodes: Nodes (block degrees of freedom) of each cell, ascending, shape (n, d+1).
        facets: Facet opposite to each of these vertices, shape (n, d+1).
        side: First and second place of each facet as flat index cell * (d+1) + i, the cell of smaller global number
            first; equal on the boundary of the rank's cells, -1 for facets of no cell, shape (2, facets).
        J: Jacobians [length], shape (n, d, d).
        volume: Volumes [length^d], shape (n,).
        area: Outward normals times facet areas [length^(d-1)], shape (n, d+1, d).
    """

    nodes: np.ndarray
    facets: np.ndarray
    side: np.ndarray
    J: np.ndarray
    volume: np.ndarray
    area: np.ndarray

    @property
    def d(self) -> int:
        """Dimension."""
        return self.J.shape[-1]

    @property
    def inverse(self) -> np.ndarray:
        """Inverse Jacobians [1/length], shape (n, d, d); row i-1 is the gradient of barycentric i."""
        return -self.area[:, 1:] / (self.d * self.volume[:, None, None])

    @property
    def has_second(self) -> np.ndarray:
        """Whether a facet lies between two cells of the rank, shape (facets,)."""
        return self.side[0] != self.side[1]


def simplices(model: Model) -> Simplices:
    """The arrays of a model's mesh."""
    d, mesh = model.d, model.mesh
    order = np.argsort(model.nodes, axis=1)
    nodes = np.take_along_axis(model.nodes, order, axis=1)
    facets = mesh.topology.connectivity(d, d - 1).array.reshape(-1, d + 1)
    facets = np.take_along_axis(facets, order, axis=1)
    flat, places = facets.ravel(), np.arange(facets.size)
    facet_map = mesh.topology.index_map(d - 1)
    side = np.full((2, facet_map.size_local + facet_map.num_ghosts), -1)
    side[0, flat[::-1]] = places[::-1]
    side[1, flat] = places
    cell_map = mesh.topology.index_map(d)
    number = cell_map.local_to_global(np.arange(len(nodes), dtype=np.int32))[side // (d + 1)]
    side = np.where(number[0] <= number[1], side, side[::-1])

    x = mesh.geometry.x[np.take_along_axis(mesh.geometry.dofmaps[0], order, axis=1), :d]
    edges = x[:, 1:] - x[:, :1]
    determinant, cofactor = _cofactor(edges)
    area = np.empty((len(nodes), d + 1, d))
    area[:, 1:] = -cofactor * np.sign(determinant)[:, None, None] / (1, 1, 1, 2)[d]
    area[:, 0] = -area[:, 1:].sum(axis=1)
    return Simplices(nodes, facets, side, edges.transpose(0, 2, 1), abs(determinant) / (1, 1, 2, 6)[d], area)


def _cofactor(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Determinants and cofactors of matrices with the given rows; row k of a cofactor is det * grad of x_k."""
    if edges.shape[-1] == 2:
        a, b = edges[:, 0], edges[:, 1]
        turned = np.stack([np.stack([b[:, 1], -b[:, 0]], -1), np.stack([-a[:, 1], a[:, 0]], -1)], 1)
    else:
        a, b, c = edges[:, 0], edges[:, 1], edges[:, 2]
        turned = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], 1)
    return np.einsum("ni,ni->n", edges[:, 0], turned[:, 0]), turned


def facet_order(nodes: np.ndarray) -> np.ndarray:
    """Permutation that sorts the nodes of facets, to go from the order of DOLFINx to ours, shape (n, d)."""
    return np.argsort(nodes, axis=1)


def moments(area: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Moments ``int_F t phi_m`` [force] of linear tractions with nodal values t.

    Args:
        area: Facet areas, shape (n,).
        values: Nodal tractions [force/area], shape (n, d, c).
    """
    d = values.shape[1]
    return (values + values.sum(axis=1, keepdims=True)) * (area / (d * (d + 1)))[:, None, None]


def nodal_forces(moment: np.ndarray) -> np.ndarray:
    """Area times nodal traction, ``|F| t_m`` [force], of moments of shape (..., d, c): the inverse of ``moments``."""
    d = moment.shape[-2]
    return d * ((d + 1) * moment - moment.sum(axis=-2, keepdims=True))


def signed(cells: Simplices, moment: np.ndarray) -> np.ndarray:
    """Facet moments as each cell sees them, opposite on the two sides, shape (n, d+1, d, d)."""
    places = np.arange(cells.facets.size).reshape(cells.facets.shape)
    sign = np.where(cells.side[0][cells.facets] == places, 1.0, -1.0)
    return sign[:, :, None, None] * moment[cells.facets]
