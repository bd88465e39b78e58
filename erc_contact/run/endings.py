"""How a run ends before it is through: in words, with what it has, or by an exception."""

from __future__ import annotations

from mpi4py import MPI

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.base.interrupts import Interrupts
from erc_contact.newton.solution import Solution

OUT_OF_MEMORY = 55
"""PETSc's code of memory that could not be had, PETSC_ERR_MEM."""
REST = 1e-14
"""Displacement over the size of a body that is round-off [-]."""


def ending(failure: BaseException, interrupts: Interrupts, where: str) -> str:
    """The outcome of a run that a failure ends with what it has; "" if it must be raised.

    Args:
        failure: What was raised.
        interrupts: The signals of the run.
        where: How far it came, e.g. " at t = 1".
    """
    if isinstance(failure, (InputError, NotConverged)):
        return f"Stopped{where}: {failure}"
    if isinstance(failure, MemoryError) or getattr(failure, "ierr", None) == OUT_OF_MEMORY:
        return f"Stopped{where}: the memory does not suffice for what comes next ({failure})."
    if isinstance(failure, StopIteration):
        return f"Stopped{where}: by the callback. {failure}".rstrip()
    return f"Interrupted{where}." if interrupts.ended(failure) else ""


def at_rest(solution: Solution) -> bool:
    """Whether nothing moves a body: there are no loads, and u is round-off; collective.

    Its relative error means nothing then. On a curved body, whose gaps the facets do not carry, it is 100% on any mesh.
    """
    comm = solution.domain.mesh.comm
    moved = comm.allreduce(float(abs(solution.u.x.array).max(initial=0.0)), MPI.MAX)
    if moved > REST * solution.domain.extent:
        return False
    return not comm.allreduce(bool(solution.stiffness.load_vector().x.array.any()), MPI.LOR)
