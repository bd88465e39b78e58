"""Springs on the rigid motions that no support holds, for iterative solvers.

With q an orthonormal free motion and D the diagonal of K, springs of weight w that keep
the motions of a displacement v add ``w k q q^T (x - v)`` to the forces K x. The
stiffness is ``k = 1/(q^T D^-1 q)``, a mean in which the softest body counts: springs as
stiff as a body stiffer by orders would not let a soft one move.
"""

from __future__ import annotations

from petsc4py import PETSc

from erc_contact.model.model import Model
from erc_contact.newton.linear.hierarchy import free_motions


class MotionSprings:
    """Keep the free motions of a displacement by springs; members are collective.

    Args:
        model: The scene on a mesh; supports leave a body rigid motions.
        matrix: K [force/length].
        weight: Weight of the springs [-].
        x: The unknowns whose motions they keep, in any scale.
    """

    def __init__(self, model: Model, matrix: PETSc.Mat, weight: float, x: PETSc.Vec) -> None:
        self._space = free_motions(model, matrix)
        self._motions = self._space.getVecs()
        diagonal = matrix.getDiagonal()
        softness = matrix.createVecRight()
        self._stiffness = []
        for motion in self._motions:
            softness.pointwiseDivide(motion, diagonal)
            self._stiffness.append(weight / motion.dot(softness))
        softness.destroy()
        diagonal.destroy()
        self._kept = [motion.dot(x) for motion in self._motions]

    def add_tangent(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the forces of the springs for a change x to y, in place."""
        amounts = [motion.dot(x) for motion in self._motions]
        self._add(amounts, y)

    def add_forces(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the forces of the springs at x to y, in place."""
        amounts = []
        for motion, kept in zip(self._motions, self._kept, strict=True):
            amounts.append(motion.dot(x) - kept)
        self._add(amounts, y)

    def free(self) -> None:
        """Free PETSc's objects."""
        for motion in self._motions:
            motion.destroy()
        self._space.destroy()

    def _add(self, amounts: list[float], y: PETSc.Vec) -> None:
        """Add the forces of springs that are stretched by amounts, in place."""
        for motion, stiffness, amount in zip(self._motions, self._stiffness, amounts, strict=True):
            y.axpy(stiffness * amount, motion)
