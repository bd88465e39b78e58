"""Linear functions as matrices and preconditioners of PETSc."""

from __future__ import annotations

from collections.abc import Callable

from petsc4py import PETSc

Apply = Callable[[PETSc.Vec, PETSc.Vec], None]
"""Function that sets the second vector to a linear function of the first one."""


class Shell:
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
    matrix = PETSc.Mat().createPython((sizes, sizes), context=Shell(apply), comm=like.comm)
    matrix.setUp()
    return matrix


def preconditioner(apply: Apply, like: PETSc.Mat) -> PETSc.PC:
    """Make a preconditioner of a function; the caller destroys it.

    Args:
        apply: The function.
        like: A matrix of the same sizes.
    """
    pc = PETSc.PC().create(like.comm)
    pc.setOperators(like)
    pc.setType("python")
    pc.setPythonContext(Shell(apply))
    pc.setUp()
    return pc
