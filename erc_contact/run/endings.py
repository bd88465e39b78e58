"""Say in words how a run ends before it is through, or that it ends by an exception."""

from __future__ import annotations

from collections.abc import Sequence

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.base.runtime.interrupts import Interrupts
from erc_contact.newton.methods import DEFAULT
from erc_contact.run.step import Step

OUT_OF_MEMORY = 55
"""PETSc's code of memory that could not be had, PETSC_ERR_MEM."""
AT_REST = "The body is at rest: nothing loads or moves it, so that it has no stress and no error."
"""Outcome of a run whose body is at rest."""
NO_STRESS = (
    "The body has no stress but round-off: it moves as a rigid body or expands freely. Its "
    "relative error is zero by convention."
)
"""Outcome of a run whose body has no stress."""
NO_TRUE_SHAPE = " The body is the given mesh with its flat facets: no true shape of it is known."
"""End of the outcome where the geometry of the body is unknown."""


def ending(failure: BaseException, interrupts: Interrupts, where: str) -> str:
    """Return the outcome of a run that a failure ends; "" if it must be raised.

    Args:
        failure: What was raised.
        interrupts: The signals of the run.
        where: How far it came, e.g. " at t = 1".
    """
    if isinstance(failure, (InputError, NotConverged)):
        return f"Stopped{where}: {failure}"
    petsc_code = getattr(failure, "ierr", None)
    if isinstance(failure, MemoryError) or petsc_code == OUT_OF_MEMORY:
        return f"Stopped{where}: the memory does not suffice for what comes next ({failure})."
    if isinstance(failure, StopIteration):
        return f"Stopped{where}: by the callback. {failure}".rstrip()
    if interrupts.ended(failure):
        return f"Interrupted{where}."
    return ""


def other_methods(steps: Sequence[Step]) -> str:
    """Say on how many meshes the default method did not converge; empty if on none."""
    default = type(DEFAULT).__name__
    others = [step.method for step in steps if step.method != default]
    if not others:
        return ""
    meshes = f"{len(others)} of {len(steps)} meshes"
    return f" {others[0]} on {meshes}, where {DEFAULT} did not converge."
