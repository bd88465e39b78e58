"""Krylov methods: FGMRES for matrices that are functions, and conjugate gradients."""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc

from erc_contact.newton.linear.amg import AMG_PREFIX
from erc_contact.newton.linear.mumps import LIBRARY
from erc_contact.newton.linear.shells import Apply, Shell, shell

FGMRES_LIMIT = 200
"""Limit of the cycles of one linear solve by FGMRES."""
RESTART = 50
"""Number of vectors that FGMRES keeps."""
CG_LIMIT = 500
"""Limit of the iterations of conjugate gradients; 15 to 60 are usual."""


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
) -> float:
    """Solve linear equations by conjugate gradients, as far as it goes.

    Args:
        matrix: The matrix.
        pc: The preconditioner.
        preconditioned: The matrix that it is for.
        b: Right side.
        x: The first guess, which becomes the solution, in place.
        tolerance: Residual over b at which it stops [-].

    Returns:
        The residual over b [-], infinite if the preconditioner failed.
    """
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOptionsPrefix(AMG_PREFIX)
    ksp.setPC(pc)
    ksp.setOperators(matrix, preconditioned)
    ksp.setType("cg")
    ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=CG_LIMIT)
    ksp.setInitialGuessNonzero(True)
    try:
        ksp.solve(b, x)
        left = ksp.getResidualNorm() / b.norm()
    except PETSc.Error as failure:
        if failure.ierr != LIBRARY:
            raise
        left = np.inf
    ksp.destroy()
    return float(left) if np.isfinite(left) else np.inf
