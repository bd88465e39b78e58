"""Eliminate the motions of loose rigid faces from elastic equations.

The unknowns x belong to a body whose faces are at rest but for their given motions.
R_j is the displacement of a face in one of its other motions, zero at the nodes off the
face, and q_j its amount. With b nodal forces and u_0 the displacement of x,

    K x + K_R q = b  off the supports,    K_RR q = R . (b - K u_0),

    K_R = K R  off the supports,    K_RR = R . K R,

because the resultants of the faces, which are in b, work on R, and nothing else does.
So

    (K - K_R K_RR^-1 K_R^T) x = b - K_R K_RR^-1 R . (b - K p)

with the displacement p that supports prescribe. K_RR is the stiffness of the cells at
the faces, so that it is small and positive definite.

Symbols: K elastic stiffness with the supports [force/length].
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem, la
from mpi4py import MPI

from erc_contact.base.runtime import compiled
from erc_contact.model.model import Model
from erc_contact.newton.linear.elastic import Elastic


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

    def __init__(self, elastic: Elastic) -> None:
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
        stiffness = model.comm.allreduce(np.array(local), MPI.SUM)
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
        return np.asarray(self._model.comm.allreduce(local, MPI.SUM))

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
        p = self._model.prescribed if supports else self._model.function()
        motions = np.linalg.solve(self.stiffness, self.pushes(b, p))
        for amount, forces in zip(motions, self._forces, strict=True):
            b.x.array[: self._owned] -= amount * forces

    def followed(self, x: np.ndarray) -> np.ndarray:
        """Return ``K_R K_RR^-1 K_R^T x`` at the unknowns of this rank [force].

        Args:
            x: Unknowns of this rank [length], shape (owned,).
        """
        pulls = self._model.comm.allreduce(self.coupling.T @ x, MPI.SUM)
        return np.asarray(self.coupling @ np.linalg.solve(self.stiffness, pulls))

    def _nodal_forces(self) -> list[np.ndarray]:
        """Return the nodal forces K R_j of this rank [force/length], each (owned,)."""
        model = self._model
        field = model.function()
        action = compiled.form(model.stiffness(field, ufl.TestFunction(model.V)))
        nodal_forces = []
        for shape in self.shapes:
            field.x.array[:] = shape.x.array
            forces = model.function()
            fem.assemble_vector(forces.x.array, action)
            forces.x.scatter_reverse(la.InsertMode.add)
            nodal_forces.append(forces.x.array[: self._owned].copy())
        return nodal_forces


def _unit_motions(model: Model) -> list[fem.Function]:
    """Return R of all free motions of all loose faces, on all ranks in one order."""
    shapes = []
    for face in model.loose_faces:
        for number in np.flatnonzero(face.free):
            shape = model.function()
            values = face.shapes[:, :, number] / face.sizes[number]
            shape.x.array.reshape(-1, model.d)[face.nodes] = values
            # A rank may see a node without the facet: its owner sees all.
            shape.x.scatter_forward()
            shapes.append(shape)
    return shapes
