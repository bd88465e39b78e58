"""Hold what an adaptive run did: one row a mesh, the best result, and why it ended."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.progress import at
from erc_contact.error.bounds import resultant
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.coulomb.certificate import CoulombCertificate, coulomb_certificate
from erc_contact.error.numbers import Bounds
from erc_contact.error.slip_share import small_slips
from erc_contact.output.bounded_forces import bounded_forces, contact_names, forces_in_html
from erc_contact.output.contact_plots import plot_contact
from erc_contact.output.curves import SPAN, plot_history
from erc_contact.output.deformed import add_near, draw_deformed
from erc_contact.output.foundations import STILL_SHARE
from erc_contact.output.gallery import Gallery
from erc_contact.output.paraview import write_fields
from erc_contact.output.pictures import add_states, draw_error
from erc_contact.output.report import keep_domain, run_as_code, write_record, write_report
from erc_contact.output.series import write_meshes
from erc_contact.output.verdict import of_gaps, of_maxima, of_slips, parted, verdict
from erc_contact.output.view_page import add_view
from erc_contact.results import OPEN, ContactArea, ContactForce, Force, Maximum, Values
from erc_contact.results.peaks import PEAKS
from erc_contact.run.columns import Column, header, line, page_rows
from erc_contact.run.result import RunResult
from erc_contact.run.step import COLUMNS, Step, columns_of
from namedmesh import Domain
from namedmesh.base.html import table
from namedmesh.base.names import file_stem
from namedmesh.base.percent import percent
from namedmesh.pictures import on_root


@dataclass(frozen=True, eq=False)
class History(RunResult):
    """Hold what an adaptive run did, one row a mesh.

    :meth:`save` writes ``report.html`` (one page that holds all it shows: scene, what
    the error proves, pictures, forces, versions), ``history.csv``, ``history.json``,
    ``body.vtkhdf``, ``meshes.vtkhdf`` (all meshes with eps_E), and for each contact its
    profile ``contact_<name>.csv`` and ``contact_<name>.vtkhdf``. Pictures are few,
    because they take longer than a small run, and drawn where they show something:
    ``deformed.png`` of a body that moves, ``contact_<name>.png`` of a contact that is
    closed somewhere, ``view.html`` (the body in 3D, to turn; in the report, too),
    ``error_map.png`` of an error, and ``error.png`` (error against run time and degrees
    of freedom) of meshes that tell a slope. By default only those are drawn, in this
    order, for which there is time. There are more in
    :mod:`erc_contact.output`, for instance ``draw_meshes(history, path)``. Of a name
    letters, digits, dashes and underscores are in the name of a file; a name with
    others ends with a hash there, and ``history.json`` tells the part of each.

    Attributes:
        steps: The rows.
        accuracy: The prescribed relative error.
        reached: Whether it was reached.
        outcome: Why the run ended, in words.
        best: The error of least ``total``, with the admissible pair and the solution.
        meshes: Domain and eps_E of every step, for pictures.
        settings: The other arguments of the run by their names.
        bounds: The interval of the goal; None where the run had none.

    Example:
        >>> history
        <History of 2 meshes. Reached: 9.165% <= 10%.>
        >>> [f"{eps:.1%}" for eps in history.column("eps")]
        ['12.3%', '9.2%']
    """

    steps: tuple[Step, ...]
    accuracy: float
    reached: bool
    outcome: str
    best: ConstitutiveError
    meshes: tuple[tuple[Domain, np.ndarray], ...] = field(repr=False)
    settings: Mapping[str, Any] = field(repr=False, default_factory=dict, kw_only=True)
    bounds: Bounds | None = field(default=None, kw_only=True)

    def __repr__(self) -> str:
        """Describe it in a line; ``print`` shows the table."""
        return f"<History of {len(self.steps)} meshes. {self.outcome}>"

    def __str__(self) -> str:
        """Write the table, and why the run ended."""
        rows = [line(self._columns, step) for step in self.steps]
        return "\n".join([header(self._columns), *rows, self.outcome])

    def _repr_html_(self) -> str:
        """Write the table for a notebook; nothing is computed, so one rank may ask."""
        return self._table(self.outcome)

    def _table(self, caption: str = "") -> str:
        """Write the table as HTML."""
        titles, rows = page_rows(self._columns, self.steps)
        numbered = [[str(number), *row] for number, row in enumerate(rows, start=1)]
        return table(numbered, ["mesh", *titles], caption)

    @property
    def _columns(self) -> list[Column]:
        """Return the columns of the table."""
        # Rows without a contact have no pressure.
        has_contact = not np.isnan(self.steps[-1].peak_pressure)
        curved = self.best.domain.curved_facets is not None
        return columns_of(curved=curved, has_contact=has_contact)

    @property
    def error(self) -> ConstitutiveError:
        """Return ``best``, the error of least ``total``."""
        return self.best

    def force(self, part: str) -> Force:
        """Compute resultant and moment on a boundary part, of the best result.

        See :func:`erc_contact.results.force`.
        """
        return self.best.force(part)

    def reactions(self) -> dict[str, Force]:
        """Compute forces of supports, contacts and loads, and their balance.

        See :func:`erc_contact.results.reactions`.
        """
        return self.best.reactions()

    def profile(self, contact: str) -> np.ndarray:
        """Compute gap, slip and tractions along a contact, of the best result.

        See :func:`erc_contact.results.profile`.
        """
        return self.best.profile(contact)

    def contact_area(self, contact: str) -> ContactArea:
        """Find the area of a contact and where it ends, of the best result.

        ``history.contact_area("bottom").half_width`` in the plane, ``.radius`` of
        rings, ``.area`` of all; see :func:`erc_contact.results.contact_area`.
        """
        return self.best.contact_area(contact)

    def contact_force(self, contact: str) -> ContactForce:
        """Sum up normal and tangential force and pressure, of the best result.

        See :func:`erc_contact.results.contact_force`.
        """
        return self.best.contact_force(contact)

    def gap_deviation(self, contact: str) -> float:
        """Tell how far the linearised gap is from the true gap, of the best result.

        See :func:`erc_contact.results.gap_deviation` [length].
        """
        return self.best.gap_deviation(contact)

    def at(self, points: Any) -> Values:
        """Evaluate displacement and stresses at points, of the best result.

        See :func:`erc_contact.results.at`.
        """
        return self.best.at(points)

    def along(self, start: Any, stop: Any, count: int = 101) -> np.ndarray:
        """Tabulate displacement and stress along a line, of the best result.

        See :func:`erc_contact.results.along`.
        """
        return self.best.along(start, stop, count)

    def maximum(self, quantity: str) -> Maximum:
        """Find the greatest value of a quantity and its place; collective.

        The quantity is "von Mises", "pressure", ...; see
        :meth:`ConstitutiveError.maximum`. Of von Mises stress, pressure and shear the
        result also has the values on all meshes, and tells whether they grow with
        refinement (``grows``).
        """
        greatest = self.best.maximum(quantity)
        if quantity not in PEAKS:
            return greatest
        name = PEAKS[quantity]
        values = self.column(name)
        sizes = self.column(f"{name}_size")
        return replace(greatest, values=tuple(values.tolist()), sizes=tuple(sizes.tolist()))

    def coulomb_certificate(self) -> CoulombCertificate:
        """Compute what is proved with Coulomb friction, of the best result.

        See :func:`erc_contact.coulomb_certificate`. ``factor`` is what the bound of all
        solutions has over e. A run does not compute it: it costs up to a linear solve
        in the plane, and three in 3D.
        """
        return coulomb_certificate(self.best)

    def slope(self, against: str = "cells", last: int | None = None) -> float:
        """Compute the slope of log(eps) against the log of a column [-].

        A line is fitted to the last rows by least squares.

        Args:
            against: Name of the column: cells, dofs or seconds.
            last: Number of rows. By default it is the second half of them, at least
                three, and more if the unknowns do not grow by a factor of 4 in these.

        Returns:
            The slope; nan with fewer than two rows, or by default if no three rows or
            more have that factor.
        """
        number = self._rows_of_slope() if last is None else last
        x = self.column(against)[-number:]
        eps = self.column("eps")[-number:]
        if len(x) < 2 or not np.all(eps > 0):
            return float("nan")
        return float(np.polyfit(np.log(x), np.log(eps), 1)[0])

    def _rows_of_slope(self) -> int:
        """Find the number of last rows that tell a slope; 1 if none do."""
        dofs = self.column("dofs")
        for number in range(max(3, len(dofs) // 2), len(dofs) + 1):
            if dofs[-number:].max() >= SPAN * dofs[-number:].min():
                return number
        return 1

    def to_csv(self, path: str | Path) -> None:
        """Write the rows as CSV; every rank may call, rank 0 writes."""
        if self.best.domain.comm.rank == 0:
            with Path(path).open("w", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS)
                writer.writeheader()
                writer.writerows(asdict(step) for step in self.steps)

    def to_json(self, path: str | Path) -> None:
        """Write rows, best error, forces, settings and versions as JSON; collective."""
        write_record(self, path, self.reactions())

    def _save(self, folder: Path, gallery: Gallery | None) -> None:
        """Write the files to a folder that exists; collective."""
        comm = self.best.domain.comm
        model = self.best.model
        forces = self.reactions()
        self._save_table(folder, forces)
        for joint in (*model.contacts, *model.ties):
            name = joint.name
            _write_profile(comm, self.profile(name), folder / f"contact_{file_stem(name)}.csv")
        at(comm, "fields")
        write_fields(self.best, folder)
        if gallery is not None:
            self._draw(gallery)
        arguments = {"accuracy": self.accuracy, **self.settings}
        first = self.meshes[0][0]
        code = run_as_code(self.solution.scene, first, keep_domain(first, folder), arguments)
        # pressure and shear exist on a contact alone
        quantities = PEAKS if model.contacts else ["von Mises"]
        maxima = {name: self.maximum(name) for name in quantities}
        slips = of_slips(self.best, small_slips(self.best)) if self.bounds is None else []
        claims, unknown = parted(
            [*verdict(self.best), *of_gaps(self.best), *slips, *of_maxima(maxima)]
        )
        # Each component of a force takes an elastic solve.
        asked = gallery is not None and gallery.has_all_time
        names = contact_names(self.best) if asked else []
        results = forces_in_html(bounded_forces(self.best, names, resultant))
        self._write_report(
            folder,
            gallery,
            results=results,
            claims=claims,
            unknown=unknown,
            forces=forces,
            code=code,
        )

    def _save_table(self, folder: Path, forces: Mapping[str, Force]) -> None:
        """Write what needs no scene and no drawing; collective."""
        comm = self.best.domain.comm
        on_root(comm, folder / "history.csv", lambda: self.to_csv(folder / "history.csv"))
        write_record(self, folder / "history.json", forces)
        write_meshes(self.meshes, folder / "meshes.vtkhdf")

    def _draw(self, gallery: Gallery) -> None:
        """Draw all pictures of a run that show something; collective."""
        add_error(gallery, self.best, "history.best")
        self._draw_run(gallery)

    def _draw_run(self, gallery: Gallery) -> None:
        """Draw what needs no scene; collective."""
        # Few points, or points near each other, are no curve: the table says it all.
        if np.isnan(self.slope("dofs")):
            return
        words = "Error against run time and against unknowns."
        code = 'erc_contact.output.plot_history({"adaptive": history}, "error.png")'
        gallery.add("error.png", words, code, partial(plot_history, {"adaptive": self}))

    def _write_report(self, folder: Path, gallery: Gallery | None, **more: Any) -> None:
        """Write ``report.html``; collective."""
        title = f"relative error {percent(self.best.total)}, asked for {percent(self.accuracy)}"
        tables = {"Meshes": self._table()}
        write_report(self, folder / "report.html", title, tables, gallery, **more)


def add_error(gallery: Gallery, error: ConstitutiveError, code: str) -> None:
    """Draw all pictures of an error that show something; collective.

    An exact solution has no map of its error, and a body that does not move is not
    drawn deformed.

    Args:
        gallery: The gallery.
        error: The error.
        code: The error as a user writes it.
    """
    moves = error.maximum("displacement").value > STILL_SHARE * error.domain.extent
    if moves:
        words = "The deformed body."
        line = f'erc_contact.output.draw_deformed({code}, "deformed.png")'
        gallery.add("deformed.png", words, line, partial(draw_deformed, error), is_body=True)
    model = error.model
    for joint in (*model.contacts, *model.ties):
        name = joint.name
        kind = "tied joint" if joint in model.ties else "contact"
        if np.any(error.profile(name)["status"] != OPEN):
            words = f"Traction on the {kind} {joint.title}, of the admissible stress."
            file = f"contact_{file_stem(name)}.png"
            line = f"erc_contact.output.plot_contact({code}, {name!r}, {file!r})"
            gallery.add(file, words, line, partial(plot_contact, error.admissible, name))
    if moves:
        add_view(gallery, error, code)
    for contact in model.contacts:
        add_near(gallery, error, contact.name, code)
    add_states(gallery, error, code)
    if error.absolute > 0:
        words = "Share of each element in eps."
        line = f'erc_contact.output.draw_error({code}, "error_map.png")'
        gallery.add("error_map.png", words, line, partial(draw_error, error), is_body=True)


def _write_profile(comm: MPI.Comm, profile: np.ndarray, path: Path) -> None:
    """Write a profile as CSV, which pandas reads; collective."""
    header = ",".join(profile.dtype.names or ())

    def write() -> None:
        np.savetxt(path, profile, header=header, comments="", delimiter=",", fmt="%.17g")

    on_root(comm, path, write)
