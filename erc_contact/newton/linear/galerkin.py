"""A multigrid hierarchy of K + C that follows C, which is zero away from the contact.

The coarse matrices of algebraic multigrid are ``A_coarse = P^T A P`` with the
interpolation P. If C changes to C', each level gets ``P^T (C' - C) P`` added. This is a
product of the rows of P at the contact. It costs about as much as one or two cycles, a
new hierarchy about thirty. The interpolation stays.
"""

from __future__ import annotations

from petsc4py import PETSc

from erc_contact.newton.linear.changed import SAME, SUBSET


class CoarseMatrices:
    """Hold the coarse matrices of a hierarchy, which follow C; members are collective.

    Args:
        levels: Interpolation and coarse matrix of each level below the finest one, from
            there on.
        stiffness: K [force/length]. No C may have entries where it has none.
        layer: Degrees of freedom of this rank at which a C may have entries.
        start: C [force/length].
        scale: Factor of K + C in the hierarchy [length/force].
    """

    def __init__(
        self,
        levels: list[tuple[PETSc.Mat, PETSc.Mat]],
        stiffness: PETSc.Mat,
        layer: PETSc.IS,
        start: PETSc.Mat,
        scale: float,
    ) -> None:
        self._layer = layer
        self._scale = scale
        self._change = stiffness.createSubMatrix(layer, layer)
        self._difference = self._change.duplicate()
        self._set_change(start)
        self._interpolations = [interpolation for interpolation, _ in levels]
        self._coarse = [coarse for _, coarse in levels]
        if levels:
            # C has entries in the layer only, so these rows of P are enough.
            whole = self._interpolations[0]
            self._interpolations[0] = whole.createSubMatrix(layer, None)
            whole.destroy()
        self._products: list[PETSc.Mat | None] = [None] * len(levels)

    def follow(self, change: PETSc.Mat) -> None:
        """Let the coarse matrices follow K plus a change [force/length]."""
        difference = self._difference
        self._change.copy(difference, SAME)
        self._set_change(change)
        difference.aypx(-1.0, self._change, SAME)
        levels = zip(self._interpolations, self._coarse, strict=True)
        for k, (interpolation, coarse) in enumerate(levels):
            difference = difference.ptap(interpolation, result=self._products[k])
            self._products[k] = difference
            coarse.axpy(1.0, difference, SUBSET)

    def free(self) -> None:
        """Free PETSc's objects, which it would keep on several ranks."""
        for owned in (self._layer, self._change, self._difference):
            owned.destroy()
        for matrix in (*self._interpolations, *self._coarse, *self._products):
            if matrix is not None:
                matrix.destroy()

    def _set_change(self, change: PETSc.Mat) -> None:
        """Set C, scaled as the hierarchy is, to a change."""
        part = change.createSubMatrix(self._layer, self._layer)
        self._change.zeroEntries()
        self._change.axpy(self._scale, part, SUBSET)
        part.destroy()


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
