"""The adaptive loop: solve, measure, refine where the error is, until a prescribed accuracy is reached.

Source of the idea: Coorevits, Hild, Hjiaj.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from time import perf_counter

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.pair import equilibrate
from erc_contact.admissible.tighten.iteration import TIGHTEN
from erc_contact.base import checks
from erc_contact.base.exceptions import InputError, NotConverged, together
from erc_contact.base.interrupts import Interrupts
from erc_contact.base.logs import log_of
from erc_contact.base.percent import percent
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.error.sizes import size_map
from erc_contact.error.strategy import KNOWN, Mark, Strategy
from erc_contact.mesh.domain import Domain
from erc_contact.newton.methods import Method
from erc_contact.newton.solution import Solution
from erc_contact.newton.solve import DEFAULT, check_arguments, solve
from erc_contact.run.history import CURVED, HEADER, History, Step, line
from erc_contact.scene.scene import Scene

SHARE = 0.1
"""Share of e that Newton may leave when it stops certified [-]; it adds 0.5% to e.

The error of the mesh to come is taken as 2^-k of the last one: uniform refinement of degree k leaves no less.
"""
OUT_OF_MEMORY = 55
"""PETSc's code of memory that could not be had, PETSC_ERR_MEM."""


def adapt(
    scene: Scene,
    domain: Domain,
    accuracy: float,
    *,
    method: Method | None = None,
    strategy: Strategy | None = None,
    degree: int = 1,
    stop: str = "converged",
    solver: str = "auto",
    tighten: int = TIGHTEN,
    max_cells: int = 1_000_000,
    max_steps: int = 40,
    callback: Callable[[ConstitutiveError, Step], object] | None = None,
) -> History:
    """Solve a scene to a prescribed accuracy; collective.

    Args:
        scene: The problem.
        domain: The first mesh, coarse.
        accuracy: Prescribed relative error eps (17), > 0, e.g. 0.02. Where a curved body is meshed from its true
            geometry, what its flat facets cost counts, too (``error.total``).
        method: Contact method; by default Nitsche's, or the augmented Lagrangian on meshes where only that one
            converges, as in :func:`solve`; ``Step.method`` and ``outcome`` tell.
        strategy: How the next mesh is made; ``Mark()`` by default, which needs no geometry but the mesh.
        degree: Degree of the displacement, 1 or 2.
        stop: "converged" ends Newton at round-off; "certified" as soon as the rest is at most a tenth of the error of
            the mesh (:data:`SHARE`): it is part of e, which bounds the error of any state.
        solver: "direct", "iterative" or "auto", as in :func:`solve`.
        tighten: Iterations that tighten the admissible stress, as in :func:`equilibrate`.
        max_cells: The run ends before a mesh of more cells is solved.
        max_steps: The run ends after so many meshes.
        callback: ``callback(error, step)`` is called after each mesh on every rank, with the error, from which solution
            and admissible pair can be had, and the row of the table. It ends the run by raising StopIteration.

    Returns:
        The history with the best result. What ends a run before its accuracy is reached is named in ``outcome``, with a
        warning: a limit; a next mesh that cannot be made, or that the scene cannot be solved on; memory that does not
        suffice; Ctrl-C, which ends the run when the stage that is under way has ended. An accuracy that will take more
        cells than the limit is told on the first mesh.

    Raises:
        InputError: If the input cannot be worked with.
        NotConverged: If the contact solve fails on the first mesh.
        Exception: What else is raised on a later mesh, by a strategy or callback of the user's say, has the history so
            far in its attribute ``history``.
    """
    accuracy, max_cells = checks.accuracy("accuracy", accuracy), checks.whole("max_cells", max_cells, 1)
    max_steps, tighten = checks.whole("max_steps", max_steps, 1), checks.whole("tighten", tighten, 0)
    if stop not in ("converged", "certified"):
        raise InputError(f'stop is {stop!r}; allowed are "converged" and "certified".')
    check_arguments(scene, domain, method, degree, solver)
    strategy = Mark() if strategy is None else strategy
    if isinstance(strategy, type) or not callable(getattr(strategy, "next", None)):
        raise InputError(f"strategy is {strategy!r}; give an object, e.g. Mark(), SizeMap(), Uniform().")
    if callback is not None and not callable(callback):
        raise InputError(f"callback is {callback!r}; give a function of (error, step), or None.")
    comm = domain.mesh.comm
    run = _Run(comm, accuracy)
    solution: Solution | None = None
    error: ConstitutiveError | None = None
    mesh_seconds = 0.0
    log_of(comm).info(HEADER if domain.curved_facets is None else CURVED)
    with Interrupts(comm) as interrupts:
        try:
            while not run.outcome:
                allowed = SHARE * error.absolute / 2**degree if stop == "certified" and error is not None else None
                solution = solve(scene, domain, method, degree=degree, start=solution, tolerance=allowed, solver=solver)
                interrupts.check()
                admissible = equilibrate(solution, tighten=tighten)
                interrupts.check()
                error = constitutive_error(admissible)
                step = run.add(error, mesh_seconds)
                if callback is not None:
                    together(comm, callback, error, step)
                interrupts.check()
                if error.total <= accuracy:
                    run.outcome = f"Reached: {percent(error.total)} <= {percent(accuracy)}."
                    break
                if len(run.steps) >= max_steps:
                    run.outcome = f"Stopped after max_steps = {max_steps} meshes{run.above}."
                    break
                if len(run.steps) == 1:
                    _warn(error, accuracy, max_cells)
                started = perf_counter()
                domain = together(comm, strategy.next, error, accuracy, max_cells)
                interrupts.check()
                mesh_seconds = comm.allreduce(perf_counter() - started, MPI.MAX)
                if not isinstance(domain, Domain):
                    raise InputError(f"The strategy gave {checks.told(domain)}; its next() must return a Domain.")
                if domain.cells > max_cells:
                    too_many = f"{domain.cells} cells, more than max_cells = {max_cells}"
                    run.outcome = f"Stopped{run.above}: the next mesh has {too_many}."
        except (Exception, KeyboardInterrupt) as failure:
            run.end(failure, interrupts)
    return run.history(fallback=method is None)


class _Run:
    """What a run has so far.

    Attributes:
        outcome: Why it ended, in words; empty while it goes on.
    """

    def __init__(self, comm: MPI.Comm, accuracy: float) -> None:
        self.comm, self.accuracy = comm, accuracy
        self.began = comm.bcast(perf_counter() if comm.rank == 0 else None)
        self.steps: list[Step] = []
        self.meshes: list[tuple[Domain, np.ndarray]] = []
        self.best: ConstitutiveError | None = None
        self.outcome = ""

    @property
    def above(self) -> str:
        """How far the run came, in words."""
        assert self.best is not None
        return f" at {percent(self.best.total)}, above {percent(self.accuracy)}"

    def add(self, error: ConstitutiveError, mesh_seconds: float) -> Step:
        """Add a row; collective."""
        admissible, scale = error.admissible, error.scale or 1.0
        solution, domain = admissible.solution, admissible.solution.domain
        step = Step(
            cells=domain.cells,
            vertices=domain.vertices,
            dofs=solution.model.V.dofmap.index_map.size_global * domain.dim,
            newton_steps=solution.newton_steps,
            method=type(solution.method).__name__,
            eps=error.relative,
            eps_bulk=error.bulk_error / scale,
            eps_contact=error.contact_error / scale,
            eps_geometry=error.geometry_error / scale,
            solve_seconds=solution.seconds,
            equilibrate_seconds=admissible.seconds,
            error_seconds=error.seconds,
            mesh_seconds=mesh_seconds,
            seconds=self.comm.allreduce(perf_counter() - self.began, MPI.MAX),
        )
        self.steps.append(step)
        self.meshes.append((domain, error.indicators))
        if self.best is None or error.total < self.best.total:
            self.best = error
        log_of(self.comm).info(line(step, curved=domain.curved_facets is not None))
        return step

    def end(self, failure: BaseException, interrupts: Interrupts) -> None:
        """End the run with what it has, or raise: where it has nothing, or for a failure that it does not know."""
        if self.best is None:
            raise failure
        memory = isinstance(failure, MemoryError) or getattr(failure, "ierr", None) == OUT_OF_MEMORY
        if isinstance(failure, (InputError, NotConverged)):
            self.outcome = f"Stopped{self.above}: {failure}"
        elif memory:
            self.outcome = f"Stopped{self.above}: the memory does not suffice for the next mesh ({failure})."
        elif isinstance(failure, StopIteration):
            self.outcome = f"Stopped{self.above}: by the callback. {failure}".rstrip()
        elif interrupts.ended(failure):
            self.outcome = f"Interrupted{self.above}."
        else:
            self.outcome = f"Stopped{self.above}: {type(failure).__name__}: {failure}"
            failure.history = self.history(fallback=False)  # type: ignore[attr-defined]
            failure.add_note("The history of the run so far is the attribute `history` of this exception.")
            raise failure

    def history(self, *, fallback: bool) -> History:
        """The history; ``fallback`` tells that the method was the default one."""
        assert self.best is not None
        other = [step for step in self.steps if fallback and step.method != type(DEFAULT).__name__]
        if other:
            self.outcome += (
                f" {other[0].method} on {len(other)} of {len(self.steps)} meshes, where {DEFAULT} did not converge."
            )
        if self.best.domain.geometry is None:
            self.outcome += " The body is that of the mesh given, with its flat facets: no true shape of it is known."
        reached = self.best.total <= self.accuracy
        log_of(self.comm).log(logging.INFO if reached else logging.WARNING, self.outcome)
        return History(tuple(self.steps), self.accuracy, reached, self.outcome, self.best, tuple(self.meshes))


def _warn(error: ConstitutiveError, accuracy: float, max_cells: int) -> None:
    """Say before the time is spent that even the optimal mesh has too many cells, if the first mesh can know it."""
    cells = size_map(error, accuracy).predicted_cells if error.total <= KNOWN else 0.0
    if cells > max_cells:
        log_of(error.domain.mesh.comm).warning(
            f"{percent(accuracy)} takes some {cells:.2g} cells, it seems; max_cells = {max_cells} will end the run."
        )
