"""FGMRES for matrices and preconditioners that are functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from petsc4py import PETSc

Apply = Callable[[PETSc.Vec, PETSc.Vec], None]
"""Sets the second vector to a linear function of the first one."""
LIMIT, RESTART = 200, 50
"""Limit of the cycles of one linear solve, and vectors that it keeps."""


class _Shell:
    """A linear function, as PETSc wants a matrix or a preconditioner."""

    def __init__(self, apply: Apply) -> None:
        self._apply = apply

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the matrix times x."""
        self._apply(x, y)

    def apply(self, _: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the preconditioned x."""
        self._apply(x, y)


def shell(apply: Apply, like: PETSc.Vec) -> PETSc.Mat:
    """A square matrix for vectors like the given one; to be destroyed, as it and the function may know each other."""
    matrix = PETSc.Mat().createPython(
        (like.getSizes(), like.getSizes()), context=_Shell(apply), comm=like.comm
    )
    matrix.setUp()
    return matrix


def set_up(ksp: Any, precondition: Apply) -> None:
    """Let a linear solver be FGMRES with a preconditioner."""
    ksp.setType("fgmres")
    ksp.setGMRESRestart(RESTART)
    ksp.setTolerances(max_it=LIMIT)
    ksp.getPC().setType("python")
    ksp.getPC().setPythonContext(_Shell(precondition))


def fgmres(apply: Apply, precondition: Apply, b: PETSc.Vec, x: PETSc.Vec, tolerance: float) -> None:
    """Solve for x, from x on, until the residual is a tolerance of b [-], or as far as it goes."""
    matrix, ksp = shell(apply, b), PETSc.KSP().create(b.comm)
    ksp.setOperators(matrix)
    set_up(ksp, precondition)
    ksp.setTolerances(rtol=tolerance)
    ksp.setInitialGuessNonzero(True)
    ksp.solve(b, x)
    ksp.destroy()
    matrix.destroy()
