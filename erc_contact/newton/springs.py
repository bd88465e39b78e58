"""Springs at the contact nodes: a preconditioner of the equations of a multiplier.

The equations ``e(C u, lambda) = 0`` of a node, linearised and solved for the reaction,
are springs G. Where they do not determine the reaction, some compliance is added:

    G = C^T H e_u C,    H = (e_lambda/a + D^-1 e_u)^-1 at each node.

So nodes that stick get the glue D, and open ones nothing.

Symbols: C from nodal values to Bernstein coefficients, a area of a node, D the glue, A
as in :mod:`erc_contact.newton.reactions`.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from erc_contact.base.sparse import sparse_like
from erc_contact.model.model import Model
from erc_contact.newton.reactions import Reactions
from erc_contact.newton.shared_springs import SharedSprings


class Springs:
    """Hold G and H of a method with multiplier, at the contact nodes of this rank.

    Args:
        model: The scene on a mesh.
        stiffness: K [force/length].
        glue: D at the degrees of freedom of this rank [force/length].
        reactions: The map from reactions to multipliers.
        contacts: For each derivative of the equations the numbers of its contacts.

    Attributes:
        matrix: G [force/length].
    """

    def __init__(
        self,
        model: Model,
        stiffness: PETSc.Mat,
        glue: np.ndarray,
        reactions: Reactions,
        contacts: list[list[int]],
    ) -> None:
        d = model.d
        self._d = d
        low, high = stiffness.getOwnershipRange()
        self._shared: SharedSprings | None = None
        of_node = reactions.free.any(axis=1)
        if reactions.shared is not None:
            count = len(model.contacts)
            by_forces = [False] * (len(contacts) - count) + [True] * count
            self._shared = SharedSprings(
                model.comm, reactions.shared, contacts, by_forces, low, high
            )
            of_node[self._shared.nodes] = False
            self._shared_glue = glue.reshape(-1, d)[self._shared.nodes]
        self._nodes = np.flatnonzero(of_node)
        self._in_equations = reactions.free
        self._free = reactions.free[self._nodes]
        self._area = reactions.area[self._nodes]
        nodal_glue = glue.reshape(-1, d)[self._nodes]
        self._glue = nodal_glue.max(axis=1, initial=0.0)
        self._coefficients = reactions.coefficients
        self._first_dof, _ = stiffness.getOwnershipRange()
        self._work = stiffness.createVecs()

        # A block of d x d entries for each node.
        dofs = self._first_dof + self._nodes[:, None] * d + np.arange(d)
        blocks = (len(dofs), d, d)
        rows = np.broadcast_to(dofs[:, :, None], blocks).ravel()
        cols = np.broadcast_to(dofs[:, None, :], blocks).ravel()
        self._of_shared: PETSc.Mat | None = None
        if self._shared is not None:
            self._of_shared = sparse_like(stiffness, self._shared.rows, self._shared.columns)
            rows = np.concatenate([rows, self._shared.rows])
            cols = np.concatenate([cols, self._shared.columns])
        self._nodal = sparse_like(stiffness, rows, cols)
        self.matrix = self._nodal

    def update(self, by_displacements: list[PETSc.Mat], by_forces: list[PETSc.Mat]) -> None:
        """Set G and H from the derivatives of the equations e.

        Args:
            by_displacements: Those by u and by jumps between bodies.
            by_forces: Those by the multipliers.
        """
        nodes = self._nodes
        blocks = [self._blocks(tangent) for tangent in (*by_displacements, *by_forces)]
        count = len(by_displacements)
        by_u = sum(of_term[nodes] for of_term in blocks[:count])
        by_multipliers = sum(of_term[nodes] for of_term in blocks[count:])
        inverse = by_multipliers / self._area[:, None, None] + by_u / self._glue[:, None, None]
        # A component that a support fixes has no spring: H is the identity there.
        fixed = ~self._free
        _set_rows_and_columns_to_zero(inverse, fixed)
        node, component = np.nonzero(fixed)
        inverse[node, component, component] = 1.0
        self._h = np.linalg.inv(inverse)
        springs = np.matmul(self._h, by_u)
        _set_rows_and_columns_to_zero(springs, fixed)
        values = springs.ravel()
        if self._shared is not None and self._of_shared is not None:
            at_shared = [of_term[self._shared.nodes] for of_term in blocks]
            of_shared, h = self._shared.update(at_shared, self._shared_glue)
            values = np.concatenate([values, of_shared])
            self._of_shared.setValuesCOO(h)
        self._nodal.setValuesCOO(values)
        if self._coefficients is not None:
            reused = None if self.matrix is self._nodal else self.matrix
            self.matrix = self._nodal.ptap(self._coefficients, result=reused)

    def right_side(self, x: np.ndarray) -> np.ndarray:
        """Return ``C^T H x`` at A and x elsewhere: nodal forces [force].

        Args:
            x: Residual of the equations, at the degrees of freedom of this rank.
        """
        force = x.reshape(-1, self._d).copy()
        residual = np.where(self._in_equations, force, 0.0)
        at_nodes = residual[self._nodes]
        spring = np.matmul(self._h, at_nodes[..., None])[..., 0]
        if self._coefficients is None and self._of_shared is None:
            force[self._nodes] = np.where(self._free, spring, force[self._nodes])
            return force.ravel()

        on_coefficients, at_contact = self._work
        on_coefficients.set(0.0)
        on_coefficients.array.reshape(-1, self._d)[self._nodes] = spring
        if self._of_shared is not None:
            at_contact.array[:] = residual.ravel()
            self._of_shared.multAdd(at_contact, on_coefficients, on_coefficients)
        springs = on_coefficients
        if self._coefficients is not None:
            self._coefficients.multTranspose(on_coefficients, at_contact)
            springs = at_contact
        return np.where(self._in_equations.ravel(), springs.array_r, force.ravel())

    def free(self) -> None:
        """Free PETSc's objects."""
        if self.matrix is not self._nodal:
            self.matrix.destroy()
        self._nodal.destroy()
        if self._of_shared is not None:
            self._of_shared.destroy()
        for vector in self._work:
            vector.destroy()

    def _blocks(self, tangent: PETSc.Mat) -> np.ndarray:
        """Return the block of each node of this rank in a matrix, (nodes, d, d)."""
        d = self._d
        begin, column, value = tangent.getValuesCSR()
        row = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
        column = column - self._first_dof
        in_block = row // d == column // d
        place = row[in_block] * d + column[in_block] % d
        return np.bincount(place, value[in_block], (len(begin) - 1) * d).reshape(-1, d, d)


def _set_rows_and_columns_to_zero(blocks: np.ndarray, components: np.ndarray) -> None:
    """Set rows and columns of blocks (n, d, d) to zero in place, at (n, d)."""
    blocks[components] = 0.0
    blocks.transpose(0, 2, 1)[components] = 0.0
