"""Statics of bodies that supports leave rigid motions: a linear programme.

Rigid motions cost no energy, so contact forces alone balance the loads on them.
Symbols: m_k free motions, f_k work of the loads on them [force length], x_i vertices of
contact facets, w_k(x_i) jump of a motion there, n normal of the contact, g gap, s slip
before, r_i forces at the vertices, with pressures p_i = -r_i.n, in the cones of
friction. The programme is

    minimise  sum_i p_i g_i - r_i.s_i
    over      r_i in the cones,  sum_i r_i.w_k(x_i) = -f_k.

Any traction in the cones has such forces, its moments against the linear shape
functions. So where no forces fulfil the equations, the scene has no solution. The
multipliers are a motion q that the loads want most, ``max f.q``, of those on whose jump
no force of a cone does more work than on gap and slip: bodies fall until contacts stop
them, and stick where friction holds them.

Where there is no solution, a second programme minimises what is left of the equations.
Its multipliers are the motion by which the bodies go.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import together
from erc_contact.base.ranks import from_first, gathered
from erc_contact.model.contact_values import friction_parameters
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import BoundContact
from erc_contact.model.friction import CONCAVE, CONSTANT
from erc_contact.model.model import Model

DIRECTIONS = 8
"""Number of sides of the polygon round the circle of friction in space."""
NO_LOAD = 1e-12
"""Work of loads on a motion that is round-off, over that of their sizes [-]."""


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
    motions = np.column_stack([motion.x.array for motion in model.free_motions])
    work = _work_of_loads(model, loads, motions)
    if not work.any():
        return None
    parts = [_forces(model, contact, motions) for contact in model.contacts]
    amounts = _amounts(model, parts, work)
    if amounts is None:
        return None
    displacement = model.function()
    displacement.x.array[:] = motions @ amounts
    return displacement


def _work_of_loads(model: Model, loads: fem.Function, motions: np.ndarray) -> np.ndarray:
    """Return the work of loads on free motions [force length], zero for round-off."""
    forces = loads.x.array
    local = np.array([forces @ motions, abs(forces) @ abs(motions)])
    work, size = model.comm.allreduce(local, MPI.SUM)
    return np.where(abs(work) > NO_LOAD * size, work, 0.0)


def _forces(model: Model, contact: BoundContact, motions: np.ndarray) -> Forces:
    """Return unit forces at the vertices of a contact's owned facets; collective."""
    trace = contact.trace
    d = model.d
    vertices = slice(0, d)
    owned = trace.here.owned
    jumps = [trace.of(motion)[owned, vertices] for motion in motions.T]
    w = np.stack(jumps, axis=-1)
    n = np.broadcast_to(contact.direction[owned, None, :], w.shape[:3])
    gap = np.zeros(w.shape[:2])
    if contact.gap is not None:
        points = model.facet_points[vertices]
        gap = evaluate(contact.gap, model.mesh, points, contact.facets)[owned]
    slip = trace.slip_before[owned, vertices]
    slope, offset, is_free = _friction(model, contact)
    slope = np.broadcast_to(slope[owned, None], gap.shape)
    limit = (offset * trace.here.areas / d)[owned, None]
    limit = np.broadcast_to(np.inf if is_free else limit, gap.shape)

    normal_least = -np.inf if contact.bilateral else 0.0
    columns = []

    def add(direction: np.ndarray, along_n: float, least: object, most: object) -> None:
        """Add forces of a direction (f, v, d), whose pressure is ``along_n``."""
        work = np.einsum("fvd,fvdk->fvk", direction, w).reshape(-1, w.shape[3])
        cost = along_n * gap - np.einsum("fvd,fvd->fv", direction, slip)
        lower = np.broadcast_to(least, gap.shape).ravel()
        upper = np.broadcast_to(most, gap.shape).ravel()
        columns.append(Forces(work, cost.ravel(), lower, upper))

    tangents = _tangents(n)
    if slope.any() and not is_free:
        round_circle = slope[..., None] / np.cos(np.pi / DIRECTIONS) if d == 3 else slope[..., None]
        for along in _polygon(tangents):
            add(round_circle * along - n, 1.0, 0.0, np.inf)
    else:
        add(-n, 1.0, normal_least, np.inf)
    if limit.any():
        for tangent in tangents:
            add(tangent, 0.0, -limit, limit)
    return Forces(
        np.concatenate([part.work for part in columns]),
        np.concatenate([part.cost for part in columns]),
        np.concatenate([part.least for part in columns]),
        np.concatenate([part.most for part in columns]),
    )


def _friction(model: Model, contact: BoundContact) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return slope and offset of the friction bound on each facet, at most; collective.

    The last value tells that the bound is no line, and counts as infinite.
    """
    none = np.zeros(len(contact.facets))
    if contact.friction is None:
        return none, none, False
    dependence = contact.friction.dependence
    if dependence == CONCAVE:
        return none, none, True
    values = friction_parameters(model, contact, model.facet_samples)
    shape = len(contact.facets), len(model.facet_samples)
    bound = contact.friction_bound(np.ones(shape), values).max(axis=1, initial=0.0)
    if dependence == CONSTANT:
        return none, bound, False
    return bound, none, False


def _tangents(n: np.ndarray) -> list[np.ndarray]:
    """Return d - 1 orthonormal tangents to normals (f, v, d)."""
    if n.shape[-1] == 2:
        return [np.stack([-n[..., 1], n[..., 0]], axis=-1)]
    axes = np.eye(3)[abs(n).argmin(axis=-1)]
    first = np.cross(n, axes)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return [first, np.cross(n, first)]


def _polygon(tangents: list[np.ndarray]) -> list[np.ndarray]:
    """Return directions of friction: both in the plane, else corners of a polygon."""
    if len(tangents) == 1:
        return [tangents[0], -tangents[0]]
    first, second = tangents
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return [np.cos(angle) * first + np.sin(angle) * second for angle in angles]


def _amounts(model: Model, parts: list[Forces], work: np.ndarray) -> np.ndarray | None:
    """Solve the programme for the amounts q of the motions; collective.

    None if no forces balance the loads, or bodies fit nowhere between their contacts.
    """
    local = [(part.work, part.cost, part.least, part.most) for part in parts]
    of_ranks = gathered(model.comm, local)

    def solve() -> np.ndarray | None:
        if of_ranks is None:
            return None
        columns = [of_contact for of_rank in of_ranks for of_contact in of_rank]
        matrix, cost, least, most = (
            np.concatenate([column[i] for column in columns]) for i in range(4)
        )
        return _solved(matrix.T, cost, np.column_stack([least, most]), work)

    return from_first(model.comm, together(model.comm, solve))


def _solved(
    matrix: np.ndarray, cost: np.ndarray, bounds: np.ndarray, work: np.ndarray
) -> np.ndarray | None:
    """Return the multipliers of the programme, or None without a solution."""
    from scipy.optimize import linprog  # noqa: PLC0415 - for loose bodies only

    length = abs(cost).max(initial=0.0) or 1.0
    size = abs(work).max()
    result = linprog(cost / length, A_eq=matrix, b_eq=-work / size, bounds=bounds, method="highs")
    if result.status != 0:
        return None
    return np.asarray(-length * result.eqlin.marginals)
