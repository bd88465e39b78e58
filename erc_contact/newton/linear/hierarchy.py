"""A multigrid hierarchy of K plus a matrix that is zero away from the contact.

The hierarchy is PETSc's GAMG: smoothed aggregation with the rigid motions as near null
space. At degree 2 it begins with the elements of degree 1
(:mod:`erc_contact.newton.linear.p_coarsening`). The aggregates and the interpolation
are made once, for K. Where a matrix differs from it at the contact only, as every
tangent of a contact problem does, the coarse matrices follow with the same
interpolation (:mod:`erc_contact.newton.linear.galerkin`).
That of K serves all of them; that of K + D saves a tenth of the cycles of a contact
solve, and doubles those of an elastic solve with given contact tractions. Another
preconditioner that PETSc's options ask for is set up anew for each matrix.

Where the unknowns are jumps at contacts between bodies
(:mod:`erc_contact.model.coordinates`), the hierarchy is that of the same matrix for the
displacements of the bodies, whose rigid motions are known at every node.

PETSc compares pivots with fixed numbers. So the hierarchy is that of a matrix whose
entries are near one, whatever the units.

Symbols: K and D as in :mod:`erc_contact.newton.linear.elastic`; C a matrix that is zero
away from the contact.
"""

from __future__ import annotations

import numpy as np
from dolfinx import la
from petsc4py import PETSc

from erc_contact.base.sparse import add_diagonal
from erc_contact.model.model import Model
from erc_contact.newton.linear.amg import AMG_PREFIX, orthonormal, rigid_motions, with_defaults
from erc_contact.newton.linear.changed import ChangedBlocks, ChangedEntries
from erc_contact.newton.linear.galerkin import CoarseMatrices, levels_of
from erc_contact.newton.linear.mumps import factorised
from erc_contact.newton.linear.p_coarsening import TwoLevels
from erc_contact.newton.linear.shells import preconditioner


class Hierarchy:
    """Hold a hierarchy and the matrix that it is for; members are collective.

    It does not know the solver that owns it: objects that know each other are freed
    late, on each rank at another time.

    Args:
        model: The scene on a mesh.
        stiffness: K [force/length].
        operator: K as it is multiplied [force/length].
        glue: D at the degrees of freedom of this rank [force/length].
        share: Share of D in the first matrix [-].
        support_stiffness: Diagonal of K where supports fix a component [force/length].
        has_contact: Whether D is not zero on all ranks.

    Attributes:
        scale: A power of two, so that no digit is lost, about the inverse of
            `support_stiffness` [length/force].
        matrix: The matrix of the hierarchy times the scale, K plus a share of D, or K +
            C after :meth:`renew` [-].
        pc: PETSc's preconditioner of this matrix.
    """

    def __init__(
        self,
        model: Model,
        stiffness: PETSc.Mat,
        operator: PETSc.Mat,
        glue: np.ndarray,
        share: float,
        *,
        support_stiffness: float,
        has_contact: bool,
    ) -> None:
        self._model = model
        self._stiffness = stiffness
        self._glue = glue
        self._support_stiffness = support_stiffness
        self._has_contact = has_contact
        _, exponent = np.frexp(support_stiffness)
        self.scale = float(np.ldexp(1.0, 1 - exponent))
        self._exact: PETSc.KSP | None = None
        self._coarse: CoarseMatrices | None = None
        self._share: float | None = share
        """Share of the glue in the matrix; None after :meth:`renew` with a tangent."""

        self._stiffness_of_bodies = stiffness
        if not model.coordinates.is_identity:
            self._stiffness_of_bodies = self._of_bodies(stiffness, support_stiffness)
        self._sum = self._changed(stiffness, operator)
        self._sum_of_bodies = self._sum
        if not model.coordinates.is_identity:
            self._sum_of_bodies = self._changed(self._stiffness_of_bodies, None)
        self.matrix = self._sum.matrix
        self._bodies = self._sum_of_bodies.matrix
        first = self._part_of_glue(share)
        first_of_bodies = self._change_of_bodies(first)
        if share:
            self._change(first, first_of_bodies)
        self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._bodies.setOption(PETSc.Mat.Option.SPD, True)
        self._two_levels: TwoLevels | None = None
        self._multigrid, algebraic = self._preconditioners(first_of_bodies)
        levels: list[tuple[PETSc.Mat, PETSc.Mat]] = []
        # PETSc must not set these up anew: the coarse matrices follow C here.
        if has_contact and self._two_levels is not None:
            levels.append((self._two_levels.interpolation, self._two_levels.coarse))
            self._two_levels.keep()
        is_gamg = algebraic.getType() == PETSc.PC.Type.GAMG
        if has_contact and is_gamg:
            algebraic.setReusePreconditioner(True)
        if has_contact and (is_gamg or levels):
            self._coarse = CoarseMatrices(
                levels + levels_of(algebraic),
                self._stiffness_of_bodies,
                self._layer(),
                first_of_bodies,
                self.scale,
            )
        first_of_bodies.destroy()
        first.destroy()
        self.pc = self._multigrid
        if self._bodies is not self.matrix:
            self.pc = preconditioner(self._apply_to_unknowns, self.matrix)

    def _changed(
        self, stiffness: PETSc.Mat, operator: PETSc.Mat | None
    ) -> ChangedBlocks | ChangedEntries:
        """Return a matrix to which changes can be added, as the cycle needs it."""
        if self._model.degree > 1:
            return ChangedBlocks(stiffness, self.scale, self._model.d, operator)
        return ChangedEntries(stiffness, self.scale)

    def _change(self, change: PETSc.Mat, of_bodies: PETSc.Mat) -> None:
        """Set C of the matrices for the unknowns and for displacements."""
        self._sum.change(change)
        if self._sum_of_bodies is not self._sum:
            self._sum_of_bodies.change(of_bodies)

    def _preconditioners(self, change: PETSc.Mat) -> tuple[PETSc.PC, PETSc.PC]:
        """Set up the cycle, and algebraic multigrid, the lower part or all of it.

        Args:
            change: The first C, for displacements [force/length].
        """
        if self._model.degree > 1:
            self._two_levels = TwoLevels(
                self._model,
                self._bodies,
                (self._stiffness_of_bodies, change),
                self.scale,
                self._support_stiffness,
            )
            return self._two_levels.pc, self._two_levels.algebraic
        self._bodies.setNearNullSpace(rigid_motions(self._model.V, self._bodies))
        multigrid = PETSc.PC().create(self.matrix.comm)
        multigrid.setOptionsPrefix(AMG_PREFIX)
        multigrid.setOperators(self._bodies)
        with_defaults(multigrid)
        return multigrid, multigrid

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
        if self._bodies is not self.matrix:
            self._bodies.setOption(PETSc.Mat.Option.SPD, False)
        of_bodies = self._change_of_bodies(change)
        self._change(change, of_bodies)
        if self._coarse is None:
            self._multigrid.setUp()
        else:
            self._coarse.follow(of_bodies)
        if of_bodies is not change:
            of_bodies.destroy()

    def factorise(self) -> None:
        """Replace the hierarchy by a factor of its matrix."""
        entries = self._sum.entries()
        self._exact = factorised(entries)
        entries.destroy()
        if self._coarse is not None:
            self._coarse.free()
            self._coarse = None
        if self.pc is not self._multigrid:
            self.pc.destroy()
        self.pc = self._exact.getPC()
        # A solver that is given the matrix as products would factorise it anew.
        self.pc.setReusePreconditioner(True)

    def free(self) -> None:
        """Free PETSc's objects, which it would keep on several ranks."""
        if self._coarse is not None:
            self._coarse.free()
        self.pc.destroy()
        self._multigrid.destroy()
        if self._two_levels is not None:
            self._two_levels.free()
        self._sum.free()
        if not self._model.coordinates.is_identity:
            self._sum_of_bodies.free()
            self._stiffness_of_bodies.destroy()
        if self._exact is not None:
            self._exact.destroy()

    def _part_of_glue(self, share: float) -> PETSc.Mat:
        """Return a share of D as a matrix [force/length]."""
        sizes = self._stiffness.getSizes()
        glue = PETSc.Mat().createAIJ(sizes, nnz=1, comm=self._stiffness.comm)
        add_diagonal(glue, share * self._glue)
        glue.assemble()
        return glue

    def _of_bodies(self, matrix: PETSc.Mat, diagonal: float) -> PETSc.Mat:
        """Return a matrix for the unknowns as one for displacements."""
        fixed = self._model.fixed.ravel()[: len(self._glue)]
        return self._model.coordinates.of_bodies(matrix, fixed, diagonal)

    def _change_of_bodies(self, change: PETSc.Mat) -> PETSc.Mat:
        """Return a change of the matrix as one for displacements.

        It is the change itself where unknowns are displacements.
        """
        if self._model.coordinates.is_identity:
            return change
        return self._of_bodies(change, 0.0)

    def _apply_to_unknowns(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to about the inverse of the matrix times x, for unknowns x."""
        coordinates = self._model.coordinates
        fixed_unknowns = coordinates.fixed.ravel()[: len(self._glue)]
        fixed = self._model.fixed.ravel()[: len(self._glue)]
        force = x.copy()
        force.array[fixed_unknowns] = 0.0
        of_bodies = x.duplicate()
        coordinates.inverse.multTranspose(force, of_bodies)
        of_bodies.array[fixed] = 0.0
        self._multigrid.apply(of_bodies, force)
        force.array[fixed] = 0.0
        coordinates.inverse.mult(force, y)
        y.array[fixed_unknowns] = x.array_r[fixed_unknowns] / (self.scale * self._support_stiffness)
        force.destroy()
        of_bodies.destroy()

    def _layer(self) -> PETSc.IS:
        """Find the degrees of freedom of this rank in cells at the contact.

        Ghost cells are among these cells, and another rank may own a cell at a node of
        this rank without a ghost of it here.
        """
        model = self._model
        near = model.function()
        cells = np.concatenate([contact.facets[:, 0] for contact in model.contacts])
        of_nodes = near.x.array.reshape(-1, model.d)
        of_nodes[model.nodes[cells]] = 1.0
        for contact in model.contacts:
            if contact.trace.there is not None:
                of_nodes[contact.trace.partners] = 1.0
        near.x.scatter_reverse(la.InsertMode.add)
        first, _ = self._stiffness.getOwnershipRange()
        owned = np.flatnonzero(near.x.array[: len(self._glue)]) + first
        return PETSc.IS().createGeneral(owned.astype(PETSc.IntType), comm=self._stiffness.comm)


def weak_share(model: Model) -> float:
    """Return the share of D that holds a loose body, ``h/(10 L)``, else zero [-].

    It does so about as softly as the body's own stiffness.
    """
    if not model.free_motions:
        return 0.0
    return 0.1 * model.domain.cells ** (-1 / model.d)


def free_motions(model: Model, matrix: PETSc.Mat) -> PETSc.NullSpace:
    """Return the rigid motions that no support holds, for the unknowns of a matrix.

    Loose rigid faces, which move with the body, are at rest in its unknowns.
    """
    coordinates = model.coordinates
    vectors = []
    for motion in model.free_motions:
        vector = matrix.createVecRight()
        owned = vector.getLocalSize()
        vector.array[:] = coordinates.to_x(motion).x.array[:owned]
        vector.array[coordinates.fixed.ravel()[:owned]] = 0.0
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=orthonormal(vectors), comm=matrix.comm)
