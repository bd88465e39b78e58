"""The checkpoint of a run: what a folder holds of it, and what is added; all ranks together.

Levels that are damaged are left out, with a warning that names the file: the run goes
on from the last good one. A folder of another run is refused, and so is one that
nothing can be written to. Where that comes later, because the disk is full, say, the
run goes on, with a warning for each level that is not kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.base.logs import log_of
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.run.fingerprint import Fingerprint, differences
from erc_contact.run.levels import Damaged, Folder, Level
from erc_contact.run.states import Restored, level_of

TOLD = 3
"""Differences between two runs that a message names."""


class Checkpoint:
    """The folder of a run; all methods are collective.

    Args:
        comm: Communicator of the run.
        path: The folder.
        given: The fingerprint of the run; None only reads.
        accuracy: The prescribed relative error of the run, which is kept beside it.
        every: Number of meshes from one that is written to the next.

    Attributes:
        numbers: The numbers of the good levels, in order.

    Raises:
        InputError: If the folder is that of another run, of one that is going on, or of
            a newer version, or nothing can be written there.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        path: str | Path,
        given: Fingerprint | None = None,
        accuracy: float = 0.0,
        every: int = 1,
    ) -> None:
        self.comm, self.given, self.accuracy, self.every = comm, given, accuracy, every
        self.folder, self._written = Folder(Path(path)), 0
        error: Exception | None = None
        found: list[int] = []
        if comm.rank == 0:
            try:
                self._open()
                found = self._good()
            except Exception as reason:
                self.folder.close()
                error = reason
        raise_together(comm, error)
        self.numbers: list[int] = comm.bcast(found)
        self._written = max(self.numbers, default=0)

    def read(self, number: int, before: Restored | None = None) -> Restored:
        """A good level; ``before`` is another one, read already, that may have the same mesh."""
        level, error = None, None
        if self.comm.rank == 0:
            try:
                level = self.folder.read(number)
            except Damaged as reason:
                error = InputError(f"{self.folder.file(number)} was good, and now {reason}.")
        raise_together(self.comm, error)
        about = self.comm.bcast(level.about if level else None)
        return Restored(self.comm, level or Level(about, {}), before)

    def add(self, error: ConstitutiveError, steps: Sequence[Any], *, last: bool = False) -> None:
        """Write the level that was measured last, if its turn has come or it is the last; failures are warnings."""
        number = len(steps)
        if number <= self._written or not (last or (number - 1) % self.every == 0):
            return
        self._written, failure = number, None
        try:
            level = level_of(error, steps)
            if self.comm.rank == 0:
                about = level.about | {"fingerprint": self.given, "accuracy": self.accuracy}
                self.folder.write(number, replace(level, about=about))
        except (InputError, OSError, MemoryError) as reason:
            log_of(self.comm).warning(
                "The mesh of %d cells is not kept: %s. The run goes on; what %s has stays as it is.",
                *(steps[-1].cells, reason, self.folder.path),
            )
        except Exception as reason:  # every rank must learn of it
            failure = reason
        raise_together(self.comm, failure)  # when a rank goes on, the file is on the disk

    def go_on_from(self, number: int) -> None:
        """Let levels after this one be written again: the run makes them anew, since one of them is damaged."""
        self._written = number

    def close(self) -> None:
        """Let other runs have the folder."""
        self.folder.close()

    def _open(self) -> None:
        if self.given is None:
            if not self.folder.path.is_dir():
                raise InputError(
                    f"There is no folder {str(self.folder.path)!r}; look at the path and the working folder."
                )
            return
        try:
            self.folder.open()
        except OSError as reason:
            raise InputError(
                f"checkpoint: nothing can be written to the folder {str(self.folder.path)!r} ({reason.strerror}); give "
                "another folder, or None for a run that is not kept."
            ) from reason

    def _good(self) -> list[int]:
        """The numbers of the good levels, on rank 0."""
        good = []
        for number in self.folder.numbers():
            try:
                about: dict[str, Any] = self.folder.read(number).about
            except Damaged as reason:
                log_of(self.comm).warning("%s is left out: %s.", self.folder.file(number), reason)
                continue
            differ = differences(self.given, about["fingerprint"]) if self.given is not None else []
            if differ:
                more = f"; and {len(differ) - TOLD} more" if len(differ) > TOLD else ""
                raise InputError(
                    f"The folder {str(self.folder.path)!r} is that of another run: {'; '.join(differ[:TOLD])}{more}. "
                    "Give another folder, or the same call."
                )
            good.append(number)
        return good
