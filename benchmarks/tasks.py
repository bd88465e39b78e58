"""Run measurements by their names, as the first argument asks."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Mapping

import erc_contact  # noqa: F401 - before mpi4py, it loads MPI

from mpi4py import MPI  # isort: skip


def tell(line: str) -> None:
    """Print a line on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        print(line, flush=True)


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
