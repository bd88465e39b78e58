"""Errors of the package: one root, few children, every message says what to do.

A message names what was got, what is allowed and what to change. Under MPI an
error that one rank finds is raised on all of them (:func:`raise_together`), so
that no rank waits for ever in a collective call.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py import MPI


class ErcContactError(Exception):
    """Root of all errors that the package raises on purpose."""


class InputError(ErcContactError, ValueError):
    """The scene, the mesh or an argument cannot be worked with."""


class NotHeldError(InputError):
    """A rigid motion of the body is held by no support and by no contact."""


class NotConverged(ErcContactError, RuntimeError):
    """The contact solve ended without a solution.

    Attributes:
        rungs: One line for each attempt: start, line search, Newton steps, PETSc's reason, last residual.
    """

    def __init__(self, message: str, rungs: tuple[str, ...]) -> None:
        super().__init__(message)
        self.rungs = rungs


def raise_together(comm: MPI.Comm, error: Exception | None) -> None:
    """Raise on every rank of ``comm`` if any rank has an error; collective.

    Args:
        comm: Communicator; every rank must call.
        error: What this rank found, or None.

    Raises:
        Exception: This rank's own error, or the first other rank's.
    """
    found = [e for e in comm.allgather(error) if e is not None]
    if error is not None:
        raise error
    if found:
        raise found[0]
