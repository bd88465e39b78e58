"""Solve scenes that are moved a little from one that is solved, on its mesh.

Loads, gaps, friction bounds and the values of supports are others. The bodies, and what
is held, are the same, and so are the elastic equations: their factor or hierarchy
serves all scenes. Where contacts are the same, so are the equations of the method.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import NotConverged
from erc_contact.model.model import Model
from erc_contact.model.promises import bind_nearby
from erc_contact.newton.direct import Direct
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.iterative import Iterative
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.solution import Solution
from erc_contact.newton.solve import solution_of, solved
from erc_contact.scene.scene import Scene


class Nearby:
    """Solve scenes moved from that of a solution; construction and members: collective.

    Args:
        near: The solution. Its elastic solver should be in memory while these are
            solved.
        solver: As in :func:`erc_contact.newton.solve.solve`.
    """

    def __init__(self, near: Solution, solver: str) -> None:
        self._near = near
        self._solver = solver
        self._model = near.model
        self._forms: dict[Method, ContactForms] = {}

    def solve(self, scene: Scene) -> Solution:
        """Solve a scene of the same bodies, contacts and springs.

        Raises:
            InputError: As :func:`erc_contact.newton.solve.solve`.
            NotConverged: If no attempt converged.
        """
        near = self._near
        model = bind_nearby(scene, self._model)
        if model.contacts != self._model.contacts:
            self._forms = {}
        self._model = model
        kind = self._kind(model)
        if kind is not None:
            try:
                return solution_of(kind, model, near.method, near, None)
            except NotConverged:
                # The direct solver takes over from multigrid where it may.
                if self._solver != "auto" or not near.stiffness.iterative:
                    raise
        return solved(
            scene,
            near.domain,
            near.method,
            degree=model.degree,
            after=None,
            start=near,
            tolerance=None,
            solver=self._solver,
        )

    def _kind(self, model: Model) -> Callable[[Model], Direct | Iterative] | None:
        """Return what solves a model with the factor or hierarchy that there is.

        None if it does not fit.
        """
        near = self._near.model
        same_nodes = np.array_equal(model.fixed, near.fixed)
        same_unknowns = np.array_equal(model.coordinates.fixed, near.coordinates.fixed)
        if not model.comm.allreduce(same_nodes and same_unknowns, MPI.LAND):
            return None
        elastic = self._near.stiffness
        if isinstance(elastic, Stiffness):
            return partial(Direct, elastic=elastic.of_model(model), forms=self._forms)
        if isinstance(elastic, Multigrid):
            return partial(Iterative, elastic=elastic.of_model(model), forms=self._forms)
        return None
