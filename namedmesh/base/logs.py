"""Warnings, each told once by rank 0 of the communicator concerned."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py import MPI

NAME = "namedmesh"
"""Name of the package's logger."""
_SILENT = logging.getLogger("namedmesh.other_ranks")
_SILENT.disabled = True


def log_of(comm: MPI.Comm) -> logging.Logger:
    """Return the package's logger on rank 0, a silent logger on other ranks."""
    return logging.getLogger(NAME) if comm.rank == 0 else _SILENT
