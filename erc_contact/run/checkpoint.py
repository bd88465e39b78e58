"""Keep a run in a folder and go on from it; all ranks together.

Levels that are damaged are left out, with a warning that names the file: the run goes
on from the last good one. A folder of another run is refused, and so is one that
nothing can be written to. Where that comes later, because the disk is full, say, the
run goes on, with a warning for each level that is not kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, on_rank, raise_together
from erc_contact.base.logs import log_of
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.newton.methods import Method
from erc_contact.run.fingerprint import Fingerprint, differences
from erc_contact.run.levels import Folder
from erc_contact.run.states import Restored, level_of
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.for_solvers import Geometry
from namedmesh.keeping import Contents, Damaged, describe_shape

DIFFERENCES = 3
"""Greatest number of differences between two runs that a message names."""


@dataclass(frozen=True, eq=False)
class Kept:
    """Hold what a folder has of a run.

    Attributes:
        steps: The rows.
        meshes: Domain and eps_E of the levels that are kept.
        best: The error of least ``total`` among them.
        last: The error of the last one.
        carried: What the aim of the run carried to that one.
    """

    steps: list[Any]
    meshes: list[tuple[Domain, np.ndarray]]
    best: ConstitutiveError
    last: ConstitutiveError
    carried: dict[str, float]


class Checkpoint:
    """Keep the levels of a run in a folder; all methods are collective.

    Args:
        comm: Communicator of the run.
        path: The folder.
        fingerprint: The fingerprint of the run; None only reads.
        accuracy: The prescribed relative error of the run, which is kept beside it.
        every: Number of meshes from one that is written to the next.
        shape: The true shape of all meshes, which the first one has; None takes what
            the folder keeps of it.

    Attributes:
        numbers: The numbers of the good levels, in order.

    Raises:
        InputError: If the folder belongs to another run, to a run that is going on, or
            to a newer version, or nothing can be written there.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        path: str | Path,
        fingerprint: Fingerprint | None = None,
        accuracy: float = 0.0,
        every: int = 1,
        shape: Geometry | None = None,
    ) -> None:
        self.comm = comm
        self.shape = shape
        self.fingerprint = fingerprint
        self.accuracy = accuracy
        self.every = every
        self.folder = Folder(Path(path))
        self._written = 0
        # Rank 0 alone reads.
        self.numbers: list[int] = comm.bcast(on_rank(comm, 0, self._good_levels))
        self._written = max(self.numbers, default=0)

    def read(self, number: int, before: Restored | None = None) -> Restored:
        """Read a good level.

        Args:
            number: Its number.
            before: Another level, read already, that may have the same mesh.

        Raises:
            InputError: If it has changed since, or is no level of a run.
        """

        def read_level() -> Contents:
            try:
                return self.folder.read(number)
            except Damaged as reason:
                file = self.folder.file(number)
                raise InputError(f"{file} was good, and now {reason}.") from reason

        level = on_rank(self.comm, 0, read_level)
        about = self.comm.bcast(level.about if level else None)
        try:
            return Restored(self.comm, level or Contents(about, {}), before, self.shape)
        except (AttributeError, LookupError, TypeError, ValueError, RuntimeError) as reason:
            if isinstance(reason, InputError):
                raise
            file = self.folder.file(number)
            raise InputError(f"{file} is no level of a run ({reason}).") from reason

    def read_all(self, scene: Scene, methods: Sequence[Method], tighten: int) -> Kept:
        """Read all good levels; the folder has at least one level.

        Args:
            scene: The scene of the run.
            methods: The methods that its solutions may have.
            tighten: Iterations that tighten sigma^.
        """
        last_number = self.numbers[-1]
        last = self.read(last_number)
        steps = list(last.steps)
        least = min(self.numbers, key=lambda number: steps[number - 1].total)
        meshes = []
        errors = {}
        for number in self.numbers:
            level = last if number == last_number else self.read(number)
            meshes.append((level.domain, level.indicators))
            # to measure costs an admissible pair, and of the others nothing is needed
            if number in (least, last_number):
                errors[number] = level.error(scene, methods, tighten)
        return Kept(
            steps, meshes, errors[least], errors[last_number], dict(last.about.get("carried", {}))
        )

    def add(
        self,
        error: ConstitutiveError,
        steps: Sequence[Any],
        carried: dict[str, float] | None = None,
        *,
        last: bool = False,
    ) -> None:
        """Write the level that was measured last, if its turn has come.

        What cannot be written is a warning.

        Args:
            error: The error of the level.
            steps: The rows of the run so far.
            carried: What the aim of the run has carried to this level.
            last: Whether the run ends with it, so that it is written in any case.
        """
        number = len(steps)
        its_turn = last or (number - 1) % self.every == 0
        if number <= self._written or not its_turn:
            return
        self._written = number
        failure = None
        try:
            level = level_of(error, steps)
            if self.comm.rank == 0:
                about: dict[str, Any] = {"fingerprint": self.fingerprint, "accuracy": self.accuracy}
                about["carried"] = carried or {}
                self.folder.write(number, replace(level, about=level.about | about))
        except (InputError, OSError, MemoryError) as reason:
            log_of(self.comm).warning(
                "The mesh of %d cells is not kept: %s. The run goes on; "
                "what %s has stays as it is.",
                steps[-1].cells,
                reason,
                self.folder.path,
            )
        except Exception as reason:  # every rank must learn of it
            failure = reason
        raise_together(self.comm, failure)  # when a rank goes on, the file is on the disk

    def go_on_from(self, number: int) -> None:
        """Allow levels after this level to be written again.

        The run makes them anew, since one of them is damaged.
        """
        self._written = number

    def close(self) -> None:
        """Unlock the folder for other runs."""
        self.folder.close()

    def _open(self) -> None:
        """Open the folder on rank 0; without a fingerprint it is read alone."""
        path = str(self.folder.path)
        if self.fingerprint is None:
            if not self.folder.path.is_dir():
                raise InputError(
                    f"There is no folder {path!r}; look at the path and the working folder."
                )
            return
        try:
            self.folder.open()
        except OSError as reason:
            raise InputError(
                f"checkpoint: nothing can be written to the folder {path!r} "
                f"({reason.strerror}); give another folder, or None for a run that is not kept."
            ) from reason

    def _good_levels(self) -> list[int]:
        """Open the folder and return the numbers of its good levels, on rank 0."""
        try:
            self._open()
            return self._read_good_levels()
        except Exception:
            self.folder.close()
            raise

    def _read_good_levels(self) -> list[int]:
        """Return the numbers of the good levels of the open folder, on rank 0."""
        good = []
        for number in self.folder.numbers():
            try:
                about: dict[str, Any] = self.folder.read(number).about
            except Damaged as reason:
                log_of(self.comm).warning("%s is left out: %s.", self.folder.file(number), reason)
                continue
            if self.fingerprint is not None:
                self._check_same_run(differences(self.fingerprint, about["fingerprint"]))
            good.append(number)
        return good

    def _check_same_run(self, differing: list[str]) -> None:
        """Raise an InputError if this run differs from the run of the folder."""
        if not differing:
            return
        words = "; ".join(differing[:DIFFERENCES])
        if len(differing) > DIFFERENCES:
            words += f"; and {len(differing) - DIFFERENCES} more"
        raise InputError(
            f"The folder {str(self.folder.path)!r} belongs to another run: {words}. "
            "Give another folder, or the same call."
        )


@contextmanager
def keep_run(
    folder: Any,
    domain: Domain,
    identity: Callable[[], Fingerprint],
    accuracy: float,
    every: int = 1,
) -> Iterator[Checkpoint | None]:
    """Give what keeps a run inside the `with`, None without a folder; collective.

    Args:
        folder: The folder, or None.
        domain: The first mesh.
        identity: Returns the fingerprint of the run.
        accuracy: The prescribed relative error of the run.
        every: Number of meshes from one that is written to the next.

    Raises:
        InputError: If this is no name of a folder, or the true shape of the body cannot
            be written; see also :class:`Checkpoint`.
    """
    if folder is None:
        yield None
        return
    if not isinstance(folder, str | Path):
        raise InputError(f"checkpoint is {folder!r}; give the name of a folder, or None.")
    describe_shape(domain.geometry)
    shape = domain.whole.geometry
    store = Checkpoint(domain.comm, folder, identity(), accuracy, every, shape)
    try:
        yield store
    finally:
        # the lock on the folder ends with the run, however the run ends
        store.close()
