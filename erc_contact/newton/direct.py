"""The contact solve with a direct solver: one factor for all attempts.

Newton's method solves the problem condensed on the contact.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from dolfinx import fem

from erc_contact.model.model import Model
from erc_contact.newton import first_guess
from erc_contact.newton.condensed import Condensed
from erc_contact.newton.dense import Dense, follow_path
from erc_contact.newton.first_guess import Carried
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.interior_forms import InteriorForms
from erc_contact.newton.interior_point import CentralPath
from erc_contact.newton.ladder import Attempt, Shares
from erc_contact.newton.linear.loose_stiffness import stiffness_of
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.snes import DiscreteSolution, Outcome, outcome_of_path, solve_in_turn


class Direct:
    """Make attempts of a contact solve with a direct solver; collective.

    A state is the displacement of the contact nodes, on rank 0.

    Args:
        model: The scene on a mesh.
        elastic: Its elastic equations if there are any yet.
        forms: Equations of methods at its contacts that there are; others are added.

    Attributes:
        elastic: Its elastic equations.
        guess: The displacement with the contact glued [length].
        forms: Equations of the methods that were tried, empty where bodies are carried.
        carried: Its bodies at their contacts.
    """

    nodal_first: ClassVar[bool] = True

    def __init__(
        self,
        model: Model,
        elastic: Stiffness | None = None,
        forms: dict[Method, ContactForms] | None = None,
    ) -> None:
        self.model = model
        self.elastic = stiffness_of(model) if elastic is None else elastic
        loads = self.elastic.load_vector()
        self.carried = Carried(model, loads)
        self.guess = self.elastic.solve_glued(loads)
        self._forms, self.forms = self.carried.forms(forms)
        self._problems: dict[Method, Condensed] = {}

    def glued_state(self) -> np.ndarray | None:
        """Return the state with the contact glued."""
        return first_guess.solve_glued(self.carried.model, self.elastic, self.guess)

    def warm(self, old: Model, u: fem.Function) -> np.ndarray | None:
        """Return the state of a displacement u of a model on another mesh."""
        field = first_guess.from_mesh(old, u, self.model)
        self.carried.take_from_contacts(field)
        if self.model.connections.any:
            # Supports have parts in the jumps.
            field.x.scatter_forward()
            field.x.array[:] -= self.model.prescribed.x.array
            field = self.model.connections.least_displacement(field)
        state = self.elastic.gather(field)[: self.elastic.contact_size]
        return None if self.elastic.schur is None else state

    def attempt(
        self, attempt: Attempt, state: Any, tolerance: float | None
    ) -> tuple[Outcome, Any, DiscreteSolution | None]:
        """Make one attempt from a state.

        Returns:
            How it ended, its last state, and its solution if it is a final attempt
            that converged.
        """
        method = attempt.method
        if attempt.interior:
            return *self._interior(attempt, state), None
        if method not in self._forms:
            self._forms[method] = ContactForms(self.carried.model, method)
        if method not in self._problems:
            self._problems[method] = self._condense(self._forms[method])
        problem = self._problems[method]

        def work() -> tuple[Outcome, Any, Any]:
            dense = Dense(problem, tolerance)
            u_A = problem.from_contact(state)

            def solve(shares: Shares) -> tuple[Outcome, float]:
                nonlocal u_A
                problem.set_shares(shares.friction, shares.gap)
                problem.hold(shares.springs, u_A)
                last, outcome = dense.solve(u_A, attempt)
                moved = 0.0
                if outcome.converged:
                    moved = float(np.linalg.norm(last - u_A))
                    u_A = last
                return outcome, moved

            outcome = solve_in_turn(attempt, solve)
            contacts = problem.counts(u_A) if outcome.friction > 1.0 else ()
            problem.set_shares(1.0, 1.0)
            problem.hold(0.0, u_A)
            results = None
            if attempt.final and outcome.converged:
                distance = dense.distance(problem.residual(u_A))
                least = dense.least_singular_value(u_A)
                force = problem.matrix @ u_A - problem.loads
                results = distance, least, u_A, force
            dense.destroy()
            return replace(outcome, contacts=contacts), u_A[: self.elastic.contact_size], results

        outcome, state, results = problem.run(work)
        if results is None:
            return outcome, state, None
        distance, least_singular_value, u_A, force = results
        v = self.elastic.expand(self.guess, u_A, force)
        u, carried = self.carried.whole(v)
        multipliers = problem.multipliers_at(u_A)
        solution = DiscreteSolution(u, multipliers, distance, least_singular_value, carried)
        return outcome, state, solution

    def _condense(self, forms: ContactForms, path: CentralPath | None = None) -> Condensed:
        """Return the contact problem of some forms, condensed on the contact."""
        return Condensed(self.carried.model, forms, self.elastic, self.guess, path)

    def _interior(self, attempt: Attempt, state: Any) -> tuple[Outcome, Any]:
        """Make interior point steps; return their outcome and last state."""
        forms = InteriorForms(self.carried.model, attempt.method)
        problem = self._condense(forms, CentralPath(forms, attempt.friction_shares[0]))

        def work() -> tuple[Outcome, Any]:
            u_A, steps, is_known = follow_path(problem, problem.from_contact(state))
            return outcome_of_path(steps, is_known), u_A[: self.elastic.contact_size]

        outcome, last = problem.run(work)
        return outcome, last

    def destroy(self) -> None:
        """Free nothing: the factor belongs to the solution."""
