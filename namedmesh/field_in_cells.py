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
from namedmesh.files.shape_functions import corner_functions, inverses, local_coordinates
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
        block: Number of the block of the cell of each point, shape (n,).
        cell: Number of the cell in its block, shape (n,).
        local: Local coordinates there, shape (n, d).
        distance: Distance of a point outside of all cells to the nearest cell, whose
            nearest point stands for it [length], shape (n,); zero inside.
    """

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
        every = np.arange(len(field.simplices))
        self._chosen = (
            every if bodies is None else np.flatnonzero(np.isin(field.body_of_simplex, bodies))
        )
        self._corners = field.x[field.simplices[self._chosen]]

    @cached_property
    def _tree(self) -> tuple[geometry.BoundingBoxTree, np.ndarray]:
        """Return the tree of boxes of the simplices, and the number of each box."""
        nodes, cells = np.unique(self.field.simplices[self._chosen], return_inverse=True)
        x = np.ascontiguousarray(self.field.x[nodes])
        mesh = distribute(MPI.COMM_SELF, cells.reshape(len(self._chosen), -1), x)
        extent = np.ptp(x, axis=0).max()
        tree = geometry.bb_tree(mesh, mesh.topology.dim, padding=PADDING * extent)
        return tree, mesh.topology.original_cell_index

    def places(self, x: np.ndarray) -> PlacesInCells:
        """Find points, shape (n, d) [length]."""
        simplex, least = self._simplices(x)
        distance = np.zeros(len(x))
        near = x.copy()
        outside = np.flatnonzero(least < INSIDE)
        if len(outside):
            facet, feet, distance[outside] = self._nearest(x[outside])
            simplex[outside] = facet
            near[outside] = feet
        of_file = self._chosen[simplex]
        field = self.field
        block_of = field.block_of_simplex[of_file]
        cell_of = field.cell_of_simplex[of_file]
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
        return PlacesInCells(block_of, cell_of, local, distance)

    def values(self, places: PlacesInCells) -> np.ndarray:
        """Evaluate the displacement [length], shape (n, d)."""
        result = np.empty(places.local.shape)
        for number, block in enumerate(self.field.blocks):
            here = np.flatnonzero(places.block == number)
            nodal = self.field.values[block.nodes[places.cell[here]]]
            weights = block.functions.at(places.local[here])
            result[here] = np.matmul(weights[:, None], nodal)[:, 0]
        return result

    def gradients(self, places: PlacesInCells) -> np.ndarray:
        """Evaluate the derivatives ``du_i/dx_j`` of the displacement [-], (n, d, d)."""
        d = places.local.shape[1]
        result = np.empty((len(places.local), d, d))
        for number, block in enumerate(self.field.blocks):
            here = np.flatnonzero(places.block == number)
            local = places.local[here]
            nodal = self.field.values[block.nodes[places.cell[here]]]
            along = np.matmul(nodal.swapaxes(1, 2), block.functions.gradients(local))
            corners = self.field.x[block.corners[places.cell[here]]]
            of_map = corner_functions(block.functions.shape).gradients(local)
            jacobian = np.matmul(corners.swapaxes(1, 2), of_map)
            result[here] = np.matmul(along, inverses(jacobian))
        return result

    def _simplices(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find the simplex that holds each point best.

        Returns:
            Its number among the chosen simplices, and the least barycentric coordinate
            of the point in it, -inf where no simplex is near.
        """
        tree, numbers = self._tree
        candidates = geometry.compute_collisions_points(tree, in_space(x))
        point = np.repeat(np.arange(len(x)), np.diff(candidates.offsets))
        simplex = numbers[candidates.array]
        corners = self._corners[simplex]
        edges = corners[:, 1:] - corners[:, :1]
        offset = x[point] - corners[:, 0]
        local = np.linalg.solve(edges.transpose(0, 2, 1), offset[..., None])[..., 0]
        least = barycentric(local).min(axis=1)
        # The last one of each point in this order is the best.
        order = np.lexsort((-simplex, least, point))
        last = np.searchsorted(point[order], np.arange(len(x)), side="right") - 1
        found = np.zeros(len(x), dtype=np.int64)
        best = np.full(len(x), -np.inf)
        has_one = np.diff(candidates.offsets) > 0
        found[has_one] = simplex[order][last[has_one]]
        best[has_one] = least[order][last[has_one]]
        return found, best

    @cached_property
    def _boundary(self) -> tuple[np.ndarray, np.ndarray]:
        """Return simplices with an outer facet, and the corners of the facet."""
        simplices = self.field.simplices[self._chosen]
        d = simplices.shape[1] - 1
        facets = simplices[:, facet_vertices(d)].reshape(-1, d)
        (numbers,) = row_numbers(facets)
        outer = np.flatnonzero(np.bincount(numbers)[numbers] == 1)
        return outer // (d + 1), self.field.x[facets[outer]]

    def _nearest(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Find the point of the boundary that is nearest to each point.

        Returns:
            The simplex that has it, the point, and its distance.
        """
        simplex, corners = self._boundary
        found = closest(x, corners)
        feet = np.einsum("nk,nki->ni", found.local, corners[found.facet])
        return simplex[found.facet], feet, found.distance
