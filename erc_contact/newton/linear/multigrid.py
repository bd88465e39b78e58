"""The elastic equations solved iteratively: conjugate gradients with algebraic multigrid, on any number of ranks.

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

from typing import Any, ClassVar

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.base.logs import log_of
from erc_contact.base.runtime.garbage import free_dropped
from erc_contact.model.model import Model
from erc_contact.newton.linear.amg import PREFIX, orthonormal, rigid_motions, with_defaults
from erc_contact.newton.linear.elastic import Elastic
from erc_contact.newton.linear.galerkin import SAME, SUBSET, CoarseMatrices
from erc_contact.newton.linear.mumps import LIBRARY, factorised
from erc_contact.newton.linear.traces import IterativeTraces

ROUGH, EXACT = 1e-4, 1e-12
"""Tolerances of linear solves: of first guesses and corrections, and of what must balance the loads [-].

A first guess to 1e-2 costs four cycles less and up to four Newton steps more."""
DIRECT = 'Take solver="direct": nearly incompressible bodies, slender ones and jumps of the moduli are hard for multigrid.'
"""What a user can do where multigrid fails."""
NEAR = 1e3
"""A residual of so many tolerances is near enough; what is left is balanced again [-]."""
LIMIT = 500
"""Limit of the iterations of one linear solve; 15 to 60 are usual."""


class Multigrid(Elastic):
    """The elastic stiffness of a model with its supports, and a multigrid hierarchy.

    Attributes:
        contact_size: Number of free degrees of freedom at contact nodes, over all
            ranks; 0 without contact.
    """

    iterative: ClassVar[bool] = True

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        glued = int(np.count_nonzero(self.glue.x.array[: self.owned]))
        self.contact_size = int(model.comm.allreduce(glued, MPI.SUM))
        self._matrix: PETSc.Mat | None = None
        self._fine: Any = None
        self._pc: Any = None
        self._exact: Any = None
        self._coarse: CoarseMatrices | None = None
        self._share: float | None = None
        """Share of the glue in the matrix of the hierarchy; None after :meth:`renew` with a tangent."""

    @property
    def matrix(self) -> PETSc.Mat:
        """K, see :meth:`Elastic.stiffness`; it is assembled when it is needed."""
        if self._matrix is None:
            self._matrix = self.stiffness()
        return self._matrix

    def glued(
        self, b: fem.Function, *, supports: bool = True, tolerance: float = ROUGH
    ) -> fem.Function:
        """``w = (K + D)^-1 b`` [length] under nodal forces b [force], whose ghost contributions are added up here.

        Args:
            b: Nodal forces.
            supports: Whether fixed components take the values of the supports, else
                zero.
            tolerance: Residual over the right side [-].
        """
        self._set_up(1.0)
        right = self.right_side(b, supports=supports)
        return self._solved(self._fine, right, tolerance, direct=self.contact_size == 0)

    def solve(
        self, b: fem.Function, *, supports: bool = True, tolerance: float | None = None
    ) -> fem.Function:
        """Displacement u of ``K u = b`` [length] under nodal forces b [force]; see :meth:`glued`.

        The loads must do no work on rigid motions that no support holds; u has no part
        in these motions. Without supports it is a correction, of which four digits are
        right by default.

        Args:
            b: Nodal forces.
            supports: Whether fixed components take the values of the supports, else
                zero.
            tolerance: Residual over the right side [-].
        """
        self._set_up(self._weak_share())
        right = self.right_side(b, supports=supports)
        if self.model.free_motions:
            motions = self._motions()
            self.matrix.setNullSpace(motions)
            motions.remove(right)  # round-off
        return self._solved(self.matrix, right, tolerance or (EXACT if supports else ROUGH))

    def solve_with_springs(
        self, springs: PETSc.Mat, b: fem.Function, near: fem.Function
    ) -> fem.Function:
        """Return the displacement u of ``(K + C) u = b`` [length], see :class:`.solver.ElasticSolver`."""
        self.renew(springs)
        return self._solved(self._fine, self.right_side(b, supports=False), EXACT, near)

    def lifted(self, y: fem.Function, tolerance: float) -> fem.Function:
        """Forces that hold the contact nodes at given displacements, the other nodes being free of forces [force].

        Args:
            y: Displacement of the contact nodes that this rank owns [length], zero
                where supports fix it.
            tolerance: Of the displacement between them [-]; the energy has twice the
                digits.
        """
        self._set_up(1.0)
        held = np.flatnonzero(self.glue.x.array[: self.owned] > 0).astype(np.int32)
        fixed = np.flatnonzero(self.model.fixed.ravel()[: self.owned])
        u, b = self.matrix.createVecRight(), self.matrix.createVecRight()
        u.array[:] = y.x.array[: self.owned]
        self.matrix.mult(u, b)
        b.scale(-1.0)
        b.array[held] = b.array[fixed] = 0.0
        inside = self.matrix.copy()
        inside.zeroRowsColumnsLocal(held, diag=float(self.glue.x.array.max(initial=1.0)))
        between = self._solved(inside, b, tolerance)
        inside.destroy()
        u.array[:] += between.x.array[: self.owned]
        forces = self.matrix.createVecRight()
        self.matrix.mult(u, forces)
        forces.array[fixed] = 0.0
        found = self.displacement(forces)
        for vector in (u, forces):
            vector.destroy()
        return found

    def traces(self, numbers: np.ndarray) -> IterativeTraces:
        """Return the body as a surface sees it, see :class:`.solver.ElasticSolver`."""
        return IterativeTraces(self.model, numbers, self)

    def renew(self, change: PETSc.Mat) -> None:
        """Let the hierarchy be that of K plus a change C at the contact [force/length]."""
        if self._pc is None:
            self._set_up(1.0)
        self._share = None
        self._fine.setOption(PETSc.Mat.Option.SPD, False)
        self.matrix.copy(self._fine, SAME)
        self._fine.axpy(1.0, change, SUBSET)
        if self._coarse is None:
            self._pc.setUp()
        else:
            self._coarse.follow(change)

    def cycle(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the hierarchy's approximation of the inverse times x."""
        self._pc.apply(x, y)

    @property
    def factorised(self) -> bool:
        """Whether a hierarchy is in memory."""
        return self._pc is not None

    def free(self) -> None:
        """Free K and the hierarchy; a later solve makes them again."""
        if self._coarse is not None:
            self._coarse.free()
        for made in (self._pc, self._fine, self._matrix, self._exact):
            if made is not None:
                made.destroy()
        self._pc = self._fine = self._matrix = self._exact = self._coarse = self._share = None
        free_dropped(self.model.comm)

    def _set_up(self, share: float) -> None:
        """Let the hierarchy be that of K plus a share of D."""
        if self._pc is None:
            self._make(self._weak_share())
        if self._share != share and self.contact_size:
            glue = self._part_of_glue(share)
            self.renew(glue)
            glue.destroy()
            self._fine.setOption(PETSc.Mat.Option.SPD, True)
        self._share = share

    def _part_of_glue(self, share: float) -> PETSc.Mat:
        glue = PETSc.Mat().createAIJ(self.matrix.getSizes(), nnz=1, comm=self.matrix.comm)
        self.add_glue(glue, share)
        glue.assemble()
        return glue

    def _make(self, share: float) -> None:
        """Make the hierarchy of K plus a share of D."""
        self._fine = self.matrix.copy()
        self._fine.setNearNullSpace(rigid_motions(self.model, self._fine))
        if share:
            self.add_glue(self._fine, share)
        self._fine.setOption(PETSc.Mat.Option.SPD, True)
        self._pc = PETSc.PC().create(self._fine.comm)
        self._pc.setOptionsPrefix(PREFIX)
        self._pc.setOperators(self._fine)
        with_defaults(self._pc)
        self._share = share
        if self._pc.getType() == PETSc.PC.Type.GAMG and self.contact_size:
            self._pc.setReusePreconditioner(True)  # they change with C
            glue = self._part_of_glue(share)
            self._coarse = CoarseMatrices(self._pc, self.matrix, self._layer(), glue)
            glue.destroy()

    def _layer(self) -> PETSc.IS:
        """The degrees of freedom of this rank in cells at the contact, ghost cells included."""
        near = self.model.function()
        cells = np.concatenate([contact.facets[:, 0] for contact in self.model.contacts])
        near.x.array.reshape(-1, self.model.d)[self.model.nodes[cells]] = 1.0
        near.x.scatter_reverse(la.InsertMode.add)
        own = np.flatnonzero(near.x.array[: self.owned]) + self.matrix.getOwnershipRange()[0]
        return PETSc.IS().createGeneral(own.astype(PETSc.IntType), comm=self.matrix.comm)

    def _solved(
        self,
        matrix: PETSc.Mat,
        b: PETSc.Vec,
        tolerance: float,
        near: fem.Function | None = None,
        *,
        direct: bool = True,
    ) -> fem.Function:
        """The solution for a right side, which is destroyed; a direct solver may take over where multigrid fails."""
        size = b.norm(PETSc.NormType.NORM_INFINITY)
        if not np.isfinite(size):
            raise InputError(
                "The loads are no numbers of double precision. Choose units in which they are nearer to 1."
            )
        x = b.duplicate()
        if size > 0:
            b.scale(1 / size)
            if near is not None:
                x.array[:] = near.x.array[: self.owned] / size
            rest = self._conjugate_gradients(matrix, b, x, tolerance)
            if rest > NEAR * tolerance and direct:
                log_of(self.model.comm).info(
                    "Multigrid left %.0e of the loads: a direct solver takes over.", rest
                )
                self._exact = factorised(self._fine)
                if self._coarse is not None:
                    self._coarse.free()
                self._pc, self._coarse = self._exact.getPC(), None
                rest = self._conjugate_gradients(matrix, b, x, tolerance)
            if not rest <= NEAR * tolerance:
                raise NotConverged(
                    f"Conjugate gradients with multigrid left {rest:.0e} of the loads. {DIRECT}", ()
                )
            x.scale(size)
        u = self.displacement(x)
        x.destroy()
        b.destroy()
        return u

    def _conjugate_gradients(
        self, matrix: PETSc.Mat, b: PETSc.Vec, x: PETSc.Vec, tolerance: float
    ) -> float:
        """Solve for x; return the residual over the right side, infinite if multigrid failed."""
        ksp = PETSc.KSP().create(matrix.comm)
        ksp.setOptionsPrefix(PREFIX)
        ksp.setPC(self._pc)
        ksp.setOperators(matrix, self._fine)
        ksp.setType("cg")
        ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=LIMIT)
        ksp.setInitialGuessNonzero(True)
        try:
            ksp.solve(b, x)
            rest = ksp.getResidualNorm() / b.norm()
        except PETSc.Error as failure:
            if failure.ierr != LIBRARY:
                raise
            rest = np.inf
        ksp.destroy()
        return float(rest) if np.isfinite(rest) else np.inf

    def weak_glue(self) -> PETSc.Vec:
        """The glue that holds a loose body, zero for a held one [force/length]."""
        weak = self.matrix.createVecRight()
        weak.array[:] = self._weak_share() * self.glue.x.array[: self.owned]
        return weak

    def _weak_share(self) -> float:
        """Share of D that holds a loose body about as softly as its own stiffness, ``h/(10 L)`` [-], else zero."""
        return (
            0.1 * self.model.domain.cells ** (-1 / self.model.d) if self.model.free_motions else 0.0
        )

    def _motions(self) -> PETSc.NullSpace:
        """The rigid motions that no support holds."""
        vectors = []
        for motion in self.model.free_motions:
            x = self.matrix.createVecRight()
            x.array[:] = motion.x.array[: self.owned]
            vectors.append(x)
        return PETSc.NullSpace().create(vectors=orthonormal(vectors), comm=self.matrix.comm)
