"""Carry the displacement of a file to any mesh of its bodies.

Bodies that touch have other displacements at one place. So each body of the mesh, known
by its region and by what is connected on this rank, gets the displacement of the bodies
of the file in which the middles of its cells lie.

Symbols: d dimension, n cells, q points in each.
"""

from __future__ import annotations

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.base.percent import place_words
from namedmesh.field_in_cells import FieldInCells
from namedmesh.files.displacements import FileField
from namedmesh.graphs import components
from namedmesh.named import NamedMesh

SAME_PLACE = 1e-5
"""Distance of a point to a node that is none, over the extent of the body [-].

Result files often have six digits.
"""
SHARE = 0.1
"""Least share of the middles of a body that lie in a body of the file [-]."""
BESIDE = 0.5
"""Greatest distance of a node to the file's bodies, by the edge of its cell [-]."""

INWARD = 1e-6
"""Way of points to the middle of their cell, by which they are in no other [-]."""


class FieldOnMesh:
    """Evaluate the displacement of a file in the cells of a mesh.

    Args:
        domain: The mesh.
        field: The displacement.

    Attributes:
        field: The displacement.

    Raises:
        InputError: If the cells of the file have another dimension.

    Example:
        >>> on_mesh = FieldOnMesh(block, field)
        >>> u = on_mesh.at_nodes(nodes_of_cells, x)
    """

    def __init__(self, domain: NamedMesh, field: FileField) -> None:
        self.field = field
        d = domain.dim
        if field.x.shape[1] != d:
            raise InputError(
                f"the cells of the file are in {field.x.shape[1]}D, and the mesh is in {d}D; let "
                "the other code write results of its own cells, CalculiX by OUTPUT=2D."
            )
        x, corners = domain.points
        self._corners = x[corners, :d]
        tolerance = SAME_PLACE * domain.extent
        every = FieldInCells(field, None, tolerance)
        self._group = _bodies_of_mesh(domain)
        found = every.places(self._corners.mean(axis=1))
        self._simplex = found.simplex
        body = np.empty(len(self._corners), dtype=np.int64)
        for number, block in enumerate(field.blocks):
            here = found.block == number
            body[here] = block.body[found.cell[here]]
        self._inside: dict[int, FieldInCells] = {}
        known: dict[bytes, FieldInCells] = {}
        for group in np.unique(self._group):
            bodies, votes = np.unique(body[self._group == group], return_counts=True)
            chosen = bodies[votes >= SHARE * votes.sum()]
            if chosen.tobytes() not in known:
                known[chosen.tobytes()] = FieldInCells(field, chosen, tolerance)
            self._inside[int(group)] = known[chosen.tobytes()]

    def at_nodes(self, nodes: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate the displacement at nodes.

        Args:
            nodes: Numbers of the nodes of the cells on this rank, shape (n, k).
            x: All nodes [length], shape (m, d).

        Returns:
            The displacement [length], shape (m, d). A node outside of the bodies of the
            file gets the displacement of their nearest point.

        Raises:
            InputError: If nodes are farther outside than half of a cell.
        """
        cell = self.cell_of_nodes(nodes)
        values = np.zeros(x.shape)
        distance = np.zeros(len(x))
        for inside, here in self._by_body(cell):
            places = inside.places(x[here])
            values[here] = inside.values(places)
            distance[here] = places.distance
        corners = self._corners[cell]
        edge = abs(corners - corners[:, :1]).max(axis=(1, 2))
        beside = np.flatnonzero(distance > BESIDE * edge)
        if len(beside):
            at = place_words(x[beside[0]], 6)
            raise InputError(
                f"{len(beside)} of {len(x)} nodes are outside of the bodies of the file, the first "
                f"at {at}, by {distance[beside[0]]:.3g}; look whether it is the result of this "
                "model, in the same place and in the same unit of length."
            )
        return values

    def cell_of_nodes(self, nodes: np.ndarray) -> np.ndarray:
        """Return the cell in which each node is evaluated, shape (m,).

        Any cell of a node will do, as nodes of two bodies are two.

        Args:
            nodes: Numbers of the nodes of the cells on this rank, shape (n, k).
        """
        _, first = np.unique(nodes, return_index=True)
        return np.asarray(first // nodes.shape[1])

    def in_cells(self, cells: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Evaluate the displacement and its derivatives in cells.

        Args:
            cells: Numbers of cells on this rank, shape (n,).
            x: Points in each [length], shape (n, q, d).

        Returns:
            The displacement [length], shape (n, q, d), and ``du_i/dx_j`` [-], shape (n,
            q, d, d).
        """
        d = x.shape[2]
        cell = np.repeat(cells, x.shape[1])
        # On a side of a cell its own derivatives are meant.
        middles = self._corners[cells].mean(axis=1, keepdims=True)
        points = (x + INWARD * (middles - x)).reshape(-1, d)
        values = np.empty(points.shape)
        gradients = np.empty((len(points), d, d))
        for inside, here in self._by_body(cell):
            # Most points of a cell are where its middle is.
            places = inside.places(points[here], self._simplex[cell[here]])
            values[here] = inside.values(places)
            gradients[here] = inside.gradients(places)
        return values.reshape(x.shape), gradients.reshape(*x.shape, d)

    def _by_body(self, cell: np.ndarray) -> list[tuple[FieldInCells, np.ndarray]]:
        """Return the bodies of the file, and which of some cells are in them."""
        group = self._group[cell]
        return [(self._inside[int(number)], group == number) for number in np.unique(group)]


def _bodies_of_mesh(domain: NamedMesh) -> np.ndarray:
    """Return a number of the body of each cell on this rank, with ghosts."""
    vertices = domain.mesh.topology.connectivity(domain.dim, 0)
    table = vertices.array.reshape(-1, domain.dim + 1)
    links = np.concatenate([table[:, [0, i]] for i in range(1, domain.dim + 1)])
    piece = components(int(table.max(initial=-1)) + 1, links)[table[:, 0]]
    keys = np.column_stack([domain.region_tags[: len(table)], piece])
    _, numbers = np.unique(keys, axis=0, return_inverse=True)
    return np.asarray(numbers).ravel()
