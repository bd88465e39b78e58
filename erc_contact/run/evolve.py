"""Solve a loading history: adaptive contact solves, each from where the last one ended.

Friction is about slip rates. In each step it acts on the tangential displacement since
the last one (backward Euler), so what a body does depends on the way its loads came.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from erc_contact.admissible.kernels import kernels_ahead
from erc_contact.admissible.tighten.iteration import TIGHTEN
from erc_contact.base.exceptions import InputError, together
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.strategy import Strategy
from erc_contact.newton.ladder import NODAL
from erc_contact.newton.methods import Method
from erc_contact.run.checkpoint import keep_run
from erc_contact.run.evolution import Evolution
from erc_contact.run.fingerprint import fingerprint_of_history
from erc_contact.run.plan import DECISIVE, check_callback, make_plan
from erc_contact.run.time_row import TimeStep
from erc_contact.run.walk import InTime, Walk
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base import checks


def evolve(
    scene_at: Callable[[float], Scene],
    domain: Domain,
    times: Sequence[float],
    accuracy: float,
    *,
    method: Method | None = None,
    strategy: Strategy | None = None,
    degree: int = 1,
    stop: str = "converged",
    solver: str = "auto",
    tighten: int = TIGHTEN,
    path: float | None = None,
    accuracy_in_time: float | None = None,
    max_cells: int = 1_000_000,
    max_steps: int = 40,
    callback: Callable[[ConstitutiveError, TimeStep], object] | None = None,
    checkpoint: str | Path | None = None,
) -> Evolution:
    """Solve a loading history, each step to a prescribed accuracy; collective.

    At the first time the body comes from rest, in one step. Each further step goes on
    with the mesh of the last one, which is refined or made anew as its error asks. A
    refined mesh represents the slip so far, and the state of a law, exactly. A step
    that does not converge is halved, up to 8 times.

    Args:
        scene_at: Gives the scene at a time t. All scenes have contacts of the same
            names. Callables of x may contain t:
            ``lambda t: Scene(..., loads=[Traction("top", lambda x: t * x[0])])``.
            Nothing is compiled anew for another time where scenes differ in numbers
            only.
        domain: The first mesh, coarse.
        times: Ends of the steps, increasing, e.g. ``np.linspace(0, 1, 21)`` for 20
            steps after the first state.
        accuracy: Prescribed relative error eps (17) of each step, given its history, >
            0.
        method: Contact method; by default the augmented Lagrangian, which keeps a
            sticking point exactly where it is.
        strategy: How the next mesh is made, as in :func:`adapt`.
        degree: Degree of the displacement, 1 or 2.
        stop: "converged" or "certified", as in :func:`adapt`.
        solver: "direct", "iterative" or "auto", as in :func:`solve`.
        tighten: Iterations that tighten the admissible stress, as in
            :func:`equilibrate`.
        path: Prescribed accuracy of the steps in time [-], or None to take the times as
            they are. Each step is then compared with its two halves: the difference of
            the displacements at its end, in the energy norm, relative to them, is at
            most this. Times between the given ones are added as needed; the result has
            the halves.
        accuracy_in_time: Prescribed accuracy of the energy that friction takes in a
            step [-], e.g. 0.05, or None to take the times as they are. What the length
            of a step leaves unknown of this energy (``TimeStep.in_time``) is at most
            this share of it, or else below what the mesh leaves unknown. Times are
            added as with ``path``.
        max_cells: No step goes on to a mesh of more cells.
        max_steps: Greatest number of meshes of a step.
        callback: ``callback(error, row)`` is called after each step on every rank. It
            ends the run by raising StopIteration.
        checkpoint: Folder that keeps each step. The same call goes on from what the
            folder holds, on any number of ranks, and solves no step again. Each file
            opens in ParaView.

    Returns:
        The history of all steps. What ends it before the last time is named in
        ``outcome``, with a warning. The results at the ends of all steps stay in
        memory.

    Raises:
        InputError: If the input cannot be worked with, or the folder belongs to another
            run.
        NotConverged: If the contact solve fails at the first time.
        Exception: What else is raised later, by ``scene_at`` say, has the history so
            far in its attribute ``history``.

    Example:
        >>> evolution = ec.evolve(scene_at, block, times=[0.5, 1.0], accuracy=0.2)
        >>> evolution.outcome
        'All 2 steps to t = 1 are done.'
    """
    ends = checks.increasing("times", times)
    in_time = InTime.checked(path, accuracy_in_time)
    if not callable(scene_at):
        raise InputError(
            f"scene_at is {checks.description(scene_at)}; "
            "give a function of the time that returns a Scene."
        )
    if not isinstance(domain, Domain):
        raise InputError(
            f"domain is {checks.description(domain)}; "
            "give a Domain: rectangle(...), read_mesh(...)."
        )
    check_callback(callback)
    comm = domain.comm
    plan = make_plan(
        together(comm, scene_at, ends[0]),
        domain,
        strategy,
        accuracy=accuracy,
        method=NODAL if method is None else method,
        degree=degree,
        stop=stop,
        solver=solver,
        tighten=tighten,
        max_cells=max_cells,
        max_steps=max_steps,
    )
    # The C compiler works on another core while the forms are compiled here.
    kernels_ahead(domain.dim)
    # unlike in adapt, accuracy and limits decide where the next step begins
    arguments = plan.arguments((*DECISIVE, "accuracy", "max_cells", "max_steps"))
    arguments |= {"times": ends, **in_time.arguments()}
    identity = partial(fingerprint_of_history, scene_at, domain, ends, arguments)
    with keep_run(checkpoint, domain, identity, plan.accuracy) as store:
        return Walk(plan, scene_at, ends, in_time, callback, store).go(domain)
