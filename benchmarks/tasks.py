"""Run measurements by their names, as the first argument asks."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Mapping, Sequence

import erc_contact  # noqa: F401 - before mpi4py, it loads MPI

from mpi4py import MPI  # isort: skip


def tell(line: str) -> None:
    """Print a line on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        print(line, flush=True)


def on_ranks[T](counts: Sequence[int], run: Callable[[MPI.Comm], T]) -> list[T]:
    """Run something on numbers of ranks, one after another; collective.

    Returns:
        What it returns on rank 0, for each of them.
    """
    world = MPI.COMM_WORLD
    results: list[T] = []
    for ranks in counts:
        comm = world.Split(int(world.rank >= ranks), world.rank)
        here = run(comm) if world.rank < ranks else None
        results.append(world.bcast(here))
        comm.Free()
    return results


def run(tasks: Mapping[str, Callable[..., None]]) -> None:
    """Run the task that the first argument names, or all, with the numbers after it.

    Args:
        tasks: The tasks by their names; the first number is a seed.
    """
    # Some of the scenes are doubtful as mechanics, which does not matter here.
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    wanted, *numbers = sys.argv[1:] or ["all"]
    if wanted not in (*tasks, "all"):
        sys.exit(f"No family is called {wanted!r}; there are {', '.join(tasks)} and all.")
    for name, task in tasks.items():
        if wanted in (name, "all"):
            tell(f"\n{name}, seed {numbers[0] if numbers else 0}")
            task(*(int(number) for number in numbers))
