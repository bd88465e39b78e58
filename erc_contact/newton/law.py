"""Newton's method for the law of a body: a sequence of contact problems.

A potential is linearised about the strain of the last displacement, and the contact
problem of the linear body is solved by the methods of all linear bodies
(:mod:`erc_contact.newton.contact_solve`). So contacts, friction, joints and ranks are
theirs. Near the solution the steps converge quadratically. Each contact problem starts
from the contact of the last one. On the way they are solved roughly, to a share of the
misfit that is expected of the step, as in inexact Newton methods (Dembo, Eisenstat and
Steihaug, https://doi.org/10.1137/0719025).

The *misfit* is what is left: the energy norm of ``psi'(eps(u)) - sigma``, with the
stress sigma of the linear body, which is in equilibrium. It is measured in the metric
of the tangent, and needs no solve.

Far away a full step may go too far. With the step d from u, the potential energy of
body, loads, frictionless contact and Tresca friction decreases along ``u + t d`` while

    h(t) = int (psi'(eps(u + t d)) - sigma) : eps(d)  <=  0,

because displacements that contacts allow are convex. h grows with t and begins below
zero. So a step that goes too far ends where h is zero.

Symbols: n cells, q points of a cell, s components of a tensor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import NotConverged
from erc_contact.base.logs import log_of
from erc_contact.base.progress import at
from erc_contact.model.carrying import carry_displacement
from erc_contact.model.data.expressions import definite_inverses
from erc_contact.model.data.values import DATA_DEGREE
from erc_contact.model.model import Model
from erc_contact.newton.contact_solve import Solver, solution_of
from erc_contact.newton.methods import Method
from erc_contact.newton.solution import Solution

SOLVED = 1e-11
"""Misfit over the energy norm of the stress that counts as none [-]."""
STALLED = 1e-8
"""Misfit that is round-off if it does not fall any more, over the same [-]."""
CANCELLED = 1e-3
"""Share of ``C eps`` that the stress is compared with at least [-]."""
LAW_STEPS = 60
"""Limit of the steps."""
TOO_FAR = 0.5
"""A full step is taken while ``h(1) <= TOO_FAR |h(0)|`` [-]."""
NEAR = 0.05
"""Accuracy of the share of a step [-]."""
SHARE_OF_TOLERANCE = 0.7
"""Share of the tolerance of a solve that the law may leave; the contact has as much."""
FORCING = 0.1
"""Error of a contact problem on the way, over the misfit that is expected [-]."""
LEAST_GAIN = 0.3
"""Share of a misfit that a step is expected to leave at most [-]."""


def solution_of_law(
    kind: Callable[..., Solver],
    model: Model,
    method: Method | None,
    start: Solution | None,
    tolerance: float | None,
) -> Solution:
    """Solve a model as :func:`.contact_solve.solution_of`, also with a potential.

    Args:
        kind: Makes a solver of a model; its argument ``forms`` are forms that there
            are, and ``tolerance`` is its part of the error.
        model: The scene on a mesh. A potential is linearised in place.
        method: The contact method, None for the default.
        start: A solution to start from, of any mesh of the body.
        tolerance: Greatest error of the solution in the energy norm.

    Returns:
        The solution of the last linear body. Its ``newton_steps`` are of all contact
        problems, and its ``reason`` tells the misfits.

    Raises:
        NotConverged: If the misfit does not become small, or a contact problem does not
            converge.
    """
    if model.linearised is None:
        return solution_of(partial(kind, tolerance=tolerance), model, method, start)
    if tolerance is not None:
        tolerance *= SHARE_OF_TOLERANCE
    steps = 0
    misfits: list[float] = []
    # Where multigrid has failed, the direct solver goes on from where it was.
    about = model.linearised.u.copy()
    holds = not model.linearised.at_rest
    if start is not None and not holds:
        before = carry_displacement(start.u, start.model.space, model.space)
        if before is not None:
            about = before
            model.linearised.move(about)
    # The forms of all steps are alike.
    kind = partial(kind, forms={})
    goal, size = SOLVED, 0.0
    while len(misfits) < LAW_STEPS:
        at(model.space.comm, f"law step {len(misfits) + 1}")
        share_of_size = _rough_distance(misfits, goal)
        is_rough = share_of_size is not None
        distance = tolerance if share_of_size is None else share_of_size * size
        step = partial(kind, tolerance=distance, rough=is_rough)
        solution = solution_of(step, model, method, start, checks=not misfits)
        steps += solution.newton_steps
        change = _Change(model, about, solution.u)
        misfit, size = change.misfit()
        misfits.append(misfit / size if size > 0.0 else 0.0)
        log_of(model.space.comm).debug(
            "%d cells: law step %d, misfit %.1e", model.domain.cells, len(misfits), misfits[-1]
        )
        if tolerance is not None and size > 0.0:
            goal = tolerance / size
        if not is_rough and _ends(misfits, goal):
            told = ", ".join(f"{value:.0e}" for value in misfits)
            return replace(
                solution,
                newton_steps=steps,
                distance=float(np.hypot(solution.distance, misfit)),
                reason=f"{solution.reason}; misfits of the law: {told}",
            )
        # At first the supports do not hold yet: only a full step makes them hold.
        share = change.share() if holds else 1.0
        holds = True
        about.x.array[:] += share * (solution.u.x.array - about.x.array)
        model.linearised.move(about)
        start = solution
    told = ", ".join(f"{value:.0e}" for value in misfits[-5:])
    raise NotConverged(
        f"Newton's method for the law of {type(model.scene.material).__name__} did not converge on "
        f"{model.domain.cells} cells in {LAW_STEPS} steps; the last misfits of the stress are "
        f"{told}. Take smaller loads, more hardening, or a potential whose second derivative does "
        "not jump so much.",
        tuple(f"misfit {value:.2e}" for value in misfits),
    )


def _rough_distance(misfits: list[float], goal: float) -> float | None:
    """Return how far a contact problem on the way may be from its solution.

    Newton's steps square the misfit. What a contact problem leaves is a part of the
    next misfit. So a small share of the misfit is enough, if it falls by less than it
    did before.

    Args:
        misfits: The misfits of the steps before, over the size of the stress [-].
        goal: The misfit that is asked for, over the same [-].

    Returns:
        The distance over the size of the stress [-]; None for the first step, whose
        size is not known, and for a step that may be the last.
    """
    if not misfits:
        return None
    gain = LEAST_GAIN
    if len(misfits) > 1 and misfits[-1] < misfits[-2]:
        gain = min(misfits[-1] / misfits[-2], LEAST_GAIN)
    may_be_last = misfits[-1] * gain**2 <= goal or misfits[-1] <= STALLED
    return None if may_be_last else max(FORCING * gain * misfits[-1], goal)


def _ends(misfits: list[float], goal: float) -> bool:
    """Tell whether the steps end at a solution; see :func:`_rough_distance`."""
    last = misfits[-1]
    is_stalled = len(misfits) > 1 and last <= STALLED and last > 0.5 * misfits[-2]
    return last <= max(goal, SOLVED) or is_stalled


class _Change:
    """Compare the stresses of law and linear body along a step; members: collective.

    Args:
        model: The model, linearised about ``about``.
        about: A displacement [length].
        u: The displacement of the linear body [length].
    """

    def __init__(self, model: Model, about: fem.Function, u: fem.Function) -> None:
        space = model.space
        linearised = model.linearised
        assert linearised is not None
        self._comm = space.comm
        self._law = linearised.law
        is_plain = not linearised.varies_in_cells and space.degree == 1
        self._cells = space.owned_cells
        self._x, self._weights = space.cell_rule(1 if is_plain else DATA_DEGREE)
        places = self._x, self._cells
        self._strain = linearised.strain_at(*places)
        self._step = linearised.strain_of(u)(*places) - self._strain
        self._tangent = linearised.tangent_at(*places)
        self._metric = definite_inverses(self._tangent)
        self._stress = self._law.stress(self._strain, *places) + self._of_tangent(self._step)

    def misfit(self) -> tuple[float, float]:
        """Return the misfit and the size of the stress [sqrt(force length)].

        An unloaded body has a stress that is round-off of stresses that cancel.
        """
        cancelled = CANCELLED * self._norm(self._of_tangent(self._strain + self._step))
        return self._norm(self._beyond(1.0)), max(self._norm(self._stress), cancelled)

    def share(self) -> float:
        """Return the share of the step to take, in (0, 1]."""
        first = self._slope(0.0)
        if self._slope(1.0) <= TOO_FAR * abs(first) or first >= 0.0:
            return 1.0
        from scipy.optimize import brentq  # type: ignore[import-untyped]  # noqa: PLC0415 - for steps that go too far only

        return float(brentq(self._slope, 0.0, 1.0, xtol=NEAR))

    def _of_tangent(self, strain: np.ndarray) -> np.ndarray:
        """Return ``C eps`` of strains (n, q, s)."""
        return np.asarray(np.matmul(self._tangent, strain[..., None])[..., 0])

    def _beyond(self, share: float) -> np.ndarray:
        """Return the stress of the law at a share of a step, less the linear stress."""
        strain = self._strain + share * self._step
        return self._law.stress(strain, self._x, self._cells) - self._stress

    def _slope(self, share: float) -> float:
        """Return h [force length]."""
        density = (self._beyond(share) * self._step).sum(axis=-1)
        return self._comm.allreduce(float((self._weights * density).sum()), MPI.SUM)

    def _norm(self, stress: np.ndarray) -> float:
        """Return the energy norm of a stress [sqrt(force length)]."""
        density = np.einsum("nqi,nqij,nqj->nq", stress, self._metric, stress)
        square = self._comm.allreduce(float((self._weights * density).sum()), MPI.SUM)
        return float(np.sqrt(max(square, 0.0)))
