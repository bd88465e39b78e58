"""Draw the pictures of a run in its folder, as long as there is time for them.

Pictures take longer than a short run. So by default saving takes at most a second, for
the import of matplotlib and pyvista, and a fifth of the run. Rank 0 has the clock.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

from erc_contact.base.exceptions import InputError
from erc_contact.base.logs import log_of
from erc_contact.base.progress import at
from namedmesh import Domain
from namedmesh.pictures import on_root

IMPORT_SECONDS = 1.0
"""Time that saving may take after a run of no time [s]."""
RUN_SHARE = 0.2
"""Share of the time of the run that saving may take beyond that [-]."""
PICTURE_SECONDS = {2: 0.3, 3: 0.6}
"""Time of a picture of a small mesh, by dimension [s]."""
CELL_SECONDS = 8e-6
"""Time that each cell adds to a picture of the body [s]."""
LIBRARY_SECONDS = {"matplotlib.figure": 0.8, "pyvista.plotting": 0.6}
"""Time of the first picture of a process for each library that it loads [s].

The second one draws bodies in 3D.
"""


class Gallery:
    """Draw pictures in a folder one after another, the most telling picture first.

    Attributes:
        folder: The folder.
        allowed: Time that saving may take [s]; infinite if all pictures are asked for.
        drawn: Names of the files that are drawn, and what they show.
        missing: Names of the files for which there was no time, and the lines of code
            that draw them.
    """

    def __init__(self, domain: Domain, folder: Path, run_seconds: float, *, every: bool) -> None:
        """Start the clock.

        Args:
            domain: The mesh of the pictures.
            folder: The folder.
            run_seconds: Time of the run [s].
            every: Whether all are drawn, whatever time they take.
        """
        self.folder = folder
        self.allowed = float("inf") if every else IMPORT_SECONDS + RUN_SHARE * run_seconds
        self.drawn: dict[str, str] = {}
        self.missing: dict[str, str] = {}
        self._comm = domain.comm
        self._dim = domain.dim
        self._cells = domain.cells
        self._began = perf_counter()
        # Time of the slowest picture over the time by the constants of this module.
        self._slowness = 1.0

    @property
    def has_all_time(self) -> bool:
        """Tell whether all is asked for, whatever time it takes."""
        return self.allowed == float("inf")

    def add(
        self,
        file: str,
        words: str,
        code: str,
        draw: Callable[[Path], object],
        *,
        is_body: bool = False,
    ) -> None:
        """Draw a picture if there is time for it; collective.

        A file of this name by an older run is removed if there is not.

        Args:
            file: Its name.
            words: What it shows.
            code: The line that draws it, as a user writes it.
            draw: Draws it to a path; it is collective.
            is_body: Whether it shows the elements of the body.
        """
        path = self.folder / file
        seconds = PICTURE_SECONDS[self._dim]
        libraries = ["matplotlib.figure"]
        if is_body:
            seconds += CELL_SECONDS * self._cells
        if is_body and self._dim == 3:
            libraries.append("pyvista.plotting")
        unloaded = [name for name in libraries if name not in sys.modules]
        expected = self._slowness * seconds + sum(LIBRARY_SECONDS[name] for name in unloaded)
        end = perf_counter() - self._began + expected
        # All ranks must draw the same pictures.
        has_time = self._comm.bcast(end <= self.allowed)
        if not has_time:
            self.missing[file] = code
            on_root(self._comm, path, lambda: path.unlink(missing_ok=True))
            return
        at(self._comm, file)
        began = perf_counter()
        try:
            draw(path)
        except InputError as reason:  # the libraries of this machine cannot draw it
            log_of(self._comm).warning("%s is left out. %s", file, reason)
            return
        self.drawn[file] = words
        # The next picture has a machine that is as slow.
        if not unloaded:
            self._slowness = max(self._slowness, (perf_counter() - began) / seconds)
