"""SIGTERM put off while a library is at work that would take it for its own error.

METIS does so. The system gives a signal to any thread that does not block it. So it can
be put off only if all other threads of the process block it, too: threads of MPI do if
it starts within such a context, the threads of a BLAS do not.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

THREADS = Path("/proc/self/task")
"""Folder with a folder for each thread of this process, on Linux."""


@contextmanager
def sigterm_blocked() -> Iterator[bool]:
    """Put off SIGTERM within a context; one that came arrives at its end.

    Yields:
        Whether all threads block it, so that none can arrive before.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    try:
        yield THREADS.is_dir() and all(_blocks(thread) for thread in THREADS.iterdir())
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _blocks(thread: Path) -> bool:
    """Tell whether a thread blocks SIGTERM, or has just ended."""
    try:
        lines = (thread / "status").read_text().splitlines()
    except OSError:
        return True
    for line in lines:
        if line.startswith("SigBlk:"):
            mask = int(line.split()[1], 16)
            return bool(mask >> (signal.SIGTERM - 1) & 1)
    return False
