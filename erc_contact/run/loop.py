"""Run adaptively: solve, measure, refine; hold what the run has so far, and end it."""

from __future__ import annotations

import logging
from time import perf_counter

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.pair import equilibrate
from erc_contact.base import checks
from erc_contact.base.exceptions import InputError, together
from erc_contact.base.logs import log_of
from erc_contact.base.percent import percent
from erc_contact.base.progress import stage
from erc_contact.base.runtime.interrupts import Interrupts
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.mesh.domain import Domain
from erc_contact.newton.doubts import DoubtsOfRun
from erc_contact.newton.ladder import NODAL
from erc_contact.newton.solve import DEFAULT, solved
from erc_contact.run.checkpoint import Checkpoint
from erc_contact.run.endings import AT_REST, NO_TRUE_SHAPE, ending
from erc_contact.run.foreseen import too_many_cells
from erc_contact.run.history import History
from erc_contact.run.new_step import new_step
from erc_contact.run.plan import SETTINGS, Plan
from erc_contact.run.step import CURVED, HEADER, Step, line

NEWTON_SHARE = 0.1
"""Share of e that Newton may leave when it stops certified [-]; it adds 0.5% to e.

The error of the mesh to come is taken as 2^-k of the last one: uniform refinement of
degree k leaves no less.
"""


class Loop:
    """Hold what an adaptive run has so far, and go on with it.

    Args:
        plan: What is asked for.
        comm: Communicator of the run.
        store: Where the run is kept, or None.
        quiet: Whether its rows are for debugging only, as in a step of a loading
            history.

    Attributes:
        last: The error that was measured last in this process.
        best: The error of least ``total``.
        doubts: What is doubtful in its solutions; a step of a loading history leaves it
            to the history.
        outcome: Why it ended, in words; empty while it goes on.
        warned: Whether it said that it will have too many cells.
    """

    def __init__(
        self, plan: Plan, comm: MPI.Comm, store: Checkpoint | None, *, quiet: bool = False
    ) -> None:
        self.plan = plan
        self.comm = comm
        self.store = store
        self.quiet = quiet
        self.began = comm.bcast(perf_counter() if comm.rank == 0 else None)
        self.steps: list[Step] = []
        self.meshes: list[tuple[Domain, np.ndarray]] = []
        self.doubts = DoubtsOfRun(comm)
        self.last: ConstitutiveError | None = None
        self.best: ConstitutiveError | None = None
        self.outcome = ""
        self.warned = False

    def go(self, domain: Domain) -> History:
        """Run from a first mesh, or from what is kept, to the end; collective."""
        self._log(HEADER if domain.curved_facets is None else CURVED)
        with Interrupts(self.comm) as interrupts:
            try:
                error = self._resumed() or self._level(domain, None, 0.0, interrupts)
                while not self._ends(error):
                    domain, seconds = self._next(error, interrupts)
                    if domain.cells > self.plan.max_cells:
                        limit = f"max_cells = {self.plan.max_cells}"
                        too_many = f"the next mesh has {domain.cells} cells, more than {limit}"
                        self.outcome = f"Stopped{self.above}: {too_many}."
                        break
                    error = self._level(domain, error, seconds, interrupts)
            except (Exception, KeyboardInterrupt) as failure:
                self._end(failure, interrupts)
            if self.store is not None and self.last is not None:
                self.store.add(self.last, self.steps, last=True)
        return self._history(fallback=self.plan.method is None)

    @property
    def above(self) -> str:
        """Say how far the run came."""
        assert self.best is not None
        return f" at {percent(self.best.total)}, above {percent(self.plan.accuracy)}"

    def _resumed(self) -> ConstitutiveError | None:
        """Make what is kept that of this run; collective.

        Returns:
            The error of the last mesh that is kept, None if there is none.
        """
        store = self.store
        plan = self.plan
        if store is None or not store.numbers:
            return None
        last_number = store.numbers[-1]
        last = store.read(last_number)
        self.steps = list(last.steps)
        self.began -= self.steps[-1].seconds
        least = min(store.numbers, key=lambda number: self.steps[number - 1].total)
        methods = (DEFAULT, NODAL) if plan.method is None else (plan.method,)
        for number in store.numbers:
            level = last if number == last_number else store.read(number)
            self.meshes.append((level.domain, level.indicators))
            # to measure costs an admissible pair, and of the others nothing is needed
            if number in (least, last_number):
                error = level.error(plan.scene, methods, plan.tighten)
                if number == least:
                    self.best = error
        for step in self.steps:
            self._log_row(step, error.domain)
        self.doubts.see(error.solution)
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
        allowed = None
        if plan.stop == "certified" and last is not None:
            allowed = NEWTON_SHARE * last.absolute / 2**plan.degree
        with stage(self.comm, f"mesh {len(self.steps) + 1}, {domain.cells} cells"):
            error = self._measured(domain, last, allowed, interrupts)
        step = self._add(error, mesh_seconds)
        if not self.quiet:
            self.doubts.see(error.solution)
        # the mesh is kept before the callback, which may end the run
        if self.store is not None:
            with stage(self.comm, "keeping the mesh"):
                self.store.add(error, self.steps)
        if plan.callback is not None:
            together(self.comm, plan.callback, error, step)
        interrupts.check()
        return error

    def _measured(
        self,
        domain: Domain,
        last: ConstitutiveError | None,
        allowed: float | None,
        interrupts: Interrupts,
    ) -> ConstitutiveError:
        """Solve on a mesh and measure the error; collective.

        Args:
            domain: The mesh.
            last: The error on the last mesh, whose solution is the first guess.
            allowed: Energy norm that Newton's method may leave [sqrt(force length)], or
                None.
            interrupts: The signals of the run.
        """
        plan = self.plan
        solution = solved(
            plan.scene,
            domain,
            plan.method,
            degree=plan.degree,
            after=plan.after,
            start=last.solution if last else None,
            tolerance=allowed,
            solver=plan.solver,
        )
        interrupts.check()
        with stage(self.comm, "equilibrium"):
            admissible = equilibrate(solution, tighten=plan.tighten)
        interrupts.check()
        with stage(self.comm, "error"):
            return constitutive_error(admissible)

    def _add(self, error: ConstitutiveError, mesh_seconds: float) -> Step:
        """Add a row; collective."""
        step = new_step(error, mesh_seconds, self.began)
        self.steps.append(step)
        self.last = error
        self.meshes.append((error.domain, error.indicators))
        if self.best is None or error.total < self.best.total:
            self.best = error
        self._log_row(step, error.domain)
        return step

    def _log_row(self, step: Step, domain: Domain) -> None:
        """Log the row of a mesh."""
        self._log(line(step, curved=domain.curved_facets is not None))

    def _log(self, text: str, level: int = logging.INFO) -> None:
        """Log a text, for debugging alone if the run is quiet."""
        log_of(self.comm).log(logging.DEBUG if self.quiet else level, text)

    def _ends(self, error: ConstitutiveError) -> bool:
        """Decide whether the run ends with this error; then the outcome says why."""
        plan = self.plan
        best = self.best
        assert best is not None
        if error.solution.at_rest:
            self.outcome = AT_REST
        elif best.total <= plan.accuracy:
            self.outcome = f"Reached: {percent(best.total)} <= {percent(plan.accuracy)}."
        elif len(self.steps) >= plan.max_steps:
            self.outcome = f"Stopped after max_steps = {plan.max_steps} meshes{self.above}."
        elif not self.warned:
            self._warn_of_cells(error)
        return bool(self.outcome)

    def _warn_of_cells(self, error: ConstitutiveError) -> None:
        """Warn before the time is spent that the accuracy takes too many cells."""
        most = self.plan.max_cells
        words = too_many_cells(self.steps, error, self.plan.accuracy, most)
        if words:
            self.warned = True
            log_of(self.comm).warning(f"{words}, it seems; max_cells = {most} will end the run.")

    def _next(self, error: ConstitutiveError, interrupts: Interrupts) -> tuple[Domain, float]:
        """Make the next mesh; collective.

        Returns:
            The mesh, and the wall time of making it [s].
        """
        plan = self.plan
        started = perf_counter()
        with stage(self.comm, f"making mesh {len(self.steps) + 1}"):
            domain = together(self.comm, plan.strategy.next, error, plan.accuracy, plan.max_cells)
        interrupts.check()
        seconds = self.comm.allreduce(perf_counter() - started, MPI.MAX)
        if not isinstance(domain, Domain):
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
        self.outcome = ending(failure, interrupts, self.above)
        if not self.outcome:
            self.outcome = f"Stopped{self.above}: {type(failure).__name__}: {failure}"
            failure.history = self._history(fallback=False)  # type: ignore[attr-defined]
            failure.add_note(
                "The history of the run so far is the attribute `history` of this exception."
            )
            raise failure

    def _history(self, *, fallback: bool) -> History:
        """Make the history, and log its outcome; collective.

        Args:
            fallback: Whether the method was left to the package.
        """
        best = self.best
        assert best is not None
        if fallback:
            self._tell_other_method()
        if not best.domain.knows_shape:
            self.outcome += NO_TRUE_SHAPE
        reached = best.total <= self.plan.accuracy or best.solution.at_rest
        self._log(self.outcome, logging.INFO if reached else logging.WARNING)
        self.doubts.end()
        return History(
            tuple(self.steps),
            self.plan.accuracy,
            reached,
            self.outcome,
            best,
            tuple(self.meshes),
            settings=self.plan.arguments(SETTINGS),
        )

    def _tell_other_method(self) -> None:
        """Add to the outcome on how many meshes the default method did not converge."""
        default = type(DEFAULT).__name__
        others = [step.method for step in self.steps if step.method != default]
        if others:
            meshes = f"{len(others)} of {len(self.steps)} meshes"
            self.outcome += f" {others[0]} on {meshes}, where {DEFAULT} did not converge."
