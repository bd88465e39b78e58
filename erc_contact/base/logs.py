"""Progress and warnings: each is told once, by rank 0 of the communicator that it concerns."""

from __future__ import annotations

import logging

from mpi4py import MPI

_SILENT = logging.getLogger("erc_contact.other_ranks")
_SILENT.disabled = True


def log_of(comm: MPI.Comm) -> logging.Logger:
    """The package's logger on rank 0 of a communicator, one that says nothing on the other ranks."""
    return logging.getLogger("erc_contact") if comm.rank == 0 else _SILENT


def log_to_console(level: int = logging.INFO, comm: MPI.Comm = MPI.COMM_WORLD) -> None:
    """Show progress on the terminal, on rank 0 only.

    Args:
        level: ``logging.INFO`` shows a row a mesh, ``logging.DEBUG`` every attempt of the contact solve.
        comm: Its rank 0 writes.
    """
    from rich.highlighter import NullHighlighter  # noqa: PLC0415
    from rich.logging import RichHandler  # noqa: PLC0415 - only those who want progress pay for it

    log = logging.getLogger("erc_contact")
    log.setLevel(level)
    if comm.rank == 0 and not any(isinstance(handler, RichHandler) for handler in log.handlers):
        log.addHandler(RichHandler(show_path=False, show_level=False, show_time=False, highlighter=NullHighlighter()))
    elif comm.rank != 0:
        log.addHandler(logging.NullHandler())
        log.propagate = False
