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
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.domain import Domain
from erc_contact.newton.solution import Solution
from erc_contact.output.as_code import evolution_as_code
from erc_contact.output.evolutions import animate, plot_energies, plot_loop, plot_zones
from erc_contact.output.files import on_root
from erc_contact.output.pictures import draw_deformed
from erc_contact.output.report import write_record, write_report
from erc_contact.output.series import write_series
from erc_contact.output.verdict import verdict
from erc_contact.run.energy import energies
from erc_contact.run.history import History
from erc_contact.scene.scene import Scene

HEADER = "       t  cells meshes  N     eps    cont  shear  dissipated  balance  total"
"""``shear`` is that of the first contact over its pressure, ``balance`` the imbalance over the larger energy."""
WIDTHS = (8, 6, 6, 2, 7, 7, 6, 11, 8, 6)
"""Widths of the columns below it."""
SHOWN = ("t", "cells", "meshes", "Newton", "eps", "contact", "shear", "dissipated", "balance", "seconds")
"""The same columns in notebooks and reports."""
NOTE = (
    "Error, scene, forces and body are those at the end of the last step. In the table of steps, shear is that of the "
    "first contact over its pressure, dissipated is the energy that friction took so far, and balance is what work, "
    "strain energy and work of the contacts leave, over the larger energy."
)
"""What the report says of the columns."""


@dataclass(frozen=True)
class TimeStep:
    """One step of a history; energies are sums from the first time on, from rest.

    Attributes:
        time: Its end.
        cells: Number of elements of the mesh on which it ends.
        meshes: Number of meshes.
        newton_steps: Newton steps on all of them.
        eps: Relative error (17) of the step, given its history.
        eps_contact: Contact part of eps.
        total: Eps with the estimate of the geometry.
        reached: Whether the accuracy was reached.
        force: Resultant on each contact by its name [force], d components.
        moment: Moment about the origin on each contact by its name [force length].
        work: Work of loads and supports [force length].
        contact_work: Work of the contacts on the body [force length].
        dissipated: What friction took [force length]; each step of it is backward Euler's.
        stored: Strain energy of u^ [force length].
        scale: ``|sigma^ + C eps(u^)|``, the norm that eps is relative to [sqrt(force length)].
        solve_seconds: Seconds of the contact solves of the step.
        equilibrate_seconds: Seconds of the admissible pairs of the step.
        seconds: Seconds from the start of the run.
    """

    time: float
    cells: int
    meshes: int
    newton_steps: int
    eps: float
    eps_contact: float
    total: float
    reached: bool
    force: dict[str, list[float]]
    moment: dict[str, list[float]]
    work: float
    contact_work: float
    dissipated: float
    stored: float
    scale: float
    solve_seconds: float
    equilibrate_seconds: float
    seconds: float

    @property
    def imbalance(self) -> float:
        """The sum ``work + contact_work - stored`` [force length], zero for the exact solution of all steps.

        Both fields of the pair are in it, so it is of the order of their errors.
        """
        return self.work + self.contact_work - self.stored

    @property
    def in_time(self) -> float:
        """``-contact_work - dissipated`` [force length], what the length of the steps costs, less for shorter ones.

        The friction part of e^2/2 of the steps is in it, too.
        """
        return -self.contact_work - self.dissipated


def row_of(time: float, history: History, last: ConstitutiveError | None, before: TimeStep | None) -> TimeStep:
    """The row of a step; collective. Its seconds are not known yet.

    Args:
        time: Its end.
        history: The adaptive run at its end.
        last: The error at the end of the last step; None at the first time.
        before: The row of the last step.
    """
    error = history.best
    energy = energies(error, last)
    done = (before.work, before.contact_work, before.dissipated) if before else (0.0, 0.0, 0.0)
    forces = {contact.name: error.force(contact.name) for contact in error.solution.model.contacts}
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
        work=done[0] + energy.work,
        contact_work=done[1] + energy.contact,
        dissipated=done[2] + energy.dissipated,
        stored=energy.stored,
        scale=error.scale,
        solve_seconds=sum(step.solve_seconds for step in history.steps),
        equilibrate_seconds=sum(step.equilibrate_seconds for step in history.steps),
        seconds=0.0,
    )


NUMBERS = ("time", "cells", "meshes", "newton_steps", "eps", "eps_contact", "total", "reached")
ENERGIES = ("work", "contact_work", "dissipated", "stored", "imbalance", "in_time")
SECONDS = ("solve_seconds", "equilibrate_seconds", "seconds")


def shown(row: TimeStep) -> list[str]:
    """The row of a step below :data:`SHOWN`."""
    size = max(row.stored, row.dissipated, 1e-300)
    ratio = "-"
    if row.force:
        force = np.array(next(iter(row.force.values())))
        axis = int(abs(force).argmax())
        rest = np.delete(force, axis)
        ratio = f"{np.linalg.norm(rest) / abs(force[axis]):.4f}" if force[axis] else "-"
    counts = [str(one) for one in (row.cells, row.meshes, row.newton_steps)]
    energies = [f"{row.dissipated:.4g}", f"{row.imbalance / size:.0e}"]
    errors = [percent(row.eps, 3), percent(row.eps_contact, 3)]
    return [f"{row.time:.4g}", *counts, *errors, ratio, *energies, f"{row.seconds:.1f}"]


def line(row: TimeStep) -> str:
    """The row of a step below :data:`HEADER`."""
    return " ".join(f"{entry:>{width}}" for entry, width in zip(shown(row), WIDTHS, strict=True))


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

    def to_csv(self, path: str | Path) -> None:
        """Write the rows as CSV; every rank may call, rank 0 writes."""
        if self.error.domain.mesh.comm.rank != 0:
            return
        first = self.steps[0]
        named = [f"force_{name}_{axis}" for name, of in first.force.items() for axis in "xyz"[: len(of)]]
        named += [f"moment_{name}_{axis}" for name, of in first.moment.items() for axis in "xyz"[-len(of) :]]
        with Path(path).open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow([*NUMBERS, *named, *ENERGIES, *SECONDS])
            for step in self.steps:
                vectors = [c for of in (step.force, step.moment) for v in of.values() for c in v]
                before, after = ([getattr(step, name) for name in of] for of in (NUMBERS, (*ENERGIES, *SECONDS)))
                writer.writerow([*before, *vectors, *after])

    def save(self, folder: str | Path) -> None:
        """Write table, report, figures and a ParaView file to a folder; collective.

        ``report.html`` (one page that holds all it shows, as that of :meth:`History.save`, with error, scene and forces
        at the end of the last step), ``evolution.csv``, ``evolution.json``, ``energies.png`` (work, strain energy,
        dissipation and their balance), ``deformed.png``, ``body.vtkhdf`` with all times, which opens in ParaView as it
        is, and for each contact ``loop_<name>.png`` (force against displacement) and, in 2D, ``zones_<name>.png``
        (open, slip and stick along the contact in time).
        """
        folder, comm, forces = Path(folder), self.error.domain.mesh.comm, self.error.reactions()
        on_root(comm, folder / "evolution.csv", lambda: self.to_csv(folder / "evolution.csv"))
        write_record(self, folder / "evolution.json", forces)
        plot_energies(self, folder / "energies.png")
        pictures = {"energies.png": "Energies, and what their balance leaves."}
        for name in self.steps[0].force:
            plot_loop(self, name, folder / f"loop_{name}.png")
            pictures[f"loop_{name}.png"] = f"Shear of the contact {name} against displacement."
            if self.error.domain.dim == 2:
                plot_zones(self, name, folder / f"zones_{name}.png")
                pictures[f"zones_{name}.png"] = f"Open, slip and stick along the contact {name} in time."
        draw_deformed(self.error, folder / "deformed.png")
        pictures["deformed.png"] = "The deformed body at the end."
        write_series(self, folder / "body.vtkhdf")
        length = f"to t = {self.steps[-1].time:g} in {len(self.steps)} steps"
        write_report(
            self,
            folder / "report.html",
            f"Loading history {length}, each asked for {percent(self.accuracy)}",
            {"Steps": table(map(shown, self.steps), SHOWN)},
            pictures,
            claims=verdict(self.error),
            forces=forces,
            code=evolution_as_code(self.scene_at, self.domain, {"accuracy": self.accuracy, **self.settings}),
            note=NOTE,
        )

    def animate(self, path: str | Path, seconds: float = 0.15) -> None:
        """Write a gif of the deformed body in time, each frame for some seconds; collective. It takes 2 s a frame."""
        animate(self, path, seconds)
