"""SIGTERM held back while a library is at work that would take it for an error of its own, as METIS does.

The system gives a signal to any thread that does not block it. So it can be held back
only if all other threads of the process block it, too: those of MPI do if it starts
within such a context, those of a BLAS with several threads do not.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

THREADS = Path("/proc/self/task")


@contextmanager
def sigterm_held() -> Iterator[bool]:
    """A context at whose end a SIGTERM that came within it arrives; it tells whether none can arrive before."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    try:
        yield THREADS.is_dir() and all(_blocks(thread) for thread in THREADS.iterdir())
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _blocks(thread: Path) -> bool:
    """Whether a thread blocks SIGTERM, or has just ended."""
    try:
        lines = (thread / "status").read_text().splitlines()
    except OSError:
        return True
    masks = [line.split()[1] for line in lines if line.startswith("SigBlk:")]
    return bool(masks) and bool(int(masks[0], 16) >> (signal.SIGTERM - 1) & 1)
