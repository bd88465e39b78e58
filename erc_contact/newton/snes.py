"""Newton's method for the condensed contact problem: PETSc's SNES on rank 0, in scaled variables.

Displacements are divided by their size and forces by the size of those that cancel. Otherwise the bisection line
search, which has absolute tolerances, would depend on the units.

Symbols: R residual, A and K as in :mod:`erc_contact.newton.condensed`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from erc_contact.newton.condensed import Condensed

PREFIX = "erc_contact_"
"""Prefix of PETSc options, as in ``-erc_contact_snes_monitor``; they override our settings."""
TOLERANCE = 1e-12
"""Newton's method stops when the residual is below this fraction of the forces that cancel in it [-]."""
STEPS = 100
"""Limit of Newton steps of one attempt."""
FAR = 1e5
"""Bound of the forces that cancel in the residual, as a multiple of those with the contact glued [-]."""
CYCLE = 0.9
"""A contact status that comes back is a cycle unless the residual has fallen below this fraction meanwhile [-]."""
PRESS = 1e-5
"""How far a state is pressed into the foundation for another tangent, over the size of the displacement [-]."""
ZERO_PIVOT = 71
"""PETSc's code of a matrix that cannot be factorised, PETSC_ERR_MAT_LU_ZRPVT."""


@dataclass(frozen=True)
class Outcome:
    """How one attempt ended.

    Attributes:
        converged: Whether it ended at a solution.
        reason: Why it ended.
        steps: Number of Newton steps.
        residual: Norm of the residual as a fraction of the forces that cancel in it [-].
        status: Numbers of open, slipping and sticking points of the contact.
    """

    converged: bool
    reason: str
    steps: int
    residual: float
    status: tuple[int, int, int]

    def __str__(self) -> str:
        status = "{} open, {} slip, {} stick".format(*self.status)
        return f"{self.reason}, residual {self.residual:.1e}, {self.steps} steps ({status})"


@dataclass(frozen=True, eq=False)
class State:
    """The last state of an attempt, on rank 0.

    Attributes:
        displacement: u_A [length].
        residual: R(u_A) [force].
    """

    displacement: np.ndarray
    residual: np.ndarray


class Newton:
    """SNES for one condensed problem, used on rank 0 within :meth:`Condensed.run`.

    Args:
        problem: The condensed problem.
        tolerance: Newton's method may stop when :meth:`remaining` is below it [sqrt(force length)]; None for round-off.
    """

    def __init__(self, problem: Condensed, tolerance: float | None = None) -> None:
        self.problem, self.tolerance = problem, tolerance
        self.scale = problem.length / problem.force
        size = problem.size
        self.jacobian = PETSc.Mat().createDense((size, size), comm=PETSc.COMM_SELF)
        self.jacobian.setUp()
        self.elastic: PETSc.KSP | None = None

    def solve(self, start: np.ndarray, line_search: str) -> tuple[State, Outcome]:
        """Make one attempt from the displacement start; return the last state and how the attempt ended."""
        problem, text = self.problem, ""
        snes = PETSc.SNES().create(PETSc.COMM_SELF)
        snes.setOptionsPrefix(PREFIX)
        x = self.jacobian.createVecRight()
        snes.setFunction(self._function, x.duplicate())
        snes.setJacobian(self._tangent, self.jacobian)
        snes.setType("newtonls")
        snes.setTolerances(rtol=0.0, atol=TOLERANCE, stol=0.0, max_it=STEPS)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        ksp.getPC().setType("lu")
        snes.getLineSearch().setType(line_search)

        test = _StoppingTest(self)
        snes.setConvergenceTest(test)
        snes.setFromOptions()
        x.array[:] = start / self.problem.length
        try:
            snes.solve(None, x)
            reason, norm = snes.getConvergedReason(), snes.getFunctionNorm()
        except PETSc.Error as failure:
            if failure.ierr != ZERO_PIVOT:
                raise
            text, reason, norm = "singular tangent", -1, np.inf
        u = x.array * problem.length
        found = State(u, problem.residual(u))
        open_, slip, stick = (int(n) for n in np.bincount(problem.status(u), minlength=3))
        converged = reason > 0 and bool(np.isfinite(norm))
        text = text or test.reason or REASONS.get(reason, str(reason))
        outcome = Outcome(converged, text, snes.getIterationNumber(), norm, (open_, slip, stick))
        snes.destroy()
        x.destroy()
        return found, outcome

    def forces(self, u: np.ndarray) -> float:
        """Size of the forces that cancel in the residual at u_A [force].

        The size is bounded: a body that nothing holds moves so far that any residual would be round-off of its forces.
        """
        problem = self.problem
        size = float((abs(problem.matrix) @ abs(u) + abs(problem.loads)).max(initial=0.0))
        return min(size, FAR * problem.force)

    def remaining(self, residual: np.ndarray) -> float:
        """Energy norm of the distance to the solution, ``sqrt(R.K^-1 R)`` [sqrt(force length)].

        If r^ is the traction of the method, the rebalance of the last state adds this to the error in the constitutive
        relation.
        """
        if self.elastic is None:
            elastic = self.problem.stiffness.definite(self.problem.size)
            matrix = PETSc.Mat().createDense(elastic.shape, array=elastic, comm=PETSc.COMM_SELF)
            matrix.setOption(PETSc.Mat.Option.SPD, True)
            self.elastic = _direct(matrix, "cholesky")
        force, u = self.jacobian.createVecs()
        force.array[:] = residual
        self.elastic.solve(force, u)
        return float(np.sqrt(max(u.dot(force), 0.0)))

    def regularity(self, u_A: np.ndarray) -> float:
        """Least singular value of the tangent, scaled by the elastic diagonal [-]; zero if it has no inverse.

        It is the lesser one of two tangents: at u_A, and at u_A pressed into the foundation by a tiny length. At points
        that touch without pressure the equations have a kink, and the tangent under pressure may be the singular one.
        """
        pressed = u_A + PRESS * self.problem.length * self.problem.normals
        return min(self._least_singular_value(u) for u in (u_A, pressed))

    def _least_singular_value(self, u_A: np.ndarray) -> float:
        """An estimate by inverse iteration on ``J^T J``."""
        diagonal = 1 / np.sqrt(self.problem.schur.diagonal())
        scaled = self.problem.tangent(u_A) * diagonal * diagonal[:, None]
        matrix = PETSc.Mat().createDense(scaled.shape, array=scaled, comm=PETSc.COMM_SELF)
        ksp = _direct(matrix, "lu")
        x, y = matrix.createVecs()
        x.array[:] = np.random.default_rng(0).standard_normal(len(diagonal))
        norm = x.norm()
        try:
            for _ in range(4):
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

    def _function(self, _: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        f.array[:] = self.problem.residual(x.array_r * self.problem.length) / self.problem.force

    def _tangent(self, _: PETSc.SNES, x: PETSc.Vec, matrix: PETSc.Mat, __: PETSc.Mat) -> None:
        matrix.getDenseArray()[:] = self.problem.tangent(x.array_r * self.problem.length) * self.scale
        matrix.assemble()

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self.jacobian.destroy()
        if self.elastic is not None:
            self.elastic.destroy()


class _StoppingTest:
    """Convergence test of one attempt, for SNES.

    An attempt converges at round-off or when it is accurate enough. It diverges when the contact status repeats itself.

    Attributes:
        reason: Why it ended, or "" if PETSc's reason says it.
    """

    def __init__(self, newton: Newton) -> None:
        self.newton, self.reason = newton, ""
        self._before: dict[bytes, tuple[int, float]] = {}  # last step and least residual of each status

    def __call__(self, snes: PETSc.SNES, step: int, norms: tuple[float, float, float]) -> PETSc.SNES.ConvergedReason:
        """PETSc's reason to end, or to go on, at one step."""
        newton, problem = self.newton, self.newton.problem
        reasons, norm = PETSc.SNES.ConvergedReason, norms[2]
        _, atol, _, _ = snes.getTolerances()
        if not np.isfinite(norm):
            return reasons.DIVERGED_FUNCTION_NANORINF
        if norm <= atol:
            return reasons.CONVERGED_FNORM_ABS
        u = snes.getSolution().array_r * problem.length
        residual = problem.residual(u)
        if np.linalg.norm(residual) <= TOLERANCE * newton.forces(u):
            self.reason = "converged to round-off"
            return reasons.CONVERGED_ITS
        if newton.tolerance is not None and newton.remaining(residual) <= newton.tolerance:
            self.reason = "accurate enough"
            return reasons.CONVERGED_ITS
        status = problem.status(u).tobytes()
        before, least = self._before.get(status, (step, norm))
        if before < step - 1 and norm > CYCLE * least:
            self.reason = f"cycle of {step - before} steps"
            return reasons.DIVERGED_INNER
        self._before[status] = (step, min(least, norm))
        return reasons.ITERATING


def _direct(matrix: PETSc.Mat, kind: str) -> PETSc.KSP:
    """A solver with the "lu" or "cholesky" factor of a dense matrix."""
    matrix.assemble()
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    ksp.getPC().setType(kind)
    return ksp


REASONS = {value: name.lower() for name, value in vars(PETSc.SNES.ConvergedReason).items() if isinstance(value, int)}
"""Names of PETSc's reasons."""
