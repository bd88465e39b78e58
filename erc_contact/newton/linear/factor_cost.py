"""Predict what a factor costs, in cycles of multigrid, from its symbolic analysis."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from erc_contact.newton.linear.mumps import operations

OPERATIONS_OF_CYCLE = 45
"""Operations of a factor in the time of a cycle, for one entry of the matrix [-].

A cycle multiplies each entry about five times, and waits for memory; a factor does not.
They are 45 in a cube of 46 875 unknowns and 44 in an assembly of 18 solids.
"""
CHEAP_BELOW = 2.0
"""A factor takes the place of multigrid on a coarse matrix up to so many cycles [-]."""
MOST_FACTORISED = 2_000_000
"""Number of unknowns beyond which a factor takes too much memory."""


def cycles_of_factor(matrix: PETSc.Mat, cycled: PETSc.Mat) -> float:
    """Predict how many cycles of multigrid take the time of a factor; collective.

    MUMPS' symbolic analysis tells how large the factor is: of an assembly of small
    solids it has a seventh of the operations of a cube's with as many unknowns. It is
    infinite where memory ends.

    Args:
        matrix: The matrix that is factorised.
        cycled: The matrix of the cycles, with all its entries.
    """
    if matrix.getSize()[0] > MOST_FACTORISED:
        return np.inf
    entries = cycled.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
    return float(operations(matrix) / (OPERATIONS_OF_CYCLE * entries))


def factor_below(coarse: PETSc.Mat, fine: PETSc.Mat) -> bool:
    """Tell whether a factor takes the place of multigrid on a level; collective.

    It is made for each tangent. Cycles with it are fewer where bodies are many or thin:
    39 instead of 60 in an assembly of 18 solids, 10 instead of 10 in a cube.

    Args:
        coarse: The coarse matrix.
        fine: The matrix above it, with all its entries.
    """
    return cycles_of_factor(coarse, fine) < CHEAP_BELOW
