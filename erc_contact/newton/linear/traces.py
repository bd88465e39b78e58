"""The body as its contact sees it: forces and displacements of its surface.

With K the elastic stiffness with the supports and S its Schur complement on the nodes
of all contacts: ``lifted(y)`` are the forces ``S y`` that hold the displacement y of
the surface [force], ``moved(f)`` is the displacement ``S^+ f`` of the surface under
forces f [length]. A surface is M nodes of contacts, by their global numbers; the other
nodes of contacts do not move in the first and are free of forces in the second.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Protocol

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import together
from erc_contact.model.model import Model
from erc_contact.model.trace import dofs_of

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
        numbers: Global numbers of the nodes of the surface, shape (M,).
        contact: Global numbers of the free degrees of freedom of the contact nodes, in
            order, shape (A,).
        matrices: Returns S and its inverse, where springs hold rigid motions, both
            (A, A); called on rank 0.
    """

    tolerance: ClassVar[float] = 1e-8
    cheap: ClassVar[bool] = True

    def __init__(
        self,
        model: Model,
        numbers: np.ndarray,
        contact: np.ndarray,
        matrices: Callable[[], tuple[np.ndarray, np.ndarray]],
    ) -> None:
        self.comm = model.comm
        self.shape = len(numbers), model.d
        self.motions = _motions(model, numbers)
        dofs = dofs_of(numbers, model.d)
        place = np.searchsorted(contact, dofs)
        # Components that a support fixes are not in the matrices.
        self._free = contact[np.minimum(place, len(contact) - 1)] == dofs
        place = place[self._free]

        def parts() -> tuple[np.ndarray, ...] | None:
            if self.comm.rank > 0:
                return None
            return tuple(matrix[np.ix_(place, place)] for matrix in matrices())

        self._matrices = together(self.comm, parts)

    def lifted(self, y: np.ndarray, *, rough: bool = False) -> np.ndarray:
        """Return ``S y``, to round-off."""
        return self._times(0, y)

    def moved(self, f: np.ndarray) -> np.ndarray:
        """Return ``S^+ f``, for forces that do no work on the free motions."""
        return self._times(1, f)

    def _times(self, which: int, values: np.ndarray) -> np.ndarray:
        """Return the product of one of the matrices and values (M, d); collective."""
        result = np.zeros(values.size)
        if self._matrices is not None:
            result[self._free] = self._matrices[which] @ values.ravel()[self._free]
        return self.comm.bcast(result).reshape(self.shape)


class Lifting(Protocol):
    """Lift displacements of the contact by linear solves, as multigrid does."""

    def lifted(self, y: fem.Function, tolerance: float) -> fem.Function:
        """Return the forces that hold the contact nodes at y [force]; collective."""

    def solve(
        self, b: fem.Function, *, supports: bool = True, tolerance: float | None = None
    ) -> fem.Function:
        """Return the displacement u of ``K u = b`` [length]; collective."""


class IterativeTraces:
    """Represent the body by linear solves, one for each question.

    Construction is collective.

    Args:
        model: The scene on a mesh.
        numbers: Global numbers of the nodes of the surface, shape (M,).
        elastic: The solver.
    """

    tolerance: ClassVar[float] = 3e-2
    cheap: ClassVar[bool] = False

    def __init__(self, model: Model, numbers: np.ndarray, elastic: Lifting) -> None:
        self.model = model
        self.numbers = numbers
        self.elastic = elastic
        self.motions = _motions(model, numbers)

    def lifted(self, y: np.ndarray, *, rough: bool = False) -> np.ndarray:
        """Return ``S y``."""
        forces = self.elastic.lifted(self._nodal(y), ROUGH_LIFTING if rough else FINE)
        return _of_owners(self.model, self.numbers, forces.x.array)

    def moved(self, f: np.ndarray) -> np.ndarray:
        """Return ``S^+ f``, for forces that do no work on the free motions."""
        coordinates = self.model.coordinates
        forces = coordinates.forces_on_bodies(self._nodal(f))
        moved = coordinates.to_x(self.elastic.solve(forces, supports=False, tolerance=FINE))
        return _of_owners(self.model, self.numbers, moved.x.array)

    def _nodal(self, values: np.ndarray) -> fem.Function:
        """Return values (M, d) as a Function of unknowns, at nodes of this rank."""
        nodal = self.model.function()
        owned, local = _owned(self.model, self.numbers)
        nodal.x.array.reshape(-1, self.model.d)[local] = values[owned]
        return nodal


def _motions(model: Model, numbers: np.ndarray) -> np.ndarray:
    """Return the free motions at the surface [-], shape (K, M, d); collective."""
    motions = []
    for motion in model.free_motions:
        unknowns = model.coordinates.to_x(motion)
        motions.append(_of_owners(model, numbers, unknowns.x.array))
    return np.array(motions).reshape(-1, len(numbers), model.d)


def _of_owners(model: Model, numbers: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return nodal values at the surface, on all ranks, shape (M, d); collective.

    Args:
        model: The scene on a mesh.
        numbers: Global numbers of the nodes of the surface, shape (M,).
        values: Values at the nodes of this rank, right on their owners, (nodes d,).
    """
    owned, local = _owned(model, numbers)
    nodal = np.zeros((len(numbers), model.d))
    nodal[owned] = values.reshape(-1, model.d)[local]
    return np.asarray(model.comm.allreduce(nodal))


def _owned(model: Model, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the nodes of the surface that this rank owns, and their local numbers."""
    low, high = model.V.dofmap.index_map.local_range
    owned = (numbers >= low) & (numbers < high)
    return owned, numbers[owned] - low
