"""Progress of a run: one line on a terminal, elsewhere a line of the log now and then.

The line is below what the log tells. A stage that may take long says what it is, and
within it how far it is. Only rank 0 tells it, and only after
:func:`erc_contact.log_to_console`. The file of a batch system gets it where nothing was
told for some time.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any

from mpi4py import MPI

OFTEN = 0.1
"""Time between two updates of the line [s]; one costs about a millisecond."""
SELDOM = 10.0
"""Time without a line after which the log tells where a run is [s]."""


class _StageLine:
    """Represent the line of a terminal, or the last line of the log.

    It is state of the process, as the terminal is.

    Attributes:
        console: Console of rich; None without a terminal.
        stages: What is under way, the innermost last.
    """

    def __init__(self) -> None:
        self.console: Any = None
        self.stages: list[str] = []
        self._live: Any = None
        self._told = 0.0

    def show(self) -> None:
        """Show the stages, or leave the line if there is none."""
        if self.console is None:
            self._log()
        else:
            self._draw()

    def begin(self, words: str) -> None:
        """Add a stage.

        The log's silence counts from the outermost one on, before which it had a row.
        """
        if not self.stages:
            self._told = monotonic()
        self.stages.append(words)
        self.show()

    def end(self, place: int) -> None:
        """Remove the stages from a place on."""
        del self.stages[place:]
        if self.console is not None:
            self._draw()

    def _log(self) -> None:
        """Write the stages to the log if it has been silent for long."""
        if self.stages and monotonic() - self._told > SELDOM:
            logging.getLogger("erc_contact").info("... %s", ": ".join(self.stages))
            self._told = monotonic()

    def _draw(self) -> None:
        """Draw the stages on the terminal."""
        from rich.live import Live  # noqa: PLC0415 - whoever has a console has rich
        from rich.text import Text  # noqa: PLC0415

        if not self.stages:
            if self._live is not None:
                self._live.stop()
            self._live = None
            return
        if self._live is None:
            self._live = Live(console=self.console, auto_refresh=False, transient=True)
            self._live.start()
        words = Text(": ".join(self.stages), style="dim", no_wrap=True, overflow="ellipsis")
        self._live.update(words, refresh=True)
        self._told = monotonic()

    def add(self, words: str) -> None:
        """Show the innermost stage with words beside it, if the last words are old."""
        if self.stages and monotonic() - self._told > OFTEN:
            stages = list(self.stages)
            self.stages[-1] += f", {words}"
            self.show()
            self.stages[:] = stages


_line = _StageLine()
"""The line of this process."""


def show_on(console: Any) -> None:
    """Show stages on a console of rich, or with None nowhere."""
    _line.console = console


@contextmanager
def stage(comm: MPI.Comm, words: str) -> Iterator[None]:
    """Show a stage of a run while it lasts."""
    if comm.rank != 0:
        yield
        return
    place = len(_line.stages)
    _line.begin(words)
    try:
        yield
    finally:
        _line.end(place)


def at(comm: MPI.Comm, words: str) -> None:
    """Tell how far the innermost stage is."""
    if comm.rank == 0:
        _line.add(words)
