"""A multigrid hierarchy of K plus a matrix that is zero away from the contact.

The hierarchy is PETSc's GAMG: smoothed aggregation with the rigid motions as near null
space. At degree 2 it begins with the elements of degree 1
(:mod:`erc_contact.newton.linear.p_coarsening`). The aggregates and the interpolation
are made once, for K. Where a matrix differs from it at the contact only, as every
tangent of a contact problem does, the coarse matrices follow with the same
interpolation P: they are ``A_coarse = P^T A P``, and if C changes, each level has its
``P^T C P`` taken away and the new one added. C has few rows. It costs about as much as
one or two cycles, a new hierarchy about thirty.

The interpolation of K serves all matrices; the interpolation of K + D saves a tenth of
the cycles of a contact solve, and doubles the cycles of an elastic solve with given
contact tractions. Another preconditioner that PETSc's options ask for is set up anew
for each matrix.

PETSc compares pivots with fixed numbers. So the hierarchy is made for a matrix whose
entries are near 1, whatever the units.

Symbols: K and D as in :mod:`erc_contact.newton.linear.elastic`; C a matrix that is zero
away from the contact.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from erc_contact.model.model import Model
from erc_contact.newton.linear.amg import AMG_PREFIX, orthonormal, rigid_motions, with_defaults
from erc_contact.newton.linear.changed import DIFFERENT, SUBSET, ChangedBlocks, ChangedEntries
from erc_contact.newton.linear.krylov import preconditioner
from erc_contact.newton.linear.mumps import Factor, factorise
from erc_contact.newton.linear.p_coarsening import TwoLevels


class Hierarchy:
    """Hold a hierarchy and the matrix that it is for; members are collective.

    It does not know the solver that owns it: objects that know each other are freed
    late, on each rank at another time.

    Args:
        model: The scene on a mesh.
        stiffness: K [force/length].
        operator: K as it is multiplied [force/length].
        glue: D [force/length], which this object frees.
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
        glue: PETSc.Mat,
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
        self._exact: Factor | None = None
        self._coarse: CoarseMatrices | None = None
        self._share: float | None = share
        """Share of the glue in the matrix; None after :meth:`renew` with a tangent."""

        places = _contact_places(model, stiffness)
        self._sum = self._make_changeable(stiffness, operator, places)
        self.matrix = self._sum.matrix
        first = self._part_of_glue(share)
        if share:
            self._sum.change(first)
        self.matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._two_levels: TwoLevels | None = None
        self._multigrid, algebraic = self._preconditioners(places, first)
        self.pc = self._multigrid
        levels: list[tuple[PETSc.Mat, PETSc.Mat]] = []
        # PETSc must not set these up anew: the coarse matrices follow C here.
        if has_contact and self._two_levels is not None:
            levels.append((self._two_levels.interpolation, self._two_levels.coarse))
            self._two_levels.keep()
        is_gamg = algebraic.getType() == PETSc.PC.Type.GAMG
        if has_contact and is_gamg:
            algebraic.setReusePreconditioner(True)
        if has_contact and (is_gamg or levels):
            self._coarse = CoarseMatrices(levels + levels_of(algebraic), first, self.scale)
        for done in (first, places):
            if done is not None:
                done.destroy()

    def _make_changeable(
        self, stiffness: PETSc.Mat, operator: PETSc.Mat, places: PETSc.Mat | None
    ) -> ChangedBlocks | ChangedEntries:
        """Return a matrix to which changes can be added, as the cycle needs it."""
        if self._model.space.degree > 1:
            return ChangedBlocks(stiffness, operator, self.scale)
        return ChangedEntries(stiffness, places, self.scale)

    def _preconditioners(
        self, places: PETSc.Mat | None, change: PETSc.Mat
    ) -> tuple[PETSc.PC, PETSc.PC]:
        """Set up the cycle, and algebraic multigrid, the lower part or all of it.

        Args:
            places: Zeros where K has no entries for a change; None without any.
            change: The first C [force/length].
        """
        if self._model.space.degree > 1:
            terms = [self._stiffness, change]
            if places is not None:
                terms.append(places)
            self._two_levels = TwoLevels(
                self._model,
                self.matrix,
                terms,
                self.scale,
                self._support_stiffness,
            )
            return self._two_levels.pc, self._two_levels.algebraic
        self.matrix.setNearNullSpace(rigid_motions(self._model.space.V, self.matrix))
        multigrid = PETSc.PC().create(self.matrix.comm)
        multigrid.setOptionsPrefix(AMG_PREFIX)
        multigrid.setOperators(self.matrix)
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
        self._sum.change(change)
        if self._exact is not None:
            self.factorise()
        elif self._coarse is None:
            self._multigrid.setUp()
        else:
            self._coarse.follow(change)

    def factorise(self) -> None:
        """Replace the hierarchy by a factor of its matrix, which follows changes."""
        if self._exact is not None:
            self._exact.destroy()
            self.pc.destroy()
        entries = self._sum.entries()
        self._exact = factorise(entries)
        entries.destroy()
        if self._coarse is not None:
            self._coarse.free()
            self._coarse = None
        self.pc = preconditioner(self._exact.solve, self.matrix)

    def free(self) -> None:
        """Free PETSc's objects, which it would keep on several ranks."""
        if self._coarse is not None:
            self._coarse.free()
        self.pc.destroy()
        self._multigrid.destroy()
        self._glue.destroy()
        if self._two_levels is not None:
            self._two_levels.free()
        self._sum.free()
        if self._exact is not None:
            self._exact.destroy()

    def _part_of_glue(self, share: float) -> PETSc.Mat:
        """Return a share of D as a matrix [force/length]."""
        glue = self._glue.copy()
        glue.scale(share)
        return glue


def _contact_places(model: Model, stiffness: PETSc.Mat) -> PETSc.Mat | None:
    """Return zeros wherever contacts add to K, or None if K has these places.

    Contacts couple the cells of one body with the nodes of another one. K is without
    them: its factor would take seven times the operations in an assembly of 18 solids.
    """
    if not model.connections.any:
        return None
    # Contacts have few nodes, so that only a few rows of K are multiplied.
    couplings = model.connections.couplings
    places = stiffness.matMult(couplings)
    transposed = places.transpose(PETSc.Mat())
    between_contacts = couplings.transposeMatMult(places)
    for more in (transposed, between_contacts):
        places.axpy(1.0, more, DIFFERENT)
        more.destroy()
    places.zeroEntries()
    return places


def weak_share(model: Model) -> float:
    """Return the share of D that holds a loose body, ``h/(10 L)``, else zero [-].

    It does so about as softly as the body's own stiffness.
    """
    if not model.free_motions:
        return 0.0
    return 0.1 * model.domain.cells ** (-1 / model.space.d)


def free_motions(model: Model, matrix: PETSc.Mat) -> PETSc.NullSpace:
    """Return the rigid motions that no support holds, as vectors of a matrix.

    Loose rigid faces, which move with the body, are at rest there.
    """
    vectors = []
    for motion in model.free_motions:
        vector = matrix.createVecRight()
        owned = vector.getLocalSize()
        vector.array[:] = motion.x.array[:owned]
        vector.array[model.fixed.ravel()[:owned]] = 0.0
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=orthonormal(vectors), comm=matrix.comm)


def hold(stiffness: PETSc.Mat, motions: list[PETSc.Vec]) -> None:
    """Add a spring for each of the free motions to a stiffness, in place.

    It is at the component that the motion moves most, after the motions before it are
    held, and as stiff as the diagonal there.

    Args:
        stiffness: The matrix [force/length].
        motions: The motions.
    """
    left = [motion.copy() for motion in motions]
    diagonal = stiffness.getDiagonal()
    springs = diagonal.duplicate()
    springs.set(0.0)
    unit = diagonal.duplicate()
    for number, motion in enumerate(left):
        size = motion.copy()
        size.abs()
        row, _ = size.max()
        size.destroy()
        unit.set(0.0)
        unit.setValue(row, 1.0)
        unit.assemble()
        springs.axpy(unit.dot(diagonal), unit)
        for later in left[number + 1 :]:
            later.axpy(-unit.dot(later) / unit.dot(motion), motion)
    diagonal.axpy(1.0, springs)
    stiffness.setDiagonal(diagonal)
    for done in (diagonal, springs, unit, *left):
        done.destroy()


class CoarseMatrices:
    """Hold the coarse matrices of a hierarchy, which follow C; members are collective.

    Args:
        levels: Interpolation and coarse matrix of each level below the finest one, from
            there on.
        start: C [force/length]. No C may have entries where K has none.
        scale: Factor of K + C in the hierarchy [length/force].
    """

    def __init__(
        self, levels: list[tuple[PETSc.Mat, PETSc.Mat]], start: PETSc.Mat, scale: float
    ) -> None:
        self._scale = scale
        self._interpolations = [interpolation for interpolation, _ in levels]
        self._coarse = [coarse for _, coarse in levels]
        self._last: PETSc.Mat | None = None
        self._parts: list[PETSc.Mat] = []
        """Part of C in the matrix of each level [force/length]."""
        self._set_parts(start)

    def follow(self, change: PETSc.Mat) -> None:
        """Let the coarse matrices follow K plus a change [force/length]."""
        self._add_parts(-self._scale)
        self._set_parts(change)
        self._add_parts(self._scale)

    def free(self) -> None:
        """Free PETSc's objects, which it would keep on several ranks."""
        for matrix in (*self._interpolations, *self._coarse, *self._parts):
            matrix.destroy()

    def _add_parts(self, factor: float) -> None:
        """Add the parts times a factor to the coarse matrices."""
        for coarse, part in zip(self._coarse, self._parts, strict=True):
            coarse.axpy(factor, part, SUBSET)

    def _set_parts(self, change: PETSc.Mat) -> None:
        """Set the parts to the parts of a change."""
        # A tangent has its entries at the same places each time.
        results: list[PETSc.Mat | None] = [*self._parts]
        if change is not self._last:
            for part in self._parts:
                part.destroy()
            results = [None] * len(self._coarse)
        self._last = change
        self._parts = []
        for interpolation, result in zip(self._interpolations, results, strict=True):
            change = change.ptap(interpolation, result=result)
            self._parts.append(change)


def levels_of(pc: PETSc.PC) -> list[tuple[PETSc.Mat, PETSc.Mat]]:
    """Return interpolations and coarse matrices of GAMG, from the finest level on.

    The caller destroys them. There are none for another preconditioner.
    """
    levels = []
    if pc.getType() == PETSc.PC.Type.GAMG:
        for level in range(pc.getMGLevels() - 1, 0, -1):
            levels.append((pc.getMGInterpolation(level), _matrix_of(pc, level - 1)))
    return levels


def _matrix_of(pc: PETSc.PC, level: int) -> PETSc.Mat:
    """Return the matrix of a level of a hierarchy."""
    smoother = pc.getMGSmoother(level)
    matrix, preconditioner = smoother.getOperators()
    preconditioner.destroy()
    smoother.destroy()
    return matrix
