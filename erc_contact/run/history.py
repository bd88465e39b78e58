"""What an adaptive run did: one row a mesh, the best result, and why it ended."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.html import table
from erc_contact.base.percent import percent
from erc_contact.base.progress import at, stage
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.coulomb import CoulombCertificate, coulomb_certificate
from erc_contact.mesh.domain import Domain
from erc_contact.newton.solution import Solution
from erc_contact.output.as_code import run_as_code
from erc_contact.output.contact_plots import plot_contact
from erc_contact.output.curves import plot_history
from erc_contact.output.files import on_root
from erc_contact.output.mesh_pictures import draw_meshes
from erc_contact.output.paraview import write_fields
from erc_contact.output.pictures import draw_deformed, draw_error
from erc_contact.output.report import write_record, write_report
from erc_contact.output.series import write_meshes
from erc_contact.output.verdict import verdict
from erc_contact.results import Force, Maximum, Values
from erc_contact.run.step import COLUMNS, CURVED, HEADER, SHOWN, Step, line, shown


@dataclass(frozen=True, eq=False)
class History:
    """What an adaptive run did, one row a mesh.

    Attributes:
        steps: The rows.
        accuracy: The prescribed relative error.
        reached: Whether it was reached.
        outcome: Why the run ended, in words.
        best: The error of least ``total``, with the admissible pair and the solution.
        meshes: Domain and eps_E of every step, for pictures.
        settings: The other arguments of the run by their names.
    """

    steps: tuple[Step, ...]
    accuracy: float
    reached: bool
    outcome: str
    best: ConstitutiveError
    meshes: tuple[tuple[Domain, np.ndarray], ...] = field(repr=False)
    settings: Mapping[str, Any] = field(repr=False, default_factory=dict, kw_only=True)

    def __repr__(self) -> str:
        """Tell what it is in a line; ``print`` shows the table."""
        return f"<History of {len(self.steps)} meshes. {self.outcome}>"

    def __str__(self) -> str:
        curved = self.best.domain.curved_facets is not None
        rows = [line(step, curved=curved) for step in self.steps]
        return "\n".join([CURVED if curved else HEADER, *rows, self.outcome])

    def _repr_html_(self) -> str:
        """The table in a notebook; nothing is computed, so one rank alone may ask."""
        return self._table(self.outcome)

    def _table(self, caption: str = "") -> str:
        return table((shown(number, step) for number, step in enumerate(self.steps, start=1)), SHOWN, caption)

    @property
    def error(self) -> ConstitutiveError:
        """The error of least ``total``, which is ``best``, as in ``history.error.force("bottom")``."""
        return self.best

    @property
    def solution(self) -> Solution:
        """The solution of least error."""
        return self.best.solution

    def force(self, part: str) -> Force:
        """Resultant and moment on a boundary part, of the best result; see :func:`erc_contact.results.force`."""
        return self.best.force(part)

    def reactions(self) -> dict[str, Force]:
        """Forces of supports, contacts and loads, and their balance; see :func:`erc_contact.results.reactions`."""
        return self.best.reactions()

    def profile(self, contact: str) -> np.ndarray:
        """Gap, slip and tractions along a contact; see :func:`erc_contact.results.profile`."""
        return self.best.profile(contact)

    def at(self, points: Any) -> Values:
        """Displacement and stresses at points; see :func:`erc_contact.results.at`."""
        return self.best.at(points)

    def maximum(self, quantity: str) -> Maximum:
        """Greatest "von Mises" stress, "pressure", ... and its place; see :meth:`ConstitutiveError.maximum`."""
        return self.best.maximum(quantity)

    def coulomb_certificate(self) -> CoulombCertificate:
        """What is proved with Coulomb friction, of the best result; see :func:`erc_contact.coulomb_certificate`.

        ``factor`` is what the bound of all solutions has over e. A run does not compute it: it costs up to a linear
        solve in the plane, and three in space.
        """
        return coulomb_certificate(self.best)

    def column(self, name: str) -> np.ndarray:
        """One column of the rows as an array."""
        return np.array([getattr(step, name) for step in self.steps])

    def slope(self, against: str = "cells", last: int | None = None) -> float:
        """Slope of log(eps) against the log of a column, least squares over the last rows.

        Args:
            against: Name of the column: cells, dofs or seconds.
            last: Number of rows; the second half by default.

        Returns:
            The slope, nan with fewer than two rows.
        """
        number = last or max(2, len(self.steps) // 2)
        x, eps = self.column(against)[-number:], self.column("eps")[-number:]
        if len(x) < 2 or not np.all(eps > 0):
            return float("nan")
        return float(np.polyfit(np.log(x), np.log(eps), 1)[0])

    def to_csv(self, path: str | Path) -> None:
        """Write the rows as CSV; every rank may call, rank 0 writes."""
        if self.best.domain.mesh.comm.rank == 0:
            with Path(path).open("w", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS)
                writer.writeheader()
                writer.writerows(asdict(step) for step in self.steps)

    def to_json(self, path: str | Path) -> None:
        """Write the rows, the best error, forces, settings and versions as JSON; collective."""
        write_record(self, path, self.reactions())

    def save(self, folder: str | Path) -> None:
        """Write table, report, figures, pictures and ParaView files to a folder; collective.

        ``report.html`` (one page that holds all it shows: scene, what the error proves, pictures, forces, versions),
        ``history.csv``, ``history.json``, ``error.png`` (error against run time and degrees of freedom),
        ``meshes.png``, ``error_map.png``, ``deformed.png``, ``body.vtkhdf``, ``meshes.vtkhdf`` (all meshes with eps_E),
        and for each contact its profile ``contact_<name>.csv``, ``contact_<name>.png`` and ``contact_<name>.vtkhdf``.
        """
        folder, comm = Path(folder), self.best.domain.mesh.comm
        with stage(comm, "saving"):
            forces = self.reactions()
            pictures = self._save_table(folder, forces)
            at(comm, "pictures of the best mesh")
            draw_error(self.best, folder / "error_map.png")
            draw_deformed(self.best, folder / "deformed.png")
            pictures |= {"error_map.png": "Share of each element in eps.", "deformed.png": "The deformed body."}
            for traction in self.best.admissible.tractions:
                name = traction.contact.name
                plot_contact(self.best.admissible, name, folder / f"contact_{name}.png")
                _write_profile(comm, self.profile(name), folder / f"contact_{name}.csv")
                pictures[f"contact_{name}.png"] = f"Traction on the contact {name}, of the admissible stress."
            at(comm, "fields")
            write_fields(self.best, folder)
            given = {"accuracy": self.accuracy, **self.settings}
            code = run_as_code(self.solution.scene, self.meshes[0][0], given)
            self._write_report(folder, pictures, claims=verdict(self.best), forces=forces, code=code)

    def _save_table(self, folder: Path, forces: Mapping[str, Force]) -> dict[str, str]:
        """Write what needs no scene; return the names of the pictures, and what they show; collective."""
        comm = self.best.domain.mesh.comm
        on_root(comm, folder / "history.csv", lambda: self.to_csv(folder / "history.csv"))
        write_record(self, folder / "history.json", forces)
        plot_history({"adaptive": self}, folder / "error.png")
        draw_meshes(self.meshes, folder / "meshes.png")
        write_meshes(self.meshes, folder / "meshes.vtkhdf")
        return {"error.png": "Error against run time and against unknowns.", "meshes.png": "Meshes of the run."}

    def _write_report(self, folder: Path, pictures: Mapping[str, str], **more: Any) -> None:
        title = f"Relative error {percent(self.best.total)}, asked for {percent(self.accuracy)}"
        write_report(self, folder / "report.html", title, {"Meshes": self._table()}, pictures, **more)


def _write_profile(comm: MPI.Comm, profile: np.ndarray, path: Path) -> None:
    """Write a profile as CSV, which pandas reads; collective."""
    columns = {"header": ",".join(profile.dtype.names or ()), "comments": "", "delimiter": ",", "fmt": "%.17g"}
    on_root(comm, path, lambda: np.savetxt(path, profile, **columns))
