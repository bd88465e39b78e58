"""Solve one model: at rest, without contact, or by attempts from several starts.

One elastic factorisation or hierarchy serves all attempts, so that it costs little to
try several starts and line searches, the cheapest first
(:mod:`erc_contact.newton.ladder`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar, Protocol

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.base.logs import log_of
from erc_contact.base.runtime.garbage import free_dropped, track_communicator
from erc_contact.base.runtime.interrupts import check_interrupts
from erc_contact.model.contact.friction import depends_on_pressure
from erc_contact.model.model import Model
from erc_contact.newton.forms import ContactForms, Counts
from erc_contact.newton.ladder import NODAL, Attempt, attempts
from erc_contact.newton.limit_loads import what_can_be_carried
from erc_contact.newton.linear.multigrid import TRY_DIRECT
from erc_contact.newton.linear.solver import ElasticSolver
from erc_contact.newton.methods import DEFAULT, Method
from erc_contact.newton.rest import displacement_at_rest, displacement_back_at_rest
from erc_contact.newton.snes import (
    ENDLESS,
    ROUND_OFF_HIDES,
    Attempted,
    DiscreteSolution,
    Outcome,
)
from erc_contact.newton.solution import SINGULAR, Solution
from erc_contact.newton.statics import mechanism

SLOW_ATTEMPTS = 5
"""Number of attempts without convergence of the linear solver that ends multigrid."""
STRONG_FRICTION = 1.0
"""Coefficient of friction above which there may be many solutions [-].

The augmented Lagrangian then finds one that is exact where the exact ones are in the
finite element space; Nitsche's method alone may find one beside them.
"""


SHOWN = 5
"""Number of contacts that an error names."""
ENERGY_RANGE = 1e-290, 1e290
"""Energies that double precision can work with, in any unit."""


class Solver(Protocol):
    """Solve the contact problem of one model from a state; members are collective.

    What a state is, only the solver knows.

    Attributes:
        model: The scene on a mesh.
        elastic: Its elastic equations.
        guess: The displacement with the contact glued [length].
        nodal_first: Whether the augmented Lagrangian is the first attempt under strong
            friction. It costs little where steps do.
        forms: Equations of the methods that were tried.
    """

    nodal_first: ClassVar[bool]
    model: Model
    forms: dict[Method, ContactForms]

    @property
    def elastic(self) -> ElasticSolver: ...  # noqa: D102

    @property
    def guess(self) -> fem.Function: ...  # noqa: D102

    def glued_state(self) -> Any:
        """Return the state with the contact glued."""

    def warm(self, old: Model, u: fem.Function) -> Any:
        """Return the state of a displacement u of a model on another mesh."""

    def attempt(self, step: Attempt, state: Any) -> Attempted:
        """Make one attempt from a state."""

    def destroy(self) -> None:
        """Free what no solution needs."""


class ContactSolve:
    """Make the attempts of the ladder until an attempt converges; collective.

    Args:
        solver: What makes an attempt.
        method: The method whose solution is wanted; with None it is :data:`DEFAULT`,
            or the augmented Lagrangian where only that one converges.
    """

    def __init__(self, solver: Solver, method: Method | None) -> None:
        self.solver = solver
        self.model = solver.model
        self.method = method_beside_faces(self.model, method)
        self.fallback = method is None
        self.log = log_of(self.model.space.comm)
        self.rungs: list[str] = []
        self.outcomes: list[Outcome] = []
        self.steps = 0

    def solve(self, start: Solution | None) -> Solution:
        """Make the attempts in turn until an attempt of the method converges.

        Raises:
            NotConverged: If none does, or the linear solver fails again and again.
        """
        states: dict[str, Any] = {}
        if start is not None and start.model.contacts:
            states["warm"] = self.solver.warm(start.model, start.u)
        slow = 0
        # A start from another mesh makes the way to the solution short in any case.
        nodal_first = (
            self.solver.nodal_first and "warm" not in states and _has_strong_friction(self.model)
        )
        friction = any(contact.friction is not None for contact in self.model.contacts)
        gap = any(contact.gap is not None for contact in self.model.contacts)
        loose = bool(self.model.free_motions)
        grows = any(depends_on_pressure(contact.friction) for contact in self.model.contacts)
        for attempt in attempts(
            self.method,
            states,
            friction=friction,
            gap=gap,
            loose=loose,
            slides=loose and grows,
            fallback=self.fallback,
            nodal_first=nodal_first,
            convex=not grows,
        ):
            if attempt.start == "glued" and "glued" not in states:
                # It takes a solve, which a warm start hardly ever needs.
                states["glued"] = self.solver.glued_state()
            if attempt.start not in states:
                continue
            check_interrupts(self.model.space.comm)
            outcome, state, solution = self.solver.attempt(attempt, states[attempt.start])
            self.steps += outcome.steps
            self.rungs.append(f"{attempt}: {outcome}")
            self.outcomes.append(outcome)
            self.log.debug(self.rungs[-1])
            if solution is not None:
                return self._solution(attempt.method, solution)
            if outcome.converged:
                # The ladder sees the new state: it asks for attempts that start there.
                states[attempt.gives] = state
            elif outcome.friction > 1.0 and not gap:
                # Across gaps it may end for other reasons than friction.
                raise NotConverged(self._sliding(outcome), tuple(self.rungs))
            slow += outcome.reason == "diverged_linear_solve"
            # Other attempts end in the same round-off.
            if slow == SLOW_ATTEMPTS or outcome.reason == ROUND_OFF_HIDES:
                raise NotConverged(
                    f"The linear solver did not converge: {self.rungs[-1]}. {TRY_DIRECT}",
                    tuple(self.rungs),
                )
        raise NotConverged(self._failure(), tuple(self.rungs))

    def _sliding(self, outcome: Outcome) -> str:
        """Say with what friction there is a solution, where less does not hold bodies.

        Args:
            outcome: How the friction was lowered; its share is > 1.
        """
        share = outcome.friction
        needed = f"{share:.3g} times the friction"
        coefficients = [self.model.greatest_coefficient(c) for c in self.model.contacts]
        if any(coefficients):
            needed += f" (a coefficient of {share * max(coefficients):.3g})"
        return (
            f"The contact solve found a solution on {self.model.domain.cells} cells with {needed}, "
            "and followed it to less friction until it ended: contacts slide there that must hold "
            f"a body. In that solution {self._states(outcome.contacts)}. "
            "So there may be no solution with the friction given. More friction, more "
            "pressure or a Displacement holds the body."
        )

    def _states(self, counts: tuple[Counts, ...]) -> str:
        """Say which contacts slide, stick or are open."""
        names: dict[str, list[str]] = {}
        for contact, (open_, slip, stick) in zip(self.model.contacts, counts, strict=True):
            state = "slide in part" if slip and stick else "slide"
            if not slip:
                state = "stick" if stick else "are open"
            elif open_ and not stick:
                state = "slide where they press"
            names.setdefault(state, []).append(repr(contact.name))
        parts = []
        for state, of_state in names.items():
            shown = ", ".join(of_state[:SHOWN])
            left = len(of_state) - SHOWN
            more = f" and {left} more" if left > 0 else ""
            parts.append(f"{shown}{more} {state}")
        return ", ".join(parts)

    def _failure(self) -> str:
        """Say what was tried and what to do, where no attempt converged."""
        also = " or the augmented Lagrangian" if self.fallback else ""
        failed = (
            f"The contact solve did not converge on {self.model.domain.cells} cells with "
            f"{self.method}{also}, in {len(self.rungs)} attempts (`rungs` of this exception "
            "lists them)"
        )
        has_pairs = any(contact.against is not None for contact in self.model.contacts)
        # Interior point steps tell no status, and round-off chose an endless way.
        telling = [
            outcome
            for outcome in self.outcomes
            if any(outcome.status) and outcome.reason != ENDLESS
        ]
        if telling and all(outcome.open for outcome in telling):
            apart = "the bodies apart" if has_pairs else "the body from its foundation"
            return (
                f"{failed}. The contact ends all open: the loads take {apart}, "
                "and nothing else may hold the body. Look at the signs of loads and gap, or add a "
                "Displacement."
            )
        residuals = [outcome.residual for outcome in self.outcomes]
        nearest = self.rungs[residuals.index(min(residuals))]
        other_method = "" if self.fallback else ", the other method (method=None tries both)"
        pressed = "one body on the other" if has_pairs else "the body on its foundation"
        return (
            f"{failed}. The nearest: {nearest}. Look first whether supports, or loads that press "
            f"{pressed} with enough friction, hold the body; a Displacement does. "
            f"Else try a finer mesh at the contact, another friction{other_method}, or another "
            "gamma (1 to 1000)."
        )

    def _solution(self, method: Method, solution: DiscreteSolution) -> Solution:
        """Make the solution of a final attempt; warn if there may be many solutions."""
        cells = self.model.domain.cells
        reason = self.rungs[-1]
        if method != self.method:
            reason = f"{self.method} did not converge: {reason}"
            self.log.info(
                "%d cells: %s did not converge, the solution is by %s.", cells, self.method, method
            )
        if solution.least_singular_value < SINGULAR:
            reason += (
                f"; the tangent is singular ({solution.least_singular_value:.0e}), "
                "the solution may be one of many"
            )
            self.log.warning(
                "The tangent of the contact problem is singular at its solution: "
                "it may be one of many."
            )
        return Solution(
            model=self.model,
            method=method,
            u=solution.u,
            multipliers=solution.multipliers,
            newton_steps=self.steps,
            reason=reason,
            distance=solution.distance,
            least_singular_value=solution.least_singular_value,
            stiffness=self.solver.elastic,
            forms=self.solver.forms,
            carried=solution.carried,
        )


def _has_strong_friction(model: Model) -> bool:
    """Tell whether a coefficient of friction is above 1; collective."""
    coefficients = [model.greatest_coefficient(contact) for contact in model.contacts]
    return max(coefficients, default=0.0) > STRONG_FRICTION


def method_beside_faces(model: Model, method: Method | None) -> Method:
    """Return the method of a contact solve; collective.

    Nitsche's method reads the stress of the cells at the contact. Where a node of such
    a cell is on a loose face, its displacement is none of the condensed unknowns. The
    augmented Lagrangian reads displacements and reactions of contact nodes alone.

    Args:
        model: The scene on a mesh.
        method: The method that the user names; None for the default.

    Raises:
        InputError: If the user names a method that reads the stress, and a cell
            touches both.
    """
    if not model.loose_faces:
        return method or DEFAULT
    on_faces = np.zeros(model.space.node_count, dtype=bool)
    for face in model.loose_faces:
        on_faces[face.nodes] = True
    touching = False
    for contact in model.contacts:
        facets = np.concatenate([contact.trace.here.facets, contact.trace.there.facets])
        touching = touching or bool(on_faces[model.space.nodes[facets[:, 0]]].any())
    if not model.space.comm.allreduce(touching, MPI.LOR):
        return method or DEFAULT
    if method is None:
        return NODAL
    if not method.multiplier:
        raise InputError(
            f"A cell touches both a contact and {model.loose_faces[0].what} with free"
            f" motions, and {method} reads its stress; refine the mesh between them, or take"
            " method=ec.AugmentedLagrangian()."
        )
    return method


def solution_of(
    kind: Callable[[Model], Solver],
    model: Model,
    method: Method | None,
    start: Solution | None,
    *,
    checks: bool = True,
) -> Solution:
    """Solve a model with one kind of solver.

    The displacement has no part in motions that nothing holds.

    Args:
        kind: Makes the solver.
        model: The scene on a mesh.
        method: The contact method, None for the default.
        start: A solution to start from, of any mesh of the body.
        checks: Whether its loads and supports are checked: once for all linear bodies
            of a law.
    """
    solver = kind(model)
    try:
        solution = _solution_by(solver, method, start, checks=checks)
    finally:
        solver.destroy()
        track_communicator(model.domain, model.space.mesh.comm)
        free_dropped(model.space.comm)
    return replace(solution, u=model.without_unheld(solution.u))


def _solution_by(
    solver: Solver, method: Method | None, start: Solution | None, *, checks: bool
) -> Solution:
    """Solve the model of a solver, with its anchors at rest."""
    model = solver.model
    elastic = solver.elastic
    loads = elastic.load_vector()
    at_rest = displacement_at_rest(model, loads)
    if at_rest is not None:
        return _at_rest(at_rest, model, method or DEFAULT, elastic)
    if checks:
        _check_size(model, loads, solver.guess)
    if not elastic.contact_size:
        return Solution(model, method or DEFAULT, solver.guess, (), "linear solve", elastic)
    if checks:
        _check_statics(model, loads)
    solution = ContactSolve(solver, method).solve(start)
    at_rest = displacement_back_at_rest(model, loads, solution.u)
    if at_rest is None:
        return solution
    back = _at_rest(at_rest, model, solution.method, elastic)
    return replace(back, newton_steps=solution.newton_steps)


def _at_rest(u: fem.Function, model: Model, method: Method, elastic: ElasticSolver) -> Solution:
    """Make the exact solution of a body at rest, without contact forces."""
    multipliers: tuple[fem.Function, ...] = ()
    if method.multiplier:
        multipliers = tuple(model.space.function() for _ in model.contacts)
    reason = "at rest: nothing loads or strains the body"
    return Solution(model, method, u, multipliers, reason, elastic)


def _check_statics(model: Model, loads: fem.Function) -> None:
    """Check that contact forces may balance the loads on rigid motions; collective.

    Args:
        model: The scene on a mesh.
        loads: Nodal forces of its loads [force], not yet summed over ranks.

    Raises:
        NotConverged: If no tractions that the contacts allow do.
    """
    moved = mechanism(model, loads)
    if moved is not None:
        raise NotConverged(
            f"There is no solution: the loads {moved}, whatever tractions the contacts allow. "
            f"{what_can_be_carried(model, loads)}Look at the directions of loads and normals and "
            "at the signs of gaps; a Displacement may hold the body.",
            (),
        )


def _check_size(model: Model, b: fem.Function, w: fem.Function) -> None:
    """Check that energies neither overflow nor underflow double precision; collective.

    Args:
        model: The scene on a mesh.
        b: Nodal forces of the loads [force].
        w: The displacement with the contact glued [length].

    Raises:
        InputError: If forces, displacements or their products do so.
    """
    local_force = float(abs(b.x.array).max(initial=0.0))
    local_length = float(abs(w.x.array).max(initial=0.0))
    local_nan = float(np.isnan(w.x.array).any())
    local = [local_force, local_length, local_nan]
    force, length, nan = np.max(model.space.comm.allgather(local), axis=0)
    stiffest = model.stiffest() * model.domain.extent ** (model.space.d - 2)
    with np.errstate(over="ignore", under="ignore"):
        energies = np.array([force * length, stiffest * length * length])
    # Without loads, or without any displacement, a product is zero and no underflow.
    meaningful = np.array([force > 0, length > 0 or force > 0])
    energies = energies[meaningful]
    least, most = ENERGY_RANGE
    if nan or np.any((energies < least) | (energies > most)):
        raise InputError(
            f"The loads (nodal forces up to {force:.1e}) move the body by {length:.1e}: "
            "the energy is no number of double precision. Choose units in which moduli, "
            "lengths and loads are nearer to 1."
        )
