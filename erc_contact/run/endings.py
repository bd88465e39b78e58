"""How a run ends before it is through: in words, with what it has, or by an exception."""

from __future__ import annotations

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.base.runtime.interrupts import Interrupts

OUT_OF_MEMORY = 55
"""PETSc's code of memory that could not be had, PETSC_ERR_MEM."""


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
