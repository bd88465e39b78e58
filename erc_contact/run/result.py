"""Share what the results of all runs have: columns of rows, files in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.progress import stage
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.newton.solution import Solution
from erc_contact.output.files import made_folder


class RunResult:
    """Share the members of :class:`History` and :class:`Evolution`.

    Attributes:
        steps: The rows.
    """

    steps: tuple[Any, ...]

    @property
    def error(self) -> ConstitutiveError:
        """Return the error that stands for the run."""
        raise NotImplementedError

    @property
    def solution(self) -> Solution:
        """Return the solution of ``error``."""
        return self.error.solution

    def column(self, name: str) -> np.ndarray:
        """Return one column of the rows as an array, e.g. "seconds" or "eps"."""
        return np.array([getattr(step, name) for step in self.steps])

    def save(self, folder: str | Path, *, pictures: bool = True) -> None:
        """Write table, report, figures, pictures and ParaView files; collective.

        The description of the class names the files.

        Args:
            folder: The folder, made if it is missing.
            pictures: Whether figures and pictures are drawn, which takes most of the
                time.

        Raises:
            InputError: If the folder cannot be written; nothing is drawn then.
        """
        comm = self.error.domain.mesh.comm
        folder = made_folder(comm, folder)
        with stage(comm, "saving"):
            self._save(folder, pictures=pictures)

    def _save(self, folder: Path, *, pictures: bool) -> None:
        """Write the files to a folder that exists; collective."""
        raise NotImplementedError
