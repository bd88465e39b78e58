"""The body as its contact sees it: forces that lift its surface, and displacements under forces on its surface.

With K the elastic stiffness with the supports and S its Schur complement on the nodes of all contacts: ``lifted(y)``
are the forces ``S y`` that hold the displacement y of the surface [force], ``moved(f)`` is the displacement ``S^+ f``
of the surface under forces f [length]. Both are of the nodes of a :class:`Surface`; the other nodes of contacts are
held in the first and free of forces in the second.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import together
from erc_contact.error.coupling import Traces
from erc_contact.error.surface import Surface
from erc_contact.model.model import Model
from erc_contact.newton.elastic import ElasticSolver
from erc_contact.newton.multigrid import Multigrid
from erc_contact.newton.stiffness import Stiffness

ROUGH, FINE = 1e-2, 3e-6
"""Tolerances of the linear solves: of a lifting whose energy is asked for, to four digits, and else [-]. Norms of maps
then differ between numbers of ranks by less than 1e-6 of themselves."""


class DenseTraces:
    """:class:`Traces` from the dense Schur complement that a direct solve leaves behind; construction is collective."""

    tolerance: ClassVar[float] = 1e-8
    cheap: ClassVar[bool] = True

    def __init__(self, model: Model, stiffness: Stiffness, surface: Surface) -> None:
        self.comm = model.comm
        self.shape = len(surface.numbers), model.d
        self.motions = _motions(model, surface)
        count = stiffness.contact_size
        dofs = (surface.numbers[:, None] * model.d + np.arange(model.d)).ravel()
        contact = stiffness.numbers[:count]
        place = np.searchsorted(contact, dofs)
        self.known = contact[np.minimum(place, count - 1)] == dofs
        self.place, self.count = place[self.known], count
        self.matrices = together(self.comm, lambda: self._matrices(stiffness) if self.comm.rank == 0 else None)

    def _matrices(self, stiffness: Stiffness) -> tuple[np.ndarray, np.ndarray]:
        """S, and its inverse where rigid motions are held by springs, between the nodes of the surface."""
        own = np.ix_(self.place, self.place)
        lifting = stiffness.reduced(self.count)[0] - np.diag(stiffness.glued_by[: self.count])
        return lifting[own], np.linalg.inv(stiffness.definite(self.count))[own]

    def lifted(self, y: np.ndarray, *, rough: bool = False) -> np.ndarray:
        """``S y``, to round-off."""
        return self._times(0, y)

    def moved(self, f: np.ndarray) -> np.ndarray:
        """``S^+ f``, for forces that do no work on the free motions."""
        return self._times(1, f)

    def free(self) -> None:
        """Free the memory."""
        self.matrices = None

    def _times(self, which: int, values: np.ndarray) -> np.ndarray:
        result = np.zeros(values.size)
        if self.matrices is not None:
            result[self.known] = self.matrices[which] @ values.ravel()[self.known]
        return self.comm.bcast(result).reshape(self.shape)


class IterativeTraces:
    """:class:`Traces` by conjugate gradients with multigrid, one linear solve each; construction is collective."""

    tolerance: ClassVar[float] = 3e-2
    cheap: ClassVar[bool] = False

    def __init__(self, model: Model, elastic: Multigrid, surface: Surface) -> None:
        self.model, self.elastic, self.surface = model, elastic, surface
        self.motions = _motions(model, surface)

    def lifted(self, y: np.ndarray, *, rough: bool = False) -> np.ndarray:
        """``S y``."""
        forces = self.elastic.lifted(self._nodal(y), ROUGH if rough else FINE)
        return of_owners(self.model, self.surface, forces.x.array)

    def moved(self, f: np.ndarray) -> np.ndarray:
        """``S^+ f``, for forces that do no work on the free motions."""
        moved = self.elastic.solve(self._nodal(f), supports=False, tolerance=FINE)
        return of_owners(self.model, self.surface, moved.x.array)

    def free(self) -> None:
        """Free the memory."""
        self.elastic.free()

    def _nodal(self, values: np.ndarray) -> fem.Function:
        """A Function with these values (M, d) at the nodes of the surface that this rank owns, zero elsewhere."""
        nodal = self.model.function()
        index = self.model.V.dofmap.index_map
        low, high = index.local_range
        own = (self.surface.numbers >= low) & (self.surface.numbers < high)
        nodal.x.array.reshape(-1, self.model.d)[self.surface.numbers[own] - low] = values[own]
        return nodal


def traces_of(model: Model, elastic: ElasticSolver, surface: Surface) -> Traces:
    """The traces of a body on a surface, with what its contact solve has left behind; collective."""
    if isinstance(elastic, Stiffness):
        return DenseTraces(model, elastic, surface)
    assert isinstance(elastic, Multigrid)
    return IterativeTraces(model, elastic, surface)


def _motions(model: Model, surface: Surface) -> np.ndarray:
    """The free motions at the nodes of the surface, from the owners of the nodes, shape (K, M, d); collective."""
    return np.array([of_owners(model, surface, motion.x.array) for motion in model.free_motions]).reshape(
        -1, len(surface.numbers), model.d
    )


def of_owners(model: Model, surface: Surface, values: np.ndarray) -> np.ndarray:
    """Nodal values of this rank's nodes, (nodes * d,), at the nodes of the surface, shape (M, d); collective."""
    index = model.V.dofmap.index_map
    low, high = index.local_range
    own = (surface.numbers >= low) & (surface.numbers < high)
    nodal = np.zeros((len(surface.numbers), model.d))
    nodal[own] = values.reshape(-1, model.d)[surface.numbers[own] - low]
    return np.asarray(model.comm.allreduce(nodal))
