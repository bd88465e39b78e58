"""Hold what a loading history did: one row a step, and the results at their ends."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.progress import at
from erc_contact.error.bounds import resultant
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.numbers import Bounds
from erc_contact.error.stiffness import stiffness
from erc_contact.output.bounded_forces import bounded_forces, contact_names, forces_in_html
from erc_contact.output.deformed import add_near, draw_deformed
from erc_contact.output.evolutions import animate, moving_side, plot_energies, plot_loop, plot_zones
from erc_contact.output.gallery import Gallery
from erc_contact.output.pictures import add_states
from erc_contact.output.report import evolution_as_code, keep_domain, write_record, write_report
from erc_contact.output.series import write_series
from erc_contact.output.verdict import of_gaps, parted, verdict
from erc_contact.output.view_page import VIEW_FILE, VIEW_WORDS, View
from erc_contact.output.views import show_history
from erc_contact.results import OPEN, SLIP, ContactArea, ContactForce, Force, Maximum, Values
from erc_contact.run.columns import header, line, page_rows
from erc_contact.run.result import RunResult
from erc_contact.run.time_row import ENERGIES, ROW_NUMBERS, SECONDS, TimeStep, columns_of
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base.html import table
from namedmesh.base.names import file_stem
from namedmesh.base.percent import percent
from namedmesh.pictures import on_root

NOTE = (
    "Error, scene, forces and body belong to the end of the last step. In the table of "
    "steps, shear is the shear over the pressure of the first contact, dissipated is the energy "
    "that friction took so far, in_time is what the length of the steps leaves unknown of it, "
    "and balance is what work, stored and plastic energy and work of the contacts leave, over the "
    "greatest energy so far. A step whose stress is round-off of the history ends at rest, with "
    "eps = 0."
)
"""What the report says of the columns."""


@dataclass(frozen=True, eq=False)
class Evolution(RunResult):
    """Hold what a loading history did, one row a step.

    :meth:`save` writes ``report.html`` (one page that holds all it shows, as for
    :class:`History`, with error, scene and forces at the end of the last step),
    ``evolution.csv``, ``evolution.json``, ``energies.png`` (work, strain energy,
    dissipation and their balance), ``view.html`` (the body at all steps in 3D, to turn;
    in the report, too), ``deformed.png``, ``body.vtkhdf`` with all times,
    which opens in ParaView as it is, ``loop_<name>.png`` (force against displacement)
    of each contact that slides with friction, and, in 2D, ``zones_<name>.png`` (open,
    slip and stick along the contact in time) of each that is ever closed. By default
    only those pictures are drawn for which there is time.

    Attributes:
        steps: The rows.
        accuracy: The prescribed relative error of each step.
        reached: Whether the last time was reached, and the accuracy in every step.
        outcome: Why the run ended, in words.
        errors: The error at the end of each step, with admissible pair and solution.
        scene_at: Gives the scene at a time.
        domain: The first mesh.
        settings: The other arguments of the run by their names.

    Example:
        >>> evolution
        <Evolution of 2 steps. All 2 steps to t = 1 are done.>
        >>> evolution.force("bottom").shape, evolution.column("cells")
        ((2, 2), array([16, 16]))
    """

    steps: tuple[TimeStep, ...]
    accuracy: float
    reached: bool
    outcome: str
    errors: tuple[ConstitutiveError, ...] = field(repr=False)
    scene_at: Callable[[float], Scene] = field(repr=False, kw_only=True)
    domain: Domain = field(repr=False, kw_only=True)
    settings: Mapping[str, Any] = field(repr=False, kw_only=True)

    def __repr__(self) -> str:
        """Describe it in a line; ``print`` shows the table."""
        return f"<Evolution of {len(self.steps)} steps. {self.outcome}>"

    def __str__(self) -> str:
        """Write the table, and why the run ended."""
        columns = columns_of(self.steps)
        rows = [line(columns, step) for step in self.steps]
        return "\n".join([header(columns), *rows, self.outcome])

    def _repr_html_(self) -> str:
        """Write the table for a notebook; nothing is computed, so one rank may ask."""
        return self._table(self.outcome)

    def _table(self, caption: str = "") -> str:
        """Write the table as HTML."""
        titles, rows = page_rows(columns_of(self.steps), self.steps)
        return table(rows, titles, caption)

    @property
    def error(self) -> ConstitutiveError:
        """Return the error at the end of the last step."""
        return self.errors[-1]

    def force(self, part: str) -> np.ndarray:
        """Return the resultant on a part at the end of each step; collective.

        Of contacts and tied joints it is in the rows, so that one rank may ask.

        Args:
            part: Name of a boundary part: a contact, a tied joint, a support or a
                loaded part, see :func:`erc_contact.results.force`. Between two bodies
                either side has a name, and their forces are opposite.

        Returns:
            Forces [force], shape (steps, d).

        Raises:
            InputError: If no boundary part has this name.
        """
        model = self.error.model
        for joint in (*model.contacts, *model.ties):
            if part in (joint.name, joint.against):
                # The rows have the force on the side that the scene names first.
                of_first = np.array([step.force[joint.name] for step in self.steps])
                return of_first if part == joint.name else -of_first
        return np.array([error.force(part).force for error in self.errors])

    def profile(self, contact: str) -> list[np.ndarray]:
        """Compute the profile of a contact at the end of each step; collective.

        See :func:`erc_contact.results.profile`.
        """
        return [error.profile(contact) for error in self.errors]

    def contact_area(self, contact: str) -> list[ContactArea]:
        """Find the area of a contact and where it ends, at the end of each step.

        See :func:`erc_contact.results.contact_area`; collective.
        """
        return [error.contact_area(contact) for error in self.errors]

    def contact_force(self, contact: str) -> list[ContactForce]:
        """Sum up forces and pressure of a contact at the end of each step; collective.

        See :func:`erc_contact.results.contact_force`.
        """
        return [error.contact_force(contact) for error in self.errors]

    def at(self, points: Any) -> Values:
        """Evaluate displacement and stresses at the end of each step; collective.

        See :func:`erc_contact.results.at`.
        ``evolution.at((0.0, 7.0)).displacement[:, 0, 0]`` is the displacement along x
        of a point at all times.

        Args:
            points: Points, the same on all ranks [length], shape (n, d) or (d,).

        Returns:
            Values with one axis more, the steps, which comes first: displacement
            (steps, n, d), stresses (steps, n, d, d).
        """
        values = [error.at(points) for error in self.errors]
        return Values(
            np.stack([of_step.displacement for of_step in values]),
            np.stack([of_step.stress for of_step in values]),
            np.stack([of_step.elastic_stress for of_step in values]),
        )

    def stiffness(
        self,
        contact: str,
        part: str,
        direction: Sequence[float],
        between: tuple[int, int] = (-2, -1),
    ) -> Bounds:
        """Compute the stiffness between two steps; collective.

        It is the change of the force of a contact over the change of the mean
        displacement of a part, see :func:`erc_contact.stiffness`.

        Args:
            contact: Name of the contact.
            part: Name of the boundary part that moves.
            direction: d numbers, of any length.
            between: Numbers of both steps, in the order of the rows; by default the
                last two.

        Raises:
            InputError: If a name or the direction is another one, or the part does not
                move along it.
        """
        first, second = (self.errors[number] for number in between)
        return stiffness(first, second, contact, part, direction)

    def along(self, start: Any, stop: Any, count: int = 101) -> list[np.ndarray]:
        """Tabulate displacement and stress along a line at the end of each step.

        See :func:`erc_contact.results.along`; collective.
        """
        return [error.along(start, stop, count) for error in self.errors]

    def maximum(self, quantity: str) -> list[Maximum]:
        """Find the greatest value of a quantity at the end of each step; collective.

        The quantity is "von Mises", "pressure", ...; the result also has its place. See
        :meth:`ConstitutiveError.maximum`.
        """
        return [error.maximum(quantity) for error in self.errors]

    def reactions(self) -> dict[str, Force]:
        """Compute the forces on the body at the end of each step; collective.

        Supports, contacts and loads exert them. See
        :func:`erc_contact.results.reactions`. What exerts no force at a time has the
        force zero there.

        Returns:
            Forces [force], shape (steps, d), and moments [force length], shape (steps,
            1 or 3), by the name of what exerts them; "balance" has their sum.
        """
        of_steps = [error.reactions() for error in self.errors]
        causes: dict[str, None] = {}  # an ordered set
        for reactions in of_steps:
            causes |= dict.fromkeys(reactions)
        balance = of_steps[0]["balance"]
        zero = Force(np.zeros_like(balance.force), np.zeros_like(balance.moment), balance.units)
        history = {}
        for cause in causes:
            forces = [reactions.get(cause, zero) for reactions in of_steps]
            history[cause] = Force(
                np.stack([reaction.force for reaction in forces]),
                np.stack([reaction.moment for reaction in forces]),
                balance.units,
            )
        return history

    def to_csv(self, path: str | Path) -> None:
        """Write the rows as CSV; every rank may call, rank 0 writes."""
        if self.error.domain.comm.rank != 0:
            return
        first = self.steps[0]
        names: list[str] = []
        for contact, force in first.force.items():
            names += [f"force_{contact}_{axis}" for axis in "xyz"[: len(force)]]
        for contact, moment in first.moment.items():
            # in the plane the only moment is that about z
            names += [f"moment_{contact}_{axis}" for axis in "xyz"[-len(moment) :]]
        with Path(path).open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow([*ROW_NUMBERS, *names, *ENERGIES, *SECONDS])
            for step in self.steps:
                row = [getattr(step, name) for name in ROW_NUMBERS]
                for vector in (*step.force.values(), *step.moment.values()):
                    row += vector
                row += [getattr(step, name) for name in (*ENERGIES, *SECONDS)]
                writer.writerow(row)

    def show(self) -> View:
        """Show the body at all steps in 3D, with a slider; collective.

        See :func:`erc_contact.output.show_history`.
        """
        return show_history(self)

    def _draw(self, gallery: Gallery) -> None:
        """Draw the pictures that show something; collective.

        The force of a contact that never slides with friction makes no loop, only
        round-off or a line.
        """
        words = "Energies, and their residual."
        code = 'erc_contact.output.evolutions.plot_energies(evolution, "energies.png")'
        gallery.add("energies.png", words, code, partial(plot_energies, self))
        for contact in self.error.model.contacts:
            name = contact.name
            title = contact.title
            profiles = self.profile(name)
            if any(_slides(profile) for profile in profiles):
                words = f"Shear of the contact {title}, over the displacement."
                file = f"loop_{file_stem(name)}.png"
                # the shear that the moving body exerts takes energy on its way
                side = moving_side(self, contact)
                code = f"erc_contact.output.evolutions.plot_loop(evolution, {side!r}, {file!r})"
                gallery.add(file, words, code, partial(plot_loop, self, side))
            is_ever_closed = any(np.any(profile["status"] != OPEN) for profile in profiles)
            if self.error.domain.dim == 2 and is_ever_closed:
                words = f"Open, slip and stick along the contact {title} in time."
                file = f"zones_{file_stem(name)}.png"
                code = f"erc_contact.output.evolutions.plot_zones(evolution, {name!r}, {file!r})"
                gallery.add(file, words, code, partial(plot_zones, self, name))
        for contact in self.error.model.contacts:
            add_near(gallery, self.error, contact.name, "evolution.error")
        add_states(gallery, self.error, "evolution.error")
        words = f"{VIEW_WORDS} At all steps."
        gallery.add(VIEW_FILE, words, f'evolution.show().save("{VIEW_FILE}")', self._write_view)
        words = "The deformed body at the end."
        code = 'erc_contact.output.draw_deformed(evolution.error, "deformed.png")'
        gallery.add("deformed.png", words, code, partial(draw_deformed, self.error), is_body=True)

    def _write_view(self, path: Path) -> None:
        """Write the page that shows all steps; collective."""
        self.show().save(path)

    def _save(self, folder: Path, gallery: Gallery | None) -> None:
        """Write the files to a folder that exists; collective."""
        comm = self.error.domain.comm
        forces = self.error.reactions()
        on_root(comm, folder / "evolution.csv", lambda: self.to_csv(folder / "evolution.csv"))
        write_record(self, folder / "evolution.json", forces)
        at(comm, "fields at all times")
        write_series(self, folder / "body.vtkhdf")
        if gallery is not None:
            self._draw(gallery)
        length = f"to t = {self.steps[-1].time:g} in {len(self.steps)} steps"
        arguments = {"accuracy": self.accuracy, **self.settings}
        domain_code = keep_domain(self.domain, folder)
        claims, unknown = parted([*verdict(self.error), *of_gaps(self.error)])
        # Each component of a force takes an elastic solve.
        asked = gallery is not None and gallery.has_all_time
        names = contact_names(self.error) if asked else []
        write_report(
            self,
            folder / "report.html",
            f"loading history {length}, each asked for {percent(self.accuracy)}",
            {"Steps": self._table()},
            gallery,
            results=forces_in_html(bounded_forces(self.error, names, resultant)),
            claims=claims,
            unknown=unknown,
            forces=forces,
            code=evolution_as_code(self.scene_at, self.domain, domain_code, arguments),
            note=NOTE,
        )

    def animate(self, path: str | Path, seconds: float = 0.15) -> None:
        """Write a gif of the deformed body in time; collective. It takes 2 s a frame.

        Args:
            path: The file.
            seconds: Time for which each frame is shown [s].
        """
        animate(self, path, seconds)


def _slides(profile: np.ndarray) -> bool:
    """Tell whether a contact slides somewhere with friction."""
    return bool(np.any(profile["status"] == SLIP))
