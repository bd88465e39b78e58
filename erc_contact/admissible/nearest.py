"""Tractions nearest to given tractions that balance other forces on rigid motions.

Of all tractions r in the convex sets of the nodes that balance the other forces, those
nearest to given z (with the least ``sum |F|/(m b) |r - z|^2``) are ``r = P(z + b sum_k
y_k q_k)``. Here P is the projection on the sets, y_k a multiplier for each motion m_k,
and q_k the mean of m_k at the nodes; b is the modulus at a facet over the mean modulus,
because a change of the traction on a soft body costs more. The multipliers y minimise a
convex function whose gradient is the imbalance ``s_k = int r.m_k + work(m_k)``. They
are at most six a body.

Springs that alone hold a motion take up an imbalance s. They have the error ``s . M^-1
s`` then, where M is their stiffness on the motions. With this error beside the
distance, the gradient is ``s + D y``, where D is M over the stiffness that weights the
distance. So soft springs (small D) have nearly balance, and stiff ones leave r alone. D
is zero for motions that nothing but contact holds, and their balance is exact.

Symbols: f facets, m nodes of a facet, d dimension, K motions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cones import Cones

IMBALANCE_ROUND_OFF = 1e-15
"""Imbalance that counts as round-off, over the forces [-]."""
SMALL_IMBALANCE = 1e-9
"""Imbalance below which a solve only improves the last digits, over the forces [-]."""
BALANCE_STEPS = 300
"""Limit of the steps of one solve; 2 to 10 are usual."""
PATIENCE = 60
"""Steps without halving the imbalance after which a solve ends."""
IMPATIENCE = 5
"""The same where the imbalance is below :data:`SMALL_IMBALANCE`."""
NEWTON_RETRY = 5
"""Number of steps after which a Newton step is tried again."""
LINE_STEPS = 60
"""Limit of the lengths that are tried for a step."""
REGULAR = 1e-12
"""Share of the trace that is added to the diagonal of a derivative [-].

Motions on which no traction can work have no derivative.
"""


@dataclass(frozen=True, eq=False)
class BalancePart:
    """Hold one contact in the balance.

    Attributes:
        cones: The sets of its nodes.
        start: Tractions r_0 [force/area], shape (f, m, d).
        shift: The tractions wanted are r_0 plus this [force/area], shape (f, m, d).
        weight: |F|/m, zero where the facet is not of this rank [length^(d-1)], shape
            (f, 1).
        motions: q, shape (f, m, d, K).
        modulus: b [-], shape (f,).
    """

    cones: Cones
    start: np.ndarray
    shift: np.ndarray
    weight: np.ndarray
    motions: np.ndarray
    modulus: np.ndarray

    def move(self, wanted: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return ``z + b q y`` for wanted tractions z [force/area], shape (f, m, d)."""
        return wanted + self.modulus[:, None, None] * (self.motions @ y)

    def on_facets(self, facets: np.ndarray) -> BalancePart:
        """Return the part of the facets of a mask, shape (f,) of booleans."""
        c = self.cones
        cones = Cones(c.n[facets], c.slope[facets], c.offset[facets], c.bilateral[facets])
        return BalancePart(
            cones,
            self.start[facets],
            self.shift[facets],
            self.weight[facets],
            self.motions[facets],
            self.modulus[facets],
        )


@dataclass(frozen=True, eq=False)
class TractionState:
    """Hold tractions ``r = P(z + b q y)`` for some multipliers y.

    Attributes:
        multipliers: y plus the multipliers of the solves before [force/area], shape
            (K,).
        tractions: r of each contact [force/area], shape (f, m, d).
        outside: ``z + b q y - r`` of each contact, the part outside the sets
            [force/area], shape (f, m, d).
        imbalance: ``s + D y`` on the motions [force], shape (K,).
        forces: Sum of the contact forces, or the other ones if they are larger.
        noise: Round-off of the imbalance [force].
    """

    multipliers: np.ndarray
    tractions: list[np.ndarray]
    outside: list[np.ndarray]
    imbalance: np.ndarray
    forces: float
    noise: float

    @property
    def size(self) -> float:
        """Return the size of the imbalance [force]."""
        return float(np.linalg.norm(self.imbalance))


@dataclass(frozen=True, eq=False)
class Nearest:
    """Find tractions that balance the other forces, nearest to wanted tractions.

    Attributes:
        comm: Communicator.
        parts: The contacts.
        wanted: z of each contact [force/area], shape (f, m, d).
        works: Work of the other forces on the motions [force], shape (K,).
        give: D [area], shape (K, K).
        before: Multipliers of the solves before, from whose tractions the wanted ones
            are made [force/area], shape (K,).
        area: Area of all contacts [length^(d-1)].
    """

    comm: MPI.Comm
    parts: list[BalancePart]
    wanted: list[np.ndarray]
    works: np.ndarray
    give: np.ndarray
    before: np.ndarray
    area: float

    def solve(self) -> TractionState:
        """Return the best state of all steps; collective.

        The steps are Newton's. Where Newton fails because of the kinks of P, BFGS takes
        over, which tolerates kinks.
        """
        y = np.zeros(len(self.works))
        now = best = self.state(y)
        inverse = self.inverse(y)
        last_gain = 0
        smooth = True
        for i in range(1, BALANCE_STEPS + 1):
            is_large = best.size > SMALL_IMBALANCE * best.forces
            patience = PATIENCE if is_large else IMPATIENCE
            if now.size <= now.noise or i > last_gain + patience:
                break
            # Near a kink of P its derivative is of no use, and BFGS takes over.
            newton = self.inverse(y) if smooth else inverse
            step = -newton @ now.imbalance
            length, new = self.line_search(y, step, now)
            y = y + length * step
            inverse = _update(inverse, length * step, new.imbalance - now.imbalance)
            # Newton's method goes on while a step gains a digit, else BFGS for a while.
            smooth = new.size < 0.1 * now.size or i % NEWTON_RETRY == 0
            if new.size < 0.5 * best.size:
                last_gain = i
            now = new
            if new.size < best.size:
                best = new
        return best

    def state(self, y: np.ndarray) -> TractionState:
        """Return the state of multipliers y; collective."""
        count = len(self.works)
        tractions = []
        outside = []
        # The works on the motions, and the sums of |r| and of |z + b q y|.
        local = np.zeros(count + 2)
        for part, wanted in zip(self.parts, self.wanted, strict=True):
            z = part.move(wanted, y)
            r = part.cones.nearest(z)
            forces = part.weight[..., None] * r
            local[:count] += np.einsum("fmi,fmik->k", forces, part.motions)
            local[count] += float((part.weight * np.linalg.norm(r, axis=-1)).sum())
            local[count + 1] += float((part.weight * np.linalg.norm(z, axis=-1)).sum())
            tractions.append(r)
            outside.append(z - r)
        total = self.comm.allreduce(local, MPI.SUM)
        # Round-off is relative to what is added up: forces, and z where it is large.
        size = max(float(total[count]), float(np.linalg.norm(self.works)))
        noise = IMBALANCE_ROUND_OFF * max(size, float(total[count + 1]))
        multipliers = self.before + y
        imbalance = total[:count] + self.works + self.give @ multipliers
        return TractionState(multipliers, tractions, outside, imbalance, size, noise)

    def inverse(self, y: np.ndarray) -> np.ndarray:
        """Return the inverse of the derivative of the imbalance by y; collective."""
        count = len(self.works)
        matrix = np.zeros((count, count))
        for part, wanted in zip(self.parts, self.wanted, strict=True):
            left, right = part.cones.derivative(part.move(wanted, y), part.motions)
            weighted = (part.weight * part.modulus[:, None])[..., None, None] * left
            matrix += weighted.reshape(-1, count).T @ right.reshape(-1, count)
        # Only round-off makes it unsymmetric, or singular where a motion slips freely.
        matrix = self.comm.allreduce(0.5 * (matrix + matrix.T), MPI.SUM)
        diagonal = max(REGULAR * float(np.trace(matrix)), REGULAR * self.area)
        return np.linalg.inv(matrix + self.give + diagonal * np.eye(count))

    def line_search(
        self, y: np.ndarray, step: np.ndarray, now: TractionState
    ) -> tuple[float, TractionState]:
        """Find the length of a step from y; collective.

        The slope along it is there at most half of that at its start. The slope does
        not decrease, so its zero can be bracketed: first by factors of ten, then by
        secants and bisections in turn.

        Returns:
            The length, and the state there.
        """
        start = float(now.imbalance @ step)
        low = 0.0
        high = np.inf
        at_low = start
        at_high = np.inf
        length = 1.0
        for i in range(LINE_STEPS):
            new = self.state(y + length * step)
            slope = float(new.imbalance @ step)
            if abs(slope) <= max(0.5 * abs(start), new.noise * float(np.linalg.norm(step))):
                break
            if slope < 0:
                low = length
                at_low = slope
            else:
                high = length
                at_high = slope
            # The zero may be decades away: means of exponents until it is within one.
            if high == np.inf:
                length *= 10
            elif high > 10 * low:
                length = max(0.1 * high, np.sqrt(low * high))
            elif i % 2:
                length = (low + high) / 2
            else:
                # Secants alone would crawl at a kink, from one side.
                length = low + (high - low) * at_low / (at_low - at_high)
        return length, new


def _update(inverse: np.ndarray, step: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Update an inverse derivative as BFGS does.

    Args:
        inverse: The inverse, shape (K, K).
        step: Step in y, shape (K,).
        change: Change of the imbalance by it [force], shape (K,).
    """
    curvature = float(step @ change)
    # A convex function has none below zero: round-off, which would cost definiteness.
    if curvature <= 0:
        return inverse
    left = np.eye(len(step)) - np.outer(step, change) / curvature
    return left @ inverse @ left.T + np.outer(step, step) / curvature
