"""What goes to rank 0 and comes from there; collective.

mpi4py turns each object into bytes and back, with a single rank, too. For arrays of some hundred numbers this takes
longer than what is done with them. A single rank keeps its own object here.
"""

from __future__ import annotations

from typing import Any

from mpi4py import MPI


def gathered(comm: MPI.Comm, value: Any) -> Any:
    """The list of the values of all ranks, on rank 0; None elsewhere."""
    return [value] if comm.size == 1 else comm.gather(value)


def from_first(comm: MPI.Comm, value: Any) -> Any:
    """The value of rank 0, on all ranks."""
    return value if comm.size == 1 else comm.bcast(value)
