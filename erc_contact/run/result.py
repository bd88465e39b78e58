"""Share what the results of all runs have: columns of rows, files in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.logs import log_of
from erc_contact.base.progress import stage
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.newton.solution import Solution
from erc_contact.output.files import make_folder
from erc_contact.output.gallery import Gallery
from erc_contact.output.view_page import View


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

    def show(self) -> View:
        """Show the body in 3D, as :func:`erc_contact.output.show_error`; collective."""
        view: View = self.error.show()
        return view

    def save(self, folder: str | Path, *, pictures: bool | None = None) -> None:
        """Write table, report, figures, pictures and ParaView files; collective.

        The description of the class names the files. Pictures take most of the time. By
        default those are drawn, the most telling ones first, with which saving takes at
        most a second and a fifth of the time of the run; the report names the others,
        and the lines of code that draw them.

        Args:
            folder: The folder, made if it is missing.
            pictures: True draws all pictures, False none, None those for which there is
                time.

        Raises:
            InputError: If the folder cannot be written; nothing is drawn then.
        """
        domain = self.error.domain
        comm = domain.comm
        folder = make_folder(comm, folder)
        seconds = self.steps[-1].seconds
        gallery = Gallery(domain, folder, seconds, every=pictures is True)
        with stage(comm, "saving"):
            self._save(folder, None if pictures is False else gallery)
        if gallery.missing:
            log_of(comm).info(
                "Pictures for which there was no time: %s. save(folder, pictures=True) draws all.",
                ", ".join(gallery.missing),
            )

    def _save(self, folder: Path, gallery: Gallery | None) -> None:
        """Write the files to a folder that exists; collective.

        Without a gallery no picture is drawn.
        """
        raise NotImplementedError
