"""Geometry of the cells of a mesh of simplices, with one order of their vertices.

The vertices of each cell are sorted by node number. Then the nodes of a facet have the
same order in both of its cells, and values on facets need no permutation.

Symbols: d dimension, k degree, T cell, F facet, facet i of T is opposite to vertex i, J
Jacobian (columns x_i - x_0), N number of nodes of a cell, m number of nodes of a facet.
Arrays have all cells of the rank, ghosts included. Tractions on facets and
displacements are given by Bernstein coefficients, see :mod:`namedmesh.simplex`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from erc_contact.admissible.images import NO_IMAGES, NoImages
from erc_contact.model.space import Space
from namedmesh.simplex import (
    from_means,
    mass,
    node_between,
    node_vertices,
    of_facets,
)


@dataclass(frozen=True, eq=False)
class CellGeometry:
    """Hold the geometry and connectivity of the cells of a rank, ghosts included.

    The vertices of each cell are sorted by node number.

    Attributes:
        degree: Degree k.
        places: Place of each sorted node in DOLFINx's order, shape (n, N).
        nodes: Nodes (block degrees of freedom) of each cell: those at the vertices,
            ascending, then those on the edges between them, shape (n, N).
        facets: Facet opposite to each of these vertices, shape (n, d+1).
        side: The two places of each facet, as flat index cell * (d+1) + i, shape (2,
            facets). The cell of smaller global number is first. Both are equal on the
            boundary of the rank's cells, and -1 for facets of no cell.
        corners: Coordinates of these vertices [length], shape (n, d+1, d).
        J: Jacobians [length], shape (n, d, d).
        volume: Volumes [length^d], shape (n,).
        area: Outward normals times facet areas [length^(d-1)], shape (n, d+1, d).
        images: What is known of cells that are images of others.

    Example:
        >>> cells = admissible.cell_geometry
        >>> float(cells.volume.sum())  # the block is 2 by 1
        2.0
        >>> float(abs(cells.area.sum(axis=1)).max())  # the surface of a cell is closed
        0.0
    """

    degree: int
    places: np.ndarray
    nodes: np.ndarray
    facets: np.ndarray
    side: np.ndarray
    corners: np.ndarray
    J: np.ndarray
    volume: np.ndarray
    area: np.ndarray
    images: NoImages = NO_IMAGES

    @property
    def d(self) -> int:
        """Return the dimension."""
        return self.J.shape[-1]

    @property
    def order(self) -> np.ndarray:
        """Return the place of each sorted vertex in DOLFINx's order, shape (n, d+1)."""
        return np.ascontiguousarray(self.places[:, : self.d + 1])

    @property
    def vertices(self) -> np.ndarray:
        """Return the nodes of the vertices of each cell, shape (n, d+1)."""
        return self.nodes[:, : self.d + 1]

    @property
    def vertices_of_facets(self) -> np.ndarray:
        """Return the nodes of the vertices of each facet, ascending: (facets, d)."""
        cell, i = np.divmod(np.maximum(self.side[0], 0), self.d + 1)
        return of_facets(self.vertices[cell], i)

    @property
    def edges(self) -> np.ndarray:
        """Return the edges that leave the first vertex of each cell [length].

        The array is contiguous, shape (n, d, d).
        """
        return np.ascontiguousarray(self.J.transpose(0, 2, 1))

    @property
    def inverse(self) -> np.ndarray:
        """Return the inverse Jacobians [1/length], shape (n, d, d).

        Row i-1 is the gradient of barycentric coordinate i.
        """
        return -self.area[:, 1:] / (self.d * self.volume[:, None, None])

    @property
    def has_second(self) -> np.ndarray:
        """Tell which facets lie between two cells of the rank, shape (facets,)."""
        return self.side[0] != self.side[1]


def cell_geometry(space: Space) -> CellGeometry:
    """Compute the geometry of the cells of a mesh."""
    d, k = space.d, space.degree
    order = np.argsort(space.vertices, axis=1)
    ends = order[:, node_vertices(d, k)]
    places = node_between(d, k)[ends[..., 0], ends[..., 1]]
    nodes = np.take_along_axis(space.nodes, places, axis=1)
    facets = space.mesh.topology.connectivity(d, d - 1).array.reshape(-1, d + 1)
    facets = np.take_along_axis(facets, order, axis=1)
    side = _sides(space, facets)

    corners = np.take_along_axis(space.cell_corners(), order[:, :, None], axis=1)
    return CellGeometry(k, places, nodes, facets, side, corners, *shapes_of_cells(corners))


def shapes_of_cells(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute J, volumes and areas of cells, see :class:`CellGeometry`.

    Args:
        corners: The vertices of the cells [length], shape (n, d+1, d).
    """
    d = corners.shape[2]
    edges = corners[:, 1:] - corners[:, :1]
    determinant, cofactor = _cofactor(edges)
    # The gradient of barycentric i points into the cell: -d |T| grad is an area.
    area = np.empty(corners.shape)
    area[:, 1:] = -cofactor * np.sign(determinant)[:, None, None] / factorial(d - 1)
    area[:, 0] = -area[:, 1:].sum(axis=1)
    volume = abs(determinant) / factorial(d)
    return edges.transpose(0, 2, 1), volume, area


def _sides(space: Space, facets: np.ndarray) -> np.ndarray:
    """Find the two places of each facet, see :attr:`CellGeometry.side`."""
    d = space.d
    topology = space.mesh.topology
    flat = facets.ravel()
    places = np.arange(facets.size)
    facet_map = topology.index_map(d - 1)
    side = np.full((2, facet_map.size_local + facet_map.num_ghosts), -1)
    # Of two places that write the same entry, the last one stays.
    side[0, flat[::-1]] = places[::-1]
    side[1, flat] = places
    # Global numbers make the first side the same one on all ranks.
    cells = np.arange(len(facets), dtype=np.int32)
    global_cells = topology.index_map(d).local_to_global(cells)
    number = global_cells[side // (d + 1)]
    return np.where(number[0] <= number[1], side, side[::-1])


def _cofactor(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute determinants and cofactors of matrices with the given rows.

    Row k of a cofactor is the determinant times the gradient of x_k.
    """
    if edges.shape[-1] == 2:
        a, b = edges[:, 0], edges[:, 1]
        of_a = np.stack([b[:, 1], -b[:, 0]], -1)
        of_b = np.stack([-a[:, 1], a[:, 0]], -1)
        cofactor = np.stack([of_a, of_b], 1)
    else:
        a, b, c = edges[:, 0], edges[:, 1], edges[:, 2]
        cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], 1)
    determinant = np.einsum("ni,ni->n", edges[:, 0], cofactor[:, 0])
    return determinant, cofactor


def facet_order(vertices: np.ndarray, degree: int) -> np.ndarray:
    """Return the permutation of nodes that sorts the vertices (n, d), shape (n, m)."""
    d = vertices.shape[1]
    ends = np.argsort(vertices, axis=1)[:, node_vertices(d - 1, degree)]
    return node_between(d - 1, degree)[ends[..., 0], ends[..., 1]]


def facet_forces(area: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Compute the forces ``S_b |F_i| n_i`` of a symmetric stress on facets [force].

    There is one for each coefficient and each facet of a cell.

    Args:
        area: Outward normals times facet areas, shape (n, d+1, d).
        stress: Coefficients, shape (n, b, d, d).

    Returns:
        The forces, shape (n, d+1, b, d).
    """
    n, b, d, _ = stress.shape
    by_component = stress.reshape(n, b * d, d).transpose(0, 2, 1)
    return np.matmul(area, by_component).reshape(n, d + 1, b, d)


def moments(area: np.ndarray, values: np.ndarray, degree: int) -> np.ndarray:
    """Compute the moments ``int_F t B_m`` of tractions [force].

    Args:
        area: Facet areas, shape (n,).
        values: Bernstein coefficients t [force/area], shape (n, m, d).
        degree: Their degree.
    """
    d = values.shape[2]
    return np.matmul(mass(d - 1, degree, degree), values) * area[:, None, None]


def force_coefficients(moment: np.ndarray, degree: int) -> np.ndarray:
    """Return coefficients of ``|F| t`` from moments (..., m, d) [force].

    Divided by the area this is the inverse of :func:`moments`.
    """
    d = moment.shape[-1]
    return from_means(d - 1, degree, moment)


def add_moments(space: Space, total: np.ndarray, facets: np.ndarray, moment: np.ndarray) -> None:
    """Add moments of facets (cell, local facet) to the moments of all facets, in place.

    ``moment`` has the nodes of a facet in the order of DOLFINx, ``total`` sorted.

    Args:
        space: The mesh.
        total: Moments of all facets [force], shape (facets, m, d).
        facets: The facets, shape (f, 2).
        moment: Their moments [force], shape (f, m, d).
    """
    moment = np.take_along_axis(moment, _sorting(space, facets), axis=1)
    total[space.facet_numbers(facets)] += moment


def tractions_of(space: Space, total: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return the tractions on facets from the moments of all facets [force/area].

    Args:
        space: The mesh.
        total: Moments of all facets [force], shape (facets, m, d).
        facets: The facets (cell, local facet), shape (f, 2).

    Returns:
        Bernstein coefficients in the order of DOLFINx, shape (f, m, d).
    """
    means = values_on(space, total, facets) / space.facet_areas(facets)[:, None, None]
    return from_means(space.d - 1, space.degree, means)


def values_on(space: Space, total: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return values of all facets on some, the inverse of :func:`add_moments`.

    Args:
        space: The mesh.
        total: Values of all facets, shape (facets, m, d).
        facets: The facets (cell, local facet), shape (f, 2).

    Returns:
        The values in the order of DOLFINx, shape (f, m, d).
    """
    of_facets = total[space.facet_numbers(facets)]
    values = np.empty_like(of_facets)
    np.put_along_axis(values, _sorting(space, facets), of_facets, axis=1)
    return values


def _sorting(space: Space, facets: np.ndarray) -> np.ndarray:
    """Return the permutation that sorts the nodes of facets, shape (f, m, 1)."""
    vertices = space.facet_nodes(facets)[:, : space.d]
    return facet_order(vertices, space.degree)[:, :, None]


def moments_of_cells(cells: CellGeometry, moment: np.ndarray) -> np.ndarray:
    """Return the moments of the tractions on each cell, shape (n, d+1, m, d).

    They have opposite signs on the two sides of a facet.
    """
    places = np.arange(cells.facets.size).reshape(cells.facets.shape)
    sign = np.where(cells.side[0][cells.facets] == places, 1.0, -1.0)
    return sign[:, :, None, None] * moment[cells.facets]
