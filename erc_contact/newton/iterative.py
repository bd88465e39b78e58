"""The contact solve with multigrid: Newton's method for all degrees of freedom.

It works in parallel on any number of ranks.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.model.model import Model
from erc_contact.newton import first_guess
from erc_contact.newton.first_guess import Carried
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.full import FullSpace
from erc_contact.newton.interior_forms import InteriorForms
from erc_contact.newton.ladder import Attempt, Shares
from erc_contact.newton.linear.loose_multigrid import multigrid_of
from erc_contact.newton.linear.multigrid import EXACT, Multigrid
from erc_contact.newton.methods import Method
from erc_contact.newton.snes import (
    DiscreteSolution,
    Outcome,
    attempt,
    outcome_of_path,
    solve_in_turn,
)
from namedmesh.base.ranks import greatest


class Iterative:
    """Make attempts of a contact solve with multigrid; collective.

    A state is a displacement.

    Args:
        model: The scene on a mesh.
        elastic: Its elastic equations if there are any yet.
        forms: Equations of methods at its contacts that there are; others are added.
        hurried: Whether the first guess gives up early where multigrid is slow.

    Attributes:
        elastic: Its elastic equations.
        guess: The displacement with the contact glued, where a gap is closed [length];
            without contact the solution.
        forms: Equations of the methods that were tried, empty where bodies are carried.
        carried: Its bodies at their contacts.
    """

    nodal_first: ClassVar[bool] = False

    def __init__(
        self,
        model: Model,
        elastic: Multigrid | None = None,
        forms: dict[Method, ContactForms] | None = None,
        *,
        hurried: bool = False,
    ) -> None:
        self.model = model
        self.elastic = multigrid_of(model, hurried=hurried) if elastic is None else elastic
        self._forces = self.elastic.load_vector()
        self._loads = self.elastic.right_side(self._forces.copy(), supports=True)
        self.carried = Carried(model, self._forces)
        if self.elastic.contact_size:
            self.guess = self._sprung(first_guess.across_gap(self.carried.model))
        else:
            self.guess = self.elastic.solve_glued(self._forces.copy(), tolerance=EXACT)
        self._forms, self.forms = self.carried.forms(forms)
        self._problems: dict[Method, FullSpace] = {}

    def glued_state(self) -> fem.Function:
        """Return the state with the contact glued."""
        return self.guess

    def warm(self, old: Model, u: fem.Function) -> fem.Function:
        """Return the state of a displacement u of a model on another mesh.

        The glue draws the contact to it.
        """
        jumps = first_guess.from_mesh(old, u, self.model)
        self.carried.take_from_contacts(jumps)
        return self._sprung(jumps)

    def attempt(
        self, step: Attempt, state: fem.Function, tolerance: float | None
    ) -> tuple[Outcome, fem.Function, DiscreteSolution | None]:
        """Make one attempt from a state.

        Returns:
            How it ended, its last state, and its solution if it is a final attempt
            that converged.
        """
        method = step.method
        if step.interior:
            return *self._interior(step, state), None
        if method not in self._forms:
            self._forms[method] = ContactForms(self.carried.model, method)
        if method not in self._problems:
            self._problems[method] = self._full(self._forms[method])
        problem = self._problems[method]
        x = problem.vector()
        x.array[:] = self.elastic.start(state) / problem.length

        def solve(shares: Shares) -> tuple[Outcome, float]:
            problem.forms.set_shares(shares.friction, shares.gap)
            problem.hold(shares.springs, x)
            before = x.copy()
            outcome = attempt(problem, x, step, tolerance)
            moved = 0.0
            if outcome.converged:
                moved = _distance(x, before)
            else:
                before.copy(x)
            before.destroy()
            return outcome, moved

        outcome = solve_in_turn(step, solve)
        contacts = problem.counts(x) if outcome.friction > 1.0 else ()
        problem.forms.set_shares(1.0, 1.0)
        problem.hold(0.0, x)
        v, multipliers = problem.fields(x)
        solution = None
        if step.final and outcome.converged:
            u, carried = self.carried.whole(v)
            distance = problem.distance(x)
            least = problem.least_singular_value(x)
            solution = DiscreteSolution(u, multipliers, distance, least, carried)
        x.destroy()
        return replace(outcome, contacts=contacts), v, solution

    def _full(self, forms: ContactForms) -> FullSpace:
        """Return the contact problem of some forms for all degrees of freedom."""
        return FullSpace(
            self.carried.model, forms, self.elastic, self._loads, self._length, self._force
        )

    def _interior(self, step: Attempt, state: fem.Function) -> tuple[Outcome, fem.Function]:
        """Make interior point steps; return their outcome and last state."""
        problem = self._full(InteriorForms(self.carried.model, step.method))
        start = self.elastic.start(state) / problem.length
        unknowns, steps, is_known = problem.follow_path(start, step.friction_shares[0])
        x = problem.vector()
        x.array[:] = unknowns
        last, _ = problem.fields(x)
        x.destroy()
        problem.free()
        return outcome_of_path(steps, is_known), last

    def destroy(self) -> None:
        """Free the contact problems; the hierarchy belongs to the solution."""
        for problem in self._problems.values():
            problem.free()
        self._loads.destroy()

    def _sprung(self, target: fem.Function) -> fem.Function:
        """Return the displacement under the loads, with springs to a target [length].

        The springs are the glue. The size of the displacement and of the forces in the
        springs scale the contact problem.
        """
        owned = slice(0, self.elastic.owned)
        target.x.scatter_forward()
        b = self._forces.copy()
        b.x.array[owned] += self.elastic.glue.times(target).x.array[owned]
        u = self.elastic.solve_glued(b)
        stretch = target.copy()
        stretch.x.array[:] -= u.x.array
        pull = self.elastic.glue.times(stretch).x.array[owned]
        comm = self.model.space.comm
        self._length = greatest(comm, u.x.array) or 1.0
        self._force = float(np.sqrt(comm.allreduce(np.dot(pull, pull), MPI.SUM))) or 1.0
        return u


def _distance(x: PETSc.Vec, y: PETSc.Vec) -> float:
    """Return the norm of the difference of two vectors; collective."""
    difference = x - y
    norm = float(difference.norm())
    difference.destroy()
    return norm
