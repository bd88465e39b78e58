"""Springs on the rigid motions that no support holds, for iterative solvers.

With Q the orthonormal free motions and k the mean of K's diagonal, springs of weight w
that keep the motions of a displacement v add ``w k Q Q^T (x - v)`` to the forces K x.
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
        self._stiffness = weight * diagonal.sum() / diagonal.getSize()
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
        for motion, amount in zip(self._motions, amounts, strict=True):
            y.axpy(self._stiffness * amount, motion)
