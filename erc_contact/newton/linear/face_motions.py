"""Let loose rigid faces move in a linear elastic problem.

The unknowns x belong to a body whose faces are at rest but for their given motions.
R_j is the displacement of a face in one of its other motions, zero at the nodes off the
face, and q_j its amount. With b nodal forces and u_0 the displacement of x,

    K x + K_R q = b  off the supports,    K_RR q = R . (b - K u_0),

    K_R = K R  off the supports,    K_RR = R . K R,

because the resultants of the faces, which are in b, work on R, and nothing else does.
Multigrid solves without q (:class:`EliminatedFaces`):

    (K - K_R K_RR^-1 K_R^T) x = b - K_R K_RR^-1 R . (b - K p)

with the displacement p that supports prescribe. K_RR is the stiffness of the cells at
the faces, so that it is small and positive definite.

A factor has the faces at rest, and their motions are added (:class:`FaceMotions`). Let
A be its matrix (K, K + D, or K with springs at the contact), and W_j the displacement
of the unknowns under a unit motion R_j of a face:

    W = -A^-1 K_R,    S = K_RR + K_R^T W.

The motions q of the faces follow from their resultants. With u_0 the displacement that
the solver finds under the nodal forces b, faces at rest,

    u = u_0 + (W + R) q,    S q = R . (b - K u_0).

S is the Schur complement on the motions, small, and positive definite as far as the
body is held. The inverse of the matrix without q is ``A^-1 + W S^-1 W^T``, and the
Schur complement S_L on some unknowns L, made with faces at rest, becomes with loose
faces

    S_L - S_L W_L H^-1 W_L^T S_L,    H = S + W_L^T S_L W_L,

because H is the stiffness of the faces while L does not move, and -S_L W_L the force on
L by their unit motions.

Symbols: K elastic stiffness with the supports [force/length].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fp
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.base.runtime import compiled
from erc_contact.model.model import Model
from erc_contact.newton.linear.elastic import ElasticEquations

type LinearSolve = Callable[[PETSc.Vec, PETSc.Vec], None]
"""Sets the second vector to the solution of a matrix for the first one."""


class EliminatedFaces:
    """Hold K_R and K_RR of the loose faces of a model.

    Construction and members are collective.

    Args:
        elastic: The elastic equations.

    Attributes:
        shapes: R [-], Functions of V. They are of size 1 on the body, so that matrices
            have entries of one size in any unit.
        coupling: K_R at the unknowns of this rank [force/length], shape (owned, J).
        stiffness: K_RR [force/length], shape (J, J).
    """

    def __init__(self, elastic: ElasticEquations) -> None:
        self._model = model = elastic.model
        self._owned = elastic.owned
        self.shapes = _unit_motions(model)
        self._forces = self._nodal_forces()
        fixed = np.flatnonzero(elastic.fixed)
        columns = []
        for forces in self._forces:
            of_unknowns = forces.copy()
            of_unknowns[fixed] = 0.0
            columns.append(of_unknowns)
        self.coupling = np.column_stack(columns)
        local = [[shape.x.array[: self._owned] @ f for f in self._forces] for shape in self.shapes]
        stiffness = model.space.comm.allreduce(np.array(local), MPI.SUM)
        self.stiffness = 0.5 * (stiffness + stiffness.T)

    def pushes(self, b: fem.Function | None, u: fem.Function) -> np.ndarray:
        """Return ``R . (b - K u)``, what moves the faces [force], shape (J,).

        Args:
            b: Nodal forces [force], not yet summed over ranks; None for zero.
            u: A displacement [length].
        """
        owned = u.x.array[: self._owned]
        local = np.array([-forces @ owned for forces in self._forces])
        if b is not None:
            local += np.array([shape.x.array @ b.x.array for shape in self.shapes])
        return np.asarray(self._model.space.comm.allreduce(local, MPI.SUM))

    def move(self, u: fem.Function, motions: np.ndarray) -> None:
        """Add motions (J,) of the faces to a displacement [length], in place."""
        for amount, shape in zip(motions, self.shapes, strict=True):
            u.x.array[:] += amount * shape.x.array

    def follow(self, u: fem.Function, b: fem.Function) -> None:
        """Move the faces to where nodal forces b [force] balance u, in place."""
        self.move(u, np.linalg.solve(self.stiffness, self.pushes(b, u)))

    def reduce(self, b: fem.Function, *, supports: bool) -> None:
        """Subtract ``K R K_RR^-1 R . (b - K p)`` from nodal forces b [force], in place.

        Args:
            b: Nodal forces, not yet summed over ranks.
            supports: Whether supports have their values p, else zero.
        """
        p = self._model.prescribed if supports else self._model.space.function()
        motions = np.linalg.solve(self.stiffness, self.pushes(b, p))
        for amount, forces in zip(motions, self._forces, strict=True):
            b.x.array[: self._owned] -= amount * forces

    def pull(self, x: np.ndarray) -> np.ndarray:
        """Return ``K_R K_RR^-1 K_R^T x`` at the unknowns of this rank [force].

        Args:
            x: Unknowns of this rank [length], shape (owned,).
        """
        pulls = self._model.space.comm.allreduce(self.coupling.T @ x, MPI.SUM)
        return np.asarray(self.coupling @ np.linalg.solve(self.stiffness, pulls))

    def _nodal_forces(self) -> list[np.ndarray]:
        """Return the nodal forces K R_j of this rank [force/length], each (owned,)."""
        model = self._model
        field = model.space.function()
        action = compiled.form(model.stiffness(field, ufl.TestFunction(model.space.V)))
        nodal_forces = []
        for shape in self.shapes:
            field.x.array[:] = shape.x.array
            forces = model.space.function()
            fem.assemble_vector(forces.x.array, action)
            forces.x.scatter_reverse(la.InsertMode.add)
            nodal_forces.append(forces.x.array[: self._owned].copy())
        return nodal_forces


def _unit_motions(model: Model) -> list[fem.Function]:
    """Return R of all free motions of all loose faces, on all ranks in one order."""
    shapes = []
    for face in model.loose_faces:
        for number in np.flatnonzero(face.free):
            shape = model.space.function()
            values = face.shapes[:, :, number] / face.sizes[number]
            shape.x.array.reshape(-1, model.space.d)[face.nodes] = values
            # A rank may see a node without the facet: its owner sees all.
            shape.x.scatter_forward()
            shapes.append(shape)
    return shapes


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

    def __init__(
        self, elastic: ElasticEquations, faces: EliminatedFaces, solve: LinearSolve
    ) -> None:
        self._elastic = elastic
        self._faces = faces
        self.displacements: list[fem.Function] = []
        for coupling in faces.coupling.T:
            right = fp.create_vector(elastic.model.space.V)
            right.array[:] = -coupling
            x = right.duplicate()
            solve(right, x)
            self.displacements.append(elastic.function(x))
            right.destroy()
            x.destroy()
        self._owned = np.column_stack([w.x.array[: elastic.owned] for w in self.displacements])
        change = elastic.model.space.comm.allreduce(faces.coupling.T @ self._owned, MPI.SUM)
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

    def respond(self, force: np.ndarray) -> np.ndarray:
        """Return ``W S^-1 W^T f`` [length], shape (owned,).

        Args:
            force: Forces f on the unknowns of this rank [force], shape (owned,).
        """
        pushes = self._elastic.model.space.comm.allreduce(self._owned.T @ force, MPI.SUM)
        return np.asarray(self._owned @ np.linalg.solve(self.stiffness, pushes))

    def soften(self, schur: np.ndarray, at_layer: np.ndarray) -> np.ndarray:
        """Return the Schur complement on L of the body with loose faces.

        Args:
            schur: That with the faces at rest [force/length], shape (L, L).
            at_layer: The unit motions at L, shape (L, J).
        """
        pulled = schur @ at_layer
        faces_alone = self.stiffness + at_layer.T @ pulled
        change = pulled @ np.linalg.solve(faces_alone, pulled.T)
        return np.asarray(schur - 0.5 * (change + change.T))
