"""Geometry of the cells of a mesh of simplices, with one order of the vertices of each cell.

The vertices of each cell are sorted by node number. Then the nodes of a facet have the
same order in both of its cells, and values on facets need no permutation.

Symbols: d dimension, k degree, T cell, F facet, facet i of T is opposite to vertex i, J
Jacobian (columns x_i - x_0), N number of nodes of a cell, m number of nodes of a facet.
Arrays have all cells of the rank, ghosts included. Tractions on facets and
displacements are given by Bernstein coefficients, see :mod:`erc_contact.mesh.simplex`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.mesh.simplex import facet_vertices, from_means, mass, node_between, node_vertices
from erc_contact.model.space import Space


@dataclass(frozen=True, eq=False)
class CellGeometry:
    """Geometry and connectivity of the cells of a rank, ghosts included, with sorted vertices.

    Attributes:
        degree: Degree k.
        order: Place of each sorted vertex in DOLFINx's order, shape (n, d+1).
        nodes: Nodes (block degrees of freedom) of each cell: those at the vertices,
            ascending, then those on the edges between them, shape (n, N).
        facets: Facet opposite to each of these vertices, shape (n, d+1).
        side: The two places of each facet, as flat index cell * (d+1) + i, shape (2,
            facets). The cell of smaller global number is first. Both are equal on the
            boundary of the rank's cells, and -1 for facets of no cell.
        J: Jacobians [length], shape (n, d, d).
        volume: Volumes [length^d], shape (n,).
        area: Outward normals times facet areas [length^(d-1)], shape (n, d+1, d).
    """

    degree: int
    order: np.ndarray
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
    def vertices(self) -> np.ndarray:
        """Nodes of the vertices of each cell, shape (n, d+1)."""
        return self.nodes[:, : self.d + 1]

    @property
    def vertices_of_facets(self) -> np.ndarray:
        """Nodes of the vertices of each facet, ascending, shape (facets, d)."""
        cell, i = np.divmod(np.maximum(self.side[0], 0), self.d + 1)
        return self.vertices[cell[:, None], facet_vertices(self.d)[i]]

    @property
    def edges(self) -> np.ndarray:
        """Edges from the first vertex of each cell to the others [length], contiguous, shape (n, d, d)."""
        return np.ascontiguousarray(self.J.transpose(0, 2, 1))

    @property
    def inverse(self) -> np.ndarray:
        """Inverse Jacobians [1/length], shape (n, d, d); row i-1 is the gradient of barycentric i."""
        return -self.area[:, 1:] / (self.d * self.volume[:, None, None])

    @property
    def has_second(self) -> np.ndarray:
        """Whether a facet lies between two cells of the rank, shape (facets,)."""
        return self.side[0] != self.side[1]


def cell_geometry(space: Space) -> CellGeometry:
    """The geometry of the cells of a mesh."""
    d, mesh = space.d, space.mesh
    order = np.argsort(space.vertices, axis=1)
    ends = order[:, node_vertices(d, space.degree)]
    nodes = np.take_along_axis(
        space.nodes, node_between(d, space.degree)[ends[..., 0], ends[..., 1]], axis=1
    )
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

    x = np.take_along_axis(space.cell_corners(), order[:, :, None], axis=1)
    edges = x[:, 1:] - x[:, :1]
    determinant, cofactor = _cofactor(edges)
    area = np.empty((len(nodes), d + 1, d))
    area[:, 1:] = -cofactor * np.sign(determinant)[:, None, None] / (1, 1, 1, 2)[d]
    area[:, 0] = -area[:, 1:].sum(axis=1)
    J, volume = edges.transpose(0, 2, 1), abs(determinant) / (1, 1, 2, 6)[d]
    return CellGeometry(space.degree, order, nodes, facets, side, J, volume, area)


def sorted_corners(space: Space, cells: CellGeometry) -> np.ndarray:
    """Coordinates of the sorted vertices of all cells [length], shape (n, d+1, d)."""
    return np.take_along_axis(space.cell_corners(), cells.order[:, :, None], axis=1)


def _cofactor(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Determinants and cofactors of matrices with the given rows; row k of a cofactor is det * grad of x_k."""
    if edges.shape[-1] == 2:
        a, b = edges[:, 0], edges[:, 1]
        turned = np.stack([np.stack([b[:, 1], -b[:, 0]], -1), np.stack([-a[:, 1], a[:, 0]], -1)], 1)
    else:
        a, b, c = edges[:, 0], edges[:, 1], edges[:, 2]
        turned = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], 1)
    return np.einsum("ni,ni->n", edges[:, 0], turned[:, 0]), turned


def facet_order(vertices: np.ndarray, degree: int) -> np.ndarray:
    """Permutation of the nodes of facets that sorts their vertices (n, d), shape (n, m)."""
    d = vertices.shape[1]
    ends = np.argsort(vertices, axis=1)[:, node_vertices(d - 1, degree)]
    return node_between(d - 1, degree)[ends[..., 0], ends[..., 1]]


def facet_forces(area: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Force ``S_b |F_i| n_i`` [force] of each coefficient of a symmetric stress on each facet of some cells.

    Args:
        area: Outward normals times facet areas, shape (n, d+1, d).
        stress: Coefficients, shape (n, b, d, d).

    Returns:
        The forces, shape (n, d+1, b, d).
    """
    n, b, d, _ = stress.shape
    return np.matmul(area, stress.reshape(n, b * d, d).transpose(0, 2, 1)).reshape(n, d + 1, b, d)


def moments(area: np.ndarray, values: np.ndarray, degree: int) -> np.ndarray:
    """Moments ``int_F t B_m`` [force] of tractions with Bernstein coefficients t.

    Args:
        area: Facet areas, shape (n,).
        values: Coefficients [force/area], shape (n, m, d).
        degree: Their degree.
    """
    d = values.shape[2]
    return np.matmul(mass(d - 1, degree, degree), values) * area[:, None, None]


def force_coefficients(moment: np.ndarray, degree: int) -> np.ndarray:
    """Coefficients of area times traction, ``|F| t`` [force], from moments (..., m, d): inverse to :func:`moments`."""
    d = moment.shape[-1]
    return from_means(d - 1, degree, moment)


def signed(cells: CellGeometry, moment: np.ndarray) -> np.ndarray:
    """Moments of the tractions on each cell, of opposite sign on the two sides of a facet, shape (n, d+1, m, d)."""
    places = np.arange(cells.facets.size).reshape(cells.facets.shape)
    sign = np.where(cells.side[0][cells.facets] == places, 1.0, -1.0)
    return sign[:, :, None, None] * moment[cells.facets]
