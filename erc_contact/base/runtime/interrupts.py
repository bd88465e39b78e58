"""Ctrl-C and SIGTERM during a run, put off to a place that all ranks share.

That is the end of a stage at the latest.

An exception in the middle of anything would leave a half-written form in the compiler's
cache, and under MPI it would come at another place of every rank, or on one rank only,
and the others would wait for it for ever. So stages that may take long ask themselves,
once in an iteration (:func:`check_interrupts`). Batch systems send SIGTERM some time
before they end a process.
"""

from __future__ import annotations

import signal
import threading
from contextvars import ContextVar
from time import monotonic
from types import FrameType, TracebackType
from typing import Any

from mpi4py import MPI

from erc_contact.base.logs import log_of

SAME_SIGNAL = 1.0
"""Time within which signals are one: a terminal and mpiexec may both send it [s]."""
USUAL: dict[int, tuple[Any, ...]] = {
    signal.SIGINT: (signal.default_int_handler, signal.SIG_DFL),
    signal.SIGTERM: (signal.SIG_DFL,),
}
"""The signals, and what handles them by default.

gmsh leaves Ctrl-C to the system from ``gmsh.initialize()`` to ``gmsh.finalize()``.
"""
_running: ContextVar[tuple[Interrupts, ...]] = ContextVar("_running", default=())
"""The runs that are under way, the innermost last."""


def interrupted(comm: MPI.Comm) -> bool:
    """Tell whether the run on these ranks was interrupted; collective."""
    was_interrupted = False
    for run in _running.get():
        if MPI.Comm.Compare(comm, run.comm) in (MPI.IDENT, MPI.CONGRUENT):
            # All ranks ask each of the runs, as asking is collective.
            was_interrupted = run.asked() or was_interrupted
    return was_interrupted


def check_interrupts(comm: MPI.Comm) -> None:
    """Raise KeyboardInterrupt on all ranks if their run was interrupted; collective."""
    if interrupted(comm):
        raise KeyboardInterrupt


class Interrupts:
    """Note a first Ctrl-C or SIGTERM within a context.

    A second one has its usual effect at once. Where somebody else handles a signal
    already, or outside the main thread, it does nothing.

    Args:
        comm: All its ranks end together, whichever of them got the signal.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self.comm = comm
        self.first: float | None = None
        self.before: dict[int, Any] = {}
        self.shared = False

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is threading.main_thread():
            self.before = {}
            for number, usual in USUAL.items():
                if signal.getsignal(number) in usual:
                    self.before[number] = signal.signal(number, self._note)
        self._token = _running.set((*_running.get(), self))
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        _running.reset(self._token)
        for number, handler in self.before.items():
            signal.signal(number, handler)

    def asked(self) -> bool:
        """Tell whether any rank was interrupted; collective."""
        self.shared = bool(self.comm.allreduce(self.first is not None, MPI.LOR))
        return self.shared

    def check(self) -> None:
        """Raise KeyboardInterrupt on all ranks if any was interrupted; collective."""
        if self.asked():
            raise KeyboardInterrupt

    def ended(self, failure: BaseException) -> bool:
        """Tell whether a failure is an interrupt on all ranks that ends this run.

        A run within another one, as a step of a loading history, leaves it to that one.
        A compiler that is killed by the same signal ends in an error of another type.
        """
        if _running.get()[0] is not self:
            return False
        if isinstance(failure, KeyboardInterrupt):
            return self.shared or self.comm.size == 1
        return self.first is not None

    def _note(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        now = monotonic()
        if self.first is None:
            self.first = now
            log_of(self.comm).warning(
                "Interrupted: the run will end with what it has. The signal again ends it at once."
            )
        elif now - self.first > SAME_SIGNAL:
            signal.signal(number, USUAL[number][0])
            signal.raise_signal(number)
