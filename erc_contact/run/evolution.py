"""What a loading history did: one row a step, the results at the ends of the steps, the balance of energy."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.base.html import table
from erc_contact.base.percent import percent
from erc_contact.base.progress import at, stage
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.domain import Domain
from erc_contact.newton.solution import Solution
from erc_contact.output.as_code import evolution_as_code
from erc_contact.output.evolutions import animate, plot_energies, plot_loop, plot_zones
from erc_contact.output.files import made_folder, on_root
from erc_contact.output.pictures import draw_deformed
from erc_contact.output.report import write_record, write_report
from erc_contact.output.series import write_series
from erc_contact.output.verdict import verdict
from erc_contact.results import Force, Maximum, Values
from erc_contact.run.energy import energies
from erc_contact.run.history import History
from erc_contact.run.time_row import (
    ENERGIES,
    HEADER,
    NUMBERS,
    SECONDS,
    SHOWN,
    SUMS,
    TimeStep,
    line,
    shown,
)
from erc_contact.scene.scene import Scene

NOTE = (
    "Error, scene, forces and body are those at the end of the last step. In the table of steps, shear is that of the "
    "first contact over its pressure, dissipated is the energy that friction took so far, in_time is what the length "
    "of the steps leaves unknown of it, and balance is what work, strain energy and work of the contacts leave, over "
    "the larger energy."
)
"""What the report says of the columns."""


def row_of(
    time: float, history: History, last: ConstitutiveError | None, before: TimeStep | None
) -> TimeStep:
    """The row of a step; collective. Its seconds are not known yet.

    Args:
        time: Its end.
        history: The adaptive run at its end.
        last: The error at the end of the last step; None at the first time.
        before: The row of the last step.
    """
    error = history.best
    energy = energies(error, last)
    sums = {name: getattr(before, name) if before else 0.0 for name in SUMS}
    forces = {contact.name: error.force(contact.name) for contact in error.model.contacts}
    return TimeStep(
        time=time,
        cells=error.domain.cells,
        meshes=len(history.steps),
        newton_steps=sum(step.newton_steps for step in history.steps),
        eps=error.relative,
        eps_contact=error.contact_error / (error.scale or 1.0),
        total=error.total,
        reached=history.reached,
        force={name: of.force.tolist() for name, of in forces.items()},
        moment={name: of.moment.tolist() for name, of in forces.items()},
        work=sums["work"] + energy.work,
        contact_work=sums["contact_work"] + energy.contact,
        friction_work=sums["friction_work"] + energy.friction,
        dissipated=sums["dissipated"] + energy.dissipated,
        stored=energy.stored,
        scale=error.scale,
        solve_seconds=sum(step.solve_seconds for step in history.steps),
        equilibrate_seconds=sum(step.equilibrate_seconds for step in history.steps),
        seconds=0.0,
    )


@dataclass(frozen=True, eq=False)
class Evolution:
    """What a loading history did, one row a step.

    Attributes:
        steps: The rows.
        accuracy: The prescribed relative error of each step.
        reached: Whether the last time was reached, and the accuracy in every step.
        outcome: Why the run ended, in words.
        errors: The error at the end of each step, with admissible pair and solution.
        scene_at: Gives the scene at a time.
        domain: The first mesh.
        settings: The other arguments of the run by their names.
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
        """Tell what it is in a line; ``print`` shows the table."""
        return f"<Evolution of {len(self.steps)} steps. {self.outcome}>"

    def __str__(self) -> str:
        return "\n".join([HEADER, *map(line, self.steps), self.outcome])

    def _repr_html_(self) -> str:
        """The table in a notebook; nothing is computed, so one rank alone may ask."""
        return table(map(shown, self.steps), SHOWN, self.outcome)

    @property
    def error(self) -> ConstitutiveError:
        """The error at the end of the last step."""
        return self.errors[-1]

    @property
    def solution(self) -> Solution:
        """The solution at the end of the last step."""
        return self.errors[-1].solution

    def column(self, name: str) -> np.ndarray:
        """One number of each step, e.g. "time", "eps", "dissipated", "imbalance"."""
        return np.array([getattr(step, name) for step in self.steps])

    def force(self, contact: str) -> np.ndarray:
        """The resultant on a contact at the end of each step [force], shape (steps, d).

        Raises:
            InputError: If no contact has this name.
        """
        known = self.steps[0].force
        if contact not in known:
            raise InputError(
                f"No contact is called {contact!r}; this history has {', '.join(sorted(known)) or 'none'}."
            )
        return np.array([step.force[contact] for step in self.steps])

    def profile(self, contact: str) -> list[np.ndarray]:
        """The profile of a contact at the end of each step; see :func:`erc_contact.results.profile`; collective."""
        return [error.profile(contact) for error in self.errors]

    def at(self, points: Any) -> Values:
        """Displacement and stresses at points at the end of each step; see :func:`erc_contact.results.at`; collective.

        ``evolution.at((0.0, 7.0)).displacement[:, 0, 0]`` is the displacement along x
        of a point at all times.

        Args:
            points: Points, the same on all ranks [length], shape (n, d) or (d,).

        Returns:
            Values with one axis more, the steps, which comes first: displacement
                (steps, n, d), stresses
            (steps, n, d, d).
        """
        values = [error.at(points) for error in self.errors]
        return Values(
            np.stack([of_step.displacement for of_step in values]),
            np.stack([of_step.stress for of_step in values]),
            np.stack([of_step.elastic_stress for of_step in values]),
        )

    def maximum(self, quantity: str) -> list[Maximum]:
        """Greatest "von Mises" stress, "pressure", ... at the end of each step, and its place; collective.

        See :meth:`ConstitutiveError.maximum`.
        """
        return [error.maximum(quantity) for error in self.errors]

    def reactions(self) -> dict[str, Force]:
        """Forces of supports, contacts and loads at the end of each step, and their balance; collective.

        See :func:`erc_contact.results.reactions`. A cause that is missing at a time has
        the force zero.

        Returns:
            Forces by their causes, with one axis more, the steps: force (steps, d),
                moment (steps, 1 or 3).
        """
        of_steps = [error.reactions() for error in self.errors]
        causes = list(dict.fromkeys(cause for forces in of_steps for cause in forces))
        balance = of_steps[0]["balance"]
        none = Force(np.zeros_like(balance.force), np.zeros_like(balance.moment))
        found = {}
        for cause in causes:
            forces = [of_step.get(cause, none) for of_step in of_steps]
            found[cause] = Force(
                np.stack([f.force for f in forces]), np.stack([f.moment for f in forces])
            )
        return found

    def to_csv(self, path: str | Path) -> None:
        """Write the rows as CSV; every rank may call, rank 0 writes."""
        if self.error.domain.mesh.comm.rank != 0:
            return
        first = self.steps[0]
        named = [
            f"force_{name}_{axis}" for name, of in first.force.items() for axis in "xyz"[: len(of)]
        ]
        named += [
            f"moment_{name}_{axis}"
            for name, of in first.moment.items()
            for axis in "xyz"[-len(of) :]
        ]
        with Path(path).open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow([*NUMBERS, *named, *ENERGIES, *SECONDS])
            for step in self.steps:
                vectors = [c for of in (step.force, step.moment) for v in of.values() for c in v]
                before, after = (
                    [getattr(step, name) for name in of] for of in (NUMBERS, (*ENERGIES, *SECONDS))
                )
                writer.writerow([*before, *vectors, *after])

    def save(self, folder: str | Path, *, pictures: bool = True) -> None:
        """Write table, report, figures and a ParaView file to a folder; collective.

        ``report.html`` (one page that holds all it shows, as that of
        :meth:`History.save`, with error, scene and forces at the end of the last step),
        ``evolution.csv``, ``evolution.json``, ``energies.png`` (work, strain energy,
        dissipation and their balance), ``deformed.png``, ``body.vtkhdf`` with all
        times, which opens in ParaView as it is, and for each contact
        ``loop_<name>.png`` (force against displacement) and, in 2D,
        ``zones_<name>.png`` (open, slip and stick along the contact in time).

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

    def _draw(self, folder: Path) -> dict[str, str]:
        """Draw all pictures; return their names, and what they show; collective."""
        comm = self.error.domain.mesh.comm
        at(comm, "energies")
        plot_energies(self, folder / "energies.png")
        drawn = {"energies.png": "Energies, and what their balance leaves."}
        for name in self.steps[0].force:
            at(comm, f"contact {name}")
            plot_loop(self, name, folder / f"loop_{name}.png")
            drawn[f"loop_{name}.png"] = f"Shear of the contact {name} against displacement."
            if self.error.domain.dim == 2:
                plot_zones(self, name, folder / f"zones_{name}.png")
                drawn[f"zones_{name}.png"] = (
                    f"Open, slip and stick along the contact {name} in time."
                )
        at(comm, "deformed body")
        draw_deformed(self.error, folder / "deformed.png")
        drawn["deformed.png"] = "The deformed body at the end."
        return drawn

    def _save(self, folder: Path, *, pictures: bool) -> None:
        """Write the files; collective."""
        comm, forces = self.error.domain.mesh.comm, self.error.reactions()
        on_root(comm, folder / "evolution.csv", lambda: self.to_csv(folder / "evolution.csv"))
        write_record(self, folder / "evolution.json", forces)
        at(comm, "fields at all times")
        write_series(self, folder / "body.vtkhdf")
        drawn = self._draw(folder) if pictures else {}
        length = f"to t = {self.steps[-1].time:g} in {len(self.steps)} steps"
        write_report(
            self,
            folder / "report.html",
            f"Loading history {length}, each asked for {percent(self.accuracy)}",
            {"Steps": table(map(shown, self.steps), SHOWN)},
            drawn,
            claims=verdict(self.error),
            forces=forces,
            code=evolution_as_code(
                self.scene_at, self.domain, {"accuracy": self.accuracy, **self.settings}
            ),
            note=NOTE,
        )

    def animate(self, path: str | Path, seconds: float = 0.15) -> None:
        """Write a gif of the deformed body in time, each frame for some seconds; collective. It takes 2 s a frame."""
        animate(self, path, seconds)
