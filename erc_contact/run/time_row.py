"""Hold and print a row of the table of a loading history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erc_contact.run.columns import Column
from namedmesh.base.percent import percent

ROW_NUMBERS = (
    "time",
    "cells",
    "meshes",
    "newton_steps",
    "eps",
    "eps_contact",
    "total",
    "reached",
    "moved",
)
"""Columns of the CSV file before forces and moments."""
SUMS = ("work", "contact_work", "friction_work", "dissipated", "plastic_work")
"""Energies of all steps so far."""
ENERGIES = (*SUMS, "stored", "imbalance", "in_time")
"""Columns of the CSV file after forces and moments: energies [force length]."""
SECONDS = ("solve_seconds", "equilibrate_seconds", "seconds")
"""Columns of the CSV file at its end: times [s]."""


@dataclass(frozen=True)
class TimeStep:
    """Hold the numbers of one step of a loading history.

    Energies are sums from the first time on, from rest.

    Attributes:
        time: Its end.
        cells: Number of elements of the mesh on which it ends.
        meshes: Number of meshes.
        newton_steps: Newton steps on all of them.
        eps: Relative error (17) of the step, given its history.
        eps_contact: Contact part of eps.
        total: Eps with the estimate of the geometry.
        reached: Whether the accuracy was reached.
        force: Resultant on each contact and tied joint by its name [force], d
            components.
        moment: Moment about the origin on each of them by its name [force length].
        work: Work of loads and supports [force length].
        contact_work: Work of the contacts on the body [force length].
        friction_work: Work of friction on the slip of the steps; in contact_work up to
            the errors of the steps.
        dissipated: What friction took [force length], of second order in the length of
            the steps; see :mod:`erc_contact.run.energy`.
        stored: Strain energy of u^ [force length]; of a body with plastic strain the
            elastic energy.
        scale: ``|sigma^ + C eps(u^)|``, the norm that eps is relative to [sqrt(force
            length)].
        solve_seconds: Seconds of the contact solves of the step.
        equilibrate_seconds: Seconds of the admissible pairs of the step.
        seconds: Seconds from the start of the run.
        greatest_energy: The greatest strain energy or dissipation so far [force
            length], without those that are round-off.
        plastic_work: What plastic strains took [force length], heat and the energy of
            hardening, of second order in the length of the steps.
        shear: Shear over pressure of the first contact with friction [-], the length of
            the resultant of r^_t over the sum of the pressure; nan without pressure or
            friction.
        moved: What a new mesh changed of the plastic strain and the hardening from
            which the step begins [-], 0 on the same mesh and where cells are refined.

    Example:
        >>> step = evolution.steps[-1]
        >>> f"t = {step.time:g}, {step.cells} cells, eps = {step.eps:.0%}"
        't = 1, 16 cells, eps = 12%'
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
    friction_work: float
    dissipated: float
    stored: float
    scale: float
    solve_seconds: float
    equilibrate_seconds: float
    seconds: float
    greatest_energy: float = 0.0
    plastic_work: float = 0.0
    moved: float = 0.0
    shear: float = np.nan

    @property
    def imbalance(self) -> float:
        """Compute the energy residual of the meshes [force length].

        It is ``work + contact_work - plastic_work - stored``, zero for the exact
        solution of all steps. Both fields of the pair are in it, so it is of the order
        of their errors. The work of moduli and springs that change in time is in it,
        too.
        """
        return self.work + self.contact_work - self.plastic_work - self.stored

    @property
    def in_time(self) -> float:
        """Estimate what the length of the steps costs [force length].

        It is ``dissipated + friction_work``. Both are of second order in the length of
        the steps, and differ where a point begins to slide, or turns. The friction part
        of e^2/2 of the steps is in it, too. Below zero is at most what new meshes lose
        of the tractions of the last step. See :mod:`erc_contact.run.energy`.
        """
        return self.dissipated + self.friction_work


def _balance(row: TimeStep) -> str:
    """Write the energy residual over the greatest energy so far."""
    if row.greatest_energy <= 0:
        return "-"
    return f"{row.imbalance / row.greatest_energy:.0e}"


def _shear(row: TimeStep) -> str:
    """Write shear over pressure."""
    return "-" if np.isnan(row.shear) else f"{row.shear:.4f}"


CONTACT = "a contact"
FRICTION = "a contact with friction"
"""What columns need."""
SHOWN = (
    Column("t", "t", 8, lambda row: f"{row.time:.4g}"),
    Column("cells", "cells", 6, lambda row: str(row.cells)),
    Column("meshes", "meshes", 6, lambda row: str(row.meshes)),
    Column("N", "Newton", 2, lambda row: str(row.newton_steps)),
    Column("eps", "eps", 7, lambda row: percent(row.eps, 3)),
    Column("cont", "contact", 7, lambda row: percent(row.eps_contact, 3), CONTACT),
    Column("shear", "shear", 6, _shear, FRICTION),
    Column("dissipated", "dissipated", 11, lambda row: f"{row.dissipated:.4g}", FRICTION),
    Column("in_time", "in_time", 8, lambda row: f"{row.in_time:.1e}", FRICTION),
    Column("balance", "balance", 8, _balance),
    Column("seconds", "seconds", 7, lambda row: f"{row.seconds:.1f}"),
)
"""Columns of the table.

"cont" is the contact part of eps, "shear" the shear over the pressure of the first
contact with friction, "balance" the energy residual over the greatest energy so far.
"""


def columns_of(rows: Sequence[TimeStep]) -> list[Column]:
    """Return the columns that mean something in the rows of a history."""
    has_friction = any(row.dissipated != 0 or not np.isnan(row.shear) for row in rows)
    has_contact = has_friction or any(row.eps_contact > 0 for row in rows)
    has = {"": True, CONTACT: has_contact, FRICTION: has_friction}
    return [column for column in SHOWN if has[column.needs]]
