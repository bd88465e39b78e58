"""Make functions that stand for values of points, on a mesh of a cell for each."""

from __future__ import annotations

from functools import cache

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

POINT_CHUNK = 4096
"""Number of points at which an expression is evaluated at once."""


@cache
def line_of_points() -> dmesh.Mesh:
    """Make a mesh whose POINT_CHUNK cells carry the values of as many points.

    It has no other meaning.
    """
    return dmesh.create_interval(MPI.COMM_SELF, POINT_CHUNK, (0.0, 1.0))


@cache
def _numbers(shape: tuple[int, ...]) -> fem.FunctionSpace:
    """Make the space of functions with a value of this shape for each point."""
    V = fem.functionspace(line_of_points(), ("DG", 0, shape))
    # Values of points are written in the order of the cells.
    assert np.array_equal(V.dofmap.list[:, 0], np.arange(POINT_CHUNK))
    return V


@cache
def stand_in(shape: tuple[int, ...], which: int) -> fem.Function:
    """Make a function that stands for a value of a shape at each point."""
    return fem.Function(_numbers(shape))
