"""The contact problem condensed on the contact: residual and tangent, small and dense.

The unknowns are the displacements u_A of the degrees of freedom A whose equilibrium
contains contact terms. The contact equations depend on the displacements u_L of the
cells at the contact and on the multipliers lambda. Both are affine functions of u_A:

    z = (u_L, lambda) = Z (u_A, 1),    a lambda = K u_A - s at a contact node of area a,

with K the elastic stiffness condensed on A and s the condensed loads. The problem is
``K u_A - s + e(z) = 0``, where e are the equations of the method; for a method with a
multiplier it is ``e(z) = 0``. Its tangent is ``K + e'(z) Z``, or ``e'(z) Z``. Newton's
method for this problem has the same iterates as Newton's method for the whole body,
because the equations away from the contact are linear and hold at every step.

For degree 2, the equations of a multiplier use Bernstein coefficients of u and lambda
instead of nodal values; the affine functions contain this change
(:mod:`erc_contact.newton.multipliers`).

The dense matrices are on rank 0. It asks the other ranks to assemble the terms of their
facets.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from erc_contact.base.exceptions import raise_together, together
from erc_contact.base.ranks import from_first, gathered
from erc_contact.model.model import Model
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.multipliers import Places, contact_edges, multiplier_rows


class Condensed:
    """The condensed contact problem of a model.

    Methods that take u_A, as :meth:`residual`, are called on rank 0 within :meth:`run`.

    Args:
        model: The scene on a mesh.
        method: The contact method.
        stiffness: The condensed elastic stiffness.
        w: Its glued displacement under the loads [length].

    Attributes:
        forms: The equations of the method, with the share of friction that
            :meth:`raise_friction` sets.
        u: Displacement, up to date in the cells at the contact only [length]; for a
            method with multiplier its nodal values at the contact are the Bernstein
            coefficients.
        multipliers: Multiplier of each contact [force/area], or () for a method
            without.
        size: Number of unknowns u_A.
        schur: S_A, the glued stiffness condensed on A, on rank 0 [force/length], shape
            (A, A).
        matrix: K on rank 0 [force/length], shape (A, A).
        loads: s on rank 0 [force].
        normals: Normals of the foundation at the contact nodes of A, on rank 0 [-].
        length: Largest component of the glued displacement and of that before the step,
            over all ranks [length].
        force: Size of the forces that cancel in the residual with these displacements,
            on rank 0 [force].
    """

    def __init__(self, model: Model, method: Method, stiffness: Stiffness, w: fem.Function) -> None:
        self.model, self.method, self.stiffness = model, method, stiffness
        self.forms = ContactForms(model, method)
        self.u, self.multipliers = self.forms.u, self.forms.multipliers
        self._at: np.ndarray | None = None
        self.size = len(stiffness.numbers) if method.in_layer else stiffness.contact_size
        self.u.x.array[:] = w.x.array
        if method.multiplier:
            model.to_coefficients(self.u.x.array.reshape(-1, model.d), model.contacts)
        self.residual_vector = model.function()
        self.tangents = [fem.create_matrix(form) for form in self.forms.tangents]
        self.w, known = stiffness.gather(w), stiffness.gather(self.u)
        self.edges = (
            contact_edges(model, stiffness.numbers[: self.size]) if method.multiplier else None
        )
        held = _slip_before(model)
        largest = max(float(abs(of.x.array).max(initial=0.0)) for of in (w, held))
        self.length = max(model.comm.allgather(largest)) or 1.0
        together(model.comm, self._condense, known, stiffness.gather(held)[: self.size])
        normals = model.function()
        for contact in model.contacts:
            contact.trace.assign(normals.x.array, contact.direction[:, None, :])
        self.normals = stiffness.gather(normals)[: self.size]
        columns = [np.full(len(w.x.array), -1)]
        columns[0][stiffness.local] = stiffness.place
        self.field_size = len(stiffness.numbers)
        if self.multipliers:
            self._add_multipliers(columns)
        self._connect(columns)

    def run(self, work: Callable[[], Any]) -> Any:
        """Do work on rank 0 while the other ranks assemble what it asks for; return its result on all ranks."""
        comm = self.model.comm
        result, error = None, None
        if comm.rank == 0:
            try:
                result = work()
            except Exception as failure:
                error = failure
            from_first(comm, None)
        else:
            while (asked := from_first(comm, None)) is not None:
                getattr(self, asked[0])(*asked[1:])
        raise_together(comm, error)
        return from_first(comm, result)

    def residual(self, u_A: np.ndarray) -> np.ndarray:
        """The residual R(u_A) [force], rank 0."""
        self._move(u_A)
        equations = self._ask("_residual")
        return equations if self.multipliers else self.matrix @ u_A - self.loads + equations

    def tangent(self, u_A: np.ndarray) -> np.ndarray:
        """dR/du_A at u_A [force/length], shape (A, A) in Fortran order, rank 0."""
        self._move(u_A)
        self.sparse.setValuesCOO(self._ask("_tangent"))
        self.sparse.matMult(self.lifted, self.product)
        dense = self.product.getDenseArray(readonly=True)
        return dense.copy(order="F") if self.multipliers else np.asfortranarray(dense + self.matrix)

    def status(self, u_A: np.ndarray) -> np.ndarray:
        """The status open (0), slip (1) or stick (2) at points of all contact facets for u_A, rank 0."""
        self._move(u_A)
        return self._ask("_status")

    def raise_friction(self, share: float) -> None:
        """Set the share of friction on all ranks."""
        self._ask("_share", share)

    def from_contact(self, u_contact: np.ndarray) -> np.ndarray:
        """u_A [length] from the contact nodes, with the other nodes of A in elastic equilibrium, rank 0."""
        count = len(u_contact)
        _, lift = self.stiffness.reduced(count)
        return self.w[: self.size] + lift[: self.size] @ (u_contact - self.w[:count])

    def multipliers_at(self, u_A: np.ndarray) -> tuple[fem.Function, ...]:
        """The multipliers of all contacts for u_A, new Functions of nodal values [force/area]; collective."""
        comm, model = self.model.comm, self.model
        z = from_first(comm, self._fields_at(u_A) if comm.rank == 0 and self.multipliers else None)
        found = []
        for contact, (dofs, places) in zip(model.contacts, self.readers[1:], strict=False):
            multiplier = model.function()
            multiplier.x.array[dofs] = z[places]
            model.to_coefficients(multiplier.x.array.reshape(-1, model.d), [contact], back=True)
            found.append(multiplier)
        return tuple(found)

    def _fields_at(self, u_A: np.ndarray) -> np.ndarray:
        return self.affine[:, :-1] @ u_A + self.affine[:, -1]

    def _move(self, u_A: np.ndarray) -> None:
        """Set the fields of all ranks to u_A, rank 0."""
        if self._at is None or not np.array_equal(self._at, u_A):
            self._ask("_set", self._fields_at(u_A))
            self._at = u_A.copy()

    # -- what every rank does
    # -------------------------------------------------------------------------------

    def _ask(self, what: str, *arguments: Any) -> Any:
        from_first(self.model.comm, (what, *arguments))
        return getattr(self, what)(*arguments)

    def _set(self, z: np.ndarray) -> None:
        for field, (dofs, places) in zip((self.u, *self.multipliers), self.readers, strict=True):
            field.x.array[dofs] = z[places]

    def _residual(self) -> np.ndarray | None:
        vector = self.residual_vector.x.array
        vector[:] = 0.0
        fem.assemble_vector(vector, self.forms.residual)
        parts = gathered(self.model.comm, vector[self.rows])
        if parts is None:
            return None
        return np.bincount(self.all_rows, np.concatenate(parts), self.size)

    def _tangent(self) -> np.ndarray | None:
        values = []
        for matrix, form, pick in zip(self.tangents, self.forms.tangents, self.picks, strict=True):
            matrix.set_value(0.0)
            fem.assemble_matrix(matrix, form)
            values.append(matrix.data[pick])
        parts = gathered(self.model.comm, np.concatenate(values))
        return None if parts is None else np.concatenate(parts)

    def _status(self) -> np.ndarray | None:
        parts = gathered(self.model.comm, self.forms.status())
        return None if parts is None else np.concatenate(parts)

    def _share(self, share: float) -> None:
        self.forms.share.value = share

    def _condense(self, known: np.ndarray, held: np.ndarray) -> None:
        """Make the dense matrices, on rank 0."""
        if self.stiffness.schur is None:
            return
        a = self.size
        self.schur, lift = self.stiffness.reduced(a)
        self.matrix = self.stiffness.unglued(a)
        self.loads = self.schur @ self.w[:a]
        self.force = float((abs(self.matrix) @ np.maximum(abs(self.w[:a]), abs(held))).max()) or 1.0
        if self.edges:
            lift = self.edges.coefficients(lift)
        self.affine = np.hstack([lift, (known - lift @ self.w[:a])[:, None]])

    # -- set up
    # ---------------------------------------------------------------------------------------------

    def _add_multipliers(self, columns: list[np.ndarray]) -> None:
        """Add the multipliers to z.

        They follow from the reactions of the nodes, or are means of their neighbours
        where their own are redundant.
        """
        model, d = self.model, self.model.d
        nodes_of = []
        for contact in model.contacts:
            side = contact.trace.here
            own = side.owned
            nodes = side.nodes[own]
            numbers = model.global_numbers(nodes)
            m = nodes.shape[1]
            shares = np.repeat(side.areas[own][:, None] / m, m, axis=1)
            parts = model.comm.allgather((numbers, shares))
            every, place = np.unique(
                np.concatenate([p[0].ravel() for p in parts]), return_inverse=True
            )
            area = np.bincount(place, np.concatenate([p[1].ravel() for p in parts]))
            nodes_of.append((every, place.reshape(-1, m), area))
            visible = np.unique(side.nodes)
            found = np.searchsorted(every, model.global_numbers(visible))
            column = np.full((len(model.fixed), d), -1)
            column[visible] = self.field_size + found[:, None] * d + np.arange(d)
            columns.append(column.ravel())
            self.field_size += len(every) * d
        together(model.comm, self._append, nodes_of)

    def _append(self, contacts: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
        """Add the rows of the multipliers to the affine functions, on rank 0; see :func:`multiplier_rows`."""
        if self.stiffness.schur is None:
            return
        reaction = np.hstack([self.matrix, -self.loads[:, None]])
        if self.edges:
            reaction = self.edges.forces(reaction)
        places = Places(self.stiffness.numbers[: self.size], self.model.d)
        self.affine = np.vstack([self.affine, *multiplier_rows(contacts, places, reaction)])

    def _connect(self, columns: list[np.ndarray]) -> None:
        """Find where the entries of residual and tangent of each rank belong on rank 0."""
        comm, a = self.model.comm, self.size
        self.readers = [(np.flatnonzero(c >= 0), c[c >= 0]) for c in columns]
        row_of = np.where(columns[0] < a, columns[0], -1)
        self.rows = np.flatnonzero(row_of >= 0)
        all_rows = gathered(comm, row_of[self.rows])
        self.picks, rows, cols = [], [], []
        for matrix, column in zip(self.tangents, columns, strict=True):
            row, col = _entries(matrix)
            row, col = row_of[row], column[col]
            pick = np.flatnonzero((row >= 0) & (col >= 0))
            self.picks.append(pick)
            rows.append(row[pick])
            cols.append(col[pick])
        parts = gathered(comm, (np.concatenate(rows), np.concatenate(cols)))

        def allocate() -> None:
            if parts is None:
                return
            self.all_rows = np.concatenate(all_rows)
            row, col = (np.concatenate([p[i] for p in parts]).astype(PETSc.IntType) for i in (0, 1))
            self.sparse = PETSc.Mat().createAIJ((a, self.field_size), comm=PETSc.COMM_SELF)
            self.sparse.setPreallocationCOO(row, col)
            columns_of = np.asfortranarray(self.affine[:, :-1])
            self.lifted = PETSc.Mat().createDense(
                (self.field_size, a), array=columns_of, comm=PETSc.COMM_SELF
            )
            self.product = PETSc.Mat().createDense((a, a), comm=PETSc.COMM_SELF)
            self.product.setUp()

        together(comm, allocate)


def _slip_before(model: Model) -> fem.Function:
    """The tangential displacement of the contacts at the end of the last step [length]; zero without history."""
    before = model.function()
    for contact in model.contacts:
        trace = contact.trace
        if trace.before is not None:
            trace.assign(before.x.array, trace.slip_before)
    return before


def _entries(matrix: Any) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns (local degrees of freedom) of the entries of a block matrix, in the order of its data."""
    b = matrix.block_size[0]
    row = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
    col = matrix.indices[: len(row)]
    rows = row[:, None, None] * b + np.arange(b)[:, None] + np.zeros((1, b), int)
    cols = col[:, None, None] * b + np.arange(b) + np.zeros((b, 1), int)
    return rows.ravel(), cols.ravel()
