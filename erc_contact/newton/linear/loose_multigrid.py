"""The elastic equations of a model with loose rigid faces, solved with multigrid.

The motions of the faces are eliminated (:mod:`.face_motions`): the matrix is ``A -
K_R K_RR^-1 K_R^T`` with A the matrix of the faces at rest, K or K with something at the
contact. It is applied, not assembled. Its inverse is ``A^-1 + W S^-1 W^T``, so that a
cycle for A, and few vectors W that are about right, precondition it as well as the
cycle does A alone. W and S are made once, for the first matrix.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from erc_contact.base.exceptions import NotConverged
from erc_contact.model.model import Model
from erc_contact.newton.linear.face_motions import EliminatedFaces, FaceMotions
from erc_contact.newton.linear.krylov import conjugate_gradients, preconditioner, shell
from erc_contact.newton.linear.multigrid import ROUGH, TRY_DIRECT, Multigrid, Way

LIFTING = 1e-2
"""Tolerance of W, which only preconditions [-]."""
ENOUGH = 10.0
"""W is good enough if it leaves so many tolerances [-]."""


class LooseMultigrid(Multigrid):
    """Solve the elastic equations of a model with loose rigid faces with multigrid."""

    def right_side(self, b: fem.Function, *, supports: bool, glued: bool = False) -> PETSc.Vec:
        """Return the right side of the equations without the motions of faces."""
        reduced = b.copy()
        self._faces.reduce(reduced, supports=supports)
        return super().right_side(reduced, supports=supports, glued=glued)

    def solve_glued(
        self, b: fem.Function, *, supports: bool = True, tolerance: float = ROUGH
    ) -> fem.Function:
        """Solve ``(K + D) u_0 = b``, see :meth:`Multigrid.solve_glued`."""
        u_0 = super().solve_glued(b, supports=supports, tolerance=tolerance)
        self._faces.follow(u_0, b)
        return u_0

    def solve(
        self, b: fem.Function, *, supports: bool = True, tolerance: float | None = None
    ) -> fem.Function:
        """Solve ``K u = b``, see :meth:`Multigrid.solve`."""
        u = super().solve(b, supports=supports, tolerance=tolerance)
        self._faces.follow(u, b)
        return u

    def solve_with_springs(
        self, springs: PETSc.Mat, b: fem.Function, near: fem.Function
    ) -> fem.Function:
        """Solve ``(K + C) u = b``, see :meth:`Multigrid.solve_with_springs`."""
        u = super().solve_with_springs(springs, b, near)
        self._faces.follow(u, b)
        return u

    def times(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to the forces by which x is in equilibrium with the faces [force]."""
        super().times(x, y)
        y.array[:] -= self._faces.pull(x.array_r)

    def start(self, u: fem.Function) -> np.ndarray:
        """Return the nodal values of a displacement; faces have their given motions."""
        nodal = super().start(u).copy()
        fixed = self.fixed
        nodal[fixed] = self.model.prescribed.x.array[: self.owned][fixed]
        return nodal

    def follow(self, u: fem.Function) -> None:
        """Let the faces follow a displacement under the loads [length], in place."""
        self._faces.follow(u, self.load_vector())

    def cycle(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y to about the inverse times x."""
        super().cycle(x, y)
        y.array[:] += self._motions_of_faces.respond(x.array_r)

    def _ways_of_stiffness(self, _: float) -> list[Callable[[], Way]]:
        """Return what makes the preconditioners for K without the motions of faces.

        K has the faces at rest, and a factor of K is not exact.
        """
        return [self._cycle, self._factor_of_sum]

    def _iterate(
        self,
        matrix: PETSc.Mat,
        way: Way,
        b: PETSc.Vec,
        x: PETSc.Vec,
        tolerance: float,
        held: np.ndarray | None,
    ) -> float:
        """Return what conjugate gradients leave, see :meth:`Multigrid._iterate`."""
        hierarchy = self.hierarchy
        motions = self._motions_of_faces
        scale = hierarchy.scale if matrix is hierarchy.matrix else 1.0
        connections = self.model.connections
        free, followed = b.duplicate(), b.duplicate()

        def times(v: PETSc.Vec, force: PETSc.Vec) -> None:
            matrix.mult(v, force)
            if held is None:
                v.copy(free)
            else:
                connections.let_go(v, free, held)
            followed.array[:] = scale * self._faces.pull(free.array_r)
            if held is not None:
                connections.let_go(followed, free, held)
                free.copy(followed)
            force.axpy(-1.0, followed)

        def precondition(force: PETSc.Vec, v: PETSc.Vec) -> None:
            way.pc.apply(force, v)
            v.array[:] += motions.respond(force.array_r) / hierarchy.scale

        operator = shell(times, b)
        if self.model.free_motions and matrix is self.operator:
            operator.setNullSpace(matrix.getNullSpace())
        pc = preconditioner(precondition, operator)
        left = conjugate_gradients(
            operator, pc, operator, b, x, tolerance, limit=way.limit, slow=way.slow
        )
        for done in (pc, operator, free, followed):
            done.destroy()
        return left

    @cached_property
    def _faces(self) -> EliminatedFaces:
        """Return the equations of the faces."""
        return EliminatedFaces(self)

    @cached_property
    def _motions_of_faces(self) -> FaceMotions:
        """Return W and S for the first matrix of the hierarchy.

        Raises:
            NotConverged: If multigrid is slow.
        """
        matrix = self.hierarchy.matrix
        iterate = super()._iterate

        def solve(force: PETSc.Vec, x: PETSc.Vec) -> None:
            force.scale(self.hierarchy.scale)
            left = iterate(matrix, self._first(), force, x, LIFTING, None)
            if not left <= ENOUGH * LIFTING:
                raise NotConverged(
                    f"Conjugate gradients with multigrid left {left:.0e} of the forces under the"
                    f" motion of a rigid face. {TRY_DIRECT}",
                    (),
                )

        return FaceMotions(self, self._faces, solve)


def multigrid_of(model: Model, *, hurried: bool = False) -> Multigrid:
    """Return the multigrid solver of a model, with or without loose rigid faces.

    Args:
        model: The scene on a mesh.
        hurried: See :class:`Multigrid`.
    """
    kind = LooseMultigrid if model.loose_faces else Multigrid
    return kind(model, hurried=hurried)
