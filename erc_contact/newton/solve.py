"""One contact solve: from a first guess to a :class:`Solution`, or :class:`NotConverged`.

Whether Newton's method converges depends on where it starts. One elastic factorisation
serves all attempts (:mod:`erc_contact.newton.linear.stiffness`), so it costs little to
try several starts and line searches, the cheapest first.
Nitsche's method starts from a solution on another mesh, which takes it as many steps as
both methods together, or from the solution of the augmented Lagrangian. The two are the
nearer the larger gamma is, and this takes fewer steps (GRECO, 256 x 256 squares: 11 and
2, against 22 from the glued contact).
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError, NotConverged, raise_together
from erc_contact.base.logs import log_of
from erc_contact.base.progress import stage
from erc_contact.base.runtime.garbage import free_dropped, register_owner
from erc_contact.base.runtime.interrupts import check_interrupts
from erc_contact.mesh.domain import Domain
from erc_contact.model.model import Model
from erc_contact.model.promises import bind
from erc_contact.newton.after import check_after, last_step
from erc_contact.newton.arguments import check_arguments
from erc_contact.newton.direct import Direct
from erc_contact.newton.doubts import doubts, tell
from erc_contact.newton.iterative import Iterative
from erc_contact.newton.ladder import NODAL, attempts
from erc_contact.newton.linear.multigrid import DIRECT
from erc_contact.newton.linear.solver import ElasticSolver
from erc_contact.newton.methods import Method, Nitsche
from erc_contact.newton.rest import displacement_at_rest
from erc_contact.newton.snes import Found, Outcome
from erc_contact.newton.solution import SINGULAR, Solution
from erc_contact.scene.scene import Scene

DEFAULT = Nitsche()
"""The method where none is given."""
SLOW = 5
"""Number of attempts whose linear solver does not converge after which multigrid is given up."""
LARGE = {2: (2_000_000, 8_000), 3: (5_000, 1_000)}
"""Numbers of degrees of freedom, of the body and about of the contact, beyond which multigrid is faster."""


def solve(
    scene: Scene,
    domain: Domain,
    method: Method | None = None,
    *,
    degree: int = 1,
    after: Solution | None = None,
    start: Solution | None = None,
    tolerance: float | None = None,
    solver: str = "auto",
) -> Solution:
    """Solve a scene on a domain; collective.

    A scene without contact is one linear solve. A body that nothing loads or moves is
    at rest, and nothing is solved: u = 0 is exact, or where it is, if it has slid on a
    plane and is released. Otherwise Newton's method starts from ``start`` if given,
    else from the linear problem with the contact glued, and its line search is a
    bisection. Further attempts use other parameters, raise friction in steps, and use
    other line searches (:mod:`erc_contact.newton.ladder`).

    Args:
        scene: The problem.
        domain: The mesh.
        method: Contact method. With None it is Nitsche's, or the augmented Lagrangian
            where only that one converges, as ``Solution.method`` and ``reason`` then
            say; in a history it is the augmented Lagrangian, which keeps a sticking
            point exactly where it is. If a method is given, only its solution is taken.
        degree: Degree of the displacement, 1 or 2.
        after: The solution of the last step of a loading history, of the same body with
            the same contacts, on this mesh or on any other. Friction then acts on the
            tangential displacement since that solution (backward Euler). So does all
            that follows: r^, u^, e and its bounds, slip in profiles. A refined mesh
            carries it without loss; what another mesh loses is
            ``error.oscillations.history``. Without it the body comes from rest, once.
        start: A solution on another mesh of the same body; Newton starts from its
            displacement on the contacts. By default it is ``after``.
        tolerance: Newton may stop at this distance to the solution of the discrete
            problem, in the energy norm [sqrt(force length)], e.g. a tenth of the
            discretisation error; None goes to round-off.
        solver: "direct" factorises the elastic stiffness with MUMPS and solves a dense
            problem of the contact on one rank. "iterative" solves for the whole body in
            parallel, with algebraic multigrid, to 1e-10 of the contact forces. "auto"
            takes multigrid for large bodies in space, and the direct solver where
            multigrid fails.

    Returns:
        The solution. ``singular`` tells that it may be one of many; a warning is
        logged. So it is where displacements or rotations are not small, a friction is
        above 3, or nothing touches a contact.

    Raises:
        InputError: If scene and domain do not fit, or the loads are no numbers that
            double precision can work with.
        NotConverged: If no attempt converged.

    Example:
        >>> ec.solve(scene, block)
        <Solution of degree 1 on 16 cells by Nitsche(theta=0, gamma=10.0), 3 Newton steps>
    """
    solution = solved(
        scene,
        domain,
        method,
        degree=degree,
        after=after,
        start=start,
        tolerance=tolerance,
        solver=solver,
    )
    tell(solution.model.comm, doubts(solution))
    return solution


def solved(
    scene: Scene,
    domain: Domain,
    method: Method | None,
    *,
    degree: int,
    after: Solution | None,
    start: Solution | None,
    tolerance: float | None,
    solver: str,
) -> Solution:
    """Do what :func:`solve` does, but leave doubts to a run, which tells each of them once; collective."""
    began = perf_counter()
    check_arguments(scene, domain, method, degree, solver, start)
    if after is not None:
        check_after(scene, domain, after)
    tolerance = (
        None
        if tolerance is None
        else checks.positive("tolerance", tolerance, "an energy norm > 0, or None")
    )
    raise_together(domain.mesh.comm, None)
    model = bind(scene, domain, int(degree), None if after is None else last_step(after))
    if after is not None:
        method, start = method or NODAL, start or after
    iterative = solver == "iterative" or (solver == "auto" and large(model))
    try:
        with stage(model.comm, f"solving with {'multigrid' if iterative else 'the direct solver'}"):
            solution = _solution(
                Iterative if iterative else Direct, model, method, start, tolerance
            )
    except NotConverged as failure:
        if solver != "auto" or not iterative:
            raise
        log_of(model.comm).info(
            "%d cells: the direct solver takes over from multigrid. %s", domain.cells, failure
        )
        with stage(model.comm, "solving with the direct solver"):
            solution = _solution(Direct, model, method, start, tolerance)
    seconds = model.comm.allreduce(perf_counter() - began, MPI.MAX)
    log_of(model.comm).debug(
        "%d cells: %s; %d Newton steps, %.2f s",
        domain.cells,
        solution.reason,
        solution.newton_steps,
        seconds,
    )
    return replace(solution, seconds=seconds)


def _solution(
    kind: type[Direct | Iterative],
    model: Model,
    method: Method | None,
    start: Solution | None,
    tolerance: float | None,
) -> Solution:
    solver = kind(model)
    try:
        loads = solver.elastic.load_vector()
        rest = displacement_at_rest(model, loads)
        if rest is not None:
            return _at_rest(rest, model, method or DEFAULT, solver.elastic)
        _check_size(model, loads, solver.guess)
        if solver.elastic.contact_size:
            return _ContactSolve(solver, method, tolerance).solve(start)
        return Solution(
            model,
            method or DEFAULT,
            solver.guess,
            (),
            0,
            "linear solve",
            0.0,
            1.0,
            solver.elastic,
            0.0,
        )
    finally:
        solver.destroy()
        register_owner(model.domain, model.comm)
        free_dropped(model.comm)


def _at_rest(rest: fem.Function, model: Model, method: Method, elastic: ElasticSolver) -> Solution:
    """The exact solution of a body at rest."""
    multipliers = tuple(model.function() for _ in model.contacts) if method.multiplier else ()
    reason = "at rest: nothing loads or moves the body"
    return Solution(model, method, rest, multipliers, 0, reason, 0.0, 1.0, elastic, 0.0)


def large(model: Model) -> bool:
    """Whether multigrid is the faster solver for a model, as measured; collective.

    In the plane a factor and a dense matrix of the contact are faster up to some
    million degrees of freedom. In space the factor grows like n^(4/3) and the matrix of
    the contact like n^(4/3) or, on meshes that are fine there, n^2.
    """
    nodes = model.V.dofmap.index_map.size_global
    own = sum(int(np.count_nonzero(c.trace.here.owned)) for c in model.contacts)
    facets = model.comm.allreduce(own, MPI.SUM)
    unknowns, contact = nodes * model.d, facets * model.degree ** (model.d - 1) * model.d
    limits = LARGE[model.d]
    return unknowns > limits[0] or contact > limits[1]


def _check_size(model: Model, b: fem.Function, w: fem.Function) -> None:
    """Raise an error if forces, displacements or their products overflow or underflow double precision."""
    local = [float(abs(f.x.array).max(initial=0.0)) for f in (b, w)] + [
        float(np.isnan(w.x.array).any())
    ]
    force, length, nan = np.max(model.comm.allgather(local), axis=0)
    least, most = 1e-290, 1e290
    stiffest = model.stiffest() * model.domain.extent ** (model.d - 2)
    with np.errstate(over="ignore", under="ignore"):
        energies = np.array([force * length, stiffest * length * length])
    energies = energies[np.array([force > 0, length > 0 or force > 0])]
    if nan or np.any((energies < least) | (energies > most)):
        raise InputError(
            f"The loads (nodal forces up to {force:.1e}) move the body by {length:.1e}: the energy is no number of "
            "double precision. Choose units in which moduli, lengths and loads are nearer to 1."
        )


class _ContactSolve:
    """The contact solve of one model: it makes the attempts of the ladder until one converges; collective."""

    def __init__(
        self, solver: Direct | Iterative, method: Method | None, tolerance: float | None
    ) -> None:
        self.solver, self.model = solver, solver.model
        self.method, self.fallback = method or DEFAULT, method is None
        self.tolerance, self.log = tolerance, log_of(self.model.comm)
        self.tried: list[str] = []
        self.outcomes: list[Outcome] = []
        self.steps = 0

    def solve(self, start: Solution | None) -> Solution:
        """Make the attempts one after the other until one of the wanted method converges."""
        states, slow = {"glued": self.solver.glued()}, 0
        if start is not None and start.model.contacts:
            states["warm"] = self.solver.warm(start.model, start.u)
        friction = any(c.friction is not None for c in self.model.contacts)
        kind = {
            "friction": friction,
            "fallback": self.fallback,
            "nodal_first": self.solver.nodal_first,
        }
        for attempt in attempts(self.method, states, **kind):
            if attempt.start not in states:
                continue
            check_interrupts(self.model.comm)
            outcome, state, found = self.solver.attempt(
                attempt, states[attempt.start], self.tolerance
            )
            self.steps += outcome.steps
            self.tried.append(f"{attempt}: {outcome}")
            self.outcomes.append(outcome)
            self.log.debug(self.tried[-1])
            if found is not None:
                return self._solution(attempt.method, found)
            if outcome.converged:
                states[attempt.gives] = state
            slow += outcome.reason == "diverged_linear_solve"
            if slow == SLOW:
                raise NotConverged(
                    f"The linear solver did not converge: {self.tried[-1]}. {DIRECT}",
                    tuple(self.tried),
                )
        raise NotConverged(self._failed(), tuple(self.tried))

    def _failed(self) -> str:
        """Say what was tried and what to do first, where no attempt converged."""
        also = " or the augmented Lagrangian" if self.fallback else ""
        failed = (
            f"The contact solve did not converge on {self.model.domain.cells} cells with {self.method}{also}, in "
            f"{len(self.tried)} attempts (`rungs` of this exception lists them)"
        )
        if all(outcome.open for outcome in self.outcomes):
            return (
                f"{failed}. The contact ends all open in each of them: the loads take the body from its foundation, "
                "and nothing else may hold the body. Look at the signs of loads and gap, or add a Displacement."
            )
        nearest = min(range(len(self.tried)), key=lambda number: self.outcomes[number].residual)
        other = "" if self.fallback else ", the other method (method=None tries both)"
        return (
            f"{failed}. The nearest: {self.tried[nearest]}. Look first whether supports, or loads that press the body "
            "on its foundation with enough friction, hold the body; a Displacement does. Else try a finer mesh at the "
            f"contact, less friction{other}, or another gamma (1 to 1000)."
        )

    def _solution(self, method: Method, found: Found) -> Solution:
        cells, reason = self.model.domain.cells, self.tried[-1]
        if method != self.method:
            reason = f"{self.method} did not converge: {reason}"
            self.log.info(
                "%d cells: %s did not converge, the solution is that of %s.",
                cells,
                self.method,
                method,
            )
        if found.least_singular_value < SINGULAR:
            reason += f"; the tangent is singular ({found.least_singular_value:.0e}), the solution may be one of many"
            self.log.warning(
                "The tangent of the contact problem is singular at its solution: it may be one of many."
            )
        numbers = self.steps, reason, found.distance, found.least_singular_value
        return Solution(
            self.model, method, found.u, found.multipliers, *numbers, self.solver.elastic, 0.0
        )
