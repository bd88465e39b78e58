"""Walk through a loading history in steps, which are halved where need be.

Friction is about slip rates. In each step it acts on the tangential displacement since
the last one (backward Euler), so what a body does depends on the way its loads came.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from time import perf_counter

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, NotConverged, together
from erc_contact.base.logs import log_of
from erc_contact.base.progress import stage
from erc_contact.base.runtime.interrupts import Interrupts
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.load_work import assemble_number
from erc_contact.error.numbers import ROUND_OFF
from erc_contact.newton.after import check_after
from erc_contact.newton.ladder import NODAL
from erc_contact.newton.plausibility import DoubtsOfRun
from erc_contact.newton.solution import Solution
from erc_contact.newton.solve import solve
from erc_contact.run.checkpoint import Checkpoint
from erc_contact.run.columns import header, line
from erc_contact.run.energy import energies
from erc_contact.run.evolution import Evolution
from erc_contact.run.foreseen import duration
from erc_contact.run.history import History
from erc_contact.run.loop import Loop, ending
from erc_contact.run.plan import SETTINGS, Plan
from erc_contact.run.time_row import SUMS, TimeStep, columns_of
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base import checks
from namedmesh.base.percent import percent

HALVINGS = 8
"""How often a step is halved at most, one after the other."""
LONGER = 0.25
"""Share of the allowed cost below which a step twice as long is tried [-]."""


class Walk:
    """Hold a loading history on its way, and go on with it.

    Args:
        plan: What each step is asked for; its scene is the scene at the first time.
        scene_at: The scene of each time.
        times: The times that are asked for, increasing.
        in_time: What is asked for of the length of the steps.
        callback: Called after each step.
        store: Where the run is kept, or None.
    """

    def __init__(
        self,
        plan: Plan,
        scene_at: Callable[[float], Scene],
        times: list[float],
        in_time: InTime,
        callback: Callable[[ConstitutiveError, TimeStep], object] | None,
        store: Checkpoint | None,
    ) -> None:
        self.plan = plan
        self.scene_at = scene_at
        self.times = times
        self.in_time = in_time
        self.callback = callback
        self.store = store
        self.rows: list[TimeStep] = []
        self.errors: list[ConstitutiveError] = []
        self.length = np.inf  # of the next step in time
        self.outcome = ""

    def go(self, domain: Domain) -> Evolution:
        """Walk from the first time, or from what is kept, to the last; collective."""
        self.domain = domain
        self.comm = domain.comm
        self.log = log_of(self.comm)
        self.doubts = DoubtsOfRun(self.comm, refines=False)
        self.began = self.comm.bcast(perf_counter() if self.comm.rank == 0 else None)
        with Interrupts(self.comm) as interrupts:
            try:
                self._resume()
                if not self.rows:
                    first = self.times[0]
                    self._accept(*self._measure_end(first, self._step(first, None), None, None))
                    interrupts.check()
                for end in self.times[1:]:
                    self._to(end, interrupts)
            except (Exception, KeyboardInterrupt) as failure:
                self._end(failure, interrupts)
        return self._evolution()

    @property
    def time(self) -> float:
        """Return the time at which the history is."""
        return self.rows[-1].time

    def _resume(self) -> None:
        """Take what is kept as the state of this run; collective."""
        store = self.store
        plan = self.plan
        if store is None or not store.numbers:
            return
        assert plan.method is not None
        methods = (plan.method, NODAL)
        level = None
        for number in store.numbers:
            # a step is of no use without the one before it, which is damaged
            if number != len(self.rows) + 1:
                break
            level = store.read(number, level)
            row = TimeStep(**level.about["rows"][-1])
            after = self.errors[-1].solution if self.errors else None
            scene = self._scene(row.time, after)
            self.errors.append(level.error(scene, methods, plan.tighten, after))
            self._add(row)
        store.go_on_from(len(self.rows))
        if self.rows:
            self.began -= self.rows[-1].seconds
        self.log.info("Read from %s; the run goes on from here.", store.folder.path)

    def _to(self, end: float, interrupts: Interrupts) -> None:
        """Make steps to a time.

        Each is halved where it does not converge or is not accurate in time.
        """
        halved = 0
        while self.time < end:
            begin = self.time
            to = until(begin, self.length, end)
            rungs: tuple[str, ...] = ()
            try:
                ended = self._attempt(to)
                ratio, words = self._inaccuracy(ended)
            except NotConverged as failure:
                ratio = np.inf
                words = "does not converge"
                rungs = failure.rungs
            if ratio > 1.0:
                halved += 1
                self.length = 0.5 * (to - begin)
                # times of double precision must tell the halves of the next step apart
                halvable = begin < begin + 0.5 * self.length < begin + self.length
                if halved > HALVINGS or not halvable:
                    raise NotConverged(
                        f"The step from t = {begin:g} to {to:g} {words}, halved {halved} times.",
                        rungs,
                    )
                self.log.info("The step to t = %g %s: the next one is half as long.", to, words)
                continue
            for error, row in ended:
                self._accept(error, row)
                interrupts.check()
            growth = 1.0 if ratio > LONGER else 2.0
            self.length = growth * (to - begin)
            halved = 0

    def _attempt(self, to: float) -> list[tuple[ConstitutiveError, TimeStep]]:
        """Compute the end of a step, or of its halves where the path has an accuracy.

        They are not accepted yet.
        """
        last = self.errors[-1]
        before = self.rows[-1]
        if self.in_time.path is None:
            return [self._measure_end(to, self._step(to, last), last, before)]
        middle = 0.5 * (self.time + to)
        first = self._measure_end(middle, self._step(middle, last), last, before)
        second = self._measure_end(to, self._step(to, first[0]), *first)
        return [first, second]

    def _measure_end(
        self, time: float, history: History, last: ConstitutiveError | None, before: TimeStep | None
    ) -> tuple[ConstitutiveError, TimeStep]:
        """Return the error and the row at the end of a step; collective."""
        return history.best, new_time_step(time, history, last, before)

    def _inaccuracy(self, ended: list[tuple[ConstitutiveError, TimeStep]]) -> tuple[float, str]:
        """Compare a step with its halves, and its dissipation with the unknown part.

        Returns:
            The greatest ratio of an inaccuracy to what is allowed [-], and its words.
        """
        ratios = [(0.0, "")]
        if self.in_time.path is not None:
            error, row = ended[-1]
            last = self.errors[-1].solution
            plan = replace(self.plan, scene=self._scene(row.time, last))
            difference = difference_from_halves(plan, last, error.solution, row.greatest_energy)
            ratios.append((difference / self.in_time.path, "differs from its halves"))
        if self.in_time.accuracy_in_time is not None:
            before = self.rows[-1]
            for _, row in ended:
                unknown = unknown_of_dissipation(row, before, self.in_time.accuracy_in_time)
                ratios.append((unknown, "leaves too much of the dissipated energy unknown"))
                before = row
        return max(ratios)

    def _step(self, to: float, last: ConstitutiveError | None) -> History:
        """Run adaptively at the end of a step, from the last mesh; collective."""
        after = None if last is None else last.solution
        plan = replace(self.plan, scene=self._scene(to, after), after=after)
        domain = self.domain if last is None else last.domain
        with stage(self.comm, f"step to t = {to:g} of {self.times[-1]:g}{self._time_left()}"):
            return Loop(plan, self.comm, None, quiet=True).go(domain)

    def _time_left(self) -> str:
        """Say how long the rest takes if it is as slow as what is done."""
        if len(self.rows) < 2:
            return ""
        first, *_, last = self.rows
        done = last.time - first.time
        seconds = (last.seconds - first.seconds) * (self.times[-1] - last.time) / done
        words = duration(seconds)
        return f"{words} left" if words else ""

    def _scene(self, time: float, after: Solution | None) -> Scene:
        """Make the scene of a time; collective."""
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
        self.errors.append(error)
        self._add(row)
        self.doubts.see(error.solution)
        if self.store is not None:
            self.store.add(error, self.rows)
        if self.callback is not None:
            together(self.comm, self.callback, error, row)

    def _add(self, row: TimeStep) -> None:
        """Add a row, and log it below the header of what the rows so far have."""
        before = header(columns_of(self.rows)) if self.rows else ""
        self.rows.append(row)
        columns = columns_of(self.rows)
        if header(columns) != before:
            self.log.info(header(columns))
        self.log.info(line(columns, row))

    def _end(self, failure: BaseException, interrupts: Interrupts) -> None:
        """End the run with what it has, or raise.

        It raises where it has nothing, or for a failure that it does not know.
        """
        if not self.rows:
            raise failure
        where = f" at t = {self.time:g}, before {self.times[-1]:g}"
        self.outcome = ending(failure, interrupts, where)
        if not self.outcome:
            self.outcome = f"Stopped{where}: {type(failure).__name__}: {failure}"
            failure.history = self._evolution()  # type: ignore[attr-defined]
            failure.add_note("The history so far is the attribute `history` of this exception.")
            raise failure

    def _evolution(self) -> Evolution:
        """Make the history, and log its outcome; collective."""
        count = len(self.rows)
        missed = sum(not row.reached for row in self.rows)
        reached = not self.outcome and not missed
        outcome = self.outcome or f"All {count} steps to t = {self.time:g} are done."
        if missed:
            outcome += f" {missed} of {count} steps are above {percent(self.plan.accuracy)}."
        outcome = outcome.rstrip() + self.doubts.end()
        self.log.log(logging.INFO if reached else logging.WARNING, outcome)
        # A history has no goal.
        names = [name for name in SETTINGS if name != "goal"]
        settings = {"times": self.times, **self.in_time.arguments()}
        return Evolution(
            tuple(self.rows),
            self.plan.accuracy,
            reached,
            outcome,
            tuple(self.errors),
            scene_at=self.scene_at,
            domain=self.domain,
            settings=settings | self.plan.arguments(names),
        )


def new_time_step(
    time: float, history: History, last: ConstitutiveError | None, before: TimeStep | None
) -> TimeStep:
    """Make the row of a step; collective. Its seconds are not known yet.

    Args:
        time: Its end.
        history: The adaptive run at its end.
        last: The error at the end of the last step; None at the first time.
        before: The row of the last step.
    """
    error = history.best
    energy = energies(error, last)
    # energies are sums from the first time on
    sums = dict.fromkeys(SUMS, 0.0)
    greatest_energy = 0.0
    if before is not None:
        sums = {name: getattr(before, name) for name in SUMS}
        greatest_energy = before.greatest_energy
    dissipated = sums["dissipated"] + energy.dissipated
    plastic_work = sums["plastic_work"] + energy.plastic
    # without stress both energies of the step are round-off
    if error.scale > 0:
        greatest_energy = max(greatest_energy, energy.stored, dissipated, plastic_work)
    linearised = error.model.linearised
    state = None if linearised is None else linearised.law.state
    moved = 0.0 if state is None else state.moved
    forces = {}
    moments = {}
    for joint in (*error.model.contacts, *error.model.ties):
        resultant = error.force(joint.name)
        forces[joint.name] = resultant.force.tolist()
        moments[joint.name] = resultant.moment.tolist()
    return TimeStep(
        shear=_shear_of(error),
        time=time,
        cells=error.domain.cells,
        meshes=len(history.steps),
        newton_steps=sum(step.newton_steps for step in history.steps),
        eps=error.relative,
        eps_contact=error.contact_error / (error.scale or 1.0),
        total=error.total,
        reached=history.reached,
        force=forces,
        moment=moments,
        work=sums["work"] + energy.work,
        contact_work=sums["contact_work"] + energy.contact,
        friction_work=sums["friction_work"] + energy.friction,
        dissipated=dissipated,
        stored=energy.stored,
        scale=error.scale,
        solve_seconds=sum(step.solve_seconds for step in history.steps),
        equilibrate_seconds=sum(step.equilibrate_seconds for step in history.steps),
        seconds=0.0,
        greatest_energy=greatest_energy,
        plastic_work=plastic_work,
        moved=moved,
    )


@dataclass(frozen=True)
class InTime:
    """Hold what :func:`erc_contact.evolve` is asked for of the length of its steps.

    Attributes:
        path: Greatest difference of a step from its two halves [-], or None.
        accuracy_in_time: Greatest share of the dissipated energy of a step that its
            length leaves unknown [-], or None.
    """

    path: float | None
    accuracy_in_time: float | None

    @classmethod
    def checked(cls, path: float | None, accuracy_in_time: float | None) -> InTime:
        """Check both accuracies and return them.

        Raises:
            InputError: If an accuracy cannot be worked with.
        """
        if path is not None:
            path = checks.accuracy("path", path)
        if accuracy_in_time is not None:
            accuracy_in_time = checks.accuracy("accuracy_in_time", accuracy_in_time)
        return cls(path, accuracy_in_time)

    def arguments(self) -> dict[str, float | None]:
        """Return both accuracies by their names."""
        return asdict(self)


def until(begin: float, length: float, end: float) -> float:
    """Return where a step of about this length ends; no short one remains."""
    if length >= end - begin:
        return end
    # round-off must not add a step where the length divides the interval
    count = np.ceil((end - begin) / length * (1 - 1e-9))
    if count <= 1:
        return end
    return begin + (end - begin) / count


def unknown_of_dissipation(row: TimeStep, before: TimeStep, accuracy: float) -> float:
    """Compute what a step leaves unknown of its dissipation, over the limit [-].

    Unknown is what the length of the step costs of the energy that friction takes in
    it. The friction part of e^2/2 is in both, and remains where a step is very short.
    So a step is short enough where it leaves less than twice that, the contact part of
    e^2. This ends the halving after a turn of the load, where friction takes little at
    first.

    Args:
        row: The row of the step.
        before: The row of the step before it.
        accuracy: Share of the energy that may be unknown [-].
    """
    unknown = row.in_time - before.in_time
    of_mesh = (row.eps_contact * row.scale) ** 2
    round_off = ROUND_OFF * row.greatest_energy
    allowed = max(accuracy * (row.dissipated - before.dissipated), of_mesh, round_off)
    if allowed > 0:
        return unknown / allowed
    return 0.0


def difference_from_halves(
    plan: Plan, last: Solution, halves: Solution, greatest_energy: float
) -> float:
    """Compute the relative difference of a step from its two halves [-]; collective.

    The displacements at the end are compared, in the energy norm. Where they are small
    in the history, so that their difference may be round-off, it is relative to 1e-6 of
    the greatest ones.

    Args:
        plan: What the step is asked for; its scene is the scene at the end.
        last: The solution at its beginning.
        halves: The solution at its end, after two halves; the step is made again on its
            mesh.
        greatest_energy: The greatest energy of the history [force length].
    """
    whole = solve(
        plan.scene,
        halves.domain,
        plan.method,
        degree=plan.degree,
        solver=plan.solver,
        after=last,
        start=halves,
    )
    difference = halves.u.copy()
    difference.x.array[:] -= whole.u.x.array
    model = halves.model
    square = assemble_number(model.space, model.stiffness(difference, difference))
    size = assemble_number(model.space, model.stiffness(halves.u, halves.u))
    size = max(size, 2 * ROUND_OFF * greatest_energy)
    if size > 0:
        return float(np.sqrt(square / size))
    return 0.0


def _shear_of(error: ConstitutiveError) -> float:
    """Compute shear over pressure of the first contact with friction; collective.

    Returns:
        ``|int r^_t| / int p`` [-], which Coulomb's law bounds by mu whatever the
        normals are; nan without pressure or friction.
    """
    pair = error.admissible
    for traction in pair.tractions:
        contact = traction.contact
        if contact.friction is None:
            continue
        area = contact.trace.here.owned_areas
        # The mean of Bernstein coefficients is the mean of the polynomial.
        pressure = area @ -traction.normal_component.mean(axis=1)
        shear = area @ traction.tangential_part.mean(axis=1)
        sums = pair.model.space.comm.allreduce(np.append(shear, pressure))
        if sums[-1] > 0 and error.scale > 0:
            return float(np.linalg.norm(sums[:-1]) / sums[-1])
        return np.nan
    return np.nan
