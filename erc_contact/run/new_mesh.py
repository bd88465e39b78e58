"""Make the next mesh of a run by its strategy."""

from __future__ import annotations

from time import perf_counter

from mpi4py import MPI

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError, together
from erc_contact.base.runtime.interrupts import Interrupts
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.domain import Domain
from erc_contact.run.plan import Plan


def new_mesh(plan: Plan, error: ConstitutiveError, interrupts: Interrupts) -> tuple[Domain, float]:
    """Make the next mesh, and tell the wall time of making it [s]; collective.

    Args:
        plan: What the run is asked for.
        error: The error, as the strategy sees it.
        interrupts: The signals of the run.

    Raises:
        InputError: If the strategy gives none.
    """
    comm = error.model.comm
    started = perf_counter()
    domain = together(comm, plan.strategy.next, error, plan.accuracy, plan.max_cells)
    interrupts.check()
    seconds = comm.allreduce(perf_counter() - started, MPI.MAX)
    if not isinstance(domain, Domain):
        raise InputError(
            f"The strategy gave {checks.description(domain)}; its next() must return a Domain."
        )
    return domain, seconds
