"""Make the next mesh of a run by its strategy."""

from __future__ import annotations

from time import perf_counter

from mpi4py import MPI

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError, together
from erc_contact.base.runtime.interrupts import Interrupts
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.strategy import Strategy
from erc_contact.mesh.domain import Domain


def new_mesh(
    strategy: Strategy,
    error: ConstitutiveError,
    accuracy: float,
    max_cells: int,
    interrupts: Interrupts,
) -> tuple[Domain, float]:
    """Make the next mesh, and tell the wall time of making it [s]; collective.

    Args:
        strategy: Makes the mesh.
        error: The error on the last mesh.
        accuracy: Prescribed relative error [-].
        max_cells: Greatest number of cells.
        interrupts: The signals of the run.

    Returns:
        The mesh, and the seconds.

    Raises:
        InputError: If the strategy returns no Domain on some rank.
    """
    comm = error.model.comm
    started = perf_counter()
    domain = together(comm, strategy.next, error, accuracy, max_cells)
    interrupts.check()
    seconds = comm.allreduce(perf_counter() - started, MPI.MAX)
    if not comm.allreduce(isinstance(domain, Domain), MPI.LAND):
        raise InputError(
            f"The strategy gave {checks.description(domain)}; its next() must return a Domain."
        )
    return domain, seconds
