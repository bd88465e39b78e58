"""The contact solve with multigrid: Newton's method for all degrees of freedom, in parallel."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.model.model import Model
from erc_contact.newton import first_guess as starts
from erc_contact.newton.full import FullSpace
from erc_contact.newton.ladder import Attempt
from erc_contact.newton.linear.multigrid import EXACT, Multigrid
from erc_contact.newton.methods import Method
from erc_contact.newton.snes import Found, Outcome, attempt


class Iterative:
    """The contact solve of a model with multigrid; a state is a displacement; collective.

    Args:
        model: The scene on a mesh.

    Attributes:
        elastic: Its elastic equations.
        guess: The displacement with the contact glued, where a gap is closed [length];
            without contact the solution.
    """

    nodal_first: ClassVar[bool] = False

    def __init__(self, model: Model) -> None:
        self.model, self.elastic = model, Multigrid(model)
        self._forces = self.elastic.load_vector()
        self._loads = self.elastic.right_side(self._forces.copy(), supports=True)
        if self.elastic.contact_size:
            self.guess = self._sprung(starts.across_gap(model))
        else:
            self.guess = self.elastic.glued(self._forces.copy(), tolerance=EXACT)
        self._problems: dict[Method, FullSpace] = {}

    def glued(self) -> fem.Function:
        """The state with the contact glued."""
        return self.guess

    def warm(self, old: Model, u: fem.Function) -> fem.Function:
        """The state of a displacement u of a model on another mesh: the contact is drawn to it by the glue."""
        return self._sprung(starts.from_mesh(old, u, self.model))

    def attempt(
        self, step: Attempt, state: fem.Function, tolerance: float | None
    ) -> tuple[Outcome, fem.Function, Found | None]:
        """Make one attempt from a state; return how it ended, its last state, and what it found if that is final."""
        if step.method not in self._problems:
            self._problems[step.method] = FullSpace(
                self.model, step.method, self.elastic, self._loads, self._length, self._force
            )
        problem = self._problems[step.method]
        x, steps = problem.vector(), 0
        x.array[:] = state.x.array[: self.elastic.owned] / problem.length
        for share in step.friction_shares:
            problem.raise_friction(share)
            outcome = attempt(problem, x, step.line_search, tolerance)
            steps += outcome.steps
            if not outcome.converged:
                break
        problem.raise_friction(1.0)
        u, multipliers = problem.found(x)
        found = None
        if step.final and outcome.converged:
            found = Found(u, multipliers, problem.distance(x), problem.least_singular_value(x))
        x.destroy()
        return replace(outcome, steps=steps), u, found

    def destroy(self) -> None:
        """Free what only the contact solve needs; the hierarchy belongs to the solution."""
        for problem in self._problems.values():
            problem.free()
        self._loads.destroy()

    def _sprung(self, given: fem.Function) -> fem.Function:
        """The displacement under the loads, with the contact drawn to a given displacement by the glue."""
        b, glue = self._forces.copy(), self.elastic.glue.x.array
        own = slice(0, self.elastic.owned)
        b.x.array[own] += glue[own] * given.x.array[own]
        u = self.elastic.glued(b)
        pull = glue[own] * (given.x.array[own] - u.x.array[own])
        local = np.array([abs(u.x.array).max(initial=0.0), np.dot(pull, pull)])
        comm = self.model.comm
        self._length = comm.allreduce(local[0], MPI.MAX) or 1.0
        self._force = float(np.sqrt(comm.allreduce(local[1], MPI.SUM))) or 1.0
        return u
