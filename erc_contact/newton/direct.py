"""The contact solve with a direct solver: one factor for all attempts.

Newton's method solves the problem condensed on the contact.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.model.model import Model
from erc_contact.newton import first_guess
from erc_contact.newton.condensed import Condensed
from erc_contact.newton.dense import CondensedSolution, Dense, follow_path
from erc_contact.newton.first_guess import CarriedBodies
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.interior_forms import InteriorForms
from erc_contact.newton.interior_point import CentralPath
from erc_contact.newton.ladder import Attempt
from erc_contact.newton.linear.loose_stiffness import stiffness_of
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.snes import (
    Attempted,
    DiscreteSolution,
    Outcome,
    solve_in_turn,
)


class Direct:
    """Make attempts of a contact solve with a direct solver; collective.

    A state is the displacement of the contact nodes, on rank 0.

    Args:
        model: The scene on a mesh.
        elastic: Its elastic equations if there are any yet.
        forms: Equations of methods at its contacts that there are; others are added.
        tolerance: Distance to the solution that is enough [sqrt(force length)]; None
            for round-off.
        rough: Whether the solution is on the way to another one: nobody asks whether it
            is the only one.

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
        tolerance: float | None = None,
        *,
        rough: bool = False,
    ) -> None:
        self.model = model
        self._tolerance = tolerance
        self._rough = rough
        self.elastic = stiffness_of(model) if elastic is None else elastic
        loads = self.elastic.load_vector()
        self.carried = CarriedBodies(model, loads)
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

    def attempt(self, step: Attempt, state: Any) -> Attempted:
        """Make one attempt from a state."""
        method = step.method
        if step.interior:
            return self._interior(step, state)
        if method not in self._forms:
            self._forms[method] = ContactForms(self.carried.model, method)
        if method not in self._problems:
            self._problems[method] = self._condense(self._forms[method])
        problem = self._problems[method]

        def work() -> tuple[Any, Outcome, CondensedSolution | None]:
            dense = Dense(problem, self._tolerance)
            start = problem.from_contact(state)
            u_A, outcome = solve_in_turn(problem, dense.solve, step, start, MPI.COMM_SELF)
            is_solved = step.final and outcome.converged
            solved = dense.solution(u_A, rough=self._rough) if is_solved else None
            dense.destroy()
            return u_A[: self.elastic.contact_size], outcome, solved

        last, outcome, solved = problem.run(work)
        solution = None
        if solved is not None:
            v = self.elastic.expand(self.guess, solved.u_A, solved.force)
            u, carried = self.carried.whole(v)
            solution = DiscreteSolution(
                u,
                problem.multipliers_at(solved.u_A),
                solved.distance,
                solved.least_singular_value,
                carried,
            )
        return Attempted(outcome, last, solution)

    def _condense(self, forms: ContactForms, path: CentralPath | None = None) -> Condensed:
        """Return the contact problem of some forms, condensed on the contact."""
        return Condensed(self.carried.model, forms, self.elastic, self.guess, path)

    def _interior(self, step: Attempt, state: Any) -> Attempted:
        """Make interior point steps."""
        forms = InteriorForms(self.carried.model, step.method)
        problem = self._condense(forms, CentralPath(forms, step.friction_shares[0]))
        path = problem.run(lambda: follow_path(problem, problem.from_contact(state)))
        return Attempted(path.outcome, path.unknowns[: self.elastic.contact_size])

    def destroy(self) -> None:
        """Free nothing: the factor belongs to the solution."""
