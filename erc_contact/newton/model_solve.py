"""Solve one model with one kind of solver: at rest, without contact, or with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import InputError, NotConverged
from erc_contact.base.runtime.garbage import free_dropped, track_communicator
from erc_contact.model.model import Model
from erc_contact.newton.contact_solve import ContactSolve, Solver
from erc_contact.newton.limit_loads import what_can_be_carried
from erc_contact.newton.linear.solver import ElasticSolver
from erc_contact.newton.methods import DEFAULT, Method
from erc_contact.newton.rest import displacement_at_rest, displacement_back_at_rest
from erc_contact.newton.solution import Solution
from erc_contact.newton.statics import mechanism

ENERGY_RANGE = 1e-290, 1e290
"""Energies that double precision can work with, in any unit."""


def solution_of(
    kind: Callable[[Model], Solver],
    model: Model,
    method: Method | None,
    start: Solution | None,
    tolerance: float | None,
) -> Solution:
    """Solve a model with one kind of solver.

    The displacement has no part in motions that nothing holds.
    """
    solution = _solution_of(kind, model, method, start, tolerance)
    return replace(solution, u=model.without_unheld(solution.u))


def _solution_of(
    kind: Callable[[Model], Solver],
    model: Model,
    method: Method | None,
    start: Solution | None,
    tolerance: float | None,
) -> Solution:
    """Solve a model, with its anchors at rest."""
    solver = kind(model)
    try:
        loads = solver.elastic.load_vector()
        at_rest = displacement_at_rest(model, loads)
        if at_rest is not None:
            return _at_rest(at_rest, model, method or DEFAULT, solver.elastic)
        _check_size(model, loads, solver.guess)
        if not solver.elastic.contact_size:
            reason = "linear solve"
            return _linear(model, method or DEFAULT, solver.guess, (), reason, solver.elastic)
        _check_statics(model, loads)
        solution = ContactSolve(solver, method, tolerance).solve(start)
        at_rest = displacement_back_at_rest(model, loads, solution.u)
        if at_rest is None:
            return solution
        back = _at_rest(at_rest, model, solution.method, solver.elastic)
        return replace(back, newton_steps=solution.newton_steps)
    finally:
        solver.destroy()
        track_communicator(model.domain, model.mesh.comm)
        free_dropped(model.comm)


def _at_rest(u: fem.Function, model: Model, method: Method, elastic: ElasticSolver) -> Solution:
    """Make the exact solution of a body at rest, without contact forces."""
    multipliers = []
    if method.multiplier:
        for _ in model.contacts:
            multipliers.append(model.function())
    reason = "at rest: nothing loads or moves the body"
    return _linear(model, method, u, tuple(multipliers), reason, elastic)


def _linear(
    model: Model,
    method: Method,
    u: fem.Function,
    multipliers: tuple[fem.Function, ...],
    reason: str,
    elastic: ElasticSolver,
) -> Solution:
    """Make a solution for which Newton's method was not needed."""
    return Solution(
        model=model,
        method=method,
        u=u,
        multipliers=multipliers,
        newton_steps=0,
        reason=reason,
        distance=0.0,
        least_singular_value=1.0,
        stiffness=elastic,
        seconds=0.0,
    )


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
    force, length, nan = np.max(model.comm.allgather(local), axis=0)
    stiffest = model.stiffest() * model.domain.extent ** (model.d - 2)
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
