"""Springs at the contact nodes: a preconditioner of the equations of a multiplier.

The equations ``e(w, lambda) = 0`` of a node, linearised and solved for the force, are
springs. Where they do not determine the force, some compliance is added:

    G = B^T H e_w B,    H = (e_lambda/area + D^-1 e_w)^-1 at each node.

So nodes that stick get the glue D, and open ones nothing.

Symbols: w what contacts read, Bernstein coefficients of degree 2, and B from u to w; D
the glue of a contact.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from erc_contact.base.sparse import sparse_like
from erc_contact.model.model import Model
from erc_contact.newton.forms import Reader
from erc_contact.newton.linear.glue import nodal_glue
from erc_contact.newton.reactions import Reactions


class Springs:
    """Hold the springs of one reader of a method with multiplier.

    Construction and members are collective.

    Args:
        model: The scene on a mesh.
        reader: The equations.
        reactions: The map from reactions to multipliers.
        like: A matrix for the degrees of freedom of the model.
    """

    def __init__(self, model: Model, reader: Reader, reactions: Reactions, like: PETSc.Mat) -> None:
        d = model.space.d
        self._d = d
        self._first_dof, last = like.getOwnershipRange()
        numbers = reactions.map.numbers_of(reader.contact)
        here, area = reactions.map.areas_of(numbers)
        owned = (here * d >= self._first_dof) & (here * d < last)
        of_rows = reactions.map.free_at(numbers)[owned]
        used = of_rows.any(axis=1)
        self._free = of_rows[used]
        self._area = area[owned][used]
        self._nodes = here[owned][used] - self._first_dof // d
        glue = nodal_glue(model.space, [model.contacts[k].trace.here for k in numbers])
        self._glue = glue.x.array.reshape(-1, d)[self._nodes].max(axis=1, initial=0.0)

        # A block of d x d entries for each node.
        dofs = self._first_dof + self._nodes[:, None] * d + np.arange(d)
        blocks = (len(dofs), d, d)
        rows = np.broadcast_to(dofs[:, :, None], blocks).ravel()
        cols = np.broadcast_to(dofs[:, None, :], blocks).ravel()
        self._nodal = sparse_like(like, rows, cols)
        self._read = reactions.reading(reader.contact)
        self._product: PETSc.Mat | None = None
        self._forces: PETSc.Mat | None = None
        if model.connections.any:
            self._forces = reactions.map.forces_on(numbers).of_all_ranks(model.space)
        self._work = like.createVecs()

    def update(self, by_w: list[PETSc.Mat], by_multipliers: list[PETSc.Mat]) -> None:
        """Set G and H from the derivatives of the equations e.

        Args:
            by_w: Those by what is read.
            by_multipliers: Those by multipliers.
        """
        nodes = self._nodes
        by_field = sum(self._blocks(tangent)[nodes] for tangent in by_w)
        by_forces = sum(self._blocks(tangent)[nodes] for tangent in by_multipliers)
        inverse = by_forces / self._area[:, None, None] + by_field / self._glue[:, None, None]
        # A component that a support fixes has no spring: H is the identity there.
        fixed = ~self._free
        _set_rows_and_columns_to_zero(inverse, fixed)
        node, component = np.nonzero(fixed)
        inverse[node, component, component] = 1.0
        self._h = np.linalg.inv(inverse)
        springs = np.matmul(self._h, by_field)
        _set_rows_and_columns_to_zero(springs, fixed)
        self._nodal.setValuesCOO(springs.ravel())

    def by_nodes(self) -> PETSc.Mat:
        """Return G [force/length], which the next call overwrites."""
        if self._read is None:
            return self._nodal
        self._product = self._nodal.ptap(self._read, result=self._product)
        return self._product

    def add_forces(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add ``B^T H e`` to nodal forces y [force], for residuals ``x = B^T e``."""
        equations, forces = self._work
        if self._forces is None:
            x.copy(equations)
        else:
            self._forces.mult(x, equations)
        at_nodes = equations.array_r.reshape(-1, self._d)[self._nodes]
        at_nodes = np.where(self._free, at_nodes, 0.0)
        spring = np.matmul(self._h, at_nodes[..., None])[..., 0]
        equations.set(0.0)
        equations.array.reshape(-1, self._d)[self._nodes] = np.where(self._free, spring, 0.0)
        if self._read is None:
            y.axpy(1.0, equations)
        else:
            self._read.multTranspose(equations, forces)
            y.axpy(1.0, forces)

    def free(self) -> None:
        """Free PETSc's objects."""
        self._nodal.destroy()
        for made in (*self._work, self._read, self._forces, self._product):
            if made is not None:
                made.destroy()

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
