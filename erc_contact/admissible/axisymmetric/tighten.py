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

Symbols: F facets, m nodes of a facet, n cells, l = 2 m - 1 free amounts of a facet.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.axisymmetric.elements import Elements, Energies
from erc_contact.admissible.axisymmetric.kernels import BLOCK, ring_kernels
from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.tighten.iteration import SharedMoments, minimise
from erc_contact.admissible.tighten.rings import rings
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
        owned = len(energies.slope)
        of_cells = (cells.degree, owned, cells.facets, cells.side, energies.matrix)
        self._least = float(energies.least.sum())
        self._energy = ring_kernels().bound("ring_energy", *of_cells)
        self._slope = energies.slope

    def __call__(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Compute the energy of facet forces x, and half its derivative, (F, m, 2)."""
        half = np.zeros_like(x)
        return self._energy(None, x, half), half

    def start(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Compute ``|S - S_0|^2`` of facet forces, and half its derivative."""
        half = np.zeros_like(x)
        return self._energy(self._slope, x, half) + self._least, half


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
        ring, size = rings(space, cells)
        basis = _amounts(free)
        m = free.shape[1]
        # A flux goes around, or from one free facet of the boundary to another one.
        can_flow = free[..., 1].any(axis=1) | cells.has_second
        start = np.cumsum(size) - size
        flows = np.logical_and.reduceat(can_flow[ring // 4], start) if len(size) else can_flow[:0]
        unknowns = 1 + size.astype(np.int64) * (2 * m - 1)
        factor = np.empty(int((unknowns * (unknowns + 1) // 2).sum()))
        of_rings = (m, len(size), ring, size)
        geometry = (cells.facets, cells.side, len(free))
        ring_kernels()("ring_patches", *of_rings, *geometry, basis, flows, matrix, factor)
        self._corrections = ring_kernels().bound(
            "ring_corrections", *of_rings, basis, flows, factor
        )

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Sum the corrections of all patches for a residual, shape (F, m, 2)."""
        z = np.zeros_like(r)
        self._corrections(np.ascontiguousarray(r), z)
        return z


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


def _amounts(free: np.ndarray) -> np.ndarray:
    """Return what acts on each facet as coefficients.

    Args:
        free: Coefficients that are not given, shape (F, m, 2).

    Returns:
        An axial resultant of 1, then the l amounts without axial resultant, then zeros,
        shape (F, m, 2, BLOCK).
    """
    count, m, _ = free.shape
    basis = np.zeros((count, m, 2, BLOCK))
    # Each set of free nodes has a number: few of them exist.
    number = free[..., 1] @ (1 << np.arange(m))
    axial = np.zeros((1 << m, m, m))
    for of_set in range(1 << m):
        spread, without = _spreads(m, tuple(bool(of_set >> node & 1) for node in range(m)))
        axial[of_set] = np.column_stack([spread, without])
    basis[:, :, 1, :m] = axial[number]
    for node in range(m):
        basis[:, node, 0, m + node] = free[:, node, 0]
    return basis
