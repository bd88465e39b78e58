"""Other solutions of a contact problem, by Newton's method with deflation.

With Coulomb friction a contact problem may have many solutions. Let R be the residual
of the condensed problem and x_i its known solutions. Newton's method for ``M(x) R(x) =
0``, with

    M = prod_i (1/|x - x_i|^2 + 1),

does not converge to any x_i. Its step is the step of Newton's method for R, times
``1/(1 - M' step/M)``. Where the tangent is singular, as on a branch of solutions, the
step is the least one.

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
from erc_contact.newton.dense import CondensedSolution, Dense
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.snes import DiscreteSolution

DEFLATED_STEPS = 40
"""Greatest number of Newton steps from one start."""
SHARES = (0.5, 0.8, 0.95, 1.05, 1.25, 2.0)
"""Shares of the friction bound whose solutions are starts [-]."""
MOVES = (-1.0, -0.3, -0.1, 0.1, 0.3, 1.0)
"""Moves of the contact along itself, over the largest displacement [-]."""
DISTINCT = 1e-3
"""Difference of two solutions that count as one, over the largest displacement [-]."""
REACH = 10.0
"""Bound of the factor of a step [-]."""
STILL = 1e-12
"""Step that is the last one, over the largest displacement [-]."""
NEARLY = 1e-4
"""Residual of a state that counts as a solution where Newton's method stands still.

It is relative to the forces that cancel in it [-]. Data that are rounded have nearly a
branch of solutions. The error of the state tells how near it is.
"""
SINGULAR_RATIO = 1e-6
"""Singular value of the scaled tangent that counts as zero, over the largest [-]."""


def other_states(
    stiffness: Stiffness, method: Method, u: fem.Function, most: int
) -> list[DiscreteSolution]:
    """Search solutions of the discrete problem beside a known solution; collective.

    Args:
        stiffness: The elastic stiffness of the model.
        method: The contact method.
        u: The known solution [length].
        most: Greatest number of solutions, > 0.

    Returns:
        The solutions; none does not mean that there is none.
    """
    guess = stiffness.solve_glued(stiffness.load_vector())
    problem = Condensed(stiffness.model, ContactForms(stiffness.model, method), stiffness, guess)
    first = stiffness.gather(u)[: problem.size]
    directions = []
    for field in _unit_slips(stiffness.model):
        directions.append(stiffness.gather(field)[: problem.size])
    states = problem.run(lambda: _Search(problem, first, directions).states(most))
    solutions = []
    for state in states:
        u_of_state = stiffness.expand(guess, state.u_A, state.force)
        multipliers = problem.multipliers_at(state.u_A)
        solution = DiscreteSolution(
            u_of_state, multipliers, state.distance, state.least_singular_value
        )
        solutions.append(solution)
    return solutions


def _unit_slips(model: Model) -> list[fem.Function]:
    """Return the unit displacement of the contact along itself for each axis [-].

    It is the axis without its normal part at contact nodes, and zero elsewhere.
    """
    fields = []
    for axis in np.eye(model.space.d):
        field = model.space.function()
        for contact in model.contacts:
            n = contact.trace.normals
            along = axis - (n @ axis)[..., None] * n
            contact.trace.assign(field.x.array, along)
        fields.append(field)
    return fields


class _Search:
    """Search solutions on rank 0, within :meth:`Condensed.run`.

    Args:
        problem: The condensed problem.
        start: The known solution.
        along: Displacements of the contact along itself, some of them zero.
    """

    def __init__(self, problem: Condensed, start: np.ndarray, along: list[np.ndarray]) -> None:
        self.problem = problem
        self.dense = Dense(problem)
        self.along = along
        self.solutions = [start]

    def states(self, most: int) -> list[CondensedSolution]:
        """Find other solutions, at most so many."""
        for start in self._starts():
            x = self.newton(start)
            if x is not None and self._is_new(x):
                self.solutions.append(x)
                if len(self.solutions) > most:
                    break
        states = [self.dense.solution(x, rough=False) for x in self.solutions[1:]]
        self.dense.destroy()
        return states

    def newton(self, x: np.ndarray, *, deflated: bool = True) -> np.ndarray | None:
        """Return the solution, or nearly a solution, that Newton's method finds from x.

        Args:
            x: The start [length].
            deflated: Whether known solutions repel it.

        Returns:
            The solution [length]; None if there is none.
        """
        problem = self.problem
        scale = 1 / np.sqrt(problem.schur.diagonal())
        step = None
        for _ in range(DEFLATED_STEPS):
            residual = problem.residual(x)
            if not np.isfinite(residual).all():
                return None
            if np.linalg.norm(residual) <= self._round_off(x) * problem.force:
                return x
            if step is not None and abs(step).max() <= STILL * problem.length:
                break
            tangent = scale[:, None] * problem.tangent(x) * scale
            solution, *_ = np.linalg.lstsq(tangent, -scale * residual, rcond=SINGULAR_RATIO)
            step = scale * solution
            factor = self._factor(x, step) if deflated else 1.0
            x = x + factor * step
        if np.linalg.norm(problem.residual(x)) <= NEARLY * problem.force:
            return x
        return None

    def _is_new(self, x: np.ndarray) -> bool:
        """Tell whether a solution differs from all known solutions."""
        least = DISTINCT * self.problem.length
        return all(abs(x - solution).max() > least for solution in self.solutions)

    def _round_off(self, x: np.ndarray) -> float:
        """Return the norm of the scaled residual that counts as round-off at x [-]."""
        vector = self.dense.vector()
        vector.array[:] = x / self.problem.length
        small, _ = self.dense.round_off(vector)
        vector.destroy()
        return small

    def _factor(self, x: np.ndarray, step: np.ndarray) -> float:
        """Return the factor of a step, ``1/(1 - M' step/M)`` [-]."""
        slope = 0.0
        along = step / self.problem.length
        for solution in self.solutions:
            away = (x - solution) / self.problem.length
            square = max(float(away @ away), np.finfo(float).tiny)
            slope -= 2 * float(away @ along) / (square * (1 + square))
        factor = 1 / (1 - slope) if slope != 1 else REACH
        return float(np.clip(factor, -REACH, REACH))

    def _starts(self) -> Iterator[np.ndarray]:
        """Generate starts; the list of known solutions grows meanwhile."""
        problem = self.problem
        first = self.solutions[0]
        for share in SHARES:
            problem.set_shares(share, 1.0)
            x = self.newton(first, deflated=False)
            problem.set_shares(1.0, 1.0)
            if x is not None:
                yield x
        for along in self.along:
            if not np.any(along):
                continue
            for move in MOVES:
                yield first + move * problem.length * along
        for i in range(1, len(self.solutions)):
            yield (self.solutions[i] + first) / 2
            yield (self.solutions[i] + self.solutions[i - 1]) / 2
