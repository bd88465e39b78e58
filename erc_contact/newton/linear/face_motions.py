"""Let loose rigid faces move in a linear elastic problem.

A solver knows the faces as supports, at rest but for their given motions. Let A be its
matrix (K, K + D, or K with springs at the contact), K_R and K_RR as in
:mod:`erc_contact.newton.linear.eliminated_faces`, and W_j the displacement of the
unknowns under a unit motion R_j of a face:

    W = -A^-1 K_R,    S = K_RR + K_R^T W.

The motions q of the faces follow from their resultants. With u_0 the displacement that
the solver finds under the nodal forces b, faces at rest,

    u = u_0 + (W + R) q,    S q = R . (b - K u_0).

S is small, and positive definite as far as the body is held. The inverse of the matrix
without q is ``A^-1 + W S^-1 W^T``, and the Schur complement S_L on some unknowns L,
made with faces at rest, becomes with loose faces

    S_L - S_L W_L H^-1 W_L^T S_L,    H = S + W_L^T S_L W_L,

because H is the stiffness of the faces while L does not move, and -S_L W_L the force on
L by their unit motions.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fp
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.newton.linear.elastic import Elastic
from erc_contact.newton.linear.eliminated_faces import EliminatedFaces

type LinearSolve = Callable[[PETSc.Vec, PETSc.Vec], None]
"""Sets the second vector to the solution of a matrix for the first one."""


class FaceMotions:
    """Hold the displacements under unit motions of the loose faces of a model.

    Construction and members are collective.

    Args:
        elastic: The elastic equations.
        faces: Their loose faces.
        solve: Solves A with the faces at rest.

    Attributes:
        displacements: W [-], Functions of V.
        stiffness: S [force/length], shape (J, J).
    """

    def __init__(self, elastic: Elastic, faces: EliminatedFaces, solve: LinearSolve) -> None:
        self._elastic = elastic
        self._faces = faces
        self.displacements: list[fem.Function] = []
        for coupling in faces.coupling.T:
            right = fp.create_vector(elastic.model.V)
            right.array[:] = -coupling
            x = right.duplicate()
            solve(right, x)
            self.displacements.append(elastic.function(x))
            right.destroy()
            x.destroy()
        self._owned = np.column_stack([w.x.array[: elastic.owned] for w in self.displacements])
        change = elastic.model.comm.allreduce(faces.coupling.T @ self._owned, MPI.SUM)
        self.stiffness = faces.stiffness + 0.5 * (change + change.T)

    def move(self, u: fem.Function, b: fem.Function | None) -> None:
        """Add the motions of the faces and what they cause to u_0, in place.

        Args:
            u: The displacement u_0 [length].
            b: Nodal forces [force], not yet summed over ranks; None for forces that do
                not work on the faces.
        """
        motions = np.linalg.solve(self.stiffness, self._faces.pushes(b, u))
        moved = np.zeros(len(u.x.array))
        for amount, displacement in zip(motions, self.displacements, strict=True):
            moved += amount * displacement.x.array
        u.x.array[:] += moved
        self._faces.move(u, motions)

    def moved(self, force: np.ndarray) -> np.ndarray:
        """Return ``W S^-1 W^T f`` [length], shape (owned,).

        Args:
            force: Forces f on the unknowns of this rank [force], shape (owned,).
        """
        pushes = self._elastic.model.comm.allreduce(self._owned.T @ force, MPI.SUM)
        return np.asarray(self._owned @ np.linalg.solve(self.stiffness, pushes))

    def softened(self, schur: np.ndarray, at_layer: np.ndarray) -> np.ndarray:
        """Return the Schur complement on L of the body with loose faces.

        Args:
            schur: That with the faces at rest [force/length], shape (L, L).
            at_layer: The unit motions at L, shape (L, J).
        """
        pulled = schur @ at_layer
        faces_alone = self.stiffness + at_layer.T @ pulled
        change = pulled @ np.linalg.solve(faces_alone, pulled.T)
        return np.asarray(schur - 0.5 * (change + change.T))
