"""Krylov methods: FGMRES and conjugate gradients, also of functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from petsc4py import PETSc

from erc_contact.newton.linear.amg import AMG_PREFIX
from erc_contact.newton.linear.mumps import LIBRARY

FGMRES_LIMIT = 600
"""Limit of the cycles of one linear solve by FGMRES; 4 to 60 are usual."""
RESTART = 200
"""Number of vectors that FGMRES keeps.

PETSc allocates them as they come, so that easy scenes do not pay. Nearly incompressible
bodies need them: at degree 2 with nu = 0.499 and 0.4999 FGMRES stagnates with 50, and
converges with 200.
"""
CG_LIMIT = 500
"""Limit of the iterations of conjugate gradients; 15 to 60 are usual."""
FACTOR_LIMIT = 5
"""The same with a factor of the matrix, after which only round-off is left."""
TRIAL = 20
"""Iterations after which conjugate gradients may give up."""
SLOW = 0.85
"""Fall of the residual in an iteration that is slow for a first guess [-].

It is 0.5 to 0.7 with nu = 0.49. With 0.87 a contact solve takes some thousand cycles
and may fail.
"""
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


def set_up(ksp: Any, precondition: Apply) -> None:
    """Set a linear solver to FGMRES with a preconditioner."""
    ksp.setType("fgmres")
    ksp.setGMRESRestart(RESTART)
    ksp.setTolerances(max_it=FGMRES_LIMIT)
    ksp.getPC().setType("python")
    ksp.getPC().setPythonContext(Shell(precondition))


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


def conjugate_gradients(
    matrix: PETSc.Mat,
    pc: PETSc.PC,
    preconditioned: PETSc.Mat,
    b: PETSc.Vec,
    x: PETSc.Vec,
    tolerance: float,
    *,
    limit: int = CG_LIMIT,
    slow: float = np.inf,
) -> float:
    """Solve linear equations by conjugate gradients, as far as it goes.

    Args:
        matrix: The matrix.
        pc: The preconditioner.
        preconditioned: The matrix that it is for.
        b: Right side.
        x: The first guess, which becomes the solution, in place.
        tolerance: Residual over b at which it stops [-].
        limit: Number of iterations after which it stops.
        slow: Fall of the residual in an iteration, the mean of half of the first
            :data:`TRIAL` ones, with which it gives up [-].

    Returns:
        The residual over b [-], infinite if the preconditioner failed or is slow.
    """
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOptionsPrefix(AMG_PREFIX)
    ksp.setPC(pc)
    ksp.setOperators(matrix, preconditioned)
    ksp.setType("cg")
    ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=limit)
    ksp.setInitialGuessNonzero(True)
    trial = _Trial(tolerance * b.norm(), slow)
    if np.isfinite(slow):
        ksp.setConvergenceTest(trial)
    try:
        ksp.solve(b, x)
        left = ksp.getResidualNorm() / b.norm()
        if trial.is_slow:
            left = np.inf
    except PETSc.Error as failure:
        if failure.ierr != LIBRARY:
            raise
        left = np.inf
    ksp.destroy()
    return float(left) if np.isfinite(left) else np.inf


class _Trial:
    """Test the convergence of a linear solve that may give up.

    Args:
        enough: Residual at which it stops.
        slow: Fall of the residual in an iteration that is slow [-].

    Attributes:
        is_slow: Whether it has given up.
    """

    def __init__(self, enough: float, slow: float) -> None:
        self.is_slow = False
        self._enough = enough
        self._slow = slow
        self._half = np.inf

    def __call__(self, _: PETSc.KSP, iteration: int, norm: float) -> PETSc.KSP.ConvergedReason:
        """Return PETSc's reason to end, or to go on, at one iteration."""
        reasons = PETSc.KSP.ConvergedReason
        if not np.isfinite(norm):
            return reasons.DIVERGED_NANORINF
        if norm <= self._enough:
            return reasons.CONVERGED_RTOL
        # The supports make the residual fall at first, whatever follows.
        if iteration == TRIAL // 2:
            self._half = norm
        if iteration == TRIAL:
            self.is_slow = bool(norm > self._half * self._slow ** (TRIAL - TRIAL // 2))
        return reasons.DIVERGED_MAX_IT if self.is_slow else reasons.ITERATING
