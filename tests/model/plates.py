"""A plate, its error, and the runs of it that must agree, for tests of foundations and springs."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from mpi4py import MPI

import erc_contact as ec

METHODS = [None, ec.Nitsche(theta=1), ec.Nitsche(theta=-1), ec.AugmentedLagrangian()]


def plate(n: int = 3, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    return ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2 * n, n), comm=comm)


def by_ranks_and_solvers(
    measure: Callable[[MPI.Comm, str], ec.ConstitutiveError],
) -> tuple[ec.ConstitutiveError, list[ec.ConstitutiveError]]:
    """The error of one rank, and the errors of all ranks by both solvers, which have its eps."""
    first = measure(MPI.COMM_SELF, "direct")
    errors = [measure(MPI.COMM_WORLD, solver) for solver in ("direct", "iterative")]
    for error in errors:
        assert error.relative == pytest.approx(first.relative, rel=1e-6)
    return first, errors
