"""Statics of bodies that supports leave rigid motions: a linear programme.

Rigid motions cost no energy, so contact forces alone balance the loads on them.
Symbols: m_k free motions, f_k work of the loads on them [force length], x_i vertices of
contact facets, w_k(x_i) jump of a motion there, n normal of the contact, g gap, s slip
before, r_i forces at the vertices, with pressures p_i = -r_i.n, in the cones of
friction. The programme is

    minimise  sum_i p_i g_i - r_i.s_i
    over      r_i in the cones,  sum_i r_i.w_k(x_i) = -f_k.

Any traction in the cones has such forces, its moments against the linear shape
functions. Where normals turn along a facet, each vertex has the cones of all of them.
So where no forces fulfil the equations, the scene has no solution. The multipliers are
a motion q that the loads want most, ``max f.q``, of motions on whose jump no force of a
cone does more work than on gap and slip: bodies fall until contacts stop them, and
stick where friction holds them.

Where there is no solution, a second programme minimises what is left of the equations.
Its multipliers are the motion by which the bodies go.

Under a mean stress the copies of a body move against each other, too: the jump J of
periodic sides is a motion on which a given force does work.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import together
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.friction import CONCAVE, CONSTANT
from erc_contact.model.given_forces import GivenForce
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.base.percent import place_words
from namedmesh.base.ranks import from_first, gathered

DIRECTIONS = 8
"""Number of sides of the polygon round the circle of friction in 3D."""
SLIDES = 1e-3
"""Rotation over the size of the body that is none, over its displacement [-]."""
SAME_PLACE = 1e-9
"""Coordinate that counts as zero, over the size of the body [-]."""
BALANCED = 1e-6
"""Work left that is none, over the work of the loads [-]."""
SAMPLE = 1000
"""Number of forces with which the programme begins, and that join it at once."""
GAIN = 1e-12
"""Gain of a force that is none, over the greatest cost [-]."""
NO_LOAD = 1e-12
"""Work of loads on a motion that is round-off, over the work of their sizes [-]."""


@dataclass(frozen=True, eq=False)
class Forces:
    """Hold unit forces at the vertices of contacts, columns of the programme.

    Attributes:
        work: Work of each on the free motions, shape (n, K).
        cost: Work of each on gap and slip [length], shape (n,).
        least: Least size of each, shape (n,).
        most: Most size of each, shape (n,).
    """

    work: np.ndarray
    cost: np.ndarray
    least: np.ndarray
    most: np.ndarray


def motion_at_rest(model: Model, loads: fem.Function) -> fem.Function | None:
    """Find the rigid motion by which loads bring bodies to contacts; collective.

    Args:
        model: The scene on a mesh.
        loads: Nodal forces of its loads [force], not yet summed over ranks.

    Returns:
        The displacement [length]; None if contacts have neither gaps nor slip, if loads
        do no work on a free motion, or if no contact forces balance them.
    """
    moves = any(c.gap is not None or c.trace.before is not None for c in model.contacts)
    if not model.free_motions or not moves:
        return None
    motions, work, parts = programme(model, loads)
    solution = on_first(model.space, parts, _rest, work)
    if solution is None:
        return None
    displacement = model.space.function()
    displacement.x.array[:] = motions @ solution
    return displacement


def mechanism(model: Model, loads: fem.Function) -> str | None:
    """Say how loads move bodies that contacts do not hold; collective.

    Args:
        model: The scene on a mesh.
        loads: Nodal forces of its loads [force], not yet summed over ranks.

    Returns:
        The motion in words; None if forces of the contacts may balance the loads.
    """
    if not model.free_motions:
        return None
    motions, work, parts = programme(model, loads)
    solution = on_first(model.space, parts, find_unbalanced, work)
    if solution is None:
        return None
    left, amounts = solution
    return _describe(model.space, motions @ amounts, left)


def jumps_not_held(model: Model, loads: fem.Function, given: Sequence[GivenForce]) -> list[str]:
    """Name the jumps of periodic sides whose forces nothing balances; collective.

    Args:
        model: The scene on a mesh.
        loads: Nodal forces of its loads [force], not yet summed over ranks.
        given: The forces that a mean stress gives.
    """
    if not model.free_motions or not given:
        return []
    _, work, parts = programme(model, loads, given=given)
    solution = on_first(model.space, parts, find_unbalanced, work)
    if solution is None:
        return []
    jumps = abs(solution[1][-len(given) :])
    moved = jumps > SLIDES * abs(solution[1]).max()
    return [force.name for force, is_moved in zip(given, moved, strict=True) if is_moved]


def _describe(space: Space, motion: np.ndarray, work: float) -> str:
    """Describe the motion of the body that moves farthest in words; collective.

    It turns about a point with a moment that is too much, or slides with a force.

    Args:
        space: The mesh.
        motion: Rigid motions of the bodies at the nodes of this rank, shape (nodes d,).
        work: Work of the loads on it that is too much.
    """
    d = space.d
    corners = space.cell_corners()[: space.domain.owned_cells]
    values = motion.reshape(-1, d)[space.vertices[: len(corners)]]
    moved = np.linalg.norm(values, axis=2).max(axis=1, initial=0.0)
    farthest = None
    if len(moved):
        cell = int(np.argmax(moved))
        farthest = float(moved[cell]), corners[cell].tolist(), values[cell].tolist()
    _, x, u = max(found for found in space.comm.allgather(farthest) if found is not None)
    points, displacements = np.array(x), np.array(u)
    gradient = np.linalg.solve(points[1:] - points[0], displacements[1:] - displacements[0]).T
    skew = 0.5 * (gradient - gradient.T)
    rate = np.linalg.norm(skew) / np.sqrt(2.0)
    length = float(np.linalg.norm(displacements[0]))
    if rate * space.domain.extent <= SLIDES * length:
        middle = place_words(points.mean(axis=0), 3)
        along = place_words(displacements[0] / length, 2)
        return f"move the body at {middle} along {along} with {work / length:.3g} too much"
    # The point nearest to the corner at which u = skew (x - place) is at rest.
    place = points[0] - np.linalg.lstsq(skew, displacements[0], rcond=1e-9)[0]
    place[abs(place) < SAME_PLACE * space.domain.extent] = 0.0
    moment = work / float(rate)
    return f"turn a body about {place_words(place, 3)} with a moment of {moment:.3g} too much"


def programme(
    model: Model, loads: fem.Function, friction: float = 1.0, given: Sequence[GivenForce] = ()
) -> tuple[np.ndarray, np.ndarray, list[Forces]]:
    """Return free motions, the work of loads on them, and unit forces; collective.

    Args:
        model: The scene on a mesh.
        loads: Nodal forces of its loads [force], not yet summed over ranks.
        friction: Factor of the friction bounds [-].
        given: Given forces, whose jumps are further motions.

    Returns:
        The motions of bodies at the nodes, shape (nodes d, m); work [force length],
        shape (K,); the forces of this rank at each contact.
    """
    motions = np.column_stack([motion.x.array for motion in model.free_motions])
    of_loads = work_of_loads(model.space, loads, motions)
    work = np.append(of_loads, [force.force for force in given])
    parts = []
    for contact in model.contacts:
        parts.append(_forces(model.space, contact, _jumps(contact, motions, given), friction))
    return motions, work, parts


def _jumps(contact: ContactOnMesh, motions: np.ndarray, given: Sequence[GivenForce]) -> np.ndarray:
    """Return jumps of motions at the vertices of owned facets, shape (f, d, d, K)."""
    owned, d = contact.trace.here.owned, contact.trace.here.d
    jumps = [contact.trace.of(motion)[owned, :d] for motion in motions.T]
    for force in given:
        is_here = force.contact is contact
        jumps.append(np.broadcast_to(is_here * force.direction, (int(owned.sum()), d, d)))
    return np.stack(jumps, axis=-1)


def work_of_loads(space: Space, loads: fem.Function, motions: np.ndarray) -> np.ndarray:
    """Return the work of loads on free motions [force length], zero for round-off."""
    forces = loads.x.array
    local = np.array([forces @ motions, abs(forces) @ abs(motions)])
    work, size = space.comm.allreduce(local, MPI.SUM)
    return np.where(abs(work) > NO_LOAD * size, work, 0.0)


def _forces(space: Space, contact: ContactOnMesh, w: np.ndarray, friction: float) -> Forces:
    """Return unit forces at the vertices of a contact's owned facets; collective.

    Args:
        space: The mesh.
        contact: The contact.
        w: Jumps of the motions there, shape (f, d, d, K).
        friction: Factor of the friction bounds [-].
    """
    trace = contact.trace
    d = space.d
    vertices = slice(0, d)
    owned = trace.here.owned
    gap = np.zeros(w.shape[:2])
    if contact.gap is not None:
        points = space.facet_points[vertices]
        gap = space.evaluate(contact.gap, points, contact.facets)[owned]
    slip = trace.slip_before[owned, vertices]
    slope, offset, is_free = _friction(space, contact)
    slope = np.broadcast_to(friction * slope[owned, None], gap.shape)
    limit = (friction * offset * trace.here.areas / d)[owned, None]
    limit = np.broadcast_to(np.inf if is_free else limit, gap.shape)

    normal_least = -np.inf if contact.bilateral else 0.0
    columns = []

    def add(direction: np.ndarray, along_n: float, least: Any, most: Any) -> None:
        """Add forces of a direction (f, v, d), whose pressure is ``along_n``."""
        work = np.einsum("fvd,fvdk->fvk", direction, w).reshape(-1, w.shape[3])
        cost = along_n * gap - np.einsum("fvd,fvd->fv", direction, slip)
        lower = np.broadcast_to(least, gap.shape).ravel()
        upper = np.broadcast_to(most, gap.shape).ravel()
        columns.append(Forces(work, cost.ravel(), lower, upper))

    facets = np.flatnonzero(owned)
    for direction in _normals(contact):
        n = np.broadcast_to(direction[owned, None, :], w.shape[:3])
        directions = contact.friction_set.semi_axes(n, facets)
        if slope.any() and not is_free:
            around = np.cos(np.pi / DIRECTIONS) if d == 3 else 1.0
            for along in _polygon(directions):
                add(slope[..., None] / around * along - n, 1.0, 0.0, np.inf)
        else:
            add(-n, 1.0, normal_least, np.inf)
        if limit.any():
            for tangent in directions:
                add(tangent, 0.0, -limit, limit)
    return _join(columns)


def _normals(contact: ContactOnMesh) -> list[np.ndarray]:
    """Return normals of facets whose cones together hold all tractions, (f, d) each.

    The cone about a sum of normals lies in the sum of the cones about them, so where
    normals turn along a facet, the normals at its vertices are enough.
    """
    of_corners = contact.trace.corner_normals
    if of_corners is None:
        return [contact.direction]
    return list(of_corners.swapaxes(0, 1))


def _friction(space: Space, contact: ContactOnMesh) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return slope and offset of the friction bound on each facet, at most; collective.

    The last value tells that the bound is no line, and counts as infinite.
    """
    none = np.zeros(len(contact.facets))
    if contact.friction is None:
        return none, none, False
    dependence = contact.friction.dependence
    if dependence == CONCAVE:
        return none, none, True
    values = friction_parameters(space, contact, space.facet_samples)
    shape = len(contact.facets), len(space.facet_samples)
    bound = contact.friction_bound(np.ones(shape), values).max(axis=1, initial=0.0)
    if dependence == CONSTANT:
        return none, bound, False
    return bound, none, False


def _polygon(directions: list[np.ndarray]) -> list[np.ndarray]:
    """Return directions of friction: two in the plane, else corners of a polygon."""
    first, *others = directions
    if not others:
        return [first, -first]
    (second,) = others
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return [np.cos(angle) * first + np.sin(angle) * second for angle in angles]


def on_first(
    space: Space, parts: list[Forces], solve: Callable[[Forces, np.ndarray], Any], work: np.ndarray
) -> Any:
    """Solve a programme with the forces of all ranks on rank 0; collective.

    None if loads do no work on the motions.

    Args:
        space: The mesh.
        parts: The unit forces of this rank at each contact.
        solve: Solves the programme of forces and the work of loads.
        work: Work of the loads on the motions, shape (K,).
    """
    if not work.any():
        return None
    of_ranks = gathered(space.comm, parts)

    def solve_joined() -> Any:
        if of_ranks is None:
            return None
        return solve(_join([part for of_rank in of_ranks for part in of_rank]), work)

    return from_first(space.comm, together(space.comm, solve_joined))


def _join(parts: list[Forces]) -> Forces:
    """Return unit forces in turn."""
    return Forces(
        np.concatenate([part.work for part in parts]),
        np.concatenate([part.cost for part in parts]),
        np.concatenate([part.least for part in parts]),
        np.concatenate([part.most for part in parts]),
    )


def _rest(forces: Forces, work: np.ndarray) -> np.ndarray | None:
    """Return the amounts of the motions at rest, or None without a solution."""
    length = abs(forces.cost).max(initial=0.0) or 1.0
    bounds = np.column_stack([forces.least, forces.most])
    size = float(abs(work).max())
    result = _minimise(forces.cost / length, forces.work.T, work, bounds, size)
    return None if result is None else -length * result[1]


def find_unbalanced(forces: Forces, work: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Return the work that no forces balance, and the amounts of its motion.

    None if forces balance all of it.
    """
    count = len(work)
    # Two more columns for each equation take up what is left of it.
    matrix = np.hstack([forces.work.T, np.eye(count), -np.eye(count)])
    cost = np.concatenate([np.zeros(len(forces.cost)), np.ones(2 * count)])
    least = np.concatenate([forces.least, np.zeros(2 * count)])
    most = np.concatenate([forces.most, np.full(2 * count, np.inf)])
    size = float(abs(work).max())
    result = _minimise(cost, matrix, work, np.column_stack([least, most]), size)
    if result is None or result[0] <= BALANCED * size:
        return None
    return result[0], -result[1]


def greatest_share(forces: Forces, work: np.ndarray, part: np.ndarray) -> float | None:
    """Return the greatest share of a part of the loads that forces balance [-].

    The other loads are as they are. None if no share of it is balanced.

    Args:
        forces: The unit forces.
        work: Work of all loads on the motions [force length], shape (K,).
        part: Work of the part, shape (K,).
    """
    size = float(abs(work).max())
    matrix = np.column_stack([forces.work.T, part / size])
    cost = np.append(np.zeros(len(forces.cost)), -1.0)
    bounds = np.column_stack([np.append(forces.least, 0.0), np.append(forces.most, size)])
    result = _minimise(cost, matrix, work - part, bounds, size)
    return None if result is None else -result[0] / size


def _minimise(
    cost: np.ndarray, matrix: np.ndarray, work: np.ndarray, bounds: np.ndarray, size: float
) -> tuple[float, np.ndarray] | None:
    """Minimise the cost of forces that balance work; None without a solution.

    Args:
        cost: Cost of each force.
        matrix: Work of each on the motions, shape (K, n).
        work: Work that they balance [force length], shape (K,).
        bounds: Least and most size of each, shape (n, 2).
        size: Size of the work of all loads [force length].

    Returns:
        The least cost, and the multipliers of the equations.
    """
    from scipy.optimize import linprog  # type: ignore[import-untyped]  # noqa: PLC0415 - for loose bodies only

    scaled = bounds / size
    # Few forces do the work: forces that would lower the cost join a sample.
    chosen = np.zeros(len(cost), dtype=bool)
    chosen[:: 1 + len(cost) // SAMPLE] = True
    chosen[-2 * len(work) :] = True
    while True:
        result = linprog(
            cost[chosen],
            A_eq=matrix[:, chosen],
            b_eq=-work / size,
            bounds=scaled[chosen],
            method="highs",
        )
        if result.status != 0 and chosen.all():
            return None
        if result.status != 0:
            chosen[:] = True
            continue
        gain = result.eqlin.marginals @ matrix - cost
        gain = np.where(scaled[:, 0] < 0, abs(gain), gain)
        gain[chosen] = 0.0
        lowers = np.argsort(-gain)[:SAMPLE]
        lowers = lowers[gain[lowers] > GAIN * max(1.0, float(abs(cost).max(initial=0.0)))]
        if not len(lowers):
            return float(result.fun) * size, np.asarray(result.eqlin.marginals)
        chosen[lowers] = True
