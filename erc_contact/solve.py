"""One contact solve: from a first guess to a :class:`Solution`, or :class:`NotConverged`.

Where Newton starts decides whether it ends. One elastic factorisation serves all attempts
(:mod:`erc_contact.stiffness`), so a ladder of starts and line searches is tried, cheapest first, and costs little.
Nitsche's method starts from the solution of the augmented Lagrangian: it is the nearer to it the larger gamma is, and
found in fewer steps (GRECO, 256 x 256 squares: 11 and 2, against 22 from the glued contact).
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact import start as starts
from erc_contact.condensed import Condensed
from erc_contact.domain import Domain
from erc_contact.exceptions import InputError, NotConverged
from erc_contact.foundation import BoundContact
from erc_contact.methods import AugmentedLagrangian, Method, Nitsche
from erc_contact.model import Model
from erc_contact.newton import Newton, Outcome
from erc_contact.scene import Scene
from erc_contact.stiffness import Stiffness

log = logging.getLogger("erc_contact")

FRICTION_STEPS = ((0.5, 1.0), (0.9, 1.0), tuple(0.05 * k for k in range(21)))
"""Shares of the friction bound when friction is raised in steps."""
LINE_SEARCHES = ("l2", "cp", "bt", "nleqerr")
"""What is tried where bisection fails: each leaves other cycles."""
NODAL = AugmentedLagrangian(gamma=1.0)
"""The method that starts the others."""
OTHERS = tuple(AugmentedLagrangian(gamma) for gamma in (0.1, 10.0, 1000.0))
"""Its parameters do not change its solution: others are tried where Newton fails."""
SINGULAR = 1e-12
"""Where the least singular value of the tangent, scaled by the elastic diagonal, is below this, it is singular [-]."""


@dataclass(frozen=True, eq=False)
class Solution:
    """A converged displacement with all that it came from.

    Attributes:
        model: The scene on its domain, with forms.
        method: The contact method.
        u: Displacement [length], a continuous P1 or P2 Function.
        multipliers: Multiplier of each contact [force/area], or () for a method without.
        newton_steps: Newton steps of all attempts together; 0 for a scene without contact.
        reason: How the solver ended, and from which start.
        remaining: Energy norm of the distance to the solution of the discrete problem [sqrt(force length)].
        regularity: Least singular value of the tangents of the contact problem at the solution, scaled by the elastic
            diagonal [-].
        stiffness: The factorised elastic stiffness; :func:`equilibrate` frees the factor.
        seconds: Wall time, the largest over the ranks [s].
    """

    model: Model
    method: Method
    u: fem.Function
    multipliers: tuple[fem.Function, ...]
    newton_steps: int
    reason: str
    remaining: float
    regularity: float
    stiffness: Stiffness
    seconds: float

    @property
    def domain(self) -> Domain:
        """The mesh with names."""
        return self.model.domain

    @property
    def scene(self) -> Scene:
        """What the user declared."""
        return self.model.scene

    @property
    def singular(self) -> bool:
        """Whether the tangent is singular: there may be other solutions as near as one likes."""
        return self.regularity < SINGULAR

    def traction(self, contact: BoundContact) -> Any:
        """The contact traction of the method on a contact of the model [force/area], UFL, shape (d,)."""
        place = self.model.contacts.index(contact)
        multiplier = self.multipliers[place] if self.multipliers else None
        return self.method.traction(self.model, contact, self.u, multiplier)


def solve(
    scene: Scene,
    domain: Domain,
    method: Method | None = None,
    *,
    degree: int = 1,
    start: Solution | None = None,
    accuracy: float | None = None,
) -> Solution:
    """Solve a scene on a domain; collective.

    A scene without contact is one linear solve. Otherwise Newton starts from ``start`` if given, else from the linear
    problem with the contact glued; line search by bisection. Further attempts use other parameters, raise friction
    in steps, and use other line searches.

    Args:
        scene: The problem.
        domain: The mesh.
        method: Contact method; ``Nitsche()`` by default.
        degree: Degree of the displacement, 1 or 2.
        start: A solution on another mesh of the same body; Newton starts from its displacement on the contacts.
        accuracy: Newton may stop at this distance to the solution of the discrete problem, in the energy norm
            [sqrt(force length)], e.g. a tenth of the discretisation error; None goes to round-off.

    Returns:
        The solution. ``singular`` tells that it may be one of many; a warning is logged.

    Raises:
        InputError: If scene and domain do not fit, or the loads are no numbers that double precision can work with.
        NotConverged: If no attempt converged.
    """
    began = perf_counter()
    method = method or Nitsche()
    model = Model(scene, domain, degree)
    stiffness = Stiffness(model)
    b = stiffness.load_vector()
    w = stiffness.glued(b)
    _check_size(model, b, w)
    if stiffness.contact:
        solution = _Ascent(model, method, stiffness, w, accuracy).solve(start)
    else:
        solution = Solution(model, method, w, (), 0, "linear solve", 0.0, 1.0, stiffness, 0.0)
    seconds = model.comm.allreduce(perf_counter() - began, MPI.MAX)
    log.debug("%d cells: %s; %d Newton steps, %.2f s", domain.cells, solution.reason, solution.newton_steps, seconds)
    return replace(solution, seconds=seconds)


def _check_size(model: Model, b: fem.Function, w: fem.Function) -> None:
    """Forces and displacements, and their products, must be numbers that double precision can work with."""
    local = [float(abs(f.x.array).max(initial=0.0)) for f in (b, w)] + [float(np.isnan(w.x.array).any())]
    force, length, nan = np.max(model.comm.allgather(local), axis=0)
    least, most = 1e-290, 1e290
    stiffest = model.greatest(model.scene.material.modulus(**model.parameters)) * model.domain.size ** (model.d - 2)
    with np.errstate(over="ignore", under="ignore"):
        energies = np.array([force * length, stiffest * length * length])
    energies = energies[np.array([force > 0, length > 0 or force > 0])]
    if nan or np.any((energies < least) | (energies > most)):
        raise InputError(
            f"The loads (nodal forces up to {force:.1e}) move the body by {length:.1e}: the energy is no number of "
            "double precision. Choose units in which moduli, lengths and loads are nearer to 1."
        )


@dataclass(frozen=True)
class _Attempt:
    """One attempt: a method, where it starts, its line search, the steps of friction.

    The start "glued" glues the contact, "warm" is a solution on another mesh, "nodal" one of the augmented Lagrangian.
    """

    method: Method
    start: str
    line_search: str = "bisection"
    friction_shares: tuple[float, ...] = (1.0,)

    def __str__(self) -> str:
        steps = f", friction in {len(self.friction_shares)} steps" if len(self.friction_shares) > 1 else ""
        return f"{self.start} start, {self.method}, {self.line_search}{steps}"


class _Ascent:
    """The ladder of attempts for one model; all ranks climb it together."""

    def __init__(self, model: Model, method: Method, stiffness: Stiffness, w: fem.Function, accuracy: float | None):
        self.model, self.method, self.stiffness, self.w = model, method, stiffness, w
        self.accuracy = accuracy
        self.problems: dict[Method, Condensed] = {}
        self.tried: list[str] = []
        self.steps = 0

    def solve(self, start: Solution | None) -> Solution:
        """Climb until an attempt of the method converges."""
        stiffness = self.stiffness
        states = {"glued": starts.glued(stiffness, self.w)}
        if start is not None and start.model.contacts:
            states["warm"] = starts.from_mesh(start.model, start.u, stiffness)
        for attempt in self._ladder(states):
            if attempt.start not in states:
                continue
            converged, state, results = self._attempt(attempt, states[attempt.start])
            if converged and attempt.method == self.method:
                return self._solution(results)
            if converged:
                states["nodal"] = state
        raise NotConverged(
            f"The contact solve did not converge on {self.model.domain.cells} cells with {self.method}. Tried: "
            f"{'; '.join(self.tried)}. Try the other method (Nitsche, AugmentedLagrangian), another gamma (1 to 1000), "
            "a finer mesh at the contact, or less friction; look whether the loads let the contact hold the body.",
            tuple(self.tried),
        )

    def _ladder(self, states: dict[str, Any]) -> Iterator[_Attempt]:
        """The attempts, cheapest first; those whose start is not among the states are skipped.

        Without a gap the problem is positively homogeneous, so steps of the load are all the same problem; friction
        is raised in steps instead.
        """
        own = self.method
        nodal = own if own.multiplier else NODAL
        first = "warm" if "warm" in states else "glued"
        yield _Attempt(nodal, first)
        if nodal != own:
            yield _Attempt(own, "nodal")
        if nodal != own and first == "warm":
            yield _Attempt(own, "warm")
        if nodal != own or first == "warm":
            yield _Attempt(own, "glued")
        for other in (NODAL, *OTHERS):
            if "nodal" not in states and other != own:
                yield _Attempt(other, "glued")
                yield _Attempt(own, "nodal")
        if any(c.law is not None for c in self.model.contacts):
            for shares in FRICTION_STEPS:
                yield _Attempt(own, "glued", friction_shares=shares)
        for line_search in LINE_SEARCHES:
            yield _Attempt(own, "glued", line_search)

    def _attempt(self, attempt: _Attempt, contact: Any) -> tuple[bool, Any, Any]:
        """Run one attempt; returns whether it converged, u at the contact nodes, and what a solution needs."""
        if attempt.method not in self.problems:
            self.problems[attempt.method] = Condensed(self.model, attempt.method, self.stiffness, self.w)
        problem = self.problems[attempt.method]
        final = attempt.method == self.method

        def work() -> tuple[Outcome, Any, Any]:
            newton = Newton(problem, self.accuracy)
            u, steps = problem.from_contact(contact), 0
            for share in attempt.friction_shares:
                problem.raise_friction(share)
                u, outcome = newton.solve(u, attempt.line_search)
                steps += outcome.steps
                if not outcome.converged:
                    break
            problem.raise_friction(1.0)
            results = None
            if final and outcome.converged:
                results = newton.remaining(), newton.regularity(u), u, problem.matrix @ u - problem.loads
            newton.destroy()
            return replace(outcome, steps=steps), u[: self.stiffness.contact], results

        outcome, state, results = problem.run(work)
        self.steps += outcome.steps
        self.tried.append(f"{attempt}: {outcome}")
        log.debug(self.tried[-1])
        return outcome.converged, state, results

    def _solution(self, results: tuple[float, float, np.ndarray, np.ndarray]) -> Solution:
        remaining, regularity, u_tested, force = results
        u = self.stiffness.expand(self.w, u_tested, force)
        reason = self.tried[-1]
        if regularity < SINGULAR:
            reason += f"; the tangent is singular ({regularity:.0e}), the solution may be one of many"
            log.warning("The tangent of the contact problem is singular at its solution: it may be one of many.")
        multipliers = self.problems[self.method].multipliers
        for multiplier, contact in zip(multipliers, self.model.contacts[: len(multipliers)], strict=True):
            self.model.to_coefficients(multiplier.x.array.reshape(-1, self.model.d), [contact], back=True)
        return Solution(
            self.model, self.method, u, multipliers, self.steps, reason, remaining, regularity, self.stiffness, 0.0
        )
