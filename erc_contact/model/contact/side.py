"""Hold the facets of one body at a contact: nodes, places, areas, moduli.

Symbols: f facets on this rank, m nodes of a facet, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from namedmesh.simplex import barycentric, measures, node_vertices, nodes

CONTINUOUS = 1e-9
"""Difference of two facets at a node that counts as none, over the greatest value."""


@dataclass(frozen=True, eq=False)
class Side:
    """Hold the facets of one body at a contact; ``Space.side`` makes it.

    Attributes:
        facets: Pairs (cell, local facet), ghosts included, shape (f, 2).
        nodes: Nodes of each facet, in the order of the reference facet, shape (f, m).
        corners: Vertices of each facet [length], shape (f, d, d).
        owned: Which facets this rank owns, shape (f,).
        modulus: The modulus of the material in the middle of their cells [force/area],
            shape (f,).
        degree: Degree of the displacement.
        node_count: Number of nodes of this rank, ghosts included.
        cell_count: Number of cells of this rank, ghosts included.

    Example:
        >>> side = solution.model.contacts[0].trace.here
        >>> side.areas  # the base of the block, of length 2, has 4 facets
        array([0.5, 0.5, 0.5, 0.5])
        >>> side.stiffness  # E = 1000 over the diameter 0.5
        array([2000., 2000., 2000., 2000.])
    """

    facets: np.ndarray
    nodes: np.ndarray
    corners: np.ndarray
    owned: np.ndarray
    modulus: np.ndarray
    degree: int
    node_count: int
    cell_count: int

    def only(self, which: slice) -> Side:
        """Return the side with some of its facets."""
        return replace(
            self,
            facets=self.facets[which],
            nodes=self.nodes[which],
            corners=self.corners[which],
            owned=self.owned[which],
            modulus=self.modulus[which],
        )

    @property
    def d(self) -> int:
        """Return the dimension of space."""
        return self.corners.shape[2]

    @cached_property
    def areas(self) -> np.ndarray:
        """Compute the areas of the facets [length^(d-1)], shape (f,)."""
        return measures(self.corners)

    @cached_property
    def owned_areas(self) -> np.ndarray:
        """Return the areas of the owned facets, zero for ghosts [length^(d-1)].

        Sums over all ranks then count each facet once. Shape (f,).
        """
        return np.where(self.owned, self.areas, 0.0)

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Estimate the stiffness ``E/h`` of the body at each facet [force/length^3].

        Here h is the diameter of the facet. Shape (f,).
        """
        diameters = self.areas ** (1 / (self.d - 1))
        return self.modulus / diameters

    @property
    def shares_of_nodes(self) -> np.ndarray:
        """Return barycentric coordinates of the nodes of a facet, shape (m, d)."""
        return barycentric(nodes(self.d - 1, self.degree))

    def points_at(self, points: np.ndarray) -> np.ndarray:
        """Return the places of reference points (q, d-1) on the facets, (f, q, d)."""
        return np.matmul(barycentric(points), self.corners)

    def values_of_nodes(self, values: np.ndarray) -> np.ndarray:
        """Return one value at each node from values of its facets, shape (nodes,).

        Where facets differ, as of data that jump between them, it is the mean weighted
        with their areas. So the sum of weights times values in the rule at the nodes is
        kept. A rank has all facets at the nodes of its own cells, so it needs no
        communication.

        Args:
            values: The values, shape (f, m).
        """
        result = np.zeros(self.node_count)
        result[self.nodes] = values
        differs = abs(result[self.nodes] - values) > CONTINUOUS * abs(values).max(initial=0.0)
        if not differs.any():
            return result
        jumps = np.zeros(self.node_count, dtype=bool)
        jumps[self.nodes[differs]] = True
        areas = np.broadcast_to(self.areas[:, None], self.nodes.shape)
        area = np.bincount(self.nodes.ravel(), areas.ravel(), self.node_count)
        weighted = np.bincount(self.nodes.ravel(), (areas * values).ravel(), self.node_count)
        result[jumps] = weighted[jumps] / area[jumps]
        return result

    @property
    def places(self) -> np.ndarray:
        """Return the positions of the nodes of each facet [length], shape (f, m, d)."""
        return self.corners[:, node_vertices(self.d - 1, self.degree)].mean(axis=2)
