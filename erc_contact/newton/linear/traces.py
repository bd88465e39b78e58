"""The body as its contact sees it: forces and displacements of its surface.

With K the elastic stiffness with the supports and S its Schur complement on what the
contacts read: ``lifted(y)`` are the forces ``S y`` that hold the displacement y of the
surface, on contacts between bodies its jump, and ``moved(f)`` is the displacement ``S^+
f`` of the surface under forces f [length]. A surface is n nodes of contacts, by their
global numbers; the other nodes of contacts do not move in the first and are free of
forces in the second.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from dolfinx import fem
from petsc4py import PETSc
from scipy.sparse import csr_array, diags_array  # type: ignore[import-untyped]

from erc_contact.base.exceptions import together
from erc_contact.model.contact.trace import dofs_of
from erc_contact.model.data.over_ranks import product
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.newton.linear.jump_basis import JumpBasis

ROUGH_LIFTING = 1e-2
"""Tolerance of a lifting of whose energy four digits are wanted [-]."""
FINE = 3e-6
"""Tolerance of the other linear solves [-].

Norms of maps then differ between numbers of ranks by less than 1e-6 of themselves.
"""


class DenseTraces:
    """Represent the body by the dense Schur complement of a direct solve.

    Construction is collective.

    Args:
        model: The scene on a mesh.
        numbers: Global numbers of the nodes of the surface, shape (n,).
        basis: The unknowns A that change jumps.
        matrices: Returns S and its inverse on A, where springs hold rigid motions, both
            (A, A); called on rank 0.
    """

    tolerance: ClassVar[float] = 1e-8
    cheap: ClassVar[bool] = True

    def __init__(
        self,
        model: Model,
        numbers: np.ndarray,
        basis: JumpBasis,
        matrices: Callable[[], tuple[np.ndarray, np.ndarray]],
    ) -> None:
        self.comm = model.space.comm
        self.shape = len(numbers), model.space.d
        self.motions = _motions(model, numbers)
        self._free = np.zeros(0, dtype=np.int64)

        def parts() -> tuple[np.ndarray, ...] | None:
            if self.comm.rank > 0:
                return None
            stiffness, compliance = matrices()
            read = basis.read(len(numbers) * model.space.d, *_jumps_at(model, numbers))
            jumps = read[:, : basis.jump_count]
            squares = (jumps**2).sum(axis=1)
            # Components that supports fix are not in the matrices.
            self._free = np.flatnonzero(squares)
            read = jumps[self._free]
            held = diags_array(1 / squares[self._free]) @ read
            return _on_surface(held, stiffness), _on_surface(read, compliance)

        self._matrices = together(self.comm, parts)

    def lift(self, y: np.ndarray, *, rough: bool = False) -> np.ndarray:
        """Return ``S y``, to round-off."""
        return self._times(0, y)

    def move(self, f: np.ndarray) -> np.ndarray:
        """Return ``S^+ f``, for forces that do no work on the free motions."""
        return self._times(1, f)

    def _times(self, which: int, values: np.ndarray) -> np.ndarray:
        """Return the product of a matrix and values (n, d); collective."""
        result = np.zeros(values.size)
        if self._matrices is not None:
            result[self._free] = self._matrices[which] @ values.ravel()[self._free]
        return self.comm.bcast(result).reshape(self.shape)


class IterativeTraces:
    """Represent the body by linear solves, a solve for each question.

    Construction is collective.

    Args:
        model: The scene on a mesh.
        numbers: Global numbers of the nodes of the surface, shape (n,).
        solve: Solves the equations, as :meth:`.solver.ElasticSolver.solve`.
        lift: Returns the forces that hold the contact nodes at a displacement [force],
            with a tolerance of the displacement between them [-].
    """

    tolerance: ClassVar[float] = 3e-2
    cheap: ClassVar[bool] = False

    def __init__(
        self,
        model: Model,
        numbers: np.ndarray,
        solve: Callable[..., fem.Function],
        lift: Callable[[fem.Function, float], fem.Function],
    ) -> None:
        self.space = model.space
        self.numbers = numbers
        self._solve = solve
        self._lift = lift
        self._jumps: PETSc.Mat | None = None
        if model.connections.any:
            self._jumps = model.connections.differences(model.connections.pairs_at(numbers))
        self.motions = _motions(model, numbers)

    def lift(self, y: np.ndarray, *, rough: bool = False) -> np.ndarray:
        """Return ``S y``."""
        forces = self._lift(self._nodal(y), ROUGH_LIFTING if rough else FINE)
        return _of_owners(self.space, self.numbers, forces.x.array)

    def move(self, f: np.ndarray) -> np.ndarray:
        """Return ``S^+ f``, for forces that do no work on the free motions."""
        on_bodies = self._by_jumps(self._nodal(f), transpose=True)
        moved = self._solve(on_bodies, supports=False, tolerance=FINE)
        return _of_owners(self.space, self.numbers, self._by_jumps(moved).x.array)

    def _by_jumps(self, u: fem.Function, *, transpose: bool = False) -> fem.Function:
        """Return jumps of a displacement, or nodal forces of forces on jumps."""
        if self._jumps is None:
            return u
        return product(self.space, self._jumps, u, transpose=transpose)

    def _nodal(self, values: np.ndarray) -> fem.Function:
        """Return values (n, d) as a Function, at nodes that this rank owns."""
        nodal = self.space.function()
        owned, local = self.space.find_owned(self.numbers)
        nodal.x.array.reshape(-1, self.space.d)[local] = values[owned]
        return nodal


def _motions(model: Model, numbers: np.ndarray) -> np.ndarray:
    """Return the free motions at the surface, or their jumps there; collective.

    Shape (K, n, d) [-].
    """
    space = model.space
    rows, columns, values = _jumps_at(model, numbers)
    nodes = np.unique(columns // space.d)
    dofs = dofs_of(nodes, space.d)
    motions = []
    for motion in model.free_motions:
        nodal = _of_owners(space, nodes, motion.x.array).ravel()
        read = values * nodal[np.searchsorted(dofs, columns)]
        motions.append(np.bincount(rows, read, len(numbers) * space.d))
    return np.array(motions).reshape(-1, len(numbers), space.d)


def _jumps_at(model: Model, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what contacts read at the surface: rows, columns and values of a matrix.

    Rows are places in a raveled (n, d), columns global degrees of freedom.
    """
    d = model.space.d
    pairs = model.connections.pairs_at(numbers)
    dofs = dofs_of(numbers, d)
    rows, columns, values = model.connections.there_in_jumps(pairs)
    return (
        np.concatenate([np.arange(len(dofs)), np.searchsorted(dofs, rows)]),
        np.concatenate([dofs, columns]),
        np.concatenate([np.ones(len(dofs)), values]),
    )


def _on_surface(jumps: csr_array, matrix: np.ndarray) -> np.ndarray:
    """Return ``J M J^T`` of a symmetric matrix M, dense."""
    return np.asarray(jumps @ (jumps @ matrix).T)


def _of_owners(space: Space, numbers: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return nodal values at the surface, on all ranks, shape (n, d); collective.

    Args:
        space: The mesh.
        numbers: Global numbers of the nodes of the surface, shape (n,).
        values: Values at the nodes of this rank, right on their owners, (nodes d,).
    """
    owned, local = space.find_owned(numbers)
    nodal = np.zeros((len(numbers), space.d))
    nodal[owned] = values.reshape(-1, space.d)[local]
    return np.asarray(space.comm.allreduce(nodal))
