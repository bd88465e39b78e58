"""Let loose rigid faces move in a linear elastic problem.

A solver knows the faces as supports, at rest but for their given motions. Let A be its
matrix (K + D, or K with springs at the contact) and W_j the displacement under a unit
motion R_j of a face,

    A W_j = 0  off the supports,    W_j = R_j  on the face.

The motions q of the faces follow from their resultants. With u_0 the displacement that
the solver finds under the nodal forces b, which contain the resultants, and prescribed
displacements p on supports,

    u = u_0 + sum_j q_j W_j,    S q = W^T (b - K p),    S_ij = W_i . A W_j.

S is small, and positive definite as far as the body is held. The Schur complement on
some unknowns L, that of the body with faces at rest, becomes that with loose faces,

    S_L - S_L W_L H^-1 W_L^T S_L,    H = S + W_L^T S_L W_L,

because H is the stiffness of the faces while L does not move, and -S_L W_L the force on
L by their unit motions.
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
from erc_contact.newton.linear.elastic import Elastic

type LinearSolve = Callable[[PETSc.Vec, PETSc.Vec], None]
"""Sets the second vector to the solution of a matrix for the first one."""


class FaceMotions:
    """Hold the displacements under unit motions of the loose faces of a model.

    Construction and members are collective.

    Args:
        elastic: The elastic equations.
        solve: Solves A with the faces at rest.

    Attributes:
        shapes: W_j of all free motions of all loose faces, Functions of V.
        unknowns: The same as unknowns x.
        stiffness: S [force/length], shape (J, J).
    """

    def __init__(self, elastic: Elastic, solve: LinearSolve) -> None:
        self._model = model = elastic.model
        self._owned = elastic.owned
        field = model.function()
        action = compiled.form(model.stiffness(field, ufl.TestFunction(model.V)))

        def forces_of(u: fem.Function) -> np.ndarray:
            """Return the nodal forces K u of this rank, complete at owned nodes."""
            field.x.array[:] = u.x.array
            forces = model.function()
            fem.assemble_vector(forces.x.array, action)
            forces.x.scatter_reverse(la.InsertMode.add)
            return forces.x.array

        fixed = np.flatnonzero(elastic.fixed)
        self.shapes: list[fem.Function] = []
        on_faces: list[fem.Function] = []
        for face in model.loose_faces:
            for number in np.flatnonzero(face.free):
                motion = model.function()
                # Of size 1 on the body, so that S has entries of one size in any unit.
                shape = face.shapes[:, :, number] / face.sizes[number]
                motion.x.array.reshape(-1, model.d)[face.nodes] = shape
                # A rank may see a node without the facet: its owner sees all.
                motion.x.scatter_forward()
                right = fp.create_vector(model.V)
                right.array[:] = -forces_of(motion)[: self._owned]
                model.coordinates.forces(right)
                right.array[fixed] = elastic.support_stiffness * motion.x.array[fixed]
                x = right.duplicate()
                solve(right, x)
                self.shapes.append(elastic.displacement(x))
                on_faces.append(motion)
                right.destroy()
                x.destroy()
        self.unknowns = [model.coordinates.to_x(shape) for shape in self.shapes]
        self._reactions = [forces_of(shape)[: self._owned].copy() for shape in self.shapes]
        # W_j is in equilibrium off the supports, so that W_i may be R_i there.
        local = np.zeros((len(on_faces), len(on_faces)))
        for i, motion in enumerate(on_faces):
            for j, reaction in enumerate(self._reactions):
                local[i, j] = motion.x.array[: self._owned] @ reaction
        stiffness = model.comm.allreduce(local, MPI.SUM)
        self.stiffness = 0.5 * (stiffness + stiffness.T)

    def pushes(self, b: fem.Function, *, supports: bool) -> np.ndarray:
        """Return ``W^T (b - K p)``, shape (J,).

        Args:
            b: Nodal forces [force], not yet summed over ranks.
            supports: Whether supports have their values p, else zero.
        """
        local = np.array([shape.x.array @ b.x.array for shape in self.shapes])
        if supports:
            prescribed = self._model.prescribed.x.array[: self._owned]
            fixed = self._model.fixed.ravel()[: self._owned]
            of_supports = np.where(fixed, prescribed, 0.0)
            local -= np.array([reaction @ of_supports for reaction in self._reactions])
        return np.asarray(self._model.comm.allreduce(local, MPI.SUM))

    def pushes_on_unknowns(self, forces: fem.Function) -> np.ndarray:
        """Return ``W^T f`` of forces on unknowns x, from their owners, shape (J,)."""
        owned = forces.x.array[: self._owned]
        local = np.array([unknown.x.array[: self._owned] @ owned for unknown in self.unknowns])
        return np.asarray(self._model.comm.allreduce(local, MPI.SUM))

    def move(self, u: fem.Function, pushes: np.ndarray) -> None:
        """Add the motions under pushes to a displacement [length], in place."""
        for amount, shape in zip(np.linalg.solve(self.stiffness, pushes), self.shapes, strict=True):
            u.x.array[:] += amount * shape.x.array

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
