"""A multigrid hierarchy of K plus a matrix that is zero away from the contact.

The hierarchy is PETSc's GAMG: smoothed aggregation with the rigid motions as near null
space. The aggregates and the interpolation are made once, for K. Where a matrix differs
from it at the contact only, as every tangent of a contact problem does, the coarse
matrices follow with the same interpolation (:mod:`erc_contact.newton.linear.galerkin`).
That of K serves all of them; that of K + D saves a tenth of the cycles of a contact
solve, and doubles those of an elastic solve with given contact tractions. Another
preconditioner that PETSc's options ask for is set up anew for each matrix.

Symbols: K and D as in :mod:`erc_contact.newton.linear.elastic`; C a matrix that is zero
away from the contact.
"""

from __future__ import annotations

import numpy as np
from dolfinx import la
from petsc4py import PETSc

from erc_contact.model.model import Model
from erc_contact.newton.linear.amg import AMG_PREFIX, rigid_motions, with_defaults
from erc_contact.newton.linear.elastic import add_diagonal
from erc_contact.newton.linear.galerkin import SAME, SUBSET, CoarseMatrices
from erc_contact.newton.linear.mumps import factorised


class Hierarchy:
    """Hold a hierarchy and the matrix that it is for; members are collective.

    It does not know the solver that owns it: objects that know each other are freed
    late, on each rank at another time.

    Args:
        model: The scene on a mesh.
        stiffness: K [force/length].
        glue: D at the degrees of freedom of this rank [force/length].
        share: Share of D in the first matrix [-].
        has_contact: Whether D is not zero on all ranks.

    Attributes:
        matrix: The matrix of the hierarchy, K plus a share of D, or K + C after
            :meth:`renew` [force/length].
        pc: PETSc's preconditioner.
    """

    def __init__(
        self,
        model: Model,
        stiffness: PETSc.Mat,
        glue: np.ndarray,
        share: float,
        *,
        has_contact: bool,
    ) -> None:
        self._model = model
        self._stiffness = stiffness
        self._glue = glue
        self._has_contact = has_contact
        self._exact: PETSc.KSP | None = None
        self._coarse: CoarseMatrices | None = None
        self._share: float | None = share
        """Share of the glue in the matrix; None after :meth:`renew` with a tangent."""

        self.matrix = stiffness.copy()
        self.matrix.setNearNullSpace(rigid_motions(model, self.matrix))
        if share:
            add_diagonal(self.matrix, share * glue)
        self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        self.pc = PETSc.PC().create(self.matrix.comm)
        self.pc.setOptionsPrefix(AMG_PREFIX)
        self.pc.setOperators(self.matrix)
        with_defaults(self.pc)
        if self.pc.getType() == PETSc.PC.Type.GAMG and self._has_contact:
            # PETSc must not set it up anew: the coarse matrices follow C here.
            self.pc.setReusePreconditioner(True)
            first = self._part_of_glue(share)
            self._coarse = CoarseMatrices(self.pc, stiffness, self._layer(), first)
            first.destroy()

    def set_share(self, share: float) -> None:
        """Set the matrix to K plus a share of D."""
        if self._share != share and self._has_contact:
            glue = self._part_of_glue(share)
            self.renew(glue)
            glue.destroy()
            self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._share = share

    def renew(self, change: PETSc.Mat) -> None:
        """Set the matrix to K plus a change C at the contact [force/length]."""
        self._share = None
        self.matrix.setOption(PETSc.Mat.Option.SPD, False)
        self._stiffness.copy(self.matrix, SAME)
        self.matrix.axpy(1.0, change, SUBSET)
        if self._coarse is None:
            self.pc.setUp()
        else:
            self._coarse.follow(change)

    def factorise(self) -> None:
        """Replace the hierarchy by a factor of its matrix."""
        self._exact = factorised(self.matrix)
        if self._coarse is not None:
            self._coarse.free()
            self._coarse = None
        self.pc = self._exact.getPC()

    def free(self) -> None:
        """Free PETSc's objects, which it would keep on several ranks."""
        if self._coarse is not None:
            self._coarse.free()
        self.pc.destroy()
        self.matrix.destroy()
        if self._exact is not None:
            self._exact.destroy()

    def _part_of_glue(self, share: float) -> PETSc.Mat:
        """Return a share of D as a matrix [force/length]."""
        sizes = self._stiffness.getSizes()
        glue = PETSc.Mat().createAIJ(sizes, nnz=1, comm=self._stiffness.comm)
        add_diagonal(glue, share * self._glue)
        glue.assemble()
        return glue

    def _layer(self) -> PETSc.IS:
        """Find the degrees of freedom of this rank in cells at the contact.

        Ghost cells are among these cells, and another rank may own a cell at a node of
        this rank without a ghost of it here.
        """
        model = self._model
        near = model.function()
        cells = np.concatenate([contact.facets[:, 0] for contact in model.contacts])
        near.x.array.reshape(-1, model.d)[model.nodes[cells]] = 1.0
        near.x.scatter_reverse(la.InsertMode.add)
        first, _ = self._stiffness.getOwnershipRange()
        owned = np.flatnonzero(near.x.array[: len(self._glue)]) + first
        return PETSc.IS().createGeneral(owned.astype(PETSc.IntType), comm=self._stiffness.comm)
