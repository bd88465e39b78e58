"""Find shifts whose forces are given: of preloads, and of sides under a mean stress.

A scene is solved with shifts q, so that each bolt is one body, and each copy has a mean
strain. The force of a bolt or a side grows with its shift, linearly as long as the
contacts do not change and nothing yields. In a scene that its bolts alone load, without
gaps, it is proportional to the shift, so that the second solve has the force to
round-off. Otherwise Broyden's method follows it, in the energy norm of the estimated
stiffness: so the mean strain that it finds stays symmetric, and copies do not turn. All
solves start from each other, and solves of linear bodies share one factor or hierarchy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, NotConverged, NotHeldError
from erc_contact.base.logs import log_of
from erc_contact.model.given_forces import (
    GivenForce,
    given_forces,
    shift_name,
    stiffnesses,
    stressed_sides,
)
from erc_contact.model.model import Model
from erc_contact.newton.solution import Solution
from erc_contact.newton.statics import jumps_not_held
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload
from namedmesh.base.names import listed

SAME_FORCE = 1e-8
"""Difference of the force of a bolt from the given one, over the greatest [-]."""
SOLVES = 30
"""Greatest number of shifts that are tried."""
HALVINGS = 6
"""Greatest number of times that a change of the shifts is halved."""
DOUBLINGS = 6
"""Greatest number of times that the first shifts are doubled."""
SLACK = 0.01
"""Force over shift and stiffness of the shank below which a bolt is slack [-].

A shank that yields has a share of its stiffness, see :func:`_least_share`.
"""

Solve = Callable[[Scene], Solution]
"""Solves a scene with given shifts."""
SolveNear = Callable[[Scene, Solution], Solution]
"""Solves one with the factor or hierarchy of a solution near by."""


def with_locked_shifts(scene: Scene, after: Solution | None) -> Scene:
    """Return a scene whose locked preloads have the shifts of the last step.

    Raises:
        InputError: If there is no last step, or no shift in it.
    """
    before = {} if after is None else {last.facets: last for last in _preloads(after.scene)}
    ties: list[Any] = []
    for tie in scene.ties:
        if not isinstance(tie, Preload) or not tie.locked or tie.shortening is not None:
            ties.append(tie)
            continue
        if after is None:
            raise InputError(
                f"Preload({tie.facets!r}) is locked in a step that has none before it; give its"
                " force or shortening first."
            )
        if tie.facets not in before:
            raise InputError(
                f"Preload({tie.facets!r}) is locked, and in the last step this joint was Tied; give"
                " it a Preload there, with shortening=0.0 if it was not tightened."
            )
        last = before[tie.facets]
        by_force = last.force is not None or last.locked
        assert last.shortening is not None
        ties.append(tie.found(last.shortening, locked=by_force))
    return replace(scene, ties=ties)


def seeks_shifts(scene: Scene) -> bool:
    """Tell whether shifts of a scene are to be found for their forces."""
    sides = stressed_sides(scene.contacts)
    return bool(with_forces(scene)) or any(entry.found is None for entry in sides)


def with_forces(scene: Scene) -> list[Preload]:
    """Return the preloads whose forces alone are given."""
    preloads = _preloads(scene)
    return [preload for preload in preloads if not preload.locked and preload.shortening is None]


def shifts_in(scene: Scene) -> dict[str, float]:
    """Return the shifts that a scene gives, by their names [length]."""
    shifts = {}
    for preload in _preloads(scene):
        if preload.shortening is not None:
            shifts[preload.facets] = float(preload.shortening)
    for entry in stressed_sides(scene.contacts):
        for i, jump in enumerate(entry.found or ()):
            shifts[shift_name(entry, i)] = jump
    return shifts


def with_shifts(scene: Scene, shifts: Mapping[str, float]) -> Scene:
    """Return a scene with given shifts by their names [length]."""
    ties: list[Any] = []
    for tie in scene.ties:
        if isinstance(tie, Preload) and tie.facets in shifts:
            ties.append(tie.found(shifts[tie.facets], locked=tie.locked))
        else:
            ties.append(tie)
    contacts = list(scene.contacts)
    for entry in stressed_sides(scene.contacts):
        # Components that no mean stress gives are not read.
        names = [shift_name(entry, i) for i in range(len(entry.mean_stress or ()))]
        jump = [shifts.get(name, 0.0) for name in names]
        contacts[contacts.index(entry)] = entry.with_jump(jump)
    return replace(scene, ties=ties, contacts=contacts)


def without_shifts(scene: Scene) -> Scene:
    """Return a scene in which the shifts that are to be found are zero."""
    return with_shifts(scene, {preload.facets: 0.0 for preload in with_forces(scene)})


def with_free_jumps(scene: Scene) -> Scene:
    """Return a scene whose sides under a mean stress have jumps to be found."""
    # A copy by its declaration has no jump that was found.
    free = {entry.facets: replace(entry) for entry in stressed_sides(scene.contacts)}
    if not free:
        return scene
    return replace(scene, contacts=[free.get(entry.facets, entry) for entry in scene.contacts])


def with_jumps_of(scene: Scene, model: Model, u: fem.Function) -> Scene:
    """Return a scene whose sides under a mean stress jump as u; collective.

    The jump is the mean of the jump of u.

    Args:
        scene: The scene.
        model: The same bodies and contacts on a mesh.
        u: A displacement [length].
    """
    shifts = shifts_in(scene)
    for entry in stressed_sides(scene.contacts):
        trace = model.contact(entry.facets).trace
        areas = trace.here.owned_areas
        local = np.append(areas @ trace.of(u.x.array).mean(axis=1), areas.sum())
        total = model.space.comm.allreduce(local, MPI.SUM)
        for i, jump in enumerate(-total[:-1] / total[-1]):
            shifts[shift_name(entry, i)] = float(jump)
    return with_shifts(scene, shifts)


def sought_forces(scene: Scene, model: Model) -> list[GivenForce]:
    """Return the given forces of a scene whose shifts are to be found; collective.

    Args:
        scene: The scene.
        model: The same bodies and contacts on a mesh.

    Raises:
        InputError: If there are none, because a mean stress acts on no side.
        NotHeldError: If nothing balances the forces of a mean stress.
    """
    sought = [given for given in given_forces(scene, model) if given.shift is None]
    if not sought:
        names = [entry.facets for entry in stressed_sides(scene.contacts)]
        raise InputError(
            f"The mean stress of the sides at {names} has no component that acts on them; give the"
            " components along their normal, or periodic sides across the stress."
        )
    of_sides = [given for given in sought if given.of_sides]
    loose = jumps_not_held(model, model.load_forces(strains=False), of_sides)
    if loose:
        told = [f"{given.name} {given.force:.4g}" for given in of_sides if given.name in loose]
        raise NotHeldError(
            f"The copies of the body would move against each other without end: no stress and no"
            f" tractions that the contacts allow balance the forces of the mean stress on"
            f" {listed(told)}. Give all periodic sides one mean stress, with mean_strain= in place"
            " of it (None in mean_stress) where neither body nor contacts hold copies; or more"
            " friction."
        )
    return sought


def shifts_of_before(scene: Scene, known: Mapping[str, float]) -> dict[str, float] | None:
    """Return the shifts that are to be found as another solution has them [length].

    Args:
        scene: The scene.
        known: The shifts of the other solution by their names.

    Returns:
        None where one of them is not known, or a bolt is not tightened there.
    """
    bolts = [preload.facets for preload in with_forces(scene)]
    sides: list[str] = []
    for entry in stressed_sides(scene.contacts):
        sides += [shift_name(entry, i) for i in range(len(entry.mean_stress or ()))]
    if not all(known.get(name) for name in bolts) or not known.keys() >= set(sides):
        return None
    return {name: known[name] for name in (*bolts, *sides)}


def solved_with_forces(
    scene: Scene, shifts: Mapping[str, float], solve: Solve, solve_near: SolveNear
) -> tuple[Solution, Solution]:
    """Solve a scene in which forces of preloads or mean stresses are given; collective.

    Args:
        scene: The scene.
        shifts: Shifts to begin with by their names [length].
        solve: Solves a scene with shifts.
        solve_near: Solves one with the factor or hierarchy of a solution near by.

    Returns:
        The solution of the scene with the shifts that were found, and the first
        solution, whose factor or hierarchy it has.

    Raises:
        NotConverged: If no shifts give these forces.
    """

    def at(names: Sequence[str], values: np.ndarray) -> Scene:
        return with_shifts(scene, dict(zip(names, values.tolist(), strict=True)))

    def near(values: np.ndarray, solution: Solution, change: np.ndarray) -> Solution:
        changed = at(names, values + change)
        try:
            return solve_near(changed, solution)
        except NotConverged:
            return solve(changed)

    # Bodies that only the bolts hold need a certain force.
    guesses, solution = _solve_scaled(
        np.array(list(shifts.values())),
        2.0,
        DOUBLINGS,
        lambda values: solve(at(list(shifts), values)),
    )
    first = solution
    steps = solution.newton_steps
    sought = sought_forces(scene, solution.model)
    names = [given.name for given in sought]
    values = guesses[[list(shifts).index(name) for name in names]]
    wanted = np.array([given.force for given in sought])
    forces = _forces_of(solution, sought)
    scale = max(abs(wanted).max(), abs(forces).max())
    shanks = stiffnesses(solution.model.space, sought)
    # A bolt may be slack, and a cell may be much softer than its sides.
    share = SLACK * _least_share(solution.model)
    of_sides = np.array([given.of_sides for given in sought])
    slack = np.where(of_sides, 0.0, share) * shanks
    # The components of a force of sides are proportional to no shift of their own.
    slopes = _first_slopes(forces, np.where(of_sides, 0.0, values), shanks, slack)
    for _ in range(SOLVES):
        log_of(solution.model.space.comm).debug("Given forces %s: shifts %s", forces, values)
        left = wanted - forces
        if abs(left).max() <= SAME_FORCE * scale:
            return replace(solution, newton_steps=steps), first
        change = np.linalg.lstsq(slopes, left, rcond=None)[0]
        solve_changed = partial(near, values, solution)
        change, solution = _solve_scaled(change, 0.5, HALVINGS, solve_changed)
        steps += solution.newton_steps
        values = values + change
        forces_before = forces
        forces = _forces_of(solution, sought)
        # Broyden's update: the slopes explain the last change, and stay across it.
        gained = forces - forces_before
        weighted = shanks * change
        slopes += np.outer(gained - slopes @ change, weighted) / (weighted @ change)
        if abs(gained).max() <= slack.min() * abs(change).max():
            _check_slack(names, forces, wanted)
        if (slopes.diagonal() <= slack).any():
            slopes = np.diag(shanks)
    told = [
        f"{name!r} {force:.6g} of {given:.6g}"
        for name, force, given in zip(names, forces, wanted, strict=True)
    ]
    raise NotConverged(
        "No shifts were found that give the forces of preloads or mean stresses, in"
        f" {SOLVES} solves; the last forces are {', '.join(told)}. Look whether contacts carry"
        " what bolts draw together, and whether the body can carry the mean stress.",
        (),
    )


def _preloads(scene: Scene) -> list[Preload]:
    """Return the preloads of a scene."""
    return [tie for tie in scene.ties if isinstance(tie, Preload)]


def _solve_scaled(
    shifts: np.ndarray, factor: float, most: int, solve: Callable[[np.ndarray], Solution]
) -> tuple[np.ndarray, Solution]:
    """Solve with shifts, or with scaled shifts where there is no solution.

    Args:
        shifts: Shifts, or changes of shifts [length].
        factor: Factor by which they are scaled once and again [-].
        most: Greatest number of times.
        solve: Solves with shifts.

    Returns:
        The shifts with which there is a solution, and this.
    """
    for _ in range(most):
        try:
            return shifts, solve(shifts)
        except NotConverged:
            if not shifts.any():
                raise
            shifts = factor * shifts
    return shifts, solve(shifts)


def _forces_of(solution: Solution, sought: Sequence[GivenForce]) -> np.ndarray:
    """Return the forces of a solution where forces are given [force]; collective."""
    # All ranks ask for the parts in one order.
    parts = dict.fromkeys(given.part for given in sought)
    of_parts = {part: solution.force(part).force for part in parts}
    return np.array([of_parts[given.part] @ given.direction for given in sought])


def _check_slack(names: Sequence[str], forces: np.ndarray, wanted: np.ndarray) -> None:
    """Check that bolts whose forces do not change with their shifts are slack.

    Raises:
        NotConverged: If one has more force than is wanted.
    """
    for name, force, given in zip(names, forces, wanted, strict=True):
        if abs(force) > abs(given):
            raise NotConverged(
                f"No shift gives {name!r} the force {given:.6g}: it stays at {force:.6g} however"
                " far the sides are let apart, because the loads pull as much."
                " Give more force, or tighten before the loads come, in a history.",
                (),
            )


def _least_share(model: Model) -> float:
    """Return the share of its stiffness that a law keeps at any strain [-]; collective.

    It is 0 where a potential does not tell it.
    """
    if model.linearised is None:
        return 1.0
    law = model.linearised.law
    if not law.has_convexity:
        return 0.0
    x, _ = model.space.cell_rule(1)
    shares = law.convexity(x, model.space.owned_cells)
    return float(model.space.comm.allreduce(float(shares.min(initial=1.0)), MPI.MIN))


def _first_slopes(
    forces: np.ndarray, shifts: np.ndarray, shanks: np.ndarray, slack: np.ndarray
) -> np.ndarray:
    """Return the slopes of proportional forces, or of the shanks where bolts are slack.

    Args:
        forces: Forces of the bolts [force], shape (m,).
        shifts: Their shifts [length].
        shanks: Stiffnesses of their shanks [force/length].
        slack: Stiffnesses below which bolts are slack [force/length].

    Returns:
        Shape (m, m).
    """
    slopes = np.divide(forces, shifts, out=np.zeros_like(forces), where=shifts != 0.0)
    return np.diag(np.where(slopes > slack, slopes, shanks))
