"""Find points in the cells of a file, and evaluate its displacement there.

Symbols: d dimension, n points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from dolfinx import geometry
from mpi4py import MPI

from namedmesh.closest import closest
from namedmesh.files.displacements import FileField
from namedmesh.files.shape_functions import corner_functions, inverses_of_maps, local_coordinates
from namedmesh.partition import distribute
from namedmesh.rows import in_space, row_numbers
from namedmesh.simplex import barycentric, facet_vertices

INSIDE = -1e-9
"""Least barycentric coordinate of points that are inside [-]."""
PADDING = 1e-8
"""How much the boxes of cells are widened, over the extent of the bodies [-]."""
LATTICE = 2.0
"""Nodes of cells of first and second order have local coordinates i/2."""


@dataclass(frozen=True, eq=False)
class PlacesInCells:
    """Hold where points are in the cells of a file.

    Attributes:
        simplex: Number of the simplex of each point, shape (n,).
        block: Number of the block of its cell, shape (n,).
        cell: Number of the cell in its block, shape (n,).
        local: Local coordinates there, shape (n, d).
        distance: Distance of a point outside of all cells to the nearest cell, whose
            nearest point stands for it [length], shape (n,); zero inside.
    """

    simplex: np.ndarray
    block: np.ndarray
    cell: np.ndarray
    local: np.ndarray
    distance: np.ndarray


class FieldInCells:
    """Evaluate the displacement of a file in some of its bodies.

    Args:
        field: The displacement.
        bodies: Numbers of the bodies; None for all of them.
        tolerance: Distance of a point to a node that is none [length].

    Example:
        >>> inside = FieldInCells(field, None, 1e-6)
        >>> inside.values(inside.places(np.array([[0.5, 0.5]])))
    """

    def __init__(self, field: FileField, bodies: np.ndarray | None, tolerance: float) -> None:
        self.field = field
        self.tolerance = tolerance
        self._is_chosen = np.ones(len(field.simplices), dtype=bool)
        if bodies is not None:
            self._is_chosen = np.isin(field.body_of_simplex, bodies)
        self._chosen = np.flatnonzero(self._is_chosen)

    @cached_property
    def _tree(self) -> tuple[geometry.BoundingBoxTree, np.ndarray]:
        """Return the tree of boxes of the simplices, and the simplex of each box."""
        nodes, cells = np.unique(self.field.simplices[self._chosen], return_inverse=True)
        x = np.ascontiguousarray(self.field.x[nodes])
        mesh = distribute(MPI.COMM_SELF, cells.reshape(len(self._chosen), -1), x)
        extent = np.ptp(x, axis=0).max()
        tree = geometry.bb_tree(mesh, mesh.topology.dim, padding=PADDING * extent)
        return tree, self._chosen[mesh.topology.original_cell_index]

    def places(self, x: np.ndarray, guess: np.ndarray | None = None) -> PlacesInCells:
        """Find points.

        Args:
            x: The points [length], shape (n, d).
            guess: Simplices in which they may be, which are tried first, shape (n,).
        """
        simplex = np.zeros(len(x), dtype=np.int64)
        least = np.full(len(x), -np.inf)
        if guess is not None:
            simplex = guess.copy()
            least = np.where(self._is_chosen[guess], self._least(guess, x), -np.inf)
        left = np.flatnonzero(least < 0.0)
        if len(left):
            simplex[left], least[left] = self._simplices(x[left])
        distance = np.zeros(len(x))
        near = x.copy()
        outside = np.flatnonzero(least < INSIDE)
        if len(outside):
            simplex[outside], near[outside], distance[outside] = self._nearest(x[outside])
        field = self.field
        block_of = field.block_of_simplex[simplex]
        cell_of = field.cell_of_simplex[simplex]
        local = np.empty(x.shape)
        for number, block in enumerate(field.blocks):
            here = np.flatnonzero(block_of == number)
            shape = block.functions.shape
            corners = field.x[block.corners[cell_of[here]]]
            found = local_coordinates(shape, corners, near[here])
            # A node has its own value, whatever digits its place has.
            node = np.round(LATTICE * found) / LATTICE
            at_node = np.matmul(corner_functions(shape).at(node)[:, None], corners)[:, 0]
            is_node = np.linalg.norm(at_node - near[here], axis=1) <= self.tolerance
            local[here] = np.where(is_node[:, None], node, found)
        return PlacesInCells(simplex, block_of, cell_of, local, distance)

    def values(self, places: PlacesInCells) -> np.ndarray:
        """Evaluate the displacement [length], shape (n, d)."""
        result = np.empty(places.local.shape)
        for number, block in enumerate(self.field.blocks):
            here = np.flatnonzero(places.block == number)
            products = block.functions.products(places.local[here])
            factors = self.field.factors[number][places.cell[here]]
            result[here] = np.matmul(products[:, None], factors)[:, 0]
        return result

    def nodal_forces(self, places: PlacesInCells, forces: np.ndarray) -> np.ndarray:
        """Return the forces on nodes that do the work of forces at points.

        Args:
            places: The points.
            forces: Forces at them [force], shape (n, d).

        Returns:
            Shape of the displacement of the file.
        """
        result = np.zeros(self.field.values.shape)
        for number, block in enumerate(self.field.blocks):
            here = np.flatnonzero(places.block == number)
            unit = block.functions.factors(np.eye(block.nodes.shape[1])[None])[0]
            shares = block.functions.products(places.local[here]) @ unit
            nodes = block.nodes[places.cell[here]]
            np.add.at(result, nodes, shares[:, :, None] * forces[here][:, None])
        return result

    def gradients(self, places: PlacesInCells) -> np.ndarray:
        """Evaluate the derivatives ``du_i/dx_j`` of the displacement [-], (n, d, d)."""
        d = places.local.shape[1]
        result = np.empty((len(places.local), d, d))
        for number, block in enumerate(self.field.blocks):
            here = np.flatnonzero(places.block == number)
            local = places.local[here]
            factors = self.field.factors[number][places.cell[here]]
            along = np.matmul(factors.swapaxes(1, 2), block.functions.slopes(local))
            corners = self.field.x[block.corners[places.cell[here]]]
            of_map = corner_functions(block.functions.shape).gradients(local)
            jacobian = np.matmul(corners.swapaxes(1, 2), of_map)
            result[here] = np.matmul(along, inverses_of_maps(jacobian))
        return result

    def _least(self, simplex: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the least barycentric coordinate of points in simplices, (n,)."""
        corners = self.field.x[self.field.simplices[simplex]]
        edges = corners[:, 1:] - corners[:, :1]
        offset = x - corners[:, 0]
        local = np.linalg.solve(edges.transpose(0, 2, 1), offset[..., None])[..., 0]
        return np.asarray(barycentric(local).min(axis=1))

    def _simplices(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find the simplex that holds each point best.

        Returns:
            The simplex, and the least barycentric coordinate of the point in it, -inf
            where no simplex is near.
        """
        tree, numbers = self._tree
        candidates = geometry.compute_collisions_points(tree, in_space(x))
        counts = np.diff(candidates.offsets)
        point = np.repeat(np.arange(len(x)), counts)
        simplex = numbers[candidates.array]
        least = self._least(simplex, x[point])
        # The last one of each point in this order is the best.
        order = np.lexsort((-simplex, least, point))
        has_one = counts > 0
        last = order[np.cumsum(counts)[has_one] - 1]
        found = np.zeros(len(x), dtype=np.int64)
        best = np.full(len(x), -np.inf)
        found[has_one] = simplex[last]
        best[has_one] = least[last]
        return found, best

    @cached_property
    def _boundary(self) -> tuple[np.ndarray, np.ndarray]:
        """Return simplices with an outer facet, and the corners of the facet."""
        simplices = self.field.simplices[self._chosen]
        d = simplices.shape[1] - 1
        facets = simplices[:, facet_vertices(d)].reshape(-1, d)
        (numbers,) = row_numbers(facets)
        outer = np.flatnonzero(np.bincount(numbers)[numbers] == 1)
        return self._chosen[outer // (d + 1)], self.field.x[facets[outer]]

    def _nearest(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Find the point of the boundary that is nearest to each point.

        Returns:
            The simplex that has it, the point, and its distance.
        """
        simplex, corners = self._boundary
        found = closest(x, corners)
        feet = np.einsum("nk,nki->ni", found.local, corners[found.facet])
        return simplex[found.facet], feet, found.distance
