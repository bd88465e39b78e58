"""Other solutions of a contact problem: Newton's method that is repelled by the solutions it knows, from many starts.

With Coulomb friction a contact problem may have many solutions. Let R be the residual
of the condensed problem and x_i its known solutions. Newton's method for ``M(x) R(x) =
0``, with

    M = prod_i (1/|x - x_i|^2 + 1),

does not converge to any x_i. Its step is that of Newton's method for R, times ``1/(1 -
M' step/M)``. Where the tangent is singular, as on a branch of solutions, the step is
the least one.

The starts are the state of the contact with more and with less friction, the known
state moved along the contact, and the states half way between two solutions.

Source: P. E. Farrell, A. Birkisson, S. W. Funke, SIAM J. Sci. Comput. 37 (2015), for
the deflation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from dolfinx import fem

from erc_contact.model.model import Model
from erc_contact.newton.condensed import Condensed
from erc_contact.newton.dense import Dense
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.snes import Found

STEPS = 40
"""Greatest number of Newton steps from one start."""
SHARES = (0.5, 0.8, 0.95, 1.05, 1.25, 2.0)
"""Shares of the friction bound whose solutions are starts [-]."""
MOVES = (-1.0, -0.3, -0.1, 0.1, 0.3, 1.0)
"""Moves of the contact along itself, over the largest displacement [-]."""
DISTINCT = 1e-3
"""Largest difference of two solutions that count as one, over the largest displacement [-]."""
REACH = 10.0
"""Bound of the factor of a step [-]."""
STILL = 1e-12
"""A step of less than this, over the largest displacement, is the last one [-]."""
NEARLY = 1e-4
"""Residual of a state that counts as a solution where Newton's method stands still,
over the forces that cancel in it. Data that are rounded have nearly a branch of
solutions. The error of the state tells how near it is [-].
"""
RANK = 1e-6
"""Singular value of the scaled tangent, over the largest one, that counts as zero [-]."""


def other_states(stiffness: Stiffness, method: Method, u: fem.Function, most: int) -> list[Found]:
    """Solutions of the discrete problem other than a known one; collective.

    Args:
        stiffness: The elastic stiffness of the model.
        method: The contact method.
        u: The known solution [length].
        most: How many are looked for, > 0.

    Returns:
        What was found; none does not mean that there is none.
    """
    guess = stiffness.glued(stiffness.load_vector())
    problem = Condensed(stiffness.model, method, stiffness, guess)
    states = [stiffness.gather(field)[: problem.size] for field in (u, *_along(stiffness.model))]
    found = problem.run(lambda: _Search(problem, states[0], states[1:]).found(most))
    return [
        Found(
            stiffness.expand(guess, x, force),
            problem.multipliers_at(x),
            distance,
            least_singular_value,
        )
        for x, force, distance, least_singular_value in found
    ]


def _along(model: Model) -> list[fem.Function]:
    """For each axis the unit displacement of the contact nodes along it, without its normal part, zero elsewhere."""
    fields = []
    for axis in np.eye(model.d):
        field = model.function()
        for contact in model.contacts:
            n = contact.direction
            along = axis - (n @ axis)[:, None] * n
            contact.trace.assign(field.x.array, along[:, None, :])
        fields.append(field)
    return fields


class _Search:
    """A search on rank 0, within :meth:`Condensed.run`.

    Args:
        problem: The condensed problem.
        start: The known solution.
        along: Displacements of the contact along itself, some of them zero.
    """

    def __init__(self, problem: Condensed, start: np.ndarray, along: list[np.ndarray]) -> None:
        self.problem, self.dense, self.along = problem, Dense(problem), along
        self.known = [start]

    def found(self, most: int) -> list[tuple[np.ndarray, np.ndarray, float, float]]:
        """States, contact forces, energy norms of the rest and regularities of at most so many other solutions."""
        problem, dense = self.problem, self.dense
        for start in self._starts():
            x = self.newton(start)
            if x is not None and all(
                abs(x - one).max() > DISTINCT * problem.length for one in self.known
            ):
                self.known.append(x)
                if len(self.known) > most:
                    break
        numbers = [
            (dense.distance(problem.residual(x)), dense.least_singular_value(x))
            for x in self.known[1:]
        ]
        dense.destroy()
        return [
            (x, problem.matrix @ x - problem.loads, *two)
            for x, two in zip(self.known[1:], numbers, strict=True)
        ]

    def newton(self, x: np.ndarray, *, deflated: bool = True) -> np.ndarray | None:
        """The solution, or nearly one, that Newton's method comes to from x, or None."""
        problem = self.problem
        scale, step = 1 / np.sqrt(problem.schur.diagonal()), None
        for _ in range(STEPS):
            residual = problem.residual(x)
            vector = self.dense.vector()
            vector.array[:] = x / problem.length
            small = self.dense.round_off(vector)
            vector.destroy()
            if not np.isfinite(residual).all():
                return None
            if np.linalg.norm(residual) <= small * problem.force:
                return x
            if step is not None and abs(step).max() <= STILL * problem.length:
                break
            tangent = scale[:, None] * problem.tangent(x) * scale
            step = scale * np.linalg.lstsq(tangent, -scale * residual, rcond=RANK)[0]
            x = x + (self._factor(x, step) if deflated else 1.0) * step
        return x if np.linalg.norm(problem.residual(x)) <= NEARLY * problem.force else None

    def _factor(self, x: np.ndarray, step: np.ndarray) -> float:
        """What the known solutions make of a step [-]."""
        slope = 0.0
        for one in self.known:
            away, along = (x - one) / self.problem.length, step / self.problem.length
            square = max(float(away @ away), np.finfo(float).tiny)
            slope -= 2 * float(away @ along) / (square * (1 + square))
        factor = 1 / (1 - slope) if slope != 1 else REACH
        return float(np.clip(factor, -REACH, REACH))

    def _starts(self) -> Iterator[np.ndarray]:
        problem = self.problem
        first = self.known[0]
        for share in SHARES:
            problem.raise_friction(share)
            x = self.newton(first, deflated=False)
            problem.raise_friction(1.0)
            if x is not None:
                yield x
        for along in self.along:
            for move in MOVES if np.any(along) else ():
                yield first + move * problem.length * along
        for i in range(1, len(self.known)):
            yield (self.known[i] + first) / 2
            yield (self.known[i] + self.known[i - 1]) / 2
