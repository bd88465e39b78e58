"""The way through a loading history: steps between the times, which are halved where need be.

Friction is about slip rates. In each step it acts on the tangential displacement since
the last one (backward Euler), so what a body does depends on the way its loads came.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import asdict, replace
from time import perf_counter

import numpy as np
from mpi4py import MPI

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError, NotConverged, together
from erc_contact.base.logs import log_of
from erc_contact.base.percent import percent
from erc_contact.base.progress import stage
from erc_contact.base.runtime.interrupts import Interrupts
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.works import assembled
from erc_contact.mesh.domain import Domain
from erc_contact.newton.after import check_after
from erc_contact.newton.doubts import DoubtsOfRun
from erc_contact.newton.ladder import NODAL
from erc_contact.newton.solution import Solution
from erc_contact.newton.solve import solve
from erc_contact.run.checkpoint import Checkpoint
from erc_contact.run.endings import ending
from erc_contact.run.evolution import Evolution, row_of
from erc_contact.run.history import History
from erc_contact.run.loop import Loop
from erc_contact.run.plan import SETTINGS, Plan
from erc_contact.run.time_row import HEADER, TimeStep, line
from erc_contact.run.time_steps import (
    HALVINGS,
    LONGER,
    InTime,
    unknown_of_dissipation,
    until,
)
from erc_contact.scene.scene import Scene


class Walk:
    """A history on its way.

    Args:
        plan: What each step is asked for; its scene is that of the first time.
        scene_at: The scene of each time.
        times: The times that are asked for, increasing.
        in_time: What is asked for of the length of the steps.
        callback: Called after each step.
        kept: Where the run is kept, or None.
    """

    def __init__(
        self,
        plan: Plan,
        scene_at: Callable[[float], Scene],
        times: list[float],
        in_time: InTime,
        callback: Callable[[ConstitutiveError, TimeStep], object] | None,
        kept: Checkpoint | None,
    ) -> None:
        self.plan, self.scene_at, self.times, self.in_time = plan, scene_at, times, in_time
        self.callback, self.kept = callback, kept
        self.rows: list[TimeStep] = []
        self.errors: list[ConstitutiveError] = []
        self.length = np.inf
        self.outcome = ""

    def go(self, domain: Domain) -> Evolution:
        """Walk from the first time, or from what is kept, to the last; collective."""
        self.domain, self.comm = domain, domain.mesh.comm
        self.log, self.doubts = log_of(self.comm), DoubtsOfRun(self.comm)
        self.began = self.comm.bcast(perf_counter() if self.comm.rank == 0 else None)
        self.log.info(HEADER)
        with Interrupts(self.comm) as interrupts:
            try:
                self._resume()
                if not self.rows:
                    self._accept(
                        *self._ended(self.times[0], self._step(self.times[0], None), None, None)
                    )
                    interrupts.check()
                for end in self.times[1:]:
                    self._to(end, interrupts)
            except (Exception, KeyboardInterrupt) as failure:
                self._end(failure, interrupts)
        return self._evolution()

    @property
    def time(self) -> float:
        """Where the history is."""
        return self.rows[-1].time

    def _resume(self) -> None:
        """What is kept becomes that of this run."""
        kept, plan = self.kept, self.plan
        if kept is None or not kept.numbers:
            return
        level = None
        for number in kept.numbers:
            if number != len(self.rows) + 1:  # one before it is damaged
                break
            level = kept.read(number, level)
            row = TimeStep(**level.about["rows"][-1])
            assert plan.method is not None
            after = self.errors[-1].solution if self.errors else None
            error = level.error(
                self._scene(row.time, after), (plan.method, NODAL), plan.tighten, after
            )
            self.rows.append(row)
            self.errors.append(error)
            self.log.info(line(row))
        kept.go_on_from(len(self.rows))
        self.began -= self.rows[-1].seconds if self.rows else 0.0
        self.log.info("Read from %s; the run goes on from here.", kept.folder.path)

    def _to(self, end: float, interrupts: Interrupts) -> None:
        """Make steps to a time, each of which is halved where it does not converge or is not accurate in time."""
        halved = 0
        while self.time < end:
            begin, to = self.time, until(self.time, self.length, end)
            rungs: tuple[str, ...] = ()
            try:
                ended = self._attempt(to)
                ratio, words = self._inaccuracy(ended)
            except NotConverged as failure:
                ratio, words, rungs = np.inf, "does not converge", failure.rungs
            if ratio > 1.0:
                halved += 1
                self.length = 0.5 * (to - begin)
                if halved > HALVINGS or not begin < begin + 0.5 * self.length < begin + self.length:
                    raise NotConverged(
                        f"The step from t = {begin:g} to {to:g} {words}, halved {halved} times.",
                        rungs,
                    )
                self.log.info("The step to t = %g %s: the next one is half as long.", to, words)
                continue
            for error, row in ended:
                self._accept(error, row)
                interrupts.check()
            self.length = (1.0 if ratio > LONGER else 2.0) * (to - begin)
            halved = 0

    def _attempt(self, to: float) -> list[tuple[ConstitutiveError, TimeStep]]:
        """The ends of a step, or of its two halves where the path has an accuracy, not accepted yet."""
        last, before = self.errors[-1], self.rows[-1]
        if self.in_time.path is None:
            return [self._ended(to, self._step(to, last), last, before)]
        middle = 0.5 * (self.time + to)
        first = self._ended(middle, self._step(middle, last), last, before)
        return [first, self._ended(to, self._step(to, first[0]), *first)]

    def _ended(
        self, time: float, history: History, last: ConstitutiveError | None, before: TimeStep | None
    ) -> tuple[ConstitutiveError, TimeStep]:
        """The error and the row at the end of a step after another one."""
        return history.best, row_of(time, history, last, before)

    def _inaccuracy(self, ended: list[tuple[ConstitutiveError, TimeStep]]) -> tuple[float, str]:
        """How far a step is from its halves and from its accuracy in energy, over what is allowed, and in words."""
        ratios = [(0.0, "")]
        if self.in_time.path is not None:
            error, row = ended[-1]
            last = self.errors[-1].solution
            plan = replace(self.plan, scene=self._scene(row.time, last))
            difference = difference_from_halves(plan, last, error.solution)
            ratios.append((difference / self.in_time.path, "differs from its halves"))
        if self.in_time.accuracy_in_time is not None:
            before = self.rows[-1]
            for _, row in ended:
                unknown = unknown_of_dissipation(row, before, self.in_time.accuracy_in_time)
                ratios.append((unknown, "leaves too much of the dissipated energy unknown"))
                before = row
        return max(ratios)

    def _step(self, to: float, last: ConstitutiveError | None) -> History:
        """The adaptive run at the end of a step, from the mesh where the last one ended."""
        after = None if last is None else last.solution
        plan = replace(self.plan, scene=self._scene(to, after), after=after)
        domain = self.domain if last is None else last.domain
        with stage(self.comm, f"step to t = {to:g}"):
            return Loop(plan, self.comm, None, quiet=True).go(domain)

    def _scene(self, time: float, after: Solution | None) -> Scene:
        """The scene of a time; collective."""
        scene = together(self.comm, self.scene_at, time)
        if not isinstance(scene, Scene):
            raise InputError(
                f"scene_at({time:g}) is {checks.description(scene)}; it must return a Scene."
            )
        if after is not None:
            check_after(scene, after.domain, after)
        return scene

    def _accept(self, error: ConstitutiveError, row: TimeStep) -> None:
        """Add a step; collective."""
        row = replace(row, seconds=self.comm.allreduce(perf_counter() - self.began, MPI.MAX))
        self.rows.append(row)
        self.errors.append(error)
        self.log.info(line(row))
        self.doubts.see(error.solution)
        if self.kept is not None:
            self.kept.add(error, self.rows)
        if self.callback is not None:
            together(self.comm, self.callback, error, row)

    def _end(self, failure: BaseException, interrupts: Interrupts) -> None:
        """End the run with what it has, or raise: where it has nothing, or for a failure that it does not know."""
        if not self.rows:
            raise failure
        at = f" at t = {self.time:g}, before {self.times[-1]:g}"
        self.outcome = ending(failure, interrupts, at)
        if not self.outcome:
            self.outcome = f"Stopped{at}: {type(failure).__name__}: {failure}"
            failure.history = self._evolution()  # type: ignore[attr-defined]
            failure.add_note("The history so far is the attribute `history` of this exception.")
            raise failure

    def _evolution(self) -> Evolution:
        self.doubts.end()
        missed = sum(not row.reached for row in self.rows)
        complete = not self.outcome
        above = (
            f"{missed} of {len(self.rows)} steps are above {percent(self.plan.accuracy)}."
            if missed
            else ""
        )
        done = f"All {len(self.rows)} steps to t = {self.time:g} are done."
        outcome = f"{self.outcome or done} {above}".rstrip()
        self.log.log(logging.INFO if complete and not missed else logging.WARNING, outcome)
        return Evolution(
            tuple(self.rows),
            self.plan.accuracy,
            complete and not missed,
            outcome,
            tuple(self.errors),
            scene_at=self.scene_at,
            domain=self.domain,
            settings={"times": self.times}
            | asdict(self.in_time)
            | {name: getattr(self.plan, name) for name in SETTINGS},
        )


def difference_from_halves(plan: Plan, last: Solution, halves: Solution) -> float:
    """The difference of one step from its two halves, relative in the energy norm [-]; collective.

    Args:
        plan: What the step is asked for; its scene is that of the end.
        last: The solution at its beginning.
        halves: The solution at its end, after two halves; the step is made again on its
            mesh.
    """
    given = plan.scene, halves.domain, plan.method
    whole = solve(*given, degree=plan.degree, solver=plan.solver, after=last, start=halves)
    rest = halves.u.copy()
    rest.x.array[:] -= whole.u.x.array
    square, size = (assembled(halves.model, halves.model.stiffness(v, v)) for v in (rest, halves.u))
    return float(np.sqrt(square / size)) if size > 0 else 0.0
