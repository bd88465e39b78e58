"""Newton's method for a contact problem: PETSc's SNES, in scaled variables.

Displacements are divided by their size and forces by the size of forces that cancel.
Otherwise the bisection line search, which has absolute tolerances, would depend on the
units.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.base.progress import at
from erc_contact.base.runtime.interrupts import check_interrupts, interrupted
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.newton.forms import Counts
from erc_contact.newton.ladder import Attempt, Shares
from erc_contact.newton.linear.mumps import LIBRARY, ZERO_PIVOT
from namedmesh.base.communicators import lasting
from namedmesh.base.releases import not_a_number

SNES_PREFIX = "erc_contact_"
"""Prefix of PETSc options, as in ``-erc_contact_snes_monitor``.

They override the settings of the package.
"""
CYCLE = 0.9
"""Fall of the residual below which a status that comes back is a cycle [-]."""
STILL_STEPS = 7
"""Steps with one status after which Newton's method must have come nearer.

With one status the equations are linear in the plane and smooth in 3D. Where the
tangent is singular, the line search cuts the steps to nothing and the status stays.
"""
IMBALANCE = 1e-6
"""Resultant of K u on a free motion, over the contact forces, that is an error [-].

In exact numbers there is none.
"""
CRAWLING = ((2, 0.8, 0.0, 6), (3, 0.5, 0.5, 9), (5, 0.5, 0.0, 0))
"""When changes of the status count as a crawl.

In so many steps there are more than this share of the changes in as many steps before,
more than this share of the closed points, and more than so many.
"""
EARLIEST = 5
"""Steps that an attempt takes at least, whatever changes [-]."""
ENDLESS = "residual grows without end"
"""Why an attempt ends whose steps go far away: which way, round-off may say."""
ASTRAY = 1e5
"""Growth of the residual over the first one from which no state comes back [-]."""
NEARER = 0.5
"""Fall of the residual in so many steps that counts as nearer [-]."""
FARTHEST = 5e9
"""Length of a Newton step, over the state's, of a tangent that is singular [-].

Where it leads, the round-off of forces that cancel is more than any residual that
counts as solved. Steps of attempts that converge were at most 4e4, of bodies 300 times
as long as thick.
"""
PULL_FOR_EVER = "softer springs pull no less"
"""Why an attempt by proximal steps ends where springs alone hold a motion."""
SINGULAR_TANGENT = "singular tangent"
"""Why an attempt ends where nothing holds a motion; another start may hold it."""
ROUND_OFF_HIDES = "round-off of the stiffest body hides the contact forces"
"""Reason of an attempt whose residual is round-off, but is not small [-]."""


@dataclass(frozen=True)
class Outcome:
    """Tell how one attempt ended.

    Attributes:
        converged: Whether it ended at a solution.
        reason: Why it ended.
        steps: Number of Newton steps.
        residual: Norm of the residual as a fraction of the forces that cancel in it
            [-].
        status: Numbers of open, slipping and sticking points of the contact.
        friction: Share of the friction bound of the last problem of a sequence that was
            solved [-]; 0 if none was.
        contacts: Numbers of open, slipping and sticking points of each contact in its
            solution, where this share is greater than one.
    """

    converged: bool
    reason: str
    steps: int
    residual: float
    status: Counts
    friction: float = 0.0
    contacts: tuple[Counts, ...] = ()

    @property
    def open(self) -> bool:
        """Tell whether the contact is open at all its points."""
        opened, *closed = self.status
        return opened > 0 and not any(closed)

    def __str__(self) -> str:
        status = "{} open, {} slip, {} stick".format(*self.status)
        return f"{self.reason}, residual {self.residual:.1e}, {self.steps} steps ({status})"


@dataclass(frozen=True, eq=False)
class DiscreteSolution:
    """Hold the solution of a final attempt.

    Attributes:
        u: Displacement [length].
        multipliers: Multiplier of each contact [force/area], nodal values, or () for a
            method without.
        distance: Energy norm of the distance to the solution of the discrete problem
            [sqrt(force length)].
        least_singular_value: Least singular value of the tangents at the solution [-].
        carried: What is left of contacts and displacement where a rigid motion has
            brought bodies to their contacts, else None.
    """

    u: fem.Function
    multipliers: tuple[fem.Function, ...]
    distance: float
    least_singular_value: float
    carried: tuple[list[ContactOnMesh], fem.Function] | None = None


class Attempted(NamedTuple):
    """Hold what an attempt gives.

    Attributes:
        outcome: How it ended.
        state: Its last state, as the solver has states.
        solution: Its solution if it is a final attempt that converged, else None.
    """

    outcome: Outcome
    state: Any
    solution: DiscreteSolution | None = None


class PathEnd(NamedTuple):
    """Tell how far the central path was followed.

    Attributes:
        unknowns: The last unknowns of this rank.
        steps: Number of steps.
        is_known: Whether the states of all points are known.
    """

    unknowns: np.ndarray
    steps: int
    is_known: bool

    @property
    def outcome(self) -> Outcome:
        """Return how the attempt ended."""
        reason = "states are known" if self.is_known else "states are not known"
        return Outcome(self.is_known, reason, self.steps, np.inf, (0, 0, 0))


class Status(NamedTuple):
    """Tell the contact status of all points.

    Attributes:
        key: The same on all ranks, another one for another status.
        counts: Numbers of open, slipping and sticking points.
        points: Open (0), slip (1) or stick (2) at the points of this rank.
    """

    key: bytes
    counts: tuple[int, int, int]
    points: np.ndarray


class Equations(Protocol):
    """Represent a contact problem ``F(x) = R(u)/force`` with ``u = length x``.

    Members are collective over the ranks of x.
    """

    def vector(self) -> PETSc.Vec:
        """Return a new vector of unknowns."""

    def function(self, snes: Any, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Set f to F(x)."""

    def prepare(self, snes: PETSc.SNES) -> None:
        """Give SNES the tangent and a linear solver."""

    def round_off(self, x: PETSc.Vec) -> tuple[float, float]:
        """Return the norm of F that counts as solved, and its round-off at x [-].

        The second is the greater one where too few digits of the forces are left.
        """

    def balances(self, x: PETSc.Vec) -> bool:
        """Tell whether K x has no resultant on motions that no support holds."""

    def accurate(self, x: PETSc.Vec, tolerance: float) -> bool:
        """Tell whether the distance to the solution is below a tolerance.

        Both are energy norms [sqrt(force length)].
        """

    def status(self, x: PETSc.Vec) -> Status:
        """Return the contact status of all points."""


def attempt(
    problem: Equations, x: PETSc.Vec, step: Attempt, tolerance: float | None = None
) -> Outcome:
    """Make one attempt from x, which becomes the last state, in place.

    Args:
        problem: The contact problem.
        x: Where Newton's method starts.
        step: The attempt.
        tolerance: It may stop when :meth:`Equations.accurate` holds for it [sqrt(force
            length)]; None for round-off.
    """
    snes = PETSc.SNES().create(x.comm)
    snes.setOptionsPrefix(SNES_PREFIX)
    f = problem.vector()
    snes.setFunction(problem.function, f)
    snes.setType("newtonls")
    # The test below decides, with an atol of a user: it knows the round-off of forces.
    snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=step.most_steps)
    problem.prepare(snes)
    snes.getLineSearch().setType(step.line_search)
    test = _StoppingTest(problem, tolerance, hurried=step.hurried)
    snes.setConvergenceTest(test)
    snes.setLineSearchPreCheck(test.look_ahead)
    snes.setFromOptions()
    try:
        snes.solve(None, x)
        code = snes.getConvergedReason()
        norm = snes.getFunctionNorm()
        reason = test.reason or REASONS.get(code, str(code))
        check_interrupts(lasting(x.comm.tompi4py()))
    except PETSc.Error as failure:
        if failure.ierr not in (ZERO_PIVOT, LIBRARY):
            raise
        code = -1
        norm = np.inf
        reason = SINGULAR_TANGENT
    counts = problem.status(x).counts
    outcome = Outcome(
        converged=test.is_solved and code > 0 and bool(np.isfinite(norm)),
        reason=reason,
        steps=snes.getIterationNumber(),
        residual=norm,
        status=counts,
    )
    snes.destroy()
    f.destroy()
    return outcome


class Adjustable(Protocol):
    """Represent a contact problem whose friction, gaps and springs may be changed.

    A state is an array of unknowns.
    """

    def set_shares(self, friction: float, gap: float) -> None:
        """Set the shares of friction and gaps [-]."""

    def hold(self, weight: float, state: np.ndarray) -> None:
        """Hold free motions where they are at a state by springs of a weight [-]."""

    def counts(self, state: np.ndarray) -> tuple[Counts, ...]:
        """Count the points of each contact by their status."""


def solve_in_turn(
    problem: Adjustable,
    solve: Callable[[np.ndarray, Attempt], tuple[np.ndarray, Outcome]],
    step: Attempt,
    state: np.ndarray,
    comm: MPI.Comm,
) -> tuple[np.ndarray, Outcome]:
    """Solve the problems of an attempt in turn; the scene's problem is left.

    Args:
        problem: The contact problem.
        solve: Solves it as it is set, from a state; returns the last state and how this
            ended.
        step: The attempt.
        state: The state from which the first problem is solved.
        comm: Communicator of the ranks that the state is spread over.

    Returns:
        The last state that solves a problem, the given one without any; how the last
        problem ended, with the steps of all problems, and the share of friction of the
        last problem that was solved.
    """
    steps = 0
    friction = 0.0
    problems = step.problems()
    following: Shares | None = next(problems)
    while following is not None:
        shares = following
        problem.set_shares(shares.friction, shares.gap)
        problem.hold(shares.springs, state)
        last, outcome = solve(state, step)
        steps += outcome.steps
        pull = None
        if outcome.converged:
            moved = last - state
            pull = shares.springs * float(np.sqrt(comm.allreduce(moved @ moved, MPI.SUM)))
            friction = shares.friction
            state = last
        # By the pull the sequence tells whether softer springs still change the state.
        try:
            following = problems.send(pull)
        except StopIteration:
            following = None
    if outcome.converged and shares != Shares():
        # The sequence ended before the scene's problem, which has no springs.
        outcome = replace(outcome, converged=False, reason=PULL_FOR_EVER, residual=np.inf)
    contacts = problem.counts(state) if friction > 1.0 else ()
    problem.set_shares(1.0, 1.0)
    problem.hold(0.0, state)
    return state, replace(outcome, steps=steps, friction=friction, contacts=contacts)


class _StoppingTest:
    """Test the convergence of one attempt, for SNES.

    An attempt converges at round-off or when it is accurate enough. It diverges when
    the contact status repeats itself, or stands still without a solution, and before a
    step that is too long.

    Attributes:
        reason: Why it ended, or "" if PETSc's reason says it.
        is_solved: Whether it ended at a solution. PETSc's line searches know reasons of
            their own.
    """

    def __init__(self, problem: Equations, tolerance: float | None, *, hurried: bool) -> None:
        self.problem = problem
        self.tolerance = tolerance
        self.reason = ""
        self.is_solved = False
        self._hurried = hurried
        self._points: np.ndarray | None = None
        """The last status of the points of this rank."""
        self._changes: list[int] = []
        """Numbers of points that changed their status in each step."""
        self._first = np.inf
        """Residual at the first step."""
        self._before: dict[bytes, tuple[int, float]] = {}
        """Last step and least residual of each contact status."""
        self._stay: tuple[bytes, int, float] = (b"", 0, np.inf)
        """The last status, and the step and residual with which its stay began."""

    def __call__(
        self, snes: PETSc.SNES, step: int, norms: tuple[float, float, float]
    ) -> PETSc.SNES.ConvergedReason:
        """Return PETSc's reason to end, or to go on, at one step."""
        reasons = PETSc.SNES.ConvergedReason
        if self.reason:
            return reasons.DIVERGED_INNER
        norm = norms[2]
        if not np.isfinite(norm):
            return not_a_number()
        x = snes.getSolution()
        _, atol, *_ = snes.getTolerances()
        comm = lasting(x.comm.tompi4py())
        at(comm, f"Newton step {step}")
        if interrupted(comm):
            # The exception comes when SNES has ended: it may lose one raised here.
            return reasons.DIVERGED_INNER
        solved, round_off = self.problem.round_off(x)
        end = self._say_solved(x, norm, max(atol, solved))
        is_lost = not end and norm <= round_off
        if (end or is_lost) and not self.problem.balances(x):
            # A body that nothing holds has moved so far that round-off holds it.
            self.reason = "moved away until round-off balances the loads"
        elif end:
            self.reason = end
            self.is_solved = True
            return reasons.CONVERGED_ITS
        elif is_lost:
            self.reason = ROUND_OFF_HIDES
        else:
            self.reason = self._goes_astray(x, step, norm)
        return reasons.DIVERGED_INNER if self.reason else reasons.ITERATING

    def look_ahead(self, x: PETSc.Vec, y: PETSc.Vec) -> bool:
        """End before a step y from x that is too long; return whether y is changed.

        Round-off decides whether the factor of a singular tangent meets a zero pivot,
        or makes such a step.
        """
        if y.norm() > FARTHEST * max(1.0, x.norm()):
            self.reason = SINGULAR_TANGENT
            y.set(0.0)
        return bool(self.reason)

    def _goes_astray(self, x: PETSc.Vec, step: int, norm: float) -> str:
        """Say why the steps lead nowhere, or ""."""
        if step == 0:
            self._first = norm
        if norm > ASTRAY * self._first:
            return ENDLESS
        status = self.problem.status(x)
        # Other attempts wait for a hurried one alone: counting takes a reduction.
        if self._hurried:
            self._count_changes(status, lasting(x.comm.tompi4py()))
        return (
            self._repeats(status.key, step, norm)
            or self._stands_still(status.key, step, norm)
            or self._crawls(status.counts)
        )

    def _count_changes(self, status: Status, comm: MPI.Comm) -> None:
        """Count the points that changed their status in the last step."""
        if self._points is not None:
            changed = int(np.count_nonzero(status.points != self._points))
            self._changes.append(comm.allreduce(changed))
        self._points = status.points.copy()

    def _crawls(self, counts: tuple[int, int, int]) -> str:
        """Say that the changes of the status do not become few, or ""."""
        changes = self._changes
        if len(changes) < EARLIEST or changes[-1] == 0:
            return ""
        _, *closed = counts
        # A short window sees many changes at once, a long window few that go on.
        for steps, fall, share, few in CRAWLING:
            last = sum(changes[-steps:])
            before = sum(changes[-2 * steps : -steps])
            is_seen = len(changes) >= 2 * steps
            if is_seen and last > max(fall * before, share * sum(closed), few):
                return "states keep changing"
        return ""

    def _say_solved(self, x: PETSc.Vec, norm: float, solved: float) -> str:
        """Say how far x solves the equations, or "" if it does not."""
        if norm <= solved:
            return "converged to round-off"
        if self.tolerance is not None and self.problem.accurate(x, self.tolerance):
            return "accurate enough"
        return ""

    def _repeats(self, key: bytes, step: int, norm: float) -> str:
        """Say that the status comes back and the residual did not fall, or ""."""
        # A status that stays is no cycle, nor is a status that comes back nearer to the
        # solution.
        last_step, least = self._before.get(key, (step, norm))
        if last_step < step - 1 and norm > CYCLE * least:
            return f"cycle of {step - last_step} steps"
        self._before[key] = (step, min(least, norm))
        return ""

    def _stands_still(self, key: bytes, step: int, norm: float) -> str:
        """Say that the status stayed for long and the residual did not fall, or ""."""
        last_key, first_step, first_norm = self._stay
        if key == last_key and step - first_step < STILL_STEPS:
            return ""
        # A new stay begins, also where the status is the same: it is asked again later.
        self._stay = key, step, norm
        if key == last_key and norm > NEARER * first_norm:
            return f"no progress in {STILL_STEPS} steps"
        return ""


REASONS = {
    value: name.lower()
    for name, value in vars(PETSc.SNES.ConvergedReason).items()
    if isinstance(value, int)
}
"""Names of PETSc's reasons."""
