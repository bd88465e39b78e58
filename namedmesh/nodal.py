"""Compute values at nodes from values of cells and edges, on any number of ranks.

Sizes at nodes say how many cells a mesh will have.
"""

from __future__ import annotations

import numpy as np
from dolfinx import la
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.releases import cell_nodes
from namedmesh.domain import Domain
from namedmesh.simplex import measures
from namedmesh.size_field import FILL, at_corners

GROW = 0.5
"""Largest growth of sizes over a length [-]: neighbouring layers grow by at most 1.5.

From 0.3 to 0.5 no count and no error changed by more than the scatter of meshes.
"""


def count_cells(domain: Domain, sizes: np.ndarray) -> float:
    """Predict the number of cells of a mesh with given sizes; collective.

    It is ``int c / h^d`` with c of :data:`namedmesh.size_field.FILL`. Where bodies
    meet, the least of their sizes is taken, as their facets match.

    Args:
        domain: The mesh that carries the sizes.
        sizes: h at the nodes ``domain.mesh.geometry.x`` [length], shape (n,).
    """
    if domain.glued is None or domain.interface_map is None:
        return at_corners(domain, sizes).count(domain.comm)
    return at_corners(domain.glued, domain.interface_map.least(sizes)).count(domain.comm)


class NodalMesh:
    """Hold cells, edges and nodes of a domain on this rank.

    Values at nodes are given for all nodes of this rank, ghosts included, shape (n,).
    """

    def __init__(self, domain: Domain) -> None:
        mesh = domain.mesh
        dim = domain.dim
        x = mesh.geometry.x[:, :dim]
        self.domain = domain
        self.comm = lasting(mesh.comm)
        self._vector = la.vector(mesh.geometry.index_map(), dtype=np.float64)
        self.nodes = cell_nodes(mesh.geometry)[: domain.owned_cells]
        self.volume = measures(x[self.nodes])
        self.size = (FILL[dim] * self.volume) ** (1 / dim)
        mesh.topology.create_entities(1)
        mesh.topology.create_connectivity(1, dim)
        mesh.topology.create_connectivity(dim, 1)
        edges = mesh.topology.index_map(1)
        numbers = np.arange(edges.size_local + edges.num_ghosts, dtype=np.int32)
        self.edges = dmesh.entities_to_geometry(mesh, 1, numbers).reshape(-1, 2)
        self.owned_edges = slice(0, edges.size_local)
        self.length = np.linalg.norm(x[self.edges[:, 0]] - x[self.edges[:, 1]], axis=1)

    def total(self, values: np.ndarray) -> float:
        """Sum over the cells of all ranks; collective."""
        return float(self.comm.allreduce(float(values.sum()), MPI.SUM))

    def _add(self, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Sum values of cells or edges at their nodes over all ranks; collective.

        Args:
            nodes: Nodes of the cells or edges that this rank owns, shape (m, c).
            values: Their values, shape (m, 1) or (m, c).
        """
        total = self._vector.array
        weights = np.broadcast_to(values, nodes.shape)
        total[:] = np.bincount(nodes.ravel(), weights.ravel(), len(total))
        self._vector.scatter_reverse(la.InsertMode.add)
        self._vector.scatter_forward()
        return total.copy()

    def around(self, values: np.ndarray) -> np.ndarray:
        """Sum values of cells over the cells around each node; collective."""
        return self._add(self.nodes, values[:, None])

    def beside(self, values: np.ndarray) -> np.ndarray:
        """Sum values of nodes over the neighbours of each node; collective."""
        edges = self.edges[self.owned_edges]
        return self._add(edges, values[edges[:, ::-1]])

    def mean_size(self) -> np.ndarray:
        """Compute the mean size of the cells at each node [length]; collective."""
        return self.around(self.size) / self.around(np.ones_like(self.size))

    def edge_length(self) -> np.ndarray:
        """Compute the mean length of the edges at each node [length]; collective."""
        total = self._add(self.edges[self.owned_edges], self.length[self.owned_edges, None])
        return total / self.beside(np.ones(len(self._vector.array)))

    def limit(self, h: np.ndarray) -> np.ndarray:
        """Limit sizes h to the largest sizes that grow by at most GROW; collective.

        A rank has all edges at the nodes that it owns, because it has all cells around
        them.
        """
        a, b = self.edges.T
        size = self._vector.array
        size[:] = h
        while True:
            before = size.copy()
            np.minimum.at(size, a, before[b] + GROW * self.length)
            np.minimum.at(size, b, before[a] + GROW * self.length)
            self._vector.scatter_forward()
            still = bool(np.all(size >= before * (1 - 1e-9)))
            if self.comm.allreduce(still, MPI.LAND):
                return size.copy()
