"""The direct solver on several ranks: each rank eliminates what only its cells touch, and pairs of ranks join the rest.

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
freedom that are eliminated, B the others of a part of the body; ``S = K_BB - K_BI
K_II^-1 K_IB``; ``g = b_B - K_BI K_II^-1 b_I`` the condensed forces.

Source: George, SIAM J. Numer. Anal. 10 (1973), for nested dissection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem, la
from petsc4py import PETSc

from erc_contact.base.exceptions import raise_together, together
from erc_contact.model.model import Model
from erc_contact.newton.linear.mumps import (
    dense_factor,
    dense_solve,
    factorised,
    interior_only,
    schur_complement,
)


@dataclass(frozen=True, eq=False)
class Interface:
    """What is left of a part of the body, which is that of one rank or of several.

    Attributes:
        numbers: Global numbers of B, ascending, shape (B,).
        have: How many of the ranks that touch them belong to the part, shape (B,).
        total: How many ranks touch them; one more in L, where they stay, shape (B,).
        schur: S [force/length], shape (B, B).
    """

    numbers: np.ndarray
    have: np.ndarray
    total: np.ndarray
    schur: np.ndarray


class Part:
    """The part of one rank.

    Args:
        matrix: Stiffness of its cells [force/length], shape (n, n); the part frees it.
        numbers: Global numbers of its rows, shape (n,).
        total: How many ranks touch them; one more in L, shape (n,).

    Raises:
        InputError: If the matrix cannot be factorised.
    """

    def __init__(self, matrix: PETSc.Mat, numbers: np.ndarray, total: np.ndarray) -> None:
        self._matrix, self._inner = matrix, total == 1
        outer = np.flatnonzero(~self._inner)
        self._outer = outer[np.argsort(numbers[outer])]
        self._numbers, self._total = numbers[self._outer], total[self._outer]
        self._factor: PETSc.KSP | None = None
        if self._inner.any():
            self._factor = factorised(matrix, self._outer if len(outer) else None)
            if len(outer):
                interior_only(self._factor)

    def interface(self) -> Interface:
        """What is left of the part."""
        count = len(self._outer)
        if count == 0:
            schur = np.zeros((0, 0))
        elif self._factor is not None:
            schur = schur_complement(self._factor, count)
        else:
            whole = self._matrix.convert("dense", PETSc.Mat())
            schur = whole.getDenseArray()[np.ix_(self._outer, self._outer)]
        return Interface(self._numbers, np.ones_like(self._total), self._total, schur)

    def up(self, b: np.ndarray) -> np.ndarray:
        """Condensed forces [force], shape (B,), of forces b at all rows [force], shape (n,)."""
        return (
            (b - self._times(self._inside(b)))[self._outer]
            if b[self._inner].any()
            else b[self._outer]
        )

    def down(self, b: np.ndarray, u_B: np.ndarray) -> np.ndarray:
        """Displacements of all rows [length] under forces b [force], from those of B [length]."""
        u = np.zeros_like(b)
        u[self._outer] = u_B
        return u + self._inside(b - self._times(u))

    def _inside(self, b: np.ndarray) -> np.ndarray:
        """``K_II^-1 b_I``, zero in B."""
        u, force = self._matrix.createVecs()
        u.set(0.0)
        if self._factor is not None:
            force.array[:] = b
            self._factor.solve(force, u)
        return np.where(self._inner, u.array_r, 0.0)

    def _times(self, u: np.ndarray) -> np.ndarray:
        x, y = self._matrix.createVecs()
        x.array[:] = u
        self._matrix.mult(x, y)
        return y.array_r

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self._matrix.destroy()
        if self._factor is not None:
            self._factor.destroy()


class Joint:
    """Two parts that become one.

    Args:
        parts: What is left of them.

    Attributes:
        interface: What is left of both.

    Raises:
        InputError: If what is between them cannot be factorised.
    """

    def __init__(self, *parts: Interface) -> None:
        numbers, place = np.unique(
            np.concatenate([part.numbers for part in parts]), return_inverse=True
        )
        have = np.bincount(place, np.concatenate([part.have for part in parts])).astype(np.int64)
        total = np.zeros_like(have)
        total[place] = np.concatenate([part.total for part in parts])
        order = np.argsort(have < total, kind="stable")  # I first
        rank = np.argsort(order)
        self._places = np.split(rank[place], [len(parts[0].numbers)])
        schur = np.zeros((len(numbers), len(numbers)))
        for part, at in zip(parts, self._places, strict=True):
            schur[np.ix_(at, at)] += part.schur
        self._count = i = int(np.count_nonzero(have == total))
        self._factor = dense_factor(schur[:i, :i], "cholesky")
        self._lift = dense_solve(self._factor, schur[:i, i:])
        left = schur[i:, i:] - schur[i:, :i] @ self._lift
        self.interface = Interface(numbers[order[i:]], have[order[i:]], total[order[i:]], left)

    def up(self, *forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces at I and condensed forces at B [force] from the condensed forces of the parts."""
        b, i = np.zeros(sum(self._lift.shape)), self._count
        for force, at in zip(forces, self._places, strict=True):
            b[at] += force
        return b[:i], b[i:] - self._lift.T @ b[:i]

    def down(self, b_I: np.ndarray, u_B: np.ndarray) -> list[np.ndarray]:
        """Displacements of both parts [length] from forces at I [force] and displacements of B [length]."""
        u = np.concatenate([dense_solve(self._factor, b_I) - self._lift @ u_B, u_B])
        return [u[at] for at in self._places]

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self._factor.destroy()


class Substructures:
    """K + D of a model factorised on several ranks; members are collective.

    Args:
        model: The scene on a mesh.
        form: The compiled form of K.
        glue: D at the nodes of this rank [force/length], zero away from L.
        layer: Degrees of freedom of this rank (with ghosts) in L.

    Attributes:
        interface: L and the Schur complement of K + D on it, on rank 0; None elsewhere.

    Raises:
        InputError: If the stiffness cannot be factorised.
    """

    def __init__(self, model: Model, form: fem.Form, glue: fem.Function, layer: np.ndarray) -> None:
        self._comm, self._owned = model.comm, model.V.dofmap.index_map.size_local * model.d
        total = _touching(model)
        rows = np.flatnonzero((total > 0) & ~model.fixed.ravel())
        total[layer] += 1
        self._rows, self._own = rows, rows < self._owned

        def part() -> Part:
            return Part(
                _stiffness(form, glue, self._owned, rows), model.global_dofs(rows), total[rows]
            )

        self._part = together(self._comm, part)
        self._parent, self._children = _family(self._comm.rank, self._comm.size)
        self._joints: list[Joint] = []
        self.interface = self._joined()
        self._root = together(self._comm, self._factor_of_root)

    def _factor_of_root(self) -> PETSc.KSP | None:
        return None if self.interface is None else dense_factor(self.interface.schur, "cholesky")

    def _joined(self) -> Interface | None:
        """Join what is left of this rank with what its children send, and send it to the parent; collective."""
        interface: Interface | None = together(self._comm, self._part.interface)
        error: Exception | None = None
        for child in self._children:
            theirs = self._comm.recv(source=child)
            try:
                if interface is not None and theirs is not None:
                    self._joints.append(Joint(interface, theirs))
                interface = (
                    None if theirs is None or interface is None else self._joints[-1].interface
                )
            except Exception as reason:
                interface, error = None, reason
        if self._parent is not None:
            self._comm.send(interface, self._parent)
        raise_together(self._comm, error)
        return interface if self._parent is None else None

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve ``(K + D) x = b``; where supports fix a component x is b."""
        comm, joints = self._comm, list(zip(self._joints, self._children, strict=True))
        given = np.zeros(len(self._rows))
        given[self._own] = b.array_r[self._rows[self._own]]
        force, inner = self._part.up(given), []
        for joint, child in joints:
            b_I, force = joint.up(force, comm.recv(source=child))
            inner.append(b_I)
        if self._root is not None:
            u = dense_solve(self._root, force)
        else:
            comm.send(force, self._parent)
            u = comm.recv(source=self._parent)
        for (joint, child), b_I in zip(joints[::-1], inner[::-1], strict=True):
            u, theirs = joint.down(b_I, u)
            comm.send(theirs, child)
        b.copy(x)
        x.array[self._rows[self._own]] = self._part.down(given, u)[self._own]

    def destroy(self) -> None:
        """Free the factors."""
        for made in (self._part, *self._joints, *([] if self._root is None else [self._root])):
            made.destroy()


def _family(rank: int, size: int) -> tuple[int | None, list[int]]:
    """The parent of a rank in a binary tree, None for rank 0 at its root, and its children in the order of joining.

    Neighbours in number join first: the partitioner halves the mesh again and again, so
    that they are often neighbours.
    """
    children, step = [], 1
    while step < size and not rank & step:
        children += [rank + step] if rank + step < size else []
        step *= 2
    return rank - step if rank else None, children


def _touching(model: Model) -> np.ndarray:
    """How many ranks touch each degree of freedom of this rank: those that own it or a cell at it; collective.

    Zero where this rank does not.
    """
    count = model.function()
    nodes = np.union1d(
        np.arange(model.V.dofmap.index_map.size_local), model.nodes[: model.domain.owned_cells]
    )
    count.x.array.reshape(-1, model.d)[nodes] = 1.0
    here = count.x.array > 0
    count.x.scatter_reverse(la.InsertMode.add)
    count.x.scatter_forward()
    return np.where(here, count.x.array, 0.0).astype(np.int64)


def _stiffness(form: fem.Form, glue: fem.Function, owned: int, rows: np.ndarray) -> PETSc.Mat:
    """Stiffness of the cells of this rank and the glue of its own nodes, at some rows."""
    csr = fem.create_matrix(form, la.BlockMode.expanded)
    fem.assemble_matrix(csr, form)
    size = len(csr.indptr) - 1
    tables = csr.indptr.astype(PETSc.IntType), csr.indices, csr.data
    every = PETSc.Mat().createAIJ((size, size), csr=tables, comm=PETSc.COMM_SELF)
    picked = PETSc.IS().createGeneral(rows.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    matrix = every.createSubMatrix(picked, picked)
    every.destroy()
    diagonal = matrix.createVecRight()
    diagonal.array[:] = np.where(rows < owned, glue.x.array[rows], 0.0)
    matrix.setDiagonal(diagonal, addv=PETSc.InsertMode.ADD)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    return matrix
