"""Progress and warnings, each told once by rank 0 of the communicator concerned."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from mpi4py import MPI

from erc_contact.base.progress import show_on

HANDLER_NAME = "erc_contact console"
"""Name of the handler that shows progress."""
PACKAGES = ("erc_contact", "namedmesh")
"""Names of the loggers of both packages."""
_SILENT = logging.getLogger("erc_contact.other_ranks")
_SILENT.disabled = True


def log_of(comm: MPI.Comm) -> logging.Logger:
    """Return the package's logger on rank 0, a silent logger on other ranks."""
    return logging.getLogger("erc_contact") if comm.rank == 0 else _SILENT


@contextmanager
def muted(about: str) -> Iterator[None]:
    """Log what happens inside the `with` for debugging alone, with what it is about.

    So scenes that are not the user's say nothing that sounds as if they were.

    Args:
        about: What the messages inside are about, in a word or two.
    """

    def only_debugging(record: logging.LogRecord) -> bool:
        record.msg = f"{about}: {record.msg}"
        return record.levelno <= logging.DEBUG

    logs = [logging.getLogger(name) for name in PACKAGES]
    for log in logs:
        log.addFilter(only_debugging)
    try:
        yield
    finally:
        for log in logs:
            log.removeFilter(only_debugging)


def log_to_console(level: int = logging.INFO, comm: MPI.Comm = MPI.COMM_WORLD) -> None:
    """Show progress, on rank 0 only.

    On a terminal a line below the rows tells what is under way: mesh, stage, iteration.
    Elsewhere, in the file of a batch system or in a notebook, there are plain lines.
    Without this call the package is silent but for warnings.

    Args:
        level: ``logging.INFO`` shows a row a mesh, ``logging.DEBUG`` every attempt of
            the contact solve.
        comm: Its rank 0 writes.

    Example:
        >>> import logging
        >>> ec.log_to_console(logging.WARNING)  # warnings alone
    """
    handler = _handler(comm)
    for name in PACKAGES:
        log = logging.getLogger(name)
        log.setLevel(level)
        log.propagate &= comm.rank == 0
        for handler_before in list(log.handlers):
            if handler_before.name == HANDLER_NAME:
                log.removeHandler(handler_before)
        log.addHandler(handler)


def _handler(comm: MPI.Comm) -> logging.Handler:
    """Make the handler that shows progress on rank 0, and nothing elsewhere."""
    from rich.console import Console  # noqa: PLC0415 - only those who want progress pay for it
    from rich.highlighter import NullHighlighter  # noqa: PLC0415
    from rich.logging import RichHandler  # noqa: PLC0415

    if comm.rank != 0:
        return logging.NullHandler()
    console = Console()
    show_on(console if console.is_terminal else None)
    handler: logging.Handler = logging.StreamHandler(sys.stdout)
    if console.is_terminal:
        handler = RichHandler(
            console=console,
            show_path=False,
            show_level=False,
            show_time=False,
            highlighter=NullHighlighter(),
        )
    handler.set_name(HANDLER_NAME)
    return handler
