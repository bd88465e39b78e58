"""Solve, measure and refine until a prescribed accuracy is reached.

Source of the idea: Coorevits, Hild, Hjiaj.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from erc_contact.admissible.kernels import kernels_ahead
from erc_contact.admissible.tighten.iteration import TIGHTEN
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.controller import GoalController
from erc_contact.error.goals.perturbations import check_goal
from erc_contact.error.strategy import Strategy
from erc_contact.newton.methods import Method
from erc_contact.run.checkpoint import keep_run
from erc_contact.run.fingerprint import fingerprint
from erc_contact.run.history import History
from erc_contact.run.loop import Loop
from erc_contact.run.plan import DECISIVE, make_plan
from erc_contact.run.step import Step
from erc_contact.scene.goal import Goal
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base import checks


def adapt(
    scene: Scene,
    domain: Domain,
    accuracy: float,
    *,
    method: Method | None = None,
    strategy: Strategy | None = None,
    degree: int = 1,
    goal: Goal | None = None,
    stop: str = "converged",
    solver: str = "auto",
    tighten: int = TIGHTEN,
    max_cells: int = 1_000_000,
    max_steps: int = 40,
    callback: Callable[[ConstitutiveError, Step], object] | None = None,
    checkpoint: str | Path | None = None,
    every: int = 1,
) -> History:
    """Solve a scene to a prescribed accuracy; collective.

    Args:
        scene: The problem.
        domain: The first mesh, coarse.
        accuracy: Prescribed relative error eps (17), > 0, e.g. 0.02. Where a curved
            body is meshed from its true geometry, what its flat facets cost counts, too
            (``error.total``).
        method: Contact method; by default Nitsche's, or the augmented Lagrangian on
            meshes where only that one converges, as in :func:`solve`; ``Step.method``
            and ``outcome`` tell.
        strategy: How the next mesh is made; ``Mark()`` by default, which needs no
            geometry but the mesh.
        degree: Degree of the displacement, 1 or 2.
        goal: A number that the run aims at, any goal of :func:`erc_contact.interval`:
            the accuracy is then half its interval over its value, and cells are marked
            by their share in it. ``history.bounds`` has the interval. Most meshes are
            solved twice, the last ones more often.
        stop: "converged" ends Newton at round-off; "certified" as soon as the rest is
            at most a tenth of the error of the mesh: it is part of e, which bounds the
            error of any state.
        solver: "direct", "iterative" or "auto", as in :func:`solve`.
        tighten: Iterations that tighten the admissible stress, as in
            :func:`equilibrate`.
        max_cells: The run ends before a mesh of more cells is solved.
        max_steps: The run ends after so many meshes.
        callback: ``callback(error, step)`` is called after each mesh on every rank,
            with the error, from which solution and admissible pair can be had, and the
            row of the table. It ends the run by raising StopIteration.
        checkpoint: Folder that keeps each mesh with its result. The same call goes on
            from what the folder holds, on any number of ranks: it solves no mesh again,
            and makes the same further meshes. Accuracy, limits, solver and callback may
            be others; the callback is not called for meshes that are read. Each file
            opens in ParaView. See also :func:`read_history`.
        every: Every how many meshes one is kept; the last one is kept at the end of the
            run in any case. After a restart ``best`` and ``meshes`` are of the meshes
            that are kept.

    Returns:
        The history with the best result. What ends a run before its accuracy is reached
        is named in ``outcome``, with a warning: a limit; a next mesh that cannot be
        made, or that the scene cannot be solved on; memory that does not
        suffice; Ctrl-C or SIGTERM, within an iteration of Newton's method or of
        tightening, or when the stage that is under way has ended. An accuracy that will
        take more cells than the limit is told on the second mesh.

    Raises:
        InputError: If the input cannot be worked with, or the folder belongs to another
            run.
        NotConverged: If the contact solve fails on the first mesh.
        Exception: What else is raised on a later mesh, by a strategy or callback of the
            user's say, has the history so far in its attribute ``history``.

    Example:
        >>> history = ec.adapt(scene, block, accuracy=0.1)
        >>> history.outcome
        'Reached: 9.165% <= 10%.'
    """
    every = checks.whole("every", every, 1)
    plan = make_plan(
        scene,
        domain,
        strategy,
        callback,
        accuracy=accuracy,
        method=method,
        degree=degree,
        goal=goal,
        stop=stop,
        solver=solver,
        tighten=tighten,
        max_cells=max_cells,
        max_steps=max_steps,
    )
    if plan.goal is not None:
        check_goal(scene, domain, plan.degree, plan.goal)
    # The C compiler works on another core while the forms are compiled here.
    kernels_ahead(domain.dim)
    identity = partial(fingerprint, scene, domain, plan.arguments(DECISIVE))
    with keep_run(checkpoint, domain, identity, plan.accuracy, every) as store:
        aim = None
        if plan.goal is not None:
            aim = GoalController(plan.goal, plan.accuracy, plan.solver, plan.tighten)
        return Loop(plan, domain.comm, store, aim=aim).go(domain)
