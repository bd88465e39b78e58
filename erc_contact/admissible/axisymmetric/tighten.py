"""Tighten the stress of axisymmetric bodies: less energy, always in equilibrium.

As in the plane (:mod:`erc_contact.admissible.tighten.iteration`) it is a minimisation
over facet forces by conjugate gradients, with small problems around vertices as
preconditioner. The forces of a facet are given by the coefficients of ``|F| t``. Free
are

- all radial coefficients,
- the axial ones with no resultant on the facet,
- a *flux* of axial force around each vertex: the same resultant on all facets of its
  ring, passed on from cell to cell.

All of them leave the axial forces of every cell in balance, the only condition. A patch
has the flux of its vertex and what is free on the facets of its ring. Coefficients of
nodes on the axis are zero.

Symbols: F facets, m nodes of a facet, n cells, H patches of a size, f facets of a ring,
l = 2 m - 1 free amounts of a facet.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.axisymmetric.elements import Elements, Energies
from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.tighten.iteration import SharedMoments, minimise
from erc_contact.admissible.tighten.rings import rings
from erc_contact.mesh.simplex import nodes
from erc_contact.model.space import Space


def tightened(
    space: Space,
    elements: Elements,
    energies: Energies,
    forces: np.ndarray,
    free: np.ndarray,
    iterations: int,
) -> tuple[np.ndarray, int, float]:
    """Tighten facet forces that are in axial equilibrium; collective.

    Args:
        space: The mesh.
        elements: The cells.
        energies: Their energies ``|S - C eps(u^)|^2``.
        forces: Coefficients of ``|F| t`` on the first side of each facet [force], shape
            (F, m, 2).
        free: Coefficients that are not given, shape (F, m, 2).
        iterations: Limit of the iterations.

    Returns:
        The coefficients, the number of iterations, and the square of the bulk part of
        the error with them [force length].
    """
    cells = elements.cells
    shared = SharedMoments(space, cells)
    energy = _Energy(cells, energies)
    square, slope = energy.start(forces)
    square = space.comm.allreduce(square, MPI.SUM)
    residual = shared.total(-slope)
    patches = _Patches(space, cells, energies.matrix, free)
    x = np.zeros_like(forces)
    done, square = minimise(
        shared, energy, lambda r: shared.total(patches(r)), x, residual, square, iterations
    )
    return forces + x, done, square


class _Energy:
    """Compute the energy of the owned cells as a quadratic form of facet forces.

    Args:
        cells: Geometry.
        energies: The energies of the cells.
    """

    def __init__(self, cells: CellGeometry, energies: Energies) -> None:
        self._owned = len(energies.slope)
        self._energies = energies
        self._facets = cells.facets[: self._owned]
        places = np.arange(cells.facets.size).reshape(cells.facets.shape)
        self._sign = np.where(cells.side[0][cells.facets] == places, 1.0, -1.0)[: self._owned]
        self._side = cells.side
        self._has_second = cells.has_second

    def __call__(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Compute the energy of facet forces x, and half its derivative, (F, m, 2)."""
        of_cells = self._of_cells(x)
        image = np.matmul(self._energies.matrix[: self._owned], of_cells[..., None])[..., 0]
        return float(np.einsum("nx,nx->", of_cells, image)), self._on_facets(image, x.shape)

    def start(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Compute ``|S - S_0|^2`` of facet forces, and half its derivative."""
        of_cells = self._of_cells(x)
        energies = self._energies
        image = np.matmul(energies.matrix[: self._owned], of_cells[..., None])[..., 0]
        square = np.einsum("nx,nx->", of_cells, image + 2 * energies.slope) + energies.least.sum()
        return float(square), self._on_facets(image + energies.slope, x.shape)

    def _of_cells(self, x: np.ndarray) -> np.ndarray:
        """Return the facet forces of each owned cell, shape (owned, 6 m)."""
        signed = self._sign[..., None, None] * x[self._facets]
        return signed.reshape(self._owned, 3 * x.shape[1] * x.shape[2])

    def _on_facets(self, image: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        """Add up values of cells on their facets, the transpose of ``_of_cells``."""
        flat = np.zeros((self._side.max() + 2, *shape[1:]))
        flat[: 3 * self._owned] = image.reshape(-1, *shape[1:])
        first, second = self._side
        # Places of no cell are the last one, which is zero.
        on_second = np.where(self._has_second[:, None, None], flat[second], 0.0)
        return np.where((first >= 0)[:, None, None], flat[first] - on_second, 0.0)


class _Batch(NamedTuple):
    """Hold the patches of one size.

    Attributes:
        facets: Facets of each ring, shape (H, f).
        sense: Sign of the flux on each facet, 0 where there is none, shape (H, f).
        inverse: Inverse of the matrix of each patch, shape (H, 1 + f l, 1 + f l).
    """

    facets: np.ndarray
    sense: np.ndarray
    inverse: np.ndarray


class _Patches:
    """Solve the minimisation on the patch of each vertex of this rank, and add up.

    Args:
        space: The mesh.
        cells: Geometry.
        matrix: Energies of the cells, shape (n, 6 m, 6 m).
        free: Coefficients that are not given, shape (F, m, 2).
    """

    def __init__(
        self, space: Space, cells: CellGeometry, matrix: np.ndarray, free: np.ndarray
    ) -> None:
        steps, sizes = rings(space, cells)
        self._along, self._spread = _amounts(cells.degree, free)
        self._batches = []
        start = 0
        for size in np.unique(sizes):
            count = int((sizes == size).sum())
            of_batch = steps[start : start + count * size].reshape(count, size)
            start += count * size
            self._batches.append(self._batch(cells, matrix, free, of_batch))

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Sum the corrections of all patches for a residual, shape (F, m, 2)."""
        count = len(r)
        flux = np.einsum("fm,fm->f", self._spread, r[..., 1])
        local = np.einsum("fmcl,fmc->fl", self._along, r, optimize=True)
        of_flux = np.zeros(count)
        of_local = np.zeros_like(local)
        for facets, sense, inverse in self._batches:
            patches, f = facets.shape
            right = np.empty((patches, 1 + f * local.shape[1]))
            right[:, 0] = (sense * flux[facets]).sum(axis=1)
            right[:, 1:] = local[facets].reshape(patches, -1)
            amounts = np.matmul(inverse, right[..., None])[..., 0]
            np.add.at(of_flux, facets, sense * amounts[:, :1])
            np.add.at(of_local, facets, amounts[:, 1:].reshape(patches, f, -1))
        z = np.einsum("fmcl,fl->fmc", self._along, of_local, optimize=True)
        z[..., 1] += self._spread * of_flux[:, None]
        return z

    def _batch(
        self, cells: CellGeometry, matrix: np.ndarray, free: np.ndarray, steps: np.ndarray
    ) -> _Batch:
        """Invert the matrices of patches of one size.

        Args:
            cells: Geometry.
            matrix: Energies of the cells.
            free: Coefficients that are not given.
            steps: Steps of their rings, shape (H, f).
        """
        pair, comes_after = np.divmod(steps, 2)
        facets = pair // 2
        patches, f = facets.shape
        sign = np.where(comes_after == 1, 1.0, -1.0)
        # A flux goes around, or from one free facet of the boundary to another one.
        is_open = ~cells.has_second[facets]
        can_flow = (free[facets, :, 1].any(axis=2) | ~is_open).all(axis=1)
        sense = sign * can_flow[:, None]
        m = self._along.shape[1]
        amounts = self._along.shape[3]
        size = 1 + f * amounts
        total = np.zeros((patches, size, size))
        each = np.arange(patches)
        for after in range(f):
            # The cell after a facet of the ring is between it and the next one.
            here = np.where(comes_after[:, after] == 1, 0, 1)
            place = cells.side[here, facets[:, after]]
            exists = cells.has_second[facets[:, after]] | (here == 0)
            following = (after + 1) % f
            ends = [after, following] if following != after else [after]
            cell, _ = np.divmod(np.maximum(place, 0), 3)
            # The flux, then the amounts of both facets.
            to_cell = np.zeros((patches, 3, m, 2, 1 + len(ends) * amounts))
            columns = [np.zeros(1, dtype=int)]
            for number, end in enumerate(ends):
                facet = facets[:, end]
                local = (cells.facets[cell] == facet[:, None]).argmax(axis=1)
                is_first = cells.side[0][facet] == 3 * cell + local
                of_cell = np.where(is_first, 1.0, -1.0)
                here_columns = slice(1 + number * amounts, 1 + (number + 1) * amounts)
                to_cell[each, local, :, :, here_columns] = (
                    of_cell[:, None, None, None] * self._along[facet]
                )
                flux = (of_cell * sense[:, end])[:, None] * self._spread[facet]
                to_cell[each, local, :, 1, 0] = flux
                columns.append(1 + end * amounts + np.arange(amounts))
            flat = to_cell.reshape(patches, 6 * m, -1)
            part = np.matmul(flat.swapaxes(1, 2), np.matmul(matrix[cell], flat))
            part *= np.where(exists, 1.0, 0.0)[:, None, None]
            of_ends = np.concatenate(columns)
            total[:, of_ends[:, None], of_ends] += part
        diagonal = np.einsum("hss->hs", total)
        is_dead = diagonal == 0.0
        diagonal[is_dead] = 1.0
        # Scaled, so that its digits do not depend on units.
        root = np.sqrt(diagonal)
        scale = root[:, :, None] * root[:, None, :]
        inverse = np.linalg.inv(total / scale) / scale
        live = ~is_dead
        inverse *= live[:, :, None] & live[:, None, :]
        return _Batch(facets, sense, inverse)


@cache
def _spreads(m: int, marks: tuple[bool, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return coefficients of resultant 1, and of resultant 0, on the nodes marked.

    Returns:
        Shapes (m,) and (m, m-1); columns that there are not are zero.
    """
    chosen = np.flatnonzero(marks)
    spread = np.zeros(m)
    spread[chosen] = m / max(len(chosen), 1)
    without = np.zeros((m, m - 1))
    for column in range(len(chosen) - 1):
        without[chosen[: column + 1], column] = 1.0
        without[chosen[column + 1], column] = -(column + 1)
    return spread, without


def _amounts(degree: int, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the free amounts of each facet as coefficients.

    Args:
        degree: Degree k.
        free: Coefficients that are not given, shape (F, m, 2).

    Returns:
        Coefficients of the l amounts without axial resultant, shape (F, m, 2, l), and
        of an axial resultant of 1, shape (F, m).
    """
    count, m, _ = free.shape
    along = np.zeros((count, m, 2, 2 * m - 1))
    spread = np.zeros((count, m))
    for marks in np.unique(free[..., 1], axis=0):
        facets = (free[..., 1] == marks).all(axis=1)
        of_marks, without = _spreads(m, tuple(marks.tolist()))
        spread[facets] = of_marks
        along[facets, :, 1, : m - 1] = without
    for node in range(m):
        along[:, node, 0, m - 1 + node] = free[:, node, 0]
    assert m == len(nodes(1, degree))
    return along, spread
