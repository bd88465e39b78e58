"""The direct solver on several ranks: each rank eliminates what only its cells touch.

K is the sum of the stiffnesses of the cells of each rank. The degrees of freedom that
only the cells of one rank touch are eliminated there by MUMPS. What is left is a Schur
complement on the others: those between ranks, and L. Two ranks add theirs, and
eliminate what now lies inside with dense algebra; then pairs of pairs do so, up to rank
0, which is left with the Schur complement on L. It is nested dissection in which the
ranks are the parts (:mod:`erc_contact.newton.linear.parts`).

Why not one factor that MUMPS makes on all ranks: PETSc does not solve with it if it has
a Schur complement, so that a second factor was needed, and two ranks were no faster at
each of them than one (406 802 unknowns in the plane: 4.7 s for the contact solve on two
ranks, 3.7 s on one; so 2.8 s and 3.0 s).

Symbols: K, D and L as in :mod:`erc_contact.newton.linear.stiffness`; I and B as in
:mod:`erc_contact.newton.linear.parts`.

Source: George, SIAM J. Numer. Anal. 10 (1973), for nested dissection.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem, la
from petsc4py import PETSc

from erc_contact.base.exceptions import raise_together, together
from erc_contact.base.sparse import sparse_like
from erc_contact.model.model import Model
from erc_contact.model.over_ranks import sum_over_ranks
from erc_contact.newton.linear.changed import DIFFERENT
from erc_contact.newton.linear.glue import Glue
from erc_contact.newton.linear.mumps import dense_factor, dense_solve
from erc_contact.newton.linear.parts import Interface, Separator, Substructure


class Substructures:
    """Hold a factor of K + D on several ranks; members are collective.

    Args:
        model: The scene on a mesh.
        form: The compiled form of K.
        glue: D.
        layer: Degrees of freedom of this rank (with ghosts) in L.

    Attributes:
        interface: L and the Schur complement of K + D on it, on rank 0; None elsewhere.

    Raises:
        InputError: If the stiffness cannot be factorised.
    """

    def __init__(self, model: Model, form: fem.Form, glue: Glue, layer: np.ndarray) -> None:
        self._comm = model.comm
        owned = model.V.dofmap.index_map.size_local * model.d
        total = _touching(model, glue)
        self._rows = np.flatnonzero((total > 0) & ~model.fixed.ravel())
        self._own = self._rows < owned
        # One rank more than there are: so L is never eliminated.
        total[layer] += 1

        def make_part() -> Substructure:
            matrix = _stiffness(form, glue, self._rows)
            return Substructure(matrix, model.global_dofs(self._rows), total[self._rows])

        self._part = together(self._comm, make_part)
        self._parent, self._children = _family(self._comm.rank, self._comm.size)
        self._joints: list[Separator] = []
        self.interface = self._join()
        self._root = together(self._comm, self._factor_of_root)

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve ``(K + D) x = b``; where supports fix a component x is b."""
        comm = self._comm
        own_rows = self._rows[self._own]
        forces = np.zeros(len(self._rows))
        forces[self._own] = b.array_r[own_rows]

        # Up the tree with condensed forces, down with displacements.
        force = self._part.up(forces)
        inner_forces = []
        for joint, child in zip(self._joints, self._children, strict=True):
            b_I, force = joint.up(force, comm.recv(source=child))
            inner_forces.append(b_I)
        if self._root is not None:
            u = dense_solve(self._root, force)
        else:
            comm.send(force, self._parent)
            u = comm.recv(source=self._parent)
        levels = list(zip(self._joints, self._children, inner_forces, strict=True))
        for joint, child, b_I in reversed(levels):
            u, u_of_child = joint.down(b_I, u)
            comm.send(u_of_child, child)
        b.copy(x)
        x.array[own_rows] = self._part.down(forces, u)[self._own]

    def destroy(self) -> None:
        """Free the factors."""
        self._part.destroy()
        for joint in self._joints:
            joint.destroy()
        if self._root is not None:
            self._root.destroy()

    def _factor_of_root(self) -> PETSc.KSP | None:
        """Factorise what is left at the root of the tree."""
        if self.interface is None:
            return None
        return dense_factor(self.interface.schur, "cholesky")

    def _join(self) -> Interface | None:
        """Join this part with the parts of the children, for the parent; collective.

        A rank that fails sends None up the tree, so that no rank waits for ever, and
        all ranks raise its error at the end.

        Returns:
            What is left, on rank 0; None elsewhere.
        """
        interface: Interface | None = together(self._comm, self._part.interface)
        error: Exception | None = None
        for child in self._children:
            of_child = self._comm.recv(source=child)
            if interface is None or of_child is None:
                interface = None
                continue
            try:
                joint = Separator(interface, of_child)
                self._joints.append(joint)
                interface = joint.interface
            except Exception as reason:
                interface = None
                error = reason
        if self._parent is not None:
            self._comm.send(interface, self._parent)
        raise_together(self._comm, error)
        return interface if self._parent is None else None


def _family(rank: int, size: int) -> tuple[int | None, list[int]]:
    """Return the parent of a rank in a binary tree, and its children in order.

    Rank 0 at the root has no parent, None. Neighbours in number join first: the
    partitioner halves the mesh again and again, so that they are often neighbours.
    """
    children = []
    step = 1
    while step < size and not rank & step:
        if rank + step < size:
            children.append(rank + step)
        step *= 2
    return rank - step if rank else None, children


def _touching(model: Model, glue: Glue) -> np.ndarray:
    """Count the ranks that touch each degree of freedom of this rank; collective.

    A rank touches it that owns it, a cell at it, or an entry of D. The count is zero
    where this rank does not touch it.
    """
    count = model.function()
    touched = np.zeros(model.node_count, dtype=bool)
    touched[model.nodes[: model.domain.owned_cells]] = True
    touched[glue.rows // model.d] = True
    touched[: model.V.dofmap.index_map.size_local] = True
    count.x.array.reshape(-1, model.d)[touched] = 1.0
    here = count.x.array > 0
    sum_over_ranks(count)
    return np.where(here, count.x.array, 0.0).astype(np.int64)


def _stiffness(form: fem.Form, glue: Glue, rows: np.ndarray) -> PETSc.Mat:
    """Assemble the stiffness of this rank's cells and its entries of the glue.

    Args:
        form: The compiled form of K.
        glue: D.
        rows: Degrees of freedom of the matrix.
    """
    csr = fem.create_matrix(form, la.BlockMode.expanded)
    fem.assemble_matrix(csr, form)
    size = len(csr.indptr) - 1
    tables = csr.indptr.astype(PETSc.IntType), csr.indices, csr.data
    whole = PETSc.Mat().createAIJ((size, size), csr=tables, comm=PETSc.COMM_SELF)
    picked = PETSc.IS().createGeneral(rows.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    matrix = whole.createSubMatrix(picked, picked)
    whole.destroy()
    place = np.full(size, -1)
    place[rows] = np.arange(len(rows))
    used = glue.free
    added = sparse_like(matrix, place[glue.rows[used]], place[glue.columns[used]])
    added.setValuesCOO(glue.values[used])
    matrix.axpy(1.0, added, DIFFERENT)
    added.destroy()
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    return matrix
