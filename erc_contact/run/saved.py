"""The history of a run from the folder that keeps it, without the scene and without a solve."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.percent import percent
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.domain import Domain
from erc_contact.output.files import made_folder, on_root
from erc_contact.run.checkpoint import Checkpoint
from erc_contact.run.history import History


@dataclass(frozen=True, eq=False)
class SavedError:
    """What a folder tells of an error: its numbers, as those of :class:`ConstitutiveError`, mesh and indicators.

    All else needs the scene, and raises an :class:`InputError`.
    """

    absolute: float
    scale: float
    bulk_error: float
    contact_error: float
    geometry_error: float
    relative: float
    total: float
    degree: int
    domain: Domain
    indicators: np.ndarray

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("_"):
            raise AttributeError(name)
        raise InputError(
            f"{name!r} of a result that is read from a folder needs the scene: call adapt(scene, ..., "
            "checkpoint=folder) as for the run; no mesh that the folder holds is solved again."
        )


@dataclass(frozen=True, eq=False)
class SavedHistory(History):
    """A history that is read; ``best`` and ``error`` are a :class:`SavedError`.

    Attributes:
        file: The file of the best mesh.
    """

    file: Path

    def save(self, folder: str | Path, *, pictures: bool = True) -> None:
        """Write the table, meshes and fields to a folder; collective.

        ``report.html`` (without the scene), ``history.csv``, ``history.json``,
        ``meshes.vtkhdf``, ``body.vtkhdf``, and of several meshes ``error.png`` and
        ``meshes.png``.
        """
        comm = self.best.domain.mesh.comm
        folder = made_folder(comm, folder)
        self._save_table(folder, {})
        self._write_report(folder, self._draw_run(folder) if pictures else {})

        def copy() -> None:
            shutil.copyfile(self.file, folder / "body.vtkhdf")

        on_root(comm, folder / "body.vtkhdf", copy)


def read_history(folder: str | Path, comm: MPI.Comm = MPI.COMM_WORLD) -> History:
    """The history of a run from the folder of ``adapt(..., checkpoint=folder)``; collective.

    Nothing is solved, and the run may be going on. Table, columns, meshes, figures and
    the fields for ParaView (:meth:`History.save`) are those of the run so far. Of
    ``best`` there are the numbers, the domain and eps_E; forces, profiles and values at
    points need the scene, hence :func:`adapt`.

    Args:
        folder: The folder.
        comm: Communicator that shares the meshes, of any number of ranks.

    Raises:
        InputError: If there is no such folder, or no good mesh in it.
    """
    kept = Checkpoint(comm, folder)
    if not kept.numbers:
        raise InputError(f"The folder {str(folder)!r} holds no mesh of a run; look at the path.")
    levels = {number: kept.read(number) for number in kept.numbers}
    last = levels[kept.numbers[-1]]
    number = min(levels, key=lambda number: last.steps[number - 1].total)
    best: Any = SavedError(
        **levels[number].numbers, domain=levels[number].domain, indicators=levels[number].indicators
    )
    reached = best.total <= last.accuracy
    outcome = f"{'Reached' if reached else 'So far'}: {percent(best.total)}, asked for {percent(last.accuracy)}."
    meshes = tuple((level.domain, level.indicators) for level in levels.values())
    result = last.accuracy, reached, outcome, cast(ConstitutiveError, best), meshes
    return SavedHistory(last.steps, *result, kept.folder.file(number))
