"""Solve a scene on a mesh: from a first guess to a :class:`Solution`.

Whether Newton's method converges depends on where it starts. One elastic factorisation
serves all attempts (:mod:`erc_contact.newton.linear.stiffness`), so it costs little to
try several starts and line searches, the cheapest first.

Scenes that are moved a little from one that is solved (:class:`Nearby`) share its mesh,
its factor or hierarchy, and the equations of contacts that are the same.

Nitsche's method starts from a solution on another mesh, which takes it as many steps as
both methods together, or from the solution of the augmented Lagrangian. The two are the
nearer the larger gamma is, and this takes fewer steps (GRECO, 256 x 256 squares: 11 and
2, against 22 from the glued contact).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import NotConverged, raise_together
from erc_contact.base.logs import log_of
from erc_contact.base.progress import stage
from erc_contact.model.given_forces import stiffnesses
from erc_contact.model.model import Model
from erc_contact.model.promises import bind, bind_nearby
from erc_contact.newton.after import check_after, last_step
from erc_contact.newton.arguments import check_arguments
from erc_contact.newton.contact_solve import solution_of
from erc_contact.newton.direct import Direct
from erc_contact.newton.given_forces import (
    seeks_shifts,
    shifts_in,
    shifts_of_before,
    solved_with_forces,
    sought_forces,
    with_locked_shifts,
    without_shifts,
)
from erc_contact.newton.iterative import Iterative
from erc_contact.newton.ladder import NODAL
from erc_contact.newton.law import solution_of_law
from erc_contact.newton.linear.choice import STANDS_BY, direct_over_multigrid
from erc_contact.newton.methods import Method
from erc_contact.newton.plausibility import doubts, tell
from erc_contact.newton.solution import Solution
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base import checks


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
    bisection. Further attempts hold loose bodies by softer and softer springs, use
    other parameters, raise friction in steps, and use other line searches
    (:mod:`erc_contact.newton.ladder`).

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
            represents it exactly; what another mesh loses is
            ``error.oscillations.history``. Without it the body comes from rest, once.
        start: A solution on another mesh of the same body; Newton starts from its
            displacement on the contacts. By default it is ``after``.
        tolerance: Newton may stop at this distance to the solution of the discrete
            problem, in the energy norm [sqrt(force length)], e.g. a tenth of the
            discretisation error; None goes to round-off.
        solver: "direct" factorises the elastic stiffness with MUMPS and solves a dense
            problem of the contact on one rank. "iterative" solves for the whole body in
            parallel, with algebraic multigrid, to 1e-10 of the contact forces. "auto"
            predicts which is faster: multigrid for large bodies in 3D and for long
            contacts. It takes the direct solver where multigrid fails, or is slow in
            its first 20 cycles, unless that would take a hundred times as long.

    Returns:
        The solution. ``singular`` tells that it may be one of many; a warning is
        logged. So it is where displacements, strains or rotations are not small, a
        friction is above 3, or nothing touches a contact.

    Raises:
        InputError: If scene and domain do not fit, or the loads are no numbers that
            double precision can work with.
        NotConverged: If no attempt converged.

    Example:
        >>> ec.solve(scene, block)
        <Solution of degree 1 on 16 cells by Nitsche(theta=0, gamma=10.0),
         3 Newton steps>
    """
    solution = solve_quietly(
        scene,
        domain,
        method,
        degree=degree,
        after=after,
        start=start,
        tolerance=tolerance,
        solver=solver,
    )
    tell(solution.model.space.comm, doubts(solution))
    return solution


def solve_quietly(
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
    """Solve as :func:`solve` does, but leave doubts to the caller; collective.

    A run tells each doubt once, whatever the number of its meshes.
    """
    began = perf_counter()
    check_arguments(scene, domain, method, degree, solver, start)
    if after is not None:
        check_after(scene, domain, after)
    if tolerance is not None:
        tolerance = checks.positive("tolerance", tolerance, "an energy norm > 0, or None")
    raise_together(domain.comm, None)
    scene = with_locked_shifts(scene, after)
    if seeks_shifts(scene):
        return _solved_with_forces(
            scene, domain, method, degree=degree, after=after, start=start, solver=solver
        )

    before = None if after is None else last_step(after)
    model = bind(scene, domain, int(degree), before)
    space = model.space
    if after is not None:
        method = method or NODAL
        start = start or after

    iterative = solver == "iterative"
    stands_by = False
    if solver == "auto":
        share = direct_over_multigrid(model)
        iterative = share > 1.0
        stands_by = iterative and share <= STANDS_BY
    kind: Callable[[Model], Direct | Iterative] = Direct
    if iterative:
        # Where the direct solver stands by, a slow start is worth no patience.
        kind = partial(Iterative, hurried=stands_by)
    name = "multigrid" if iterative else "the direct solver"
    try:
        with stage(space.comm, f"solving with {name}"):
            solution = solution_of_law(kind, model, method, start, tolerance)
    except NotConverged as failure:
        if not stands_by:
            raise
        log_of(space.comm).info(
            "%d cells: the direct solver takes over from multigrid. %s", domain.cells, failure
        )
        with stage(space.comm, "solving with the direct solver"):
            solution = solution_of_law(Direct, model, method, start, tolerance)

    seconds = space.comm.allreduce(perf_counter() - began, MPI.MAX)
    log_of(space.comm).debug(
        "%d cells: %s; %d Newton steps, %.2f s",
        domain.cells,
        solution.reason,
        solution.newton_steps,
        seconds,
    )
    return replace(solution, seconds=seconds)


def _solved_with_forces(
    scene: Scene,
    domain: Domain,
    method: Method | None,
    *,
    degree: int,
    after: Solution | None,
    start: Solution | None,
    solver: str,
) -> Solution:
    """Solve a scene with preloads by a force, or mean stresses; collective."""
    began = perf_counter()
    known: dict[str, float] = {}
    for solution in (after, start):
        if solution is not None:
            known |= shifts_in(solution.scene)
    shifts = shifts_of_before(scene, known)
    if shifts is None:
        before = None if after is None else last_step(after)
        unmoved = bind(without_shifts(scene), domain, degree, before)
        sought = sought_forces(scene, unmoved)
        guesses = np.array([given.force for given in sought]) / stiffnesses(unmoved.space, sought)
        shifts = {}
        for given, guess in zip(sought, guesses.tolist(), strict=True):
            shifts[given.name] = known.get(given.name) or guess

    arguments: dict[str, Any] = {"degree": degree, "after": after, "start": start}
    arguments |= {"tolerance": None, "solver": solver}
    solve = partial(solve_quietly, domain=domain, method=method, **arguments)

    def solve_near(scene: Scene, near: Solution) -> Solution:
        return Nearby(near, solver, after).solve(scene)

    solution, first = solved_with_forces(scene, shifts, solve, solve_near)
    stiffness = solution.stiffness
    is_linear = solution.model.linearised is None
    if is_linear and stiffness.iterative == first.stiffness.iterative:
        stiffness = first.stiffness.hand_to(solution.model)
    seconds = solution.model.space.comm.allreduce(perf_counter() - began, MPI.MAX)
    return replace(solution, stiffness=stiffness, seconds=seconds)


class Nearby:
    """Solve scenes near the scene of a solution; construction and members: collective.

    Args:
        near: The solution. Its elastic solver should be in memory while these are
            solved.
        solver: As in :func:`erc_contact.newton.solve.solve`.
        after: The solution of the last step of a history; None without.
    """

    def __init__(self, near: Solution, solver: str, after: Solution | None = None) -> None:
        self._near = near
        self._solver = solver
        self._after = after
        self._model = near.model
        # The scene itself was solved with the forms of its contacts.
        self._forms = near.forms

    def solve(self, scene: Scene) -> Solution:
        """Solve a scene of the same bodies, contacts and springs.

        Where forces of preloads are given, their shifts are found.

        Raises:
            InputError: As :func:`erc_contact.newton.solve.solve`.
            NotConverged: If no attempt converged.
        """
        near = self._near
        if near.model.linearised is not None:
            # A potential is linearised anew, so that no factor fits.
            return self._solve_anew(scene)
        if seeks_shifts(scene):
            shifts = shifts_of_before(scene, shifts_in(near.scene))
            if shifts is None:
                return self._solve_anew(scene)
            solution, _ = solved_with_forces(
                scene, shifts, self.solve, lambda moved, _: self.solve(moved)
            )
            return solution
        model = bind_nearby(scene, self._model)
        # Equations of Nitsche's method have the stress, with the shifts of preloads.
        if model.contacts != self._model.contacts or model.strains is not self._model.strains:
            self._forms = {}
        self._model = model
        kind = self._kind(model)
        if kind is not None:
            try:
                return solution_of(kind, model, near.method, near)
            except NotConverged:
                # The direct solver takes over from multigrid where it may.
                if self._solver != "auto" or not near.stiffness.iterative:
                    raise
        return self._solve_anew(scene)

    def _solve_anew(self, scene: Scene) -> Solution:
        """Solve a scene without the factor or hierarchy of the solution; collective."""
        near = self._near
        return solve_quietly(
            scene,
            near.domain,
            near.method,
            degree=near.model.space.degree,
            after=self._after,
            start=near,
            tolerance=None,
            solver=self._solver,
        )

    def _kind(self, model: Model) -> Callable[[Model], Direct | Iterative] | None:
        """Return what solves a model with the factor or hierarchy that there is.

        None if it does not fit.
        """
        near = self._near.model
        same_nodes = np.array_equal(model.fixed, near.fixed)
        if not model.space.comm.allreduce(same_nodes, MPI.LAND):
            return None
        elastic = self._near.stiffness
        kind: type[Direct | Iterative] = Iterative if elastic.iterative else Direct
        return partial(kind, elastic=elastic.of_model(model), forms=self._forms)
