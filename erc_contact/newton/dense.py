"""The condensed contact problem for SNES: dense matrices on rank 0.

Symbols: R residual, A and K as in :mod:`erc_contact.newton.condensed`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from petsc4py import PETSc

from erc_contact.newton.condensed import Condensed
from erc_contact.newton.contact_nodes import PRESSING
from erc_contact.newton.interior_point import follow
from erc_contact.newton.ladder import Attempt
from erc_contact.newton.linear.mumps import dense_factor
from erc_contact.newton.snes import IMBALANCE, ZERO_PIVOT, Outcome, PathEnd, Status, attempt

SOLVED_DENSE = 1e-12
"""Residual at which Newton's method stops, over the forces that cancel in it [-]."""
MOST_FORCES = 1e6
"""Bound of forces that cancel in the residual, over forces with the glue [-]."""
INVERSE_ITERATIONS = 4
"""Steps of the inverse iteration for the least singular value."""


class CondensedSolution(NamedTuple):
    """Hold a solution of a condensed problem, on rank 0.

    Attributes:
        u_A: Its displacement [length].
        force: Contact forces at A [force].
        distance: Energy norm of the distance to the exact solution of the discrete
            problem [sqrt(force length)].
        least_singular_value: Least singular value of the scaled tangent [-].
    """

    u_A: np.ndarray
    force: np.ndarray
    distance: float
    least_singular_value: float


def follow_path(problem: Condensed, start: np.ndarray) -> PathEnd:
    """Make interior point steps on rank 0, within :meth:`Condensed.run`.

    Args:
        problem: The condensed problem, with a central path.
        start: The displacement u_A from which they start [length].
    """
    factor: PETSc.KSP | None = None
    force = PETSc.Vec().createSeq(problem.size, comm=PETSc.COMM_SELF)
    change = force.duplicate()

    def solve(u: np.ndarray, *, renew: bool) -> np.ndarray:
        nonlocal factor
        if renew:
            if factor is not None:
                factor.destroy()
            factor = dense_factor(problem.tangent(u), "lu")
        assert factor is not None
        force.array[:] = problem.residual(u)
        factor.solve(force, change)
        solution = u - change.array_r
        problem.move(solution)
        return solution

    return follow(problem.along_path, solve, start, corrects=True)


class Dense:
    """Represent a condensed problem as SNES sees it.

    It is used on rank 0 within :meth:`Condensed.run`.

    Args:
        problem: The condensed problem.
        tolerance: Newton's method may stop when :meth:`distance` is below it
            [sqrt(force length)]; None for round-off.
    """

    def __init__(self, problem: Condensed, tolerance: float | None = None) -> None:
        self.problem = problem
        self.tolerance = tolerance
        self.scale = problem.length / problem.force
        size = problem.size
        self.jacobian = PETSc.Mat().createDense((size, size), comm=PETSc.COMM_SELF)
        self.jacobian.setUp()
        self.elastic: PETSc.KSP | None = None

    def solve(self, start: np.ndarray, step: Attempt) -> tuple[np.ndarray, Outcome]:
        """Make one attempt; return the last state u_A and how the attempt ended.

        Args:
            start: The displacement where Newton's method starts [length].
            step: The attempt.
        """
        x = self.vector()
        x.array[:] = start / self.problem.length
        outcome = attempt(self, x, step, self.tolerance)
        u_A = self._displacement(x)
        x.destroy()
        return u_A, outcome

    def solution(self, u_A: np.ndarray, *, rough: bool) -> CondensedSolution:
        """Return what is known of a solution u_A [length].

        Args:
            u_A: The solution.
            rough: Whether nobody asks whether it is the only one.
        """
        problem = self.problem
        return CondensedSolution(
            u_A,
            force=problem.matrix @ u_A - problem.loads,
            distance=self.distance(problem.residual(u_A)),
            least_singular_value=1.0 if rough else self.least_singular_value(u_A),
        )

    def vector(self) -> PETSc.Vec:
        """Return a new vector of unknowns."""
        return self.jacobian.createVecRight()

    def function(self, _: Any, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Set f to the scaled residual."""
        f.array[:] = self.problem.residual(self._displacement(x)) / self.problem.force

    def prepare(self, snes: PETSc.SNES) -> None:
        """Give SNES the tangent and a direct solver."""
        snes.setJacobian(self._set_tangent, self.jacobian)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        ksp.getPC().setType("lu")

    def round_off(self, x: PETSc.Vec) -> tuple[float, float]:
        """Return the norm of the scaled residual that counts as round-off, twice [-].

        The forces that cancel in it are bounded: a body that nothing holds moves so far
        that any residual would be round-off of its forces.
        """
        problem = self.problem
        forces = abs(problem.matrix) @ abs(self._displacement(x)) + abs(problem.loads)
        size = max(1.0, float(forces.max(initial=0.0)) / problem.force)
        solved = SOLVED_DENSE * min(size, MOST_FORCES)
        return solved, solved

    def balances(self, x: PETSc.Vec) -> bool:
        """Tell whether K x has no resultant on motions that no support holds."""
        return self.problem.imbalance(self._displacement(x)) <= IMBALANCE

    def accurate(self, x: PETSc.Vec, tolerance: float) -> bool:
        """Tell whether the distance to the solution is below a tolerance."""
        return self.distance(self.problem.residual(self._displacement(x))) <= tolerance

    def status(self, x: PETSc.Vec) -> Status:
        """Return the contact status of all points."""
        status = self.problem.status(self._displacement(x))
        open_, slip, stick = (int(count) for count in np.bincount(status, minlength=3))
        return Status(status.tobytes(), (open_, slip, stick), status)

    def distance(self, residual: np.ndarray) -> float:
        """Return the distance to the solution, ``sqrt(R.K^-1 R)`` [sqrt(force length)].

        It is an energy norm. If r^ is the traction of the method, the rebalance of the
        last state adds this to the error in the constitutive relation.
        """
        if self.elastic is None:
            definite = self.problem.stiffness.definite(self.problem.size)
            self.elastic = dense_factor(definite, "cholesky")
        force, u = self.jacobian.createVecs()
        force.array[:] = residual
        self.elastic.solve(force, u)
        return float(np.sqrt(max(u.dot(force), 0.0)))

    def least_singular_value(self, u_A: np.ndarray) -> float:
        """Estimate the least singular value of the tangent [-]; zero if singular.

        The elastic diagonal scales it. It is the lesser one of two tangents: at u_A,
        and at u_A pressed into the foundation
        (:data:`.contact_nodes.PRESSING`).
        """
        pressed = u_A + PRESSING * self.problem.length * self.problem.normals
        return min(self._by_inverse_iteration(u_A), self._by_inverse_iteration(pressed))

    def _by_inverse_iteration(self, u_A: np.ndarray) -> float:
        """Estimate the least singular value by inverse iteration on ``J^T J`` [-]."""
        diagonal = 1 / np.sqrt(self.problem.schur.diagonal())
        scaled = self.problem.tangent(u_A) * diagonal * diagonal[:, None]
        ksp = dense_factor(scaled, "lu")
        x, y = self.jacobian.createVecs()
        x.array[:] = np.random.default_rng(0).standard_normal(len(diagonal))
        norm = x.norm()
        try:
            for _ in range(INVERSE_ITERATIONS):
                x.scale(1 / norm)
                ksp.solveTranspose(x, y)
                ksp.solve(y, x)
                norm = x.norm()
                if not np.isfinite(norm) or norm == 0.0:
                    return 0.0
        except PETSc.Error as failure:
            if failure.ierr != ZERO_PIVOT:
                raise
            return 0.0
        return float(1 / np.sqrt(norm))

    def _displacement(self, x: PETSc.Vec) -> np.ndarray:
        """Return u_A [length]."""
        return x.array_r * self.problem.length

    def _set_tangent(self, _: Any, x: PETSc.Vec, matrix: PETSc.Mat, __: PETSc.Mat) -> None:
        """Set a matrix to the scaled tangent at x."""
        matrix.getDenseArray()[:] = self.problem.tangent(self._displacement(x)) * self.scale
        matrix.assemble()

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self.jacobian.destroy()
        if self.elastic is not None:
            self.elastic.destroy()
