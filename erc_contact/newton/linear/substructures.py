"""The direct solver on several ranks: each rank eliminates what only its cells touch.

K is the sum of the stiffnesses of the cells of each rank. The degrees of freedom that
only the cells of one rank touch are eliminated there by MUMPS. What is left is a Schur
complement on the others: those between ranks, and L. Two ranks add theirs, and
eliminate what now lies inside with dense algebra; then pairs of pairs do so, up to rank
0, which is left with the Schur complement on L. It is nested dissection in which the
ranks are the parts.

Why not one factor that MUMPS makes on all ranks: PETSc does not solve with it if it has
a Schur complement, so that a second factor was needed, and two ranks were no faster at
each of them than one (406 802 unknowns in the plane: 4.7 s for the contact solve on two
ranks, 3.7 s on one; so 2.8 s and 3.0 s).

Symbols: K, D and L as in :mod:`erc_contact.newton.linear.stiffness`; I the degrees of
freedom of a part that are eliminated, B the others; ``S = K_BB - K_BI K_II^-1 K_IB``;
``g = b_B - K_BI K_II^-1 b_I`` the condensed forces.

Source: George, SIAM J. Numer. Anal. 10 (1973), for nested dissection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem, la
from petsc4py import PETSc

from erc_contact.base.exceptions import raise_together, together
from erc_contact.base.sparse import sparse_like
from erc_contact.model.data.over_ranks import sum_over_ranks
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.newton.linear.changed import DIFFERENT
from erc_contact.newton.linear.glue import Glue
from erc_contact.newton.linear.mumps import Factor, dense_factor, dense_solve, factorise


@dataclass(frozen=True, eq=False)
class SchurComplement:
    """Hold what is left of the part of the body that one rank has, or several ranks.

    Attributes:
        numbers: Global numbers of B, ascending, shape (B,).
        count: How many of the ranks that touch them belong to the part, shape (B,).
        total: How many ranks touch them; one more in L, where they stay, shape (B,).
        schur: S [force/length], shape (B, B).
    """

    numbers: np.ndarray
    count: np.ndarray
    total: np.ndarray
    schur: np.ndarray


class Substructure:
    """Represent the part of one rank.

    Args:
        matrix: Stiffness of its cells [force/length], shape (n, n); the part frees it.
        numbers: Global numbers of its rows, shape (n,).
        total: How many ranks touch them; one more in L, shape (n,).

    Raises:
        InputError: If the matrix cannot be factorised.
    """

    def __init__(self, matrix: PETSc.Mat, numbers: np.ndarray, total: np.ndarray) -> None:
        self._matrix = matrix
        self._inner = total == 1
        outer = np.flatnonzero(~self._inner)
        self._outer = outer[np.argsort(numbers[outer])]
        self._numbers = numbers[self._outer]
        self._total = total[self._outer]
        self._factor: Factor | None = None
        if self._inner.any():
            self._factor = factorise(matrix, self._outer if len(outer) else None)
            if len(outer):
                self._factor.interior_only()

    def interface(self) -> SchurComplement:
        """Return what is left of the part."""
        size = len(self._outer)
        if size == 0:
            schur = np.zeros((0, 0))
        elif self._factor is not None:
            schur = self._factor.schur_complement()
        else:
            whole = self._matrix.convert("dense", PETSc.Mat())
            schur = whole.getDenseArray()[np.ix_(self._outer, self._outer)]
        return SchurComplement(self._numbers, np.ones_like(self._total), self._total, schur)

    def up(self, b: np.ndarray) -> np.ndarray:
        """Return the condensed forces at B [force] of forces b at all rows [force]."""
        if not b[self._inner].any():
            return b[self._outer]
        condensed = b - self._times(self._inside(b))
        return condensed[self._outer]

    def down(self, b: np.ndarray, u_B: np.ndarray) -> np.ndarray:
        """Return displacements of all rows [length] from displacements of B.

        Args:
            b: Forces at all rows [force], shape (n,).
            u_B: Displacements of B [length], shape (B,).
        """
        u = np.zeros_like(b)
        u[self._outer] = u_B
        return u + self._inside(b - self._times(u))

    def _inside(self, b: np.ndarray) -> np.ndarray:
        """Return ``K_II^-1 b_I`` [length], zero in B."""
        u, force = self._matrix.createVecs()
        u.set(0.0)
        if self._factor is not None:
            force.array[:] = b
            self._factor.solve(force, u)
        return np.where(self._inner, u.array_r, 0.0)

    def _times(self, u: np.ndarray) -> np.ndarray:
        """Return K u [force]."""
        x, y = self._matrix.createVecs()
        x.array[:] = u
        self._matrix.mult(x, y)
        return y.array_r

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self._matrix.destroy()
        if self._factor is not None:
            self._factor.destroy()


class Separator:
    """Join two parts.

    Args:
        parts: What is left of them.

    Attributes:
        interface: What is left of the two parts.

    Raises:
        InputError: If what is between them cannot be factorised.
    """

    def __init__(self, *parts: SchurComplement) -> None:
        all_numbers = np.concatenate([part.numbers for part in parts])
        all_counts = np.concatenate([part.count for part in parts])
        all_totals = np.concatenate([part.total for part in parts])
        numbers, place = np.unique(all_numbers, return_inverse=True)
        count = np.bincount(place, all_counts).astype(np.int64)
        total = np.zeros_like(count)
        total[place] = all_totals

        # I is what no rank outside touches; it comes first.
        order = np.argsort(count < total, kind="stable")
        rank = np.argsort(order)
        self._places = np.split(rank[place], [len(parts[0].numbers)])
        whole = np.zeros((len(numbers), len(numbers)))
        for part, places in zip(parts, self._places, strict=True):
            whole[np.ix_(places, places)] += part.schur
        i = int(np.count_nonzero(count == total))
        self._inner_size = i
        self._factor = dense_factor(whole[:i, :i], "cholesky")
        self._lift = dense_solve(self._factor, whole[:i, i:])
        schur = whole[i:, i:] - whole[i:, :i] @ self._lift
        outer = order[i:]
        self.interface = SchurComplement(numbers[outer], count[outer], total[outer], schur)

    def up(self, *forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return forces at I and condensed forces at B from the parts [force]."""
        b = np.zeros(sum(self._lift.shape))
        for force, places in zip(forces, self._places, strict=True):
            b[places] += force
        b_I = b[: self._inner_size]
        b_B = b[self._inner_size :]
        return b_I, b_B - self._lift.T @ b_I

    def down(self, b_I: np.ndarray, u_B: np.ndarray) -> list[np.ndarray]:
        """Return displacements of both parts [length].

        Args:
            b_I: Forces at I [force].
            u_B: Displacements of B [length].
        """
        u_I = dense_solve(self._factor, b_I) - self._lift @ u_B
        u = np.concatenate([u_I, u_B])
        return [u[places] for places in self._places]

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self._factor.destroy()


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
        space = model.space
        self._comm = space.comm
        owned = space.V.dofmap.index_map.size_local * space.d
        total = _touching(space, glue)
        self._rows = np.flatnonzero((total > 0) & ~model.fixed.ravel())
        self._own = self._rows < owned
        # One rank more than there are: so L is never eliminated.
        total[layer] += 1

        def make_part() -> Substructure:
            matrix = _stiffness(form, glue, self._rows)
            return Substructure(matrix, space.global_dofs(self._rows), total[self._rows])

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

    def _join(self) -> SchurComplement | None:
        """Join this part with the parts of the children, for the parent; collective.

        A rank that fails sends None up the tree, so that no rank waits for ever, and
        all ranks raise its error at the end.

        Returns:
            What is left, on rank 0; None elsewhere.
        """
        interface: SchurComplement | None = together(self._comm, self._part.interface)
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


def _touching(space: Space, glue: Glue) -> np.ndarray:
    """Count the ranks that touch each degree of freedom of this rank; collective.

    A rank touches it that owns it, a cell at it, or an entry of D. The count is zero
    where this rank does not touch it.
    """
    count = space.function()
    touched = np.zeros(space.node_count, dtype=bool)
    touched[space.nodes[: space.domain.owned_cells]] = True
    touched[glue.rows // space.d] = True
    touched[: space.V.dofmap.index_map.size_local] = True
    count.x.array.reshape(-1, space.d)[touched] = 1.0
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
