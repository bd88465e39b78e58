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

from itertools import product

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.axisymmetric.elements import CellEnergies, Elements
from erc_contact.admissible.axisymmetric.kernels import BLOCK, ring_kernels
from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.shared_moments import SharedMoments
from erc_contact.admissible.tighten.iteration import Ending, minimise
from erc_contact.admissible.tighten.patches import rings
from erc_contact.model.space import Space


def tighten_forces(
    space: Space,
    elements: Elements,
    energies: CellEnergies,
    of_patches: np.ndarray,
    forces: np.ndarray,
    free: np.ndarray,
    ending: Ending,
) -> tuple[np.ndarray, int, float]:
    """Tighten facet forces that are in axial equilibrium; collective.

    Args:
        space: The mesh.
        elements: The cells.
        energies: Their energies ``|S - C eps(u^)|^2``.
        of_patches: Energies for the patches, as ``matrix`` of :class:`CellEnergies`,
            the same on all ranks.
        forces: Coefficients of ``|F| t`` on the first side of each facet [force], shape
            (F, m, 2).
        free: Coefficients that are not given, shape (F, m, 2).
        ending: When the iterations end.

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
    patches = _Patches(space, cells, of_patches, free)
    x = np.zeros_like(forces)

    def precondition(r: np.ndarray) -> np.ndarray:
        return shared.total(patches(r))

    done, square = minimise(shared, energy, precondition, x, residual, square, ending)
    return forces + x, done, square


class _Energy:
    """Compute the energy of the owned cells as a quadratic form of facet forces.

    Args:
        cells: Geometry.
        energies: The energies of the cells.
    """

    def __init__(self, cells: CellGeometry, energies: CellEnergies) -> None:
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
        matrix: Energies of the cells, see :class:`CellEnergies`.
        free: Coefficients that are not given, shape (F, m, 2).
    """

    def __init__(
        self, space: Space, cells: CellGeometry, matrix: np.ndarray, free: np.ndarray
    ) -> None:
        ring, size = rings(space, cells)
        kinds, bases = _bases(free)
        m = free.shape[1]
        # A flux goes around, or from one free facet of the boundary to another one.
        can_flow = free[..., 1].any(axis=1) | cells.has_second
        start = np.cumsum(size) - size
        flows = np.logical_and.reduceat(can_flow[ring // 4], start) if len(size) else can_flow[:0]
        unknowns = 1 + size.astype(np.int64) * (2 * m - 1)
        factor = np.empty(int((unknowns * (unknowns + 1) // 2).sum()))
        of_rings = (m, len(size), ring, size)
        geometry = (cells.facets, cells.side, len(free))
        ring_kernels()("ring_patches", *of_rings, *geometry, kinds, bases, flows, matrix, factor)
        self._corrections = ring_kernels().bound(
            "ring_corrections", *of_rings, kinds, bases, flows, factor
        )

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Sum the corrections of all patches for a residual, shape (F, m, 2)."""
        z = np.zeros_like(r)
        self._corrections(np.ascontiguousarray(r), z)
        return z


def _spreads(free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return coefficients of resultant 1, and of resultant 0, on the free nodes (m,).

    Returns:
        Shapes (m,) and (m, m-1); columns that there are not are zero.
    """
    m = len(free)
    chosen = np.flatnonzero(free)
    spread = np.zeros(m)
    spread[chosen] = m / max(len(chosen), 1)
    without = np.zeros((m, m - 1))
    for column in range(len(chosen) - 1):
        without[chosen[: column + 1], column] = 1.0
        without[chosen[column + 1], column] = -(column + 1)
    return spread, without


def _bases(free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what acts on each facet as coefficients.

    Args:
        free: Coefficients that are not given, shape (F, m, 2).

    Returns:
        The kind of each facet, shape (F,), and for each kind an axial resultant of 1,
        then the l amounts without axial resultant, then zeros, shape (kinds, m, 2,
        BLOCK). A kind is a set of free coefficients.
    """
    m = free.shape[1]
    kinds = np.array(list(product((False, True), repeat=2 * m))).reshape(-1, m, 2)
    bases = np.zeros((len(kinds), m, 2, BLOCK))
    for basis, of_kind in zip(bases, kinds, strict=True):
        spread, without = _spreads(of_kind[:, 1])
        basis[:, 1, :m] = np.column_stack([spread, without])
        basis[range(m), 0, range(m, 2 * m)] = of_kind[:, 0]
    places = 1 << np.arange(2 * m)[::-1]
    kind = free.reshape(len(free), 2 * m) @ places
    return kind.astype(np.int32), bases
