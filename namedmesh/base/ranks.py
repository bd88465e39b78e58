"""Gather values and rows of tables from ranks, and send rows between them.

All functions are collective.

mpi4py turns each object into bytes and back, with a single rank, too. For arrays of
some hundred numbers this takes longer than what is done with them. A single rank keeps
its own object here.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from mpi4py import MPI


def gathered(comm: MPI.Comm, value: Any) -> Any:
    """Return the list of the values of all ranks, on rank 0; None elsewhere."""
    return [value] if comm.size == 1 else comm.gather(value)


def from_first(comm: MPI.Comm, value: Any) -> Any:
    """Return the value of rank 0, on all ranks."""
    return value if comm.size == 1 else comm.bcast(value)


def of_all(comm: MPI.Comm, *tables: np.ndarray) -> list[np.ndarray]:
    """Return tables with the rows of all ranks, rank after rank, on all ranks."""
    if comm.size == 1:
        return list(tables)
    return [np.concatenate(parts) for parts in zip(*comm.allgather(tables), strict=True)]


def gather_rows(comm: MPI.Comm, **arrays: np.ndarray) -> dict[str, np.ndarray]:
    """Return arrays with the rows of all ranks, rank after rank, on rank 0.

    Other ranks get an empty dictionary.
    """
    parts = gathered(comm, arrays)
    if not parts:
        return {}
    return {name: np.concatenate([part[name] for part in parts]) for name in arrays}


def distinct_rows(comm: MPI.Comm, rows: np.ndarray) -> np.ndarray:
    """Return the different rows, or numbers, of all ranks, sorted, on all ranks."""
    (every,) = of_all(comm, rows)
    return np.unique(every, axis=0 if every.ndim > 1 else None)


def global_numbers(index_map: Any, numbers: np.ndarray) -> np.ndarray:
    """Return the numbers on all ranks of numbers of this rank, of any shape."""
    local = numbers.ravel().astype(np.int32, copy=False)
    return index_map.local_to_global(local).reshape(numbers.shape)


def box(comm: MPI.Comm, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the low and the high corner of the box around points of all ranks.

    Args:
        comm: Communicator.
        points: Points of this rank, shape (n, d).

    Returns:
        Corners, shape (d,) each; infinite if no rank has a point.
    """
    low = points.min(axis=0, initial=np.inf)
    high = points.max(axis=0, initial=-np.inf)
    return _extend_over_ranks(comm, low, high)


def greatest(comm: MPI.Comm, values: np.ndarray) -> float:
    """Return the greatest absolute value of all ranks, on all ranks; 0 without any."""
    return float(comm.allreduce(float(abs(values).max(initial=0.0)), MPI.MAX))


def boxes(
    comm: MPI.Comm, x: np.ndarray, group: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest coordinates of groups of points of all ranks.

    Args:
        comm: Communicator.
        x: Points of this rank, shape (n, d).
        group: Number of the group of each, shape (n,).
        count: Number of groups.

    Returns:
        Two arrays of shape (count, d); infinite for a group without points.
    """
    low = np.full((count, x.shape[1]), np.inf)
    high = -low
    np.minimum.at(low, group, x)
    np.maximum.at(high, group, x)
    return _extend_over_ranks(comm, low, high)


def _extend_over_ranks(
    comm: MPI.Comm, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return corners of boxes around the boxes of all ranks; they are overwritten."""
    comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    return low, high


def union(comm: MPI.Comm, values: Iterable[Any]) -> set[Any]:
    """Return the values of all ranks, on all ranks."""
    return set().union(*comm.allgather(set(values)))


def exchange(
    comm: MPI.Comm, destination: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Send each row of a table to a rank; collective.

    Args:
        comm: Communicator.
        destination: Rank that gets row i, shape (n,).
        rows: Table of shape (n, m), any numeric type, the same on all ranks.

    Returns:
        The rows received, shape (n', m), and the rank each came from, shape (n',).
    """
    order = np.argsort(destination, kind="stable")
    counts = np.bincount(destination, minlength=comm.size)
    received = np.empty_like(counts)
    comm.Alltoall(counts, received)
    width = rows.shape[1]
    out = np.empty((int(received.sum()), width), dtype=rows.dtype)
    comm.Alltoallv([np.ascontiguousarray(rows[order]), counts * width], [out, received * width])
    return out, np.repeat(np.arange(comm.size), received)


def fetch(comm: MPI.Comm, rows: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return rows of a table whose parts the ranks hold; collective.

    Args:
        comm: Communicator.
        rows: The part of this rank; the parts follow each other in the table.
        wanted: Numbers of rows in the table.
    """
    if comm.size == 1:
        return rows[wanted]
    ends = np.cumsum(comm.allgather(len(rows)))
    begin = ends[comm.rank] - len(rows)
    owner = np.searchsorted(ends, wanted, side="right")
    requests, source = exchange(comm, owner, wanted[:, None])
    answer, _ = exchange(comm, source, rows[requests[:, 0] - begin])
    # The answers come rank by rank, in the order of the requests to each.
    result = np.empty_like(answer)
    result[np.argsort(owner, kind="stable")] = answer
    return result
