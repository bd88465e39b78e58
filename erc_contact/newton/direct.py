"""The contact solve with a direct solver: one factor, and Newton's method for the problem condensed on the contact."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from dolfinx import fem

from erc_contact.model.model import Model
from erc_contact.newton import first_guess as starts
from erc_contact.newton.condensed import Condensed
from erc_contact.newton.dense import Dense
from erc_contact.newton.ladder import Attempt
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.snes import Found, Outcome


class Direct:
    """The contact solve of a model by a direct solver; a state is u at the contact nodes, on rank 0; collective.

    Args:
        model: The scene on a mesh.

    Attributes:
        elastic: Its elastic equations.
        guess: The displacement with the contact glued [length].
    """

    nodal_first: ClassVar[bool] = True

    def __init__(self, model: Model) -> None:
        self.model, self.elastic = model, Stiffness(model)
        self.guess = self.elastic.glued(self.elastic.load_vector())
        self._problems: dict[Method, Condensed] = {}

    def glued(self) -> Any:
        """The state with the contact glued."""
        return starts.glued(self.elastic, self.guess)

    def warm(self, old: Model, u: fem.Function) -> Any:
        """The state of a displacement u of a model on another mesh."""
        field = starts.from_mesh(old, u, self.model)
        given = self.elastic.gather(field)[: self.elastic.contact_size]
        return None if self.elastic.schur is None else given

    def attempt(
        self, attempt: Attempt, state: Any, tolerance: float | None
    ) -> tuple[Outcome, Any, Found | None]:
        """Make one attempt from a state; return how it ended, its last state, and what it found if that is final."""
        if attempt.method not in self._problems:
            self._problems[attempt.method] = Condensed(
                self.model, attempt.method, self.elastic, self.guess
            )
        problem = self._problems[attempt.method]

        def work() -> tuple[Outcome, Any, Any]:
            dense = Dense(problem, tolerance)
            start, steps = problem.from_contact(state), 0
            for share in attempt.friction_shares:
                problem.raise_friction(share)
                last, outcome = dense.solve(start, attempt.line_search)
                start, steps = last.displacement, steps + outcome.steps
                if not outcome.converged:
                    break
            problem.raise_friction(1.0)
            results = None
            if attempt.final and outcome.converged:
                numbers = dense.distance(last.residual), dense.least_singular_value(start)
                results = *numbers, start, problem.matrix @ start - problem.loads
            dense.destroy()
            return replace(outcome, steps=steps), start[: self.elastic.contact_size], results

        outcome, state, results = problem.run(work)
        return outcome, state, None if results is None else self._found(problem, *results)

    def _found(
        self,
        problem: Condensed,
        distance: float,
        least_singular_value: float,
        u_A: np.ndarray,
        force: np.ndarray,
    ) -> Found:
        u = self.elastic.expand(self.guess, u_A, force)
        return Found(u, problem.multipliers_at(u_A), distance, least_singular_value)

    def destroy(self) -> None:
        """Nothing is left to free: the factor belongs to the solution."""
