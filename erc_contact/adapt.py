"""The adaptive loop: solve, measure, refine where the error is, until a prescribed accuracy is reached.

Source of the idea: Coorevits, Hild, Hjiaj.
"""

from __future__ import annotations

import csv
import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from math import isfinite
from pathlib import Path
from time import perf_counter

import numpy as np
from mpi4py import MPI

from erc_contact.admissible import TIGHTEN, equilibrate
from erc_contact.domain import Domain
from erc_contact.error import ConstitutiveError, constitutive_error
from erc_contact.exceptions import InputError, NotConverged
from erc_contact.methods import Nitsche
from erc_contact.percent import percent
from erc_contact.scene import Scene
from erc_contact.sizes import size_map
from erc_contact.solve import Solution, solve
from erc_contact.strategy import Mark, Strategy

log = logging.getLogger("erc_contact")

SHARE = 0.1
"""Share of e that Newton may leave when it stops certified [-]; it adds 0.5% to e.

The error of the mesh to come is taken as 2^-k of the last one: uniform refinement of degree k leaves no less.
"""


@dataclass(frozen=True)
class Step:
    """One mesh of an adaptive run; times are wall times, the largest over the ranks [s].

    Attributes:
        cells: Number of elements.
        vertices: Number of vertices.
        dofs: Degrees of freedom.
        newton: Newton steps.
        eps: Relative error (17).
        bulk: Bulk part of eps.
        contact: Contact part of eps.
        geometry: What flat facets of a curved body cost beside eps.
        solve: Seconds of the contact solve.
        equilibrate: Seconds of the admissible pair.
        error: Seconds of the error.
        mesh: Seconds of making this mesh.
        seconds: Seconds from the start of the run to this error, all stages of all meshes.
    """

    cells: int
    vertices: int
    dofs: int
    newton: int
    eps: float
    bulk: float
    contact: float
    geometry: float
    solve: float
    equilibrate: float
    error: float
    mesh: float
    seconds: float


COLUMNS = tuple(f.name for f in fields(Step))
HEADER = "  cells  verts    dofs  N     eps    bulk    cont solve equil error  mesh  total"
CURVED = "  cells  verts    dofs  N     eps    bulk    cont    geom solve equil  total"
"""The header of a body with curved parts, whose facets cost something."""


def _line(step: Step, curved: bool) -> str:
    facts = (
        f"{step.cells:7d} {step.vertices:6d} {step.dofs:7d} {step.newton:2d} {percent(step.eps, 3):>7} "
        f"{percent(step.bulk, 3):>7} {percent(step.contact, 3):>7}"
    )
    times = f"{step.solve:5.2f} {step.equilibrate:5.2f}"
    if curved:
        return f"{facts} {percent(step.geometry, 3):>7} {times} {step.seconds:6.1f}"
    return f"{facts} {times} {step.error:5.2f} {step.mesh:5.2f} {step.seconds:6.1f}"


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
    """

    steps: tuple[Step, ...]
    accuracy: float
    reached: bool
    outcome: str
    best: ConstitutiveError
    meshes: tuple[tuple[Domain, np.ndarray], ...] = field(repr=False)

    def __str__(self) -> str:
        curved = self.best.admissible.solution.domain.marks is not None
        rows = [_line(step, curved) for step in self.steps]
        return "\n".join([CURVED if curved else HEADER, *rows, self.outcome])

    @property
    def error(self) -> ConstitutiveError:
        """The error of least ``total``, ``best`` by its kind: ``history.error.force("bottom")``."""
        return self.best

    @property
    def solution(self) -> Solution:
        """The solution of least error."""
        return self.best.solution

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
        if self.best.admissible.solution.domain.mesh.comm.rank == 0:
            with Path(path).open("w", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS)
                writer.writeheader()
                writer.writerows(asdict(step) for step in self.steps)

    def save(self, folder: str | Path) -> None:
        """Write table, figures, pictures and ParaView files to a folder; collective.

        ``history.csv``, ``error.png`` (error against run time and degrees of freedom), ``meshes.png``,
        ``error_map.png``, ``deformed.png``, ``contact_<name>.png`` for each contact, ``body.vtkhdf`` and
        ``contact_<name>.vtkhdf``.
        """
        from erc_contact import fields, output  # noqa: PLC0415 - plots and pictures are paid for only when asked for

        folder = Path(folder)
        comm = self.best.admissible.solution.domain.mesh.comm
        if comm.rank == 0:
            folder.mkdir(parents=True, exist_ok=True)
        comm.barrier()
        self.to_csv(folder / "history.csv")
        output.plot_history({"adaptive": self}, folder / "error.png")
        output.draw_meshes(self.meshes, folder / "meshes.png")
        output.draw_error(self.best, folder / "error_map.png")
        output.draw_deformed(self.best, folder / "deformed.png")
        for traction in self.best.admissible.tractions:
            output.plot_contact(
                self.best.admissible, traction.contact.name, folder / f"contact_{traction.contact.name}.png"
            )
        fields.write_fields(self.best, folder)


def adapt(
    scene: Scene,
    domain: Domain,
    accuracy: float,
    *,
    method: Nitsche | None = None,
    strategy: Strategy | None = None,
    degree: int = 1,
    stop: str = "converged",
    tighten: int = TIGHTEN,
    max_cells: int = 1_000_000,
    max_steps: int = 40,
) -> History:
    """Solve a scene to a prescribed accuracy; collective.

    Args:
        scene: The problem.
        domain: The first mesh, coarse.
        accuracy: Prescribed relative error eps (17), > 0, e.g. 0.02. Where a curved body is meshed from its true
            geometry, what its flat facets cost counts, too (``error.total``).
        method: Contact method; ``Nitsche()`` by default.
        strategy: How the next mesh is made; ``Mark()`` by default, which needs no geometry but the mesh.
        degree: Degree of the displacement, 1 or 2.
        stop: "converged" ends Newton at round-off; "certified" as soon as the rest is at most a tenth of the error of
            the mesh (:data:`SHARE`): it is part of e, which bounds the error of any state.
        tighten: Iterations that tighten the admissible stress, as in :func:`equilibrate`.
        max_cells: The run ends before a mesh of more cells is solved.
        max_steps: The run ends after so many meshes.

    Returns:
        The history with the best result. A limit that ends the run is named in ``outcome``, with a warning; so is a
        next mesh that cannot be made. An accuracy that will take more cells than the limit is told on the first mesh.

    Raises:
        InputError: If the input cannot be worked with.
        NotConverged: If the contact solve fails on the first mesh; on a later one the run ends with what it has.
    """
    if not (isinstance(accuracy, (int, float)) and isfinite(accuracy) and accuracy > 0):
        raise InputError(f"accuracy is {accuracy!r}; it must be a relative error > 0, e.g. 0.02 for 2%.")
    if max_steps < 1 or max_cells < 1:
        raise InputError(f"max_steps is {max_steps} and max_cells {max_cells}; both must be >= 1.")
    if stop not in ("converged", "certified"):
        raise InputError(f'stop is {stop!r}; allowed are "converged" and "certified".')
    comm = domain.mesh.comm
    strategy = strategy or Mark()
    began = comm.bcast(perf_counter() if comm.rank == 0 else None)
    steps: list[Step] = []
    meshes: list[tuple[Domain, np.ndarray]] = []
    best: ConstitutiveError | None = None
    error: ConstitutiveError | None = None
    solution, mesh_seconds = None, 0.0
    curved = domain.marks is not None
    log.info(CURVED if curved else HEADER)
    while True:
        try:
            allowed = SHARE * error.absolute / 2**degree if stop == "certified" and error is not None else None
            solution = solve(scene, domain, method, degree=degree, start=solution, accuracy=allowed)
        except NotConverged as failure:
            if best is None:
                raise
            return _ended(steps, meshes, accuracy, best, f"Stopped: {failure}")
        admissible = equilibrate(solution, tighten=tighten)
        error = constitutive_error(admissible)
        scale = error.scale or 1.0
        steps.append(
            Step(
                cells=domain.cells,
                vertices=domain.vertices,
                dofs=solution.model.V.dofmap.index_map.size_global * domain.dim,
                newton=solution.newton_steps,
                eps=error.relative,
                bulk=error.bulk / scale,
                contact=error.contact / scale,
                geometry=error.geometry / scale,
                solve=solution.seconds,
                equilibrate=admissible.seconds,
                error=error.seconds,
                mesh=mesh_seconds,
                seconds=comm.allreduce(perf_counter() - began, MPI.MAX),
            )
        )
        meshes.append((domain, error.cells))
        log.info(_line(steps[-1], curved))
        if best is None or error.total < best.total:
            best = error
        if error.total <= accuracy:
            return _ended(steps, meshes, accuracy, best, f"Reached: {percent(error.total)} <= {percent(accuracy)}.")
        if len(steps) == max_steps:
            text = f"Stopped after max_steps = {max_steps} meshes at {percent(best.total)}, above {percent(accuracy)}."
            return _ended(steps, meshes, accuracy, best, text)
        if len(steps) == 1:
            _warn(error, accuracy, max_cells)
        started = perf_counter()
        try:
            domain = strategy.next(error, accuracy, max_cells)
        except InputError as failure:
            text = f"Stopped at {percent(best.total)}, above {percent(accuracy)}: {failure}"
            return _ended(steps, meshes, accuracy, best, text)
        mesh_seconds = comm.allreduce(perf_counter() - started, MPI.MAX)
        if domain.cells > max_cells:
            text = (
                f"Stopped at {percent(best.total)}, above {percent(accuracy)}: the next mesh has "
                f"{domain.cells} cells, more than max_cells = {max_cells}."
            )
            return _ended(steps, meshes, accuracy, best, text)


def _warn(error: ConstitutiveError, accuracy: float, max_cells: int) -> None:
    """Say before the time is spent that even the optimal mesh, as far as one mesh can tell, has too many cells."""
    cells = size_map(error, accuracy).cells
    if cells > max_cells:
        log.warning(
            f"{percent(accuracy)} takes some {cells:.2g} cells, it seems; max_cells = {max_cells} will end the run."
        )


def _ended(
    steps: Sequence[Step],
    meshes: Sequence[tuple[Domain, np.ndarray]],
    accuracy: float,
    best: ConstitutiveError,
    outcome: str,
) -> History:
    reached = best.total <= accuracy
    if best.admissible.solution.domain.geometry is None:
        outcome += " The body is that of the mesh given, with its flat facets: no true shape of it is known."
    log.log(logging.INFO if reached else logging.WARNING, outcome)
    return History(tuple(steps), accuracy, reached, outcome, best, tuple(meshes))
