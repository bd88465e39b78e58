"""Read the history of a run from the folder that keeps it, without scene and solve."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.output.gallery import Gallery
from erc_contact.run.checkpoint import Checkpoint
from erc_contact.run.history import History
from namedmesh import Domain
from namedmesh.base.percent import percent
from namedmesh.pictures import on_root


@dataclass(frozen=True, eq=False)
class SavedError:
    """Hold what a folder keeps of an error: its numbers, mesh and indicators.

    The numbers are explained at :class:`ConstitutiveError`. All else needs the scene,
    and raises an :class:`InputError`.
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
            f"{name!r} of a result that is read from a folder needs the scene: "
            "call adapt(scene, ..., checkpoint=folder) as for the run; "
            "no mesh that the folder holds is solved again."
        )


@dataclass(frozen=True, eq=False, repr=False)
class SavedHistory(History):
    """Hold a history that is read; ``best`` and ``error`` are a :class:`SavedError`.

    :meth:`save` writes ``report.html`` (without the scene), ``history.csv``,
    ``history.json``, ``meshes.vtkhdf``, ``body.vtkhdf``, and ``error.png`` of meshes
    that tell a slope.

    Attributes:
        file: The file of the best mesh.
    """

    file: Path

    def _save(self, folder: Path, gallery: Gallery | None) -> None:
        """Write table, meshes and fields, which need no scene; collective."""
        self._save_table(folder, {})
        if gallery is not None:
            self._draw_run(gallery)
        self._write_report(folder, gallery)

        def copy() -> None:
            shutil.copyfile(self.file, folder / "body.vtkhdf")

        on_root(self.best.domain.comm, folder / "body.vtkhdf", copy)


def read_history(folder: str | Path, comm: MPI.Comm = MPI.COMM_WORLD) -> History:
    """Read the history that ``adapt(..., checkpoint=folder)`` keeps; collective.

    Nothing is solved, and the run may be going on. Table, columns, meshes, figures and
    the fields for ParaView (:meth:`History.save`) show the run so far. Of ``best``
    there are the numbers, the domain and eps_E; forces, profiles and values at points
    need the scene, hence :func:`adapt`.

    Args:
        folder: The folder.
        comm: Communicator that shares the meshes, of any number of ranks.

    Raises:
        InputError: If there is no such folder, or no good mesh in it.

    Example:
        >>> _ = ec.adapt(scene, block, accuracy=0.1, checkpoint="run")
        >>> ec.read_history("run")
        <History of 2 meshes. Reached: 9.165%, asked for 10%.>
    """
    store = Checkpoint(comm, folder)
    if not store.numbers:
        raise InputError(f"The folder {str(folder)!r} holds no mesh of a run; look at the path.")
    levels = {number: store.read(number) for number in store.numbers}
    last = levels[store.numbers[-1]]
    # the row of a mesh has the place of its number, also where not every mesh is kept
    number = min(levels, key=lambda number: last.steps[number - 1].total)
    level = levels[number]
    best: Any = SavedError(**level.numbers, domain=level.domain, indicators=level.indicators)
    reached = best.total <= last.accuracy
    word = "Reached" if reached else "So far"
    return SavedHistory(
        last.steps,
        last.accuracy,
        reached,
        f"{word}: {percent(best.total)}, asked for {percent(last.accuracy)}.",
        cast(ConstitutiveError, best),
        tuple((level.domain, level.indicators) for level in levels.values()),
        store.folder.file(number),
    )
