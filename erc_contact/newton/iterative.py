"""The contact solve with multigrid: Newton's method for all degrees of freedom.

It works in parallel on any number of ranks.
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import ClassVar

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.model.model import Model
from erc_contact.newton import first_guess
from erc_contact.newton.first_guess import CarriedBodies
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.full import FullSpace
from erc_contact.newton.interior_forms import InteriorForms
from erc_contact.newton.ladder import Attempt
from erc_contact.newton.linear.loose_multigrid import multigrid_of
from erc_contact.newton.linear.multigrid import EXACT, ROUGH, Multigrid
from erc_contact.newton.methods import Method
from erc_contact.newton.snes import Attempted, DiscreteSolution, solve_in_turn
from namedmesh.base.ranks import greatest


class Iterative:
    """Make attempts of a contact solve with multigrid; collective.

    A state is a displacement.

    Args:
        model: The scene on a mesh.
        elastic: Its elastic equations if there are any yet.
        forms: Equations of methods at its contacts that there are; others are added.
        tolerance: Distance to the solution that is enough [sqrt(force length)]; None
            for round-off.
        rough: Whether the solution is on the way to another one: nobody asks whether it
            is the only one.
        hurried: Whether the first guess gives up early where multigrid is slow.

    Attributes:
        elastic: Its elastic equations.
        forms: Equations of the methods that were tried, empty where bodies are carried.
        carried: Its bodies at their contacts.
    """

    nodal_first: ClassVar[bool] = False

    def __init__(
        self,
        model: Model,
        elastic: Multigrid | None = None,
        forms: dict[Method, ContactForms] | None = None,
        tolerance: float | None = None,
        *,
        rough: bool = False,
        hurried: bool = False,
    ) -> None:
        self.model = model
        self._tolerance = tolerance
        self._rough = rough
        self.elastic = multigrid_of(model, hurried=hurried) if elastic is None else elastic
        self._forces = self.elastic.load_vector()
        self._loads = self.elastic.right_side(self._forces.copy(), supports=True)
        self.carried = CarriedBodies(model, self._forces)
        self._forms, self.forms = self.carried.forms(forms)
        self._problems: dict[Method, FullSpace] = {}

    @cached_property
    def guess(self) -> fem.Function:
        """Return the displacement with the contact glued [length].

        A gap is closed there. Without contact it is the solution.
        """
        if not self.elastic.contact_size:
            return self.elastic.solve_glued(self._forces.copy(), tolerance=EXACT)
        return self._sprung(first_guess.across_gap(self.carried.model))

    def glued_state(self) -> fem.Function:
        """Return the state with the contact glued."""
        return self.guess

    def warm(self, old: Model, u: fem.Function) -> fem.Function:
        """Return the state of a displacement u of a model.

        From another mesh the glue draws the contact to it. On the same mesh under the
        same loads, where a law is linearised anew, u is nearer than glue would lead.
        """
        if old is self.model:
            return self._measured(self.carried.deformation(u))
        jumps = first_guess.from_mesh(old, u, self.model)
        self.carried.take_from_contacts(jumps)
        return self._sprung(jumps)

    def attempt(self, step: Attempt, state: fem.Function) -> Attempted:
        """Make one attempt from a state."""
        method = step.method
        if step.interior:
            return self._interior(step, state)
        if method not in self._forms:
            self._forms[method] = ContactForms(self.carried.model, method)
        if method not in self._problems:
            self._problems[method] = self._full(self._forms[method])
        problem = self._problems[method]
        start = self.elastic.start(state) / problem.length
        solve = partial(problem.solve, tolerance=self._tolerance)
        unknowns, outcome = solve_in_turn(problem, solve, step, start, self.model.space.comm)
        x = problem.at(unknowns)
        v, multipliers = problem.fields(x)
        solution = None
        if step.final and outcome.converged:
            u, carried = self.carried.whole(v)
            distance = problem.distance(x)
            least = 1.0 if self._rough else problem.least_singular_value(x)
            solution = DiscreteSolution(u, multipliers, distance, least, carried)
        x.destroy()
        return Attempted(outcome, v, solution)

    def _full(self, forms: ContactForms) -> FullSpace:
        """Return the contact problem of some forms for all degrees of freedom."""
        return FullSpace(
            self.carried.model,
            forms,
            self.elastic,
            self._loads,
            self._length,
            self._force,
            rough=self._rough,
        )

    def _interior(self, step: Attempt, state: fem.Function) -> Attempted:
        """Make interior point steps."""
        problem = self._full(InteriorForms(self.carried.model, step.method))
        start = self.elastic.start(state) / problem.length
        path = problem.follow_path(start, step.friction_shares[0])
        x = problem.at(path.unknowns)
        last, _ = problem.fields(x)
        x.destroy()
        problem.free()
        return Attempted(path.outcome, last)

    def destroy(self) -> None:
        """Free the contact problems; the hierarchy belongs to the solution."""
        for problem in self._problems.values():
            problem.free()
        self._loads.destroy()

    def _measured(self, v: fem.Function) -> fem.Function:
        """Return a displacement [length], whose contact forces scale the problem."""
        x = self.elastic.vector(v)
        reactions = x.duplicate()
        self.elastic.times(x, reactions)
        reactions.axpy(-1.0, self._loads)
        at_contacts = reactions.array_r[self.elastic.at_contacts]
        comm = self.model.space.comm
        self._length = greatest(comm, v.x.array) or 1.0
        forces = float(np.sqrt(comm.allreduce(np.dot(at_contacts, at_contacts), MPI.SUM)))
        self._force = max(forces, ROUGH * self._loads.norm())
        x.destroy()
        reactions.destroy()
        return v

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
