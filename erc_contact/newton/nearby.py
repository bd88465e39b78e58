"""Solve a scene that is moved a little from one that is solved, on its mesh.

Loads, gaps, friction bounds and the values of supports are others. The bodies, and what
is held, are the same, and so are the elastic equations: their factor or hierarchy
serves both scenes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import NotConverged
from erc_contact.model.model import Model
from erc_contact.model.promises import bind
from erc_contact.newton.direct import Direct
from erc_contact.newton.iterative import Iterative
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.linear.solver import ElasticSolver
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.solution import Solution
from erc_contact.newton.solve import solution_of, solved
from erc_contact.scene.scene import Scene


def solved_nearby(scene: Scene, near: Solution, solver: str) -> Solution:
    """Solve a scene from the solution of one that it is moved from; collective.

    Args:
        scene: The scene, of the same bodies, contacts and springs.
        near: The solution of the other one; its elastic solver should be in memory.
        solver: As in :func:`erc_contact.newton.solve.solve`.

    Raises:
        InputError: As :func:`erc_contact.newton.solve.solve`.
        NotConverged: If no attempt converged.
    """
    model = bind(scene, near.domain, near.model.degree)
    kind = _sharing(near.stiffness, model) if _same_unknowns(model, near.model) else None
    if kind is not None:
        try:
            return solution_of(kind, model, near.method, near, None)
        except NotConverged:
            # The direct solver takes over from multigrid where it may.
            if solver != "auto" or not near.stiffness.iterative:
                raise
    return solved(
        scene,
        near.domain,
        near.method,
        degree=near.model.degree,
        after=None,
        start=near,
        tolerance=None,
        solver=solver,
    )


def _sharing(elastic: ElasticSolver, model: Model) -> Callable[[Model], Direct | Iterative] | None:
    """Return the kind of solver that shares a factor or hierarchy; collective."""
    if isinstance(elastic, Stiffness):
        return partial(Direct, elastic=elastic.of_model(model))
    if isinstance(elastic, Multigrid):
        return partial(Iterative, elastic=elastic.of_model(model))
    return None


def _same_unknowns(model: Model, other: Model) -> bool:
    """Tell whether the same components are fixed in two models; collective."""
    same_nodes = np.array_equal(model.fixed, other.fixed)
    same_unknowns = np.array_equal(model.coordinates.fixed, other.coordinates.fixed)
    return model.comm.allreduce(same_nodes and same_unknowns, MPI.LAND)
