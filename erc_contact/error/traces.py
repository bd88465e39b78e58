"""The body as its contact sees it: forces that lift its surface, and displacements under forces on its surface.

With K the elastic stiffness with the supports and S its Schur complement on the nodes of all contacts: ``lifted(y)``
are the forces ``S y`` that hold the displacement y of the surface [force], ``moved(f)`` is the displacement ``S^+ f``
of the surface under forces f [length]. Both are of the nodes of a :class:`Surface`; the other nodes of contacts are
held in the first and free of forces in the second.

The norm q of the map of :mod:`erc_contact.error.coupling` changes with the mesh. How far it is from its limit is told
by the same body on another mesh, with the same field t, interpolated to the nodes there. A small body is refined once.
Of a larger one a coarser mesh is made, so that this costs little beside the solve of the body itself. Where corners and
edges of a contact see it on every scale, q grows like the inverse of a logarithm: ``q(h) = q(0) - c/log(1 + L/h)`` with
the size L of the contact. Two meshes tell c; then ``c/log(1 + L/h)`` is what is missing on the mesh of size h. Where q
converges faster this is more than what is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import ErcContactError, together
from erc_contact.error.coupling import Traces, coupling
from erc_contact.error.surface import Surface, coulomb_surface
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.nodal import NodalMesh
from erc_contact.model.model import Model
from erc_contact.model.promises import bind
from erc_contact.newton.linear.elastic import ElasticSolver
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.linear.stiffness import Stiffness

ROUGH, FINE = 1e-2, 3e-6
"""Tolerances of the linear solves: of a lifting whose energy is asked for, to four digits, and else [-]. Norms of maps
then differ between numbers of ranks by less than 1e-6 of themselves."""
MOST_CELLS = {2: 1000, 3: 3000}
"""Greatest number of cells of another mesh, by dimension."""
COARSER = 3.0
"""A coarser mesh has cells of this many times the size, or larger ones."""
UNKNOWN = 0.1
"""Share of q that is its change where there is no other mesh to compare with [-]."""
SAME = 0.01
"""Relative difference of ``1/log(1 + L/h)`` below which a contact has the same mesh as before [-]."""


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


@dataclass(frozen=True, eq=False)
class OtherMesh:
    """The same body on another mesh, as its contact sees it.

    Attributes:
        surface: The contacts with Coulomb friction.
        traces: The body as they see it.
    """

    surface: Surface
    traces: Traces

    def norm(self, surface: Surface, t: np.ndarray) -> tuple[float, np.ndarray]:
        """Compute the norm q for the field t (M, d) of a surface; collective.

        Returns:
            q [-], and the normal displacements that go with it, on the surface of t, shape (M,).
        """
        here = self.surface
        x = here.positions()
        field = np.where(here.blocked[:, None], 0.0, surface.interpolated(t, x))
        q, _, phi = coupling(here.normal, self.traces, field, x)
        along = here.interpolated(phi[:, None] * here.normal, surface.positions())
        return q, (along * surface.normal).sum(axis=1)


def other_mesh(model: Model) -> OtherMesh | None:
    """Make the other mesh of a body; collective.

    Returns:
        A finer mesh, or a coarser one; None where the body is known only as a mesh, or cannot be meshed so coarsely.
    """
    domain, d = model.domain, model.d
    try:
        if domain.cells * 2**d <= MOST_CELLS[d]:
            return body_on(model, domain.refined())
        if domain.geometry is None:
            return None
        factor = max(COARSER, (domain.cells / MOST_CELLS[d]) ** (1 / d))
        return body_on(model, domain.remeshed(factor * NodalMesh(domain).mean_size()))
    except ErcContactError:
        return None


def body_on(model: Model, domain: Domain) -> OtherMesh:
    """Make the body of a model on another mesh, as its contact sees it; collective."""
    other = bind(model.scene, domain, model.degree)
    stiffness = Stiffness(other)
    stiffness.free()
    surface = coulomb_surface(other)
    return OtherMesh(surface, traces_of(other, stiffness, surface))


def change_of_norm(q: float, surface: Surface, other_q: float, other: OtherMesh | None) -> float:
    """Estimate how far the norm q of a field is from its limit, from its value on another mesh [-].

    Args:
        q: The norm on the mesh of the body [-].
        surface: The contacts on this mesh.
        other_q: The norm of the same field on the other mesh [-].
        other: The other mesh.

    Returns:
        c/log(1 + L/h); a tenth of q where the other mesh tells nothing.
    """
    if other is None or not np.isfinite(q):
        return UNKNOWN * q
    here, there = _missing(surface), _missing(other.surface)
    if abs(here - there) < SAME * here:
        return max(UNKNOWN * q, abs(q - other_q))
    return here * abs(q - other_q) / abs(here - there)


def _missing(surface: Surface) -> float:
    """``1/log(1 + L/h)``, what is missing of q on a mesh, over c [-]."""
    d = surface.normal.shape[1]
    size = float(surface.area.mean()) ** (1 / (d - 1))
    length = float(np.ptp(surface.positions(), axis=0).max())
    return 1 / float(np.log1p(length / size))
