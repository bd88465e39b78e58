"""Ctrl-C and SIGTERM during a run: put off until the stage that is under way has ended, on all ranks together.

An exception in the middle of a stage would leave a half-written form in the compiler's cache, and under MPI it would
come at another place of every rank, or on one rank only, and the others would wait for it for ever. Batch systems send
SIGTERM some time before they end a process.
"""

from __future__ import annotations

import signal
import threading
from time import monotonic
from types import FrameType, TracebackType
from typing import Any

from mpi4py import MPI

from erc_contact.base.logs import log_of

SAME = 1.0
"""Signals within this time are one Ctrl-C: a terminal and mpiexec may both send it [s]."""
USUAL: dict[int, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
"""The signals, and what handles them where nobody has asked for anything else."""


class Interrupts:
    """A context in which a first Ctrl-C or SIGTERM is noted, and a second one has its usual effect at once.

    Where somebody else handles a signal already, or outside the main thread, it does nothing.

    Args:
        comm: All its ranks end together, whichever of them got the signal.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self.comm = comm
        self.first: float | None = None
        self.ours: list[int] = []
        self.shared = False

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is threading.main_thread():
            self.ours = [number for number, usual in USUAL.items() if signal.getsignal(number) == usual]
        for number in self.ours:
            signal.signal(number, self._note)
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        for number in self.ours:
            signal.signal(number, USUAL[number])

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
            log_of(self.comm).warning("Interrupted: the run ends with this stage. The signal again ends it at once.")
        elif now - self.first > SAME:
            signal.signal(number, USUAL[number])
            signal.raise_signal(number)
