"""Sum values for the moments of facets over the ranks, and over images of facets."""

from __future__ import annotations

import numpy as np
from dolfinx import la
from mpi4py import MPI

from erc_contact.admissible.cells import CellGeometry, facet_order
from erc_contact.model.space import Space


class SharedMoments:
    """Sum and multiply values for the moments of facets (F, m, d) over the ranks.

    Args:
        space: The mesh.
        cells: Geometry.

    Attributes:
        mine: Facets whose node of least global number this rank owns, shape (F,). Of
            two facets on sides of copies it is the first one.
        counted: The facets that this rank counts in products.
        shared: Facets of this rank that other ranks have, too. Only their values
            travel.
    """

    def __init__(self, space: Space, cells: CellGeometry) -> None:
        self.comm = space.comm
        self.facets = space.mesh.topology.index_map(cells.d - 1)
        self._cells = cells
        vertices = cells.vertices_of_facets
        # Ranks number, and so sort, the nodes differently.
        order = facet_order(global_numbers(space, cells, vertices), cells.degree)
        least = np.take_along_axis(vertices, order[:, :1], axis=1)[:, 0]
        self.mine = least < space.V.dofmap.index_map.size_local
        self.mine[cells.images.repeated] = False
        self.counted: slice | np.ndarray = slice(self.facets.size_local)
        if len(cells.images.repeated):
            self.counted = np.setdiff1d(np.arange(self.facets.size_local), cells.images.repeated)
        if self.comm.size > 1:
            ghosts = la.vector(self.facets)
            ghosts.array[self.facets.size_local :] = 1.0
            ghosts.scatter_reverse(la.InsertMode.add)
            self.shared = np.flatnonzero(ghosts.array)
            self.order = order[self.shared, :, None]
            self.vector = la.vector(self.facets, order.shape[1] * cells.d)

    def total(self, values: np.ndarray) -> np.ndarray:
        """Sum the values of all ranks and images for each facet; collective.

        It is done in place.
        """
        self._cells.images.fold(values)
        if self.comm.size > 1:
            # The vector has an order of the nodes that all ranks agree on.
            rows = self.vector.array.reshape(-1, *values.shape[1:])
            rows[self.shared] = np.take_along_axis(values[self.shared], self.order, axis=1)
            self.vector.scatter_reverse(la.InsertMode.add)
            self.vector.scatter_forward()
            summed = np.empty((len(self.shared), *values.shape[1:]))
            np.put_along_axis(summed, self.order, rows[self.shared], axis=1)
            values[self.shared] = summed
        return self._cells.images.repeat(values)

    def agreed(self, moment: np.ndarray) -> np.ndarray:
        """Return moments as the rank has them that counts a facet; collective.

        The moments of repeated facets follow.
        """
        of_all = np.zeros_like(moment)
        of_all[self.counted] = moment[self.counted]
        return self.total(of_all)

    def dot(self, a: np.ndarray, b: np.ndarray) -> float:
        """Compute the scalar product over the owned facets of all ranks; collective."""
        counted = self.counted
        # This is einsum, not vdot: the threads of BLAS cost a hundred times the product
        # where other processes want the cores.
        local = float(np.einsum("fmi,fmi->", a[counted], b[counted]))
        return self.comm.allreduce(local, MPI.SUM)


def global_numbers(space: Space, cells: CellGeometry, nodes: np.ndarray) -> np.ndarray:
    """Return global numbers of nodes, -1 of nodes that images of cells alone have.

    No rank owns a node of images, and so no centre with one.
    """
    if not cells.images.more_nodes:
        return space.global_numbers(nodes)
    count = space.V.dofmap.index_map.size_local + space.V.dofmap.index_map.num_ghosts
    numbers = np.full(count + cells.images.more_nodes, -1)
    numbers[:count] = space.global_numbers(np.arange(count))
    of_nodes: np.ndarray = numbers[nodes]
    return of_nodes
