"""Run adaptively: solve, measure, refine; hold what the run has so far, and end it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import suppress
from time import perf_counter
from typing import Protocol

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.balance_parts import TooCoarse
from erc_contact.admissible.equilibrate import equilibrate
from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError, NotConverged, together
from erc_contact.base.logs import log_of
from erc_contact.base.progress import stage
from erc_contact.base.runtime.interrupts import Interrupts
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.error.numbers import Bounds
from erc_contact.error.optimal import SizeMap
from erc_contact.newton.ladder import NODAL
from erc_contact.newton.methods import DEFAULT
from erc_contact.newton.plausibility import DoubtsOfRun, check_upright
from erc_contact.newton.solve import solve_quietly
from erc_contact.results.peaks import peaks
from erc_contact.run.checkpoint import Checkpoint
from erc_contact.run.columns import header, line
from erc_contact.run.foreseen import mesh_under_way, too_many_cells
from erc_contact.run.history import History
from erc_contact.run.plan import SETTINGS, Plan
from erc_contact.run.step import Step, columns_of
from namedmesh import Domain
from namedmesh.base import checks
from namedmesh.base.percent import percent

NEWTON_SHARE = 0.1
"""Share of e that Newton may leave when it stops certified [-]; it adds 0.5% to e.

The error of the mesh to come is taken as 2^-k of the last one: uniform refinement of
degree k leaves no less.
"""
OUT_OF_MEMORY = 55
"""PETSc's code of memory that could not be had, PETSC_ERR_MEM."""
AT_REST = "The body is at rest: nothing loads or strains it, so that it has no stress and no error."
"""Outcome of a run whose body is at rest."""
NO_STRESS = (
    "The body has no stress but round-off: it moves as a rigid body or expands freely. Its "
    "relative error is zero by convention."
)
"""Outcome of a run whose body has no stress."""
NO_TRUE_SHAPE = " The body is the given mesh with its flat facets: no true shape of it is known."
"""End of the outcome where the geometry of the body is unknown."""


def ending(failure: BaseException, interrupts: Interrupts, where: str) -> str:
    """Return the outcome of a run that a failure ends; "" if it must be raised.

    Args:
        failure: What was raised.
        interrupts: The signals of the run.
        where: How far it came, e.g. " at t = 1".
    """
    if isinstance(failure, (InputError, NotConverged)):
        return f"Stopped{where}: {failure}"
    petsc_code = getattr(failure, "ierr", None)
    if isinstance(failure, MemoryError) or petsc_code == OUT_OF_MEMORY:
        return f"Stopped{where}: the memory does not suffice for what comes next ({failure})."
    if isinstance(failure, StopIteration):
        return f"Stopped{where}: by the callback. {failure}".rstrip()
    if interrupts.ended(failure):
        return f"Interrupted{where}."
    return ""


def other_methods(steps: Sequence[Step]) -> str:
    """Say on how many meshes the default method did not converge; empty if on none."""
    default = type(DEFAULT).__name__
    others = [step.method for step in steps if step.method != default]
    if not others:
        return ""
    meshes = f"{len(others)} of {len(steps)} meshes"
    return f" {others[0]} on {meshes}, where {DEFAULT} did not converge."


class Aiming(Protocol):
    """Follow the goal of a run; collective.

    See :class:`erc_contact.error.goals.controller.GoalController`.

    Attributes:
        before: What was carried to the last mesh.
    """

    before: dict[str, float]

    @property
    def bounds(self) -> Bounds | None: ...  # noqa: D102

    @property
    def reached(self) -> bool: ...  # noqa: D102

    @property
    def words(self) -> str: ...  # noqa: D102

    def measure(self, error: ConstitutiveError, carried: dict[str, float] | None) -> None:
        """Measure the interval on a mesh, or estimate it."""

    def finish(self, error: ConstitutiveError) -> None:
        """Measure the interval on the last mesh of a run."""

    def marked(self, error: ConstitutiveError) -> ConstitutiveError:
        """Return an error whose cells count by their share in the interval."""


class Loop:
    """Hold what an adaptive run has so far, and go on with it.

    Args:
        plan: What is asked for.
        comm: Communicator of the run.
        store: Where the run is kept, or None.
        aim: What follows its goal, or None without.
        quiet: Whether its rows are for debugging only, as in a step of a loading
            history.

    Attributes:
        aimed: The error on the mesh for which the aim was asked last.
        carried: What the aim carried to the last mesh.
        last: The error that was measured last in this process.
        best: The error of least ``total``.
        doubts: What is doubtful in its solutions; steps of a history leave it to that.
        outcome: Why it ended, in words; empty while it goes on.
        warned: Whether it said that it will have too many cells.
    """

    def __init__(
        self,
        plan: Plan,
        comm: MPI.Comm,
        store: Checkpoint | None,
        *,
        aim: Aiming | None = None,
        quiet: bool = False,
    ) -> None:
        self.plan = plan
        self.comm = comm
        self.store = store
        self.quiet = quiet
        self.began = comm.bcast(perf_counter() if comm.rank == 0 else None)
        self.steps: list[Step] = []
        self.meshes: list[tuple[Domain, np.ndarray]] = []
        self.doubts = DoubtsOfRun(comm, refines=True)
        self.last: ConstitutiveError | None = None
        self.best: ConstitutiveError | None = None
        self.outcome = ""
        self.aim = aim
        self.aimed: ConstitutiveError | None = None
        self.carried: dict[str, float] = {}
        self.warned = False

    def go(self, domain: Domain) -> History:
        """Run from a first mesh, or from what is kept, to the end; collective."""
        curved = domain.curved_facets is not None
        self.columns = columns_of(curved=curved, has_contact=bool(self.plan.scene.contacts))
        self._log(header(self.columns))
        with Interrupts(self.comm) as interrupts:
            try:
                error = self._resume() or self._level(domain, None, 0.0, interrupts)
                while not self._ends(error):
                    domain, seconds = self._next(error, interrupts)
                    if domain.cells > self.plan.max_cells:
                        most = self.plan.max_cells
                        words = f"{domain.cells} cells, more than max_cells = {most}"
                        if not self._knows_goal():
                            self.outcome = f"Stopped{self.above}: the next mesh has {words}."
                        break
                    error = self._level(domain, error, seconds, interrupts)
            except (Exception, KeyboardInterrupt) as failure:
                self._end(failure, interrupts)
            if self.store is not None and self.last is not None:
                self.store.add(self.last, self.steps, self.carried, last=True)
        return self._history(fallback=self.plan.method is None)

    @property
    def above(self) -> str:
        """Say how far the run came."""
        assert self.best is not None
        if self.aim is not None:
            return f": {self.aim.words}, above {percent(self.plan.accuracy)}"
        return f" at {percent(self.best.total)}, above {percent(self.plan.accuracy)}"

    def _resume(self) -> ConstitutiveError | None:
        """Take what is kept as the state of this run; collective.

        Returns:
            The error of the last mesh that is kept, None if there is none.
        """
        store = self.store
        plan = self.plan
        if store is None or not store.numbers:
            return None
        methods = (DEFAULT, NODAL) if plan.method is None else (plan.method,)
        kept = store.read_all(plan.scene, methods, plan.tighten)
        error = kept.last
        self.steps = kept.steps
        self.meshes = kept.meshes
        self.best = kept.best
        self.began -= self.steps[-1].seconds
        for step in self.steps:
            self._log(line(self.columns, step))
        self.doubts.see(error.solution)
        self._aim(error, kept.carried)
        log_of(self.comm).info("Read from %s; the run goes on from here.", store.folder.path)
        return error

    def _level(
        self,
        domain: Domain,
        last: ConstitutiveError | None,
        mesh_seconds: float,
        interrupts: Interrupts,
    ) -> ConstitutiveError:
        """Solve on a mesh, measure, add the row, keep it; collective."""
        plan = self.plan
        target = None if self.aim else plan.accuracy
        with stage(self.comm, mesh_under_way(self.steps, domain.cells, target)):
            error = self._measure(domain, last, interrupts)
        step = self._add(error, mesh_seconds)
        self._aim(error)
        if not self.quiet:
            self.doubts.see(error.solution)
        # the mesh is kept before the callback, which may end the run
        if self.store is not None:
            with stage(self.comm, "keeping the mesh"):
                self.store.add(error, self.steps, self.carried)
        if plan.callback is not None:
            together(self.comm, plan.callback, error, step)
        interrupts.check()
        return error

    def _aim(self, error: ConstitutiveError, carried: dict[str, float] | None = None) -> None:
        """Measure the interval of the goal, if the run has a goal; collective."""
        if self.aim is None or error.solution.at_rest:
            return
        self.aimed = error
        with stage(self.comm, "interval of the goal"):
            self.aim.measure(error, carried)
        self.carried = self.aim.before
        self._log(self.aim.words)

    def _measure(
        self, domain: Domain, last: ConstitutiveError | None, interrupts: Interrupts
    ) -> ConstitutiveError:
        """Solve on a mesh from the last solution, and measure the error; collective.

        A strategy needs an error, which needs a pair: where facets are too large for
        tractions that balance the loads, the mesh is refined there first.
        """
        plan = self.plan
        # The energy norm that Newton's method may leave, None for round-off.
        allowed = None
        if plan.stop == "certified" and last is not None:
            allowed = NEWTON_SHARE * last.absolute / 2**plan.degree
        start = last.solution if last else None
        admissible: Admissible | None = None
        while admissible is None:
            solution = solve_quietly(
                plan.scene,
                domain,
                plan.method,
                degree=plan.degree,
                after=plan.after,
                start=start,
                tolerance=allowed,
                solver=plan.solver,
            )
            interrupts.check()
            try:
                with stage(self.comm, "equilibrium"):
                    admissible = equilibrate(solution, tighten=plan.tighten)
            except TooCoarse as coarse:
                words = f"{domain.cells} cells: no pair, refined where contacts press."
                start = solution
                domain = domain.refined(coarse.cells)
                if domain.cells > plan.max_cells:
                    most = f"{domain.cells} cells, more than max_cells = {plan.max_cells}"
                    told = f"{coarse} The run has refined there, and the next mesh has {most}."
                    raise TooCoarse(told, coarse.cells) from coarse
                self._log(words)
            interrupts.check()
        with stage(self.comm, "error"):
            error = constitutive_error(admissible)
        check_upright(solution, error.relative)
        return error

    def _add(self, error: ConstitutiveError, mesh_seconds: float) -> Step:
        """Add a row; collective."""
        step = new_step(error, mesh_seconds, self.began)
        self.steps.append(step)
        self.last = error
        self.meshes.append((error.domain, error.indicators))
        if self.best is None or error.total < self.best.total:
            self.best = error
        self._log(line(self.columns, step))
        return step

    def _log(self, text: str, level: int = logging.INFO) -> None:
        """Log a text, for debugging alone if the run is quiet."""
        log_of(self.comm).log(logging.DEBUG if self.quiet else level, text)

    def _ends(self, error: ConstitutiveError) -> bool:
        """Decide whether the run ends with this error; then the outcome says why."""
        plan, best = self.plan, self.best
        assert best is not None
        is_last = len(self.steps) >= plan.max_steps
        if is_last:
            self._knows_goal()
        if error.solution.at_rest:
            self.outcome = AT_REST
        elif self.aim is not None and self.aim.reached:
            self.outcome = f"Reached: {self.aim.words}."
        elif self.aim is None and error.scale == 0:
            self.outcome = NO_STRESS
        elif self.aim is None and best.total <= plan.accuracy:
            self.outcome = f"Reached: {percent(best.total)} <= {percent(plan.accuracy)}."
        elif is_last:
            self.outcome = f"Stopped after max_steps = {plan.max_steps} meshes{self.above}."
        elif self.aim is None and not self.warned:
            by_sizes = isinstance(plan.strategy, SizeMap)
            words = too_many_cells(self.steps, error, plan.accuracy, plan.max_cells, by_sizes)
            self.warned = bool(words)
            if words:
                log_of(self.comm).warning(words)
        return bool(self.outcome)

    def _knows_goal(self) -> bool:
        """Measure the goal where the run ends; say so if it is reached; collective."""
        if self.aim is None or self.aimed is None:
            return False
        with suppress(InputError):
            self.aim.finish(self.aimed)
        if self.aim.reached:
            self.outcome = f"Reached: {self.aim.words}."
        return self.aim.reached

    def _next(self, error: ConstitutiveError, interrupts: Interrupts) -> tuple[Domain, float]:
        """Make the next mesh, and tell the wall time of making it [s]; collective.

        Raises:
            InputError: If the strategy returns no Domain on some rank.
        """
        plan = self.plan
        seen = error if self.aim is None else self.aim.marked(error)
        with stage(self.comm, f"making mesh {len(self.steps) + 1}"):
            started = perf_counter()
            domain = together(self.comm, plan.strategy.next, seen, plan.accuracy, plan.max_cells)
            interrupts.check()
            seconds = self.comm.allreduce(perf_counter() - started, MPI.MAX)
        if not self.comm.allreduce(isinstance(domain, Domain), MPI.LAND):
            raise InputError(
                f"The strategy gave {checks.description(domain)}; its next() must return a Domain."
            )
        return domain, seconds

    def _end(self, failure: BaseException, interrupts: Interrupts) -> None:
        """End the run with what it has, or raise.

        It raises where it has nothing, or for a failure that it does not know.
        """
        if self.best is None:
            raise failure
        if isinstance(failure, (InputError, NotConverged)) and self._knows_goal():
            return
        self.outcome = ending(failure, interrupts, self.above)
        if not self.outcome:
            self.outcome = f"Stopped{self.above}: {type(failure).__name__}: {failure}"
            failure.history = self._history(fallback=False)  # type: ignore[attr-defined]
            failure.add_note("The attribute `history` of this exception has the run so far.")
            raise failure

    def _history(self, *, fallback: bool) -> History:
        """Make the history, and log its outcome and other methods taken; collective."""
        best = self.best
        assert best is not None
        if fallback:
            self.outcome += other_methods(self.steps)
        if not best.domain.knows_shape:
            self.outcome += NO_TRUE_SHAPE
        self.outcome += self.doubts.end()
        is_met = self.aim.reached if self.aim else best.total <= self.plan.accuracy
        reached = is_met or best.solution.at_rest
        self._log(self.outcome, logging.INFO if reached else logging.WARNING)
        return History(
            tuple(self.steps),
            self.plan.accuracy,
            reached,
            self.outcome,
            best,
            tuple(self.meshes),
            settings=self.plan.arguments(SETTINGS),
            bounds=self.aim.bounds if self.aim else None,
        )


def new_step(error: ConstitutiveError, mesh_seconds: float, began: float) -> Step:
    """Make the row of a mesh; collective.

    Args:
        error: The error on the mesh.
        mesh_seconds: Wall time of making the mesh [s].
        began: Time at which the run began, as ``perf_counter`` has it [s].
    """
    admissible = error.admissible
    solution = admissible.solution
    model = solution.model
    domain = solution.domain
    scale = error.scale or 1.0
    greatest = peaks(admissible)
    return Step(
        cells=domain.cells,
        vertices=domain.vertices,
        dofs=model.space.V.dofmap.index_map.size_global * domain.dim,
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
        seconds=model.space.comm.allreduce(perf_counter() - began, MPI.MAX),
        **greatest,
    )
