"""FGMRES for matrices and preconditioners that are functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from petsc4py import PETSc

Apply = Callable[[PETSc.Vec, PETSc.Vec], None]
"""Function that sets the second vector to a linear function of the first one."""
LIMIT = 200
"""Limit of the cycles of one linear solve."""
RESTART = 50
"""Number of vectors that FGMRES keeps."""


class _Shell:
    """Represent a linear function as PETSc wants a matrix or a preconditioner."""

    def __init__(self, apply: Apply) -> None:
        self._apply = apply

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the matrix times x."""
        self._apply(x, y)

    def apply(self, _: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the preconditioned x."""
        self._apply(x, y)


def shell(apply: Apply, like: PETSc.Vec) -> PETSc.Mat:
    """Make a square matrix of a function.

    The caller destroys it: the matrix and the function may know each other.

    Args:
        apply: The function.
        like: A vector of the same sizes.
    """
    sizes = like.getSizes()
    matrix = PETSc.Mat().createPython((sizes, sizes), context=_Shell(apply), comm=like.comm)
    matrix.setUp()
    return matrix


def set_up(ksp: Any, precondition: Apply) -> None:
    """Set a linear solver to FGMRES with a preconditioner."""
    ksp.setType("fgmres")
    ksp.setGMRESRestart(RESTART)
    ksp.setTolerances(max_it=LIMIT)
    ksp.getPC().setType("python")
    ksp.getPC().setPythonContext(_Shell(precondition))


def fgmres(apply: Apply, precondition: Apply, b: PETSc.Vec, x: PETSc.Vec, tolerance: float) -> None:
    """Solve linear equations by FGMRES, as far as it goes.

    Args:
        apply: The matrix.
        precondition: About its inverse.
        b: Right side.
        x: The first guess, which becomes the solution, in place.
        tolerance: Residual over b at which it stops [-].
    """
    matrix = shell(apply, b)
    ksp = PETSc.KSP().create(b.comm)
    ksp.setOperators(matrix)
    set_up(ksp, precondition)
    ksp.setTolerances(rtol=tolerance)
    ksp.setInitialGuessNonzero(True)
    ksp.solve(b, x)
    ksp.destroy()
    matrix.destroy()
