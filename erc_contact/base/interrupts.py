"""Ctrl-C during a run: put off until the stage that is under way has ended, on all ranks together.

An exception in the middle of a stage would leave a half-written form in the compiler's cache, and under MPI it would
come at another place of every rank, or on one rank only, and the others would wait for it for ever.
"""

from __future__ import annotations

import signal
import threading
from time import monotonic
from types import FrameType, TracebackType

from mpi4py import MPI

from erc_contact.base.logs import log_of

SAME = 1.0
"""Signals within this time are one Ctrl-C: a terminal and mpiexec may both send it [s]."""


class Interrupts:
    """A context in which a first Ctrl-C is noted, and a second one raises KeyboardInterrupt at once.

    Where somebody else handles the signal already, or outside the main thread, it does nothing.

    Args:
        comm: All its ranks end together, whichever of them got the signal.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self.comm = comm
        self.first: float | None = None
        self.ours = self.shared = False

    def __enter__(self) -> Interrupts:
        main = threading.current_thread() is threading.main_thread()
        if main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._note)
            self.ours = True
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self.ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def check(self) -> None:
        """Raise KeyboardInterrupt on all ranks if any was interrupted; collective."""
        if self.comm.allreduce(self.first is not None, MPI.LOR):
            self.shared = True
            raise KeyboardInterrupt

    def ended(self, failure: BaseException) -> bool:
        """Whether an interrupt is the cause of a failure, and all ranks have it.

        A compiler that is killed by the same signal ends in an error of another type.
        """
        if isinstance(failure, KeyboardInterrupt):
            return self.shared or self.comm.size == 1
        return self.first is not None

    def _note(self, number: int, frame: FrameType | None) -> None:
        now = monotonic()
        if self.first is None:
            self.first = now
            log_of(self.comm).warning("Interrupted: the run ends with this stage. Ctrl-C again ends it at once.")
        elif now - self.first > SAME:
            signal.default_int_handler(number, frame)
