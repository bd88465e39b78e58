"""Tractions in convex sets that balance the loads on the rigid motions that no support holds.

Of all tractions r in the sets of the nodes that balance, the ones nearest to given z, ``sum |F|/m |r - z|^2`` least,
are ``r = P(z + sum_k y_k q_k)`` with P the projection, one multiplier y_k for each free motion m_k and q_k its mean at
the nodes; y minimises a convex function whose gradient is the imbalance ``int r.m_k + load(m_k)``. Newton in at most
six unknowns finds it, with the derivative of P, and the length of its step from the slope along it, which cannot
decrease.

Symbols: n normal of the foundation, p = -r_n pressure, f facets, m nodes of a facet, d dimension, K motions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

STEPS = 300
"""Limit of the steps of one solve; 2 to 10 are usual."""
PATIENCE = 60
"""A solve ends after so many steps that have not halved the imbalance."""
STAGES = 8
"""Limit of the shares of a pull; one or two are usual."""
FAR, NEAR = 100.0, 10.0
"""Longest share of a pull, and what is kept beyond a set, over the largest traction [-]."""
EXACT = 1e-15
"""Imbalance that is round-off, over the forces [-]."""
SMALL = 1e-9
"""Imbalance below which a further share or many further steps are not worth their time, over the forces [-]."""
ENOUGH = 5
"""Steps without progress that end a solve whose imbalance is small."""


def split(z: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normal component, tangential part and its length, of vectors (..., d) and unit normals of the same shape."""
    z_n = (z * n).sum(axis=-1)
    z_t = z - z_n[..., None] * n
    return z_n, z_t, np.linalg.norm(z_t, axis=-1)


def clip(z_t: np.ndarray, size: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Shorten tangential vectors of given lengths to a bound."""
    return np.divide(bound, size, out=np.ones_like(size), where=size > bound)[..., None] * z_t


@dataclass(frozen=True, eq=False)
class Cones:
    """The tractions ``|r_t| <= offset + slope p``, ``p >= 0``, at each node: Coulomb's cone, a cylinder, and between.

    Attributes:
        n: Unit normals, shape (f, 1, d).
        slope: Shape (f, m) [-].
        offset: Shape (f, m) [force/area].
        pulls: Where p may have any sign; the slope is zero there. Shape (f, m).
    """

    n: np.ndarray
    slope: np.ndarray
    offset: np.ndarray
    pulls: np.ndarray

    def nearest(self, z: np.ndarray) -> np.ndarray:
        """The nearest of these tractions (Euclidean projection, non-expansive), shape (f, m, d) [force/area]."""
        return self._project(z)[0]

    def _project(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The nearest traction, z_t and its length, and where the friction bound does not limit it."""
        z_n, z_t, size = split(z, self.n)
        shown = np.where(self.pulls, -z_n, np.maximum(-z_n, 0.0))
        inside = size <= self.offset + self.slope * shown
        on_surface = np.maximum(self.slope * (size - self.offset) - z_n, 0.0) / (1 + self.slope**2)
        p = np.where(inside | self.pulls, shown, on_surface)
        r_t = clip(z_t, np.where(inside, 0.0, size), self.offset + self.slope * p)
        return r_t - p[..., None] * self.n, z_t, size, inside

    def derivative(self, z: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of the projection in directions q (f, m, d, K), as two factors A, B: ``q.P'q = A.B`` at each node.

        Returns:
            Two arrays (f, m, d + 2, K): the parts along n, along z_t, and across both.
        """
        r, z_t, size, inside = self._project(z)
        along = np.divide(z_t, size[..., None], out=np.zeros_like(z_t), where=size[..., None] > 0)
        q_n, q_t = np.einsum("fmik,fzi->fmk", q, self.n), np.einsum("fmik,fmi->fmk", q, along)
        across = q - self.n[..., None] * q_n[:, :, None] - along[..., None] * q_t[:, :, None]
        presses = (((r * self.n).sum(axis=-1) < 0) | self.pulls)[..., None]
        inside, slope = inside[..., None], self.slope[..., None]
        moved = presses * (q_n - slope * q_t) / (1 + slope**2)  # on the surface
        normal = np.where(inside, presses * q_n, moved)
        tangential = np.where(inside, q_t, -slope * moved)
        length = np.linalg.norm(split(r, self.n)[1], axis=-1)
        turned = np.where(inside[..., 0], 1.0, np.divide(length, size, out=np.zeros_like(size), where=size > 0))
        left = np.concatenate([normal[:, :, None], tangential[:, :, None], turned[..., None, None] * across], axis=2)
        return left, np.concatenate([q_n[:, :, None], q_t[:, :, None], across], axis=2)


@dataclass(frozen=True, eq=False)
class Part:
    """One contact in the balance.

    Attributes:
        cones: The sets of its nodes.
        start: r_0 [force/area], shape (f, m, d).
        pull: Where the tractions are drawn from there [force/area], shape (f, m, d).
        weight: |F|/m, zero where the facet is not of this rank [length^(d-1)], shape (f, 1).
        motions: q, shape (f, m, d, K).
    """

    cones: Cones
    start: np.ndarray
    pull: np.ndarray
    weight: np.ndarray
    motions: np.ndarray


def balanced(comm: MPI.Comm, parts: list[Part], loads: np.ndarray) -> tuple[list[np.ndarray], np.ndarray, float]:
    """The tractions nearest to start + pull that balance the loads; collective.

    A pull that is much longer than the tractions costs digits and Newton its steps; it is applied in shares. What a
    share leaves beyond the set keeps the tractions where they are on its surface, however much it is shortened.

    Args:
        comm: Of the mesh.
        parts: The contacts.
        loads: Work of the loads on the motions [force], shape (K,).

    Returns:
        The tractions, the imbalance on the motions [force], and the sum of the contact forces.
    """

    def largest(arrays: list[np.ndarray]) -> float:
        return comm.allreduce(max((float(abs(a).max(initial=0.0)) for a in arrays), default=0.0), MPI.MAX)

    area = comm.allreduce(sum(float(p.weight.sum()) * p.start.shape[1] for p in parts), MPI.SUM)
    tractions, left = [p.start for p in parts], [p.pull for p in parts]
    beyond = [np.zeros_like(r) for r in tractions]
    before = np.inf
    for _ in range(STAGES):
        usual = max(largest(tractions), float(np.linalg.norm(loads)) / area)
        share = [_at_most(FAR * usual, pull) for pull in left]
        wanted = [r + _at_most(NEAR * usual, b) + pull for r, b, pull in zip(tractions, beyond, share, strict=True)]
        state = _solve(comm, parts, wanted, loads, area)
        tractions, beyond = state.tractions, state.beyond
        left = [pull - part for pull, part in zip(left, share, strict=True)]
        if largest(left) == 0.0 and (
            state.size <= 10 * EXACT * state.forces or 0.5 * before < state.size < SMALL * state.forces
        ):
            break
        before = state.size
    return tractions, state.imbalance, state.forces


def _at_most(length: float, vectors: np.ndarray) -> np.ndarray:
    return clip(vectors, np.linalg.norm(vectors, axis=-1), np.full(vectors.shape[:-1], length))


@dataclass(frozen=True, eq=False)
class _State:
    """Tractions r = P(z + q y), and what lies beyond, z + q y - r.

    Attributes:
        imbalance: On the motions [force], shape (K,).
        forces: Sum of the contact forces, or the loads if they are larger.
        noise: Round-off of the imbalance [force].
    """

    tractions: list[np.ndarray]
    beyond: list[np.ndarray]
    imbalance: np.ndarray
    forces: float
    noise: float

    @property
    def size(self) -> float:
        """Of the imbalance [force]."""
        return float(np.linalg.norm(self.imbalance))


def _solve(comm: MPI.Comm, parts: list[Part], wanted: list[np.ndarray], loads: np.ndarray, area: float) -> _State:
    """The tractions nearest to the wanted ones that balance the loads.

    Newton's steps, and where these meet kinks of P, steps of BFGS, which sees through kinks.
    """
    size = len(loads)
    small = 1e-12 * area

    def state(y: np.ndarray) -> _State:
        z = [w + part.motions @ y for part, w in zip(parts, wanted, strict=True)]
        r = [part.cones.nearest(v) for part, v in zip(parts, z, strict=True)]
        local = np.zeros(size + 2)
        for part, v, t in zip(parts, z, r, strict=True):
            local[:size] += np.einsum("fmi,fmik->k", part.weight[..., None] * t, part.motions)
            local[size:] += [float((part.weight * np.linalg.norm(a, axis=-1)).sum()) for a in (t, v)]
        total = comm.allreduce(local, MPI.SUM)
        forces = max(float(total[size]), float(np.linalg.norm(loads)))
        noise = EXACT * max(forces, float(total[size + 1]))
        return _State(r, [v - t for v, t in zip(z, r, strict=True)], total[:size] + loads, forces, noise)

    def inverse(y: np.ndarray) -> np.ndarray:
        """Of the derivative of the imbalance."""
        matrix = np.zeros((size, size))
        for part, w in zip(parts, wanted, strict=True):
            left, right = part.cones.derivative(w + part.motions @ y, part.motions)
            matrix += (part.weight[..., None, None] * left).reshape(-1, size).T @ right.reshape(-1, size)
        matrix = comm.allreduce(0.5 * (matrix + matrix.T), MPI.SUM)
        return np.linalg.inv(matrix + max(1e-12 * float(np.trace(matrix)), small) * np.eye(size))

    y = np.zeros(size)
    now = best = state(y)
    metric = inverse(y)
    last, smooth = 0, True
    for i in range(1, STEPS + 1):
        if now.size <= now.noise or i > last + (PATIENCE if best.size > SMALL * best.forces else ENOUGH):
            break
        step = -(inverse(y) if smooth else metric) @ now.imbalance
        length, new = _along(lambda t, y=y, step=step: state(y + t * step), step, now)  # type: ignore[misc]
        y = y + length * step
        metric = _updated(metric, length * step, new.imbalance - now.imbalance)
        smooth = new.size < 0.1 * now.size or i % 5 == 0
        if new.size < 0.5 * best.size:
            last = i
        now = new
        best = min(best, new, key=lambda s: s.size)
    return best


def _updated(metric: np.ndarray, change: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """The update of BFGS."""
    both = float(change @ turn)
    if both <= 0:
        return metric
    left = np.eye(len(change)) - np.outer(change, turn) / both
    return left @ metric @ left.T + np.outer(change, change) / both


def _along(state: Callable[[float], _State], step: np.ndarray, now: _State) -> tuple[float, _State]:
    """Length of a step where the slope along it is at most half of that at its start, and the state there.

    The slope does not decrease: it is bracketed, by factors of ten, then by chords and bisection in turn.
    """
    start = float(now.imbalance @ step)
    low, high, at_low, at_high = 0.0, np.inf, start, np.inf
    length = 1.0
    for i in range(60):
        new = state(length)
        slope = float(new.imbalance @ step)
        if abs(slope) <= max(0.5 * abs(start), new.noise * float(np.linalg.norm(step))):
            break
        if slope < 0:
            low, at_low = length, slope
        else:
            high, at_high = length, slope
        if high == np.inf:
            length *= 10
        elif high > 10 * low:
            length = max(0.1 * high, np.sqrt(low * high))
        elif i % 2:
            length = (low + high) / 2
        else:
            length = low + (high - low) * at_low / (at_low - at_high)
    return length, new
