"""Springs at the contact nodes that stand for the equations of a method with multiplier, in a preconditioner.

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

from erc_contact.model.model import Model
from erc_contact.newton.linear.multigrid import Multigrid
from erc_contact.newton.reactions import Reactions


class Springs:
    """G and H of a method with multiplier, at the contact nodes of this rank.

    Attributes:
        matrix: G [force/length].
    """

    def __init__(self, model: Model, elastic: Multigrid, reactions: Reactions) -> None:
        d, count = model.d, elastic.owned // model.d
        self.model, self.reactions, self.shape = model, reactions, model.fixed.shape
        self.free = reactions.free[:count]
        self.nodes = np.flatnonzero(self.free.any(axis=1))
        self.free = self.free[self.nodes]
        self.area = reactions.area[self.nodes]
        self.glue = elastic.glue.x.array.reshape(-1, d)[self.nodes].max(axis=1, initial=0.0)
        dofs = model.global_numbers(self.nodes)[:, None] * d + np.arange(d)
        rows, cols = (
            np.broadcast_to(one, (len(dofs), d, d)).ravel()
            for one in (dofs[:, :, None], dofs[:, None, :])
        )
        self._nodal = _sparse(elastic.matrix, rows, cols)
        self._first = elastic.matrix.getOwnershipRange()[0]
        self._coefficients: PETSc.Mat | None = None
        if model.degree > 1:
            row, col, value = reactions.coefficients()
            self._coefficients = _sparse(elastic.matrix, row, col)
            self._coefficients.setValuesCOO(value)
        self.matrix = self._nodal

    def update(self, tangents: list[PETSc.Mat]) -> None:
        """Set G and H from the derivatives of e by u and by the multipliers."""
        by_u, *by_multipliers = (self._blocks(tangent) for tangent in tangents)
        fixed = ~self.free
        inverse = sum(by_multipliers) / self.area[:, None, None] + by_u / self.glue[:, None, None]
        inverse[fixed] = 0.0
        inverse.transpose(0, 2, 1)[fixed] = 0.0
        node, i = np.nonzero(fixed)
        inverse[node, i, i] = 1.0
        self.h = np.linalg.inv(inverse)
        springs = np.matmul(self.h, by_u)
        springs[fixed] = 0.0
        springs.transpose(0, 2, 1)[fixed] = 0.0
        self._nodal.setValuesCOO(springs.ravel())
        if self._coefficients is not None:
            known = None if self.matrix is self._nodal else self.matrix
            self.matrix = self._nodal.ptap(self._coefficients, result=known)

    def right_side(self, x: np.ndarray) -> np.ndarray:
        """Nodal forces from the residual x of the equations: ``C^T H x`` at A and x elsewhere."""
        force, at_contact = np.zeros(self.shape), np.zeros(self.shape)
        force.ravel()[: len(x)] = x
        values = np.matmul(self.h, np.where(self.free, force[self.nodes], 0.0)[..., None])[..., 0]
        at_contact[self.nodes] = values
        force[self.nodes] = np.where(self.free, 0.0, force[self.nodes])
        force += np.where(self.reactions.free, self.reactions.back(at_contact), 0.0)
        return force.ravel()[: len(x)]

    def _blocks(self, tangent: PETSc.Mat) -> np.ndarray:
        """The block of each node in a matrix, shape (nodes, d, d)."""
        d = self.shape[1]
        begin, column, value = tangent.getValuesCSR()
        row = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
        column = column - self._first
        own = row // d == column // d
        place = row[own] * d + column[own] % d
        blocks = np.bincount(place, value[own], (len(begin) - 1) * d).reshape(-1, d, d)
        return blocks[self.nodes]


def _sparse(like: PETSc.Mat, rows: np.ndarray, cols: np.ndarray) -> PETSc.Mat:
    """A matrix of the size of another one, with entries at the given places."""
    matrix = PETSc.Mat().create(comm=like.comm)
    matrix.setSizes(like.getSizes())
    matrix.setType("aij")
    matrix.setPreallocationCOO(rows.astype(PETSc.IntType), cols.astype(PETSc.IntType))
    return matrix
