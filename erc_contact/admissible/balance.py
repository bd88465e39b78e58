"""Contact tractions that balance the loads on the rigid motions that no support holds.

Of all tractions r in the convex sets of the nodes that balance the loads, those nearest
to given z (with the least ``sum |F|/m |r - z|^2``) are ``r = P(z + sum_k y_k q_k)``.
Here P is the projection on the sets, y_k a multiplier for each free motion m_k, and q_k
the mean of m_k at the nodes. The multipliers y minimise a convex function whose
gradient is the imbalance ``int r.m_k + load(m_k)``. They are at most six.

Symbols: f facets, m nodes of a facet, d dimension, K motions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cones import Cones, clip

EXACT = 1e-15
"""Imbalance that counts as round-off, over the forces [-]."""
SMALL = 1e-9
"""Imbalance below which a solve only improves the last digits, over the forces [-]."""
STEPS = 300
"""Limit of the steps of one solve; 2 to 10 are usual."""
PATIENCE, IMPATIENCE = 60, 5
"""Steps without halving the imbalance after which a solve ends: while it is above SMALL, and below it."""
NEWTON = 5
"""Number of steps after which a Newton step is tried again."""
STAGES = 8
"""Limit of the number of shares of a shift; one or two are usual."""
SHARE, KEPT = 100.0, 10.0
"""Longest share of a shift, and longest vector beyond a set that is kept, over the largest traction [-]."""


@dataclass(frozen=True, eq=False)
class Part:
    """One contact in the balance.

    Attributes:
        cones: The sets of its nodes.
        start: Tractions r_0 [force/area], shape (f, m, d).
        shift: The tractions wanted are r_0 plus this [force/area], shape (f, m, d).
        weight: |F|/m, zero where the facet is not of this rank [length^(d-1)], shape
            (f, 1).
        motions: q, shape (f, m, d, K).
    """

    cones: Cones
    start: np.ndarray
    shift: np.ndarray
    weight: np.ndarray
    motions: np.ndarray

    def of(self, facets: np.ndarray) -> Part:
        """The part of some facets, shape (f,) of booleans."""
        c, some = self.cones, (self.start, self.shift, self.weight, self.motions)
        cones = Cones(c.n[facets], c.slope[facets], c.offset[facets], c.bilateral[facets])
        return Part(cones, *(array[facets] for array in some))


def balanced(
    comm: MPI.Comm, parts: list[Part], loads: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray, float]:
    """The tractions nearest to start + shift that balance the loads; collective.

    A shift that is much longer than the tractions loses digits and needs many Newton
    steps, so it is applied in shares. The part of a share that is beyond the set keeps
    the tractions at their place on its surface, even if this part is shortened.

    Args:
        comm: Communicator.
        parts: The contacts.
        loads: Work of the loads on the motions [force], shape (K,).

    Returns:
        The tractions, the imbalance on the motions [force], and the sum of the contact
        forces.
    """

    def largest(arrays: list[np.ndarray]) -> float:
        return comm.allreduce(
            max((float(abs(a).max(initial=0.0)) for a in arrays), default=0.0), MPI.MAX
        )

    area = comm.allreduce(sum(float(p.weight.sum()) * p.start.shape[1] for p in parts), MPI.SUM)
    if largest([p.start for p in parts]) == 0.0 and not loads.any():
        return [p.start for p in parts], np.zeros_like(loads), 0.0
    tractions, left = [p.start for p in parts], [p.shift for p in parts]
    beyond = [np.zeros_like(r) for r in tractions]
    before = np.inf
    for _ in range(STAGES):
        usual = max(largest(tractions), float(np.linalg.norm(loads)) / area)
        share = [_at_most(SHARE * usual, shift) for shift in left]
        wanted = [
            r + _at_most(KEPT * usual, b) + shift
            for r, b, shift in zip(tractions, beyond, share, strict=True)
        ]
        state = _solve(comm, parts, wanted, loads, area)
        tractions, beyond = state.tractions, state.beyond
        left = [shift - part for shift, part in zip(left, share, strict=True)]
        exact = state.size <= 10 * EXACT * state.forces
        if largest(left) == 0.0 and (exact or 0.5 * before < state.size <= SMALL * state.forces):
            break
        before = state.size
    return tractions, state.imbalance, state.forces


def _at_most(length: float, vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., d), shortened to a length where they are longer."""
    return clip(vectors, np.linalg.norm(vectors, axis=-1), np.full(vectors.shape[:-1], length))


@dataclass(frozen=True, eq=False)
class _State:
    """Tractions ``r = P(z + q y)`` for some multipliers y.

    Attributes:
        tractions: r of each contact [force/area], shape (f, m, d).
        beyond: ``z + q y - r`` of each contact, the part beyond the sets [force/area],
            shape (f, m, d).
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
        """Size of the imbalance [force]."""
        return float(np.linalg.norm(self.imbalance))


def _solve(
    comm: MPI.Comm, parts: list[Part], wanted: list[np.ndarray], loads: np.ndarray, area: float
) -> _State:
    """The tractions nearest to the wanted ones that balance the loads.

    The steps are Newton's. Where they fail because of the kinks of P, they are those of
    BFGS, which tolerates kinks.
    """
    size = len(loads)
    small = 1e-12 * area

    def state(y: np.ndarray) -> _State:
        z = [w + part.motions @ y for part, w in zip(parts, wanted, strict=True)]
        r = [part.cones.nearest(v) for part, v in zip(parts, z, strict=True)]
        local = np.zeros(size + 2)
        for part, v, t in zip(parts, z, r, strict=True):
            local[:size] += np.einsum("fmi,fmik->k", part.weight[..., None] * t, part.motions)
            local[size:] += [
                float((part.weight * np.linalg.norm(a, axis=-1)).sum()) for a in (t, v)
            ]
        total = comm.allreduce(local, MPI.SUM)
        forces = max(float(total[size]), float(np.linalg.norm(loads)))
        noise = EXACT * max(forces, float(total[size + 1]))
        return _State(
            r, [v - t for v, t in zip(z, r, strict=True)], total[:size] + loads, forces, noise
        )

    def inverse(y: np.ndarray) -> np.ndarray:
        """Inverse of the derivative of the imbalance by y."""
        matrix = np.zeros((size, size))
        for part, w in zip(parts, wanted, strict=True):
            left, right = part.cones.derivative(w + part.motions @ y, part.motions)
            matrix += (part.weight[..., None, None] * left).reshape(-1, size).T @ right.reshape(
                -1, size
            )
        matrix = comm.allreduce(0.5 * (matrix + matrix.T), MPI.SUM)
        return np.linalg.inv(matrix + max(1e-12 * float(np.trace(matrix)), small) * np.eye(size))

    y = np.zeros(size)
    now = best = state(y)
    updated = inverse(y)
    last, smooth = 0, True
    for i in range(1, STEPS + 1):
        patience = PATIENCE if best.size > SMALL * best.forces else IMPATIENCE
        if now.size <= now.noise or i > last + patience:
            break
        step = -(inverse(y) if smooth else updated) @ now.imbalance
        length, new = _along(state, y, step, now)
        y = y + length * step
        updated = _updated(updated, length * step, new.imbalance - now.imbalance)
        smooth = new.size < 0.1 * now.size or i % NEWTON == 0
        if new.size < 0.5 * best.size:
            last = i
        now = new
        best = min(best, new, key=lambda s: s.size)
    return best


def _updated(inverse: np.ndarray, step: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The update of BFGS of an inverse derivative for a step in y and the change of the imbalance."""
    both = float(step @ change)
    if both <= 0:
        return inverse
    left = np.eye(len(step)) - np.outer(step, change) / both
    return left @ inverse @ left.T + np.outer(step, step) / both


def _along(
    state: Callable[[np.ndarray], _State], y: np.ndarray, step: np.ndarray, now: _State
) -> tuple[float, _State]:
    """Length of a step from y at which the slope along it is at most half of that at its start, and the state there.

    The slope along the step does not decrease, so its zero can be bracketed: first by
    factors of ten, then by secants and bisections in turn.
    """
    start = float(now.imbalance @ step)
    low, high, at_low, at_high = 0.0, np.inf, start, np.inf
    length = 1.0
    for i in range(60):
        new = state(y + length * step)
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
