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
(:mod:`erc_contact.newton.reactions`).

At contacts between bodies the unknowns are jumps
(:mod:`erc_contact.model.coordinates`). The displacement of their nodes, a sum of two
unknowns, is then a part of z, too.

The dense matrices are on rank 0. It asks the other ranks to assemble the terms of their
facets (:mod:`erc_contact.newton.assembly`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from erc_contact.base.exceptions import raise_together, together
from erc_contact.base.ranks import from_first
from erc_contact.base.sparse import sparse, times
from erc_contact.model.model import Model
from erc_contact.newton.assembly import Assembly, Pass
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.pressing import contact_normals
from erc_contact.newton.reactions import Entries, MultiplierMap


class Condensed:
    """Represent the condensed contact problem of a model.

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
        self.model = model
        self.stiffness = stiffness
        self.forms = ContactForms(model, method)
        self.u = self.forms.u
        self.multipliers = self.forms.multipliers
        self.size = len(stiffness.numbers) if method.in_layer else stiffness.contact_size
        self.forms.set_displacement(w)
        self._last_u_A: np.ndarray | None = None

        # Gathering is collective; the dense algebra is done on rank 0 alone.
        self.w = stiffness.gather(w)
        u_L = stiffness.gather_x(self._read_unknowns(w))
        self._map: MultiplierMap | None = None
        if method.multiplier:
            self._map = MultiplierMap(model)
        slip = _slip_before(model)
        largest_w = float(abs(w.x.array).max(initial=0.0))
        largest_slip = float(abs(slip.x.array).max(initial=0.0))
        self.length = max(model.comm.allgather(max(largest_w, largest_slip))) or 1.0
        slip_A = stiffness.gather(slip)[: self.size]
        together(model.comm, self._condense, u_L, slip_A)
        self.normals = stiffness.gather(contact_normals(model))[: self.size]

        place = np.full(len(w.x.array), -1)
        place[stiffness.local] = stiffness.place
        rows = np.where(place < self.size, place, -1)
        self.field_size = len(stiffness.numbers)
        columns = self._columns_of_displacements(place, w)
        if self._map is not None:
            columns += self._columns_of_multipliers(self._map)
            together(model.comm, self._add_multipliers, self._map)
        passes = [Pass(1.0, rows, np.ones(len(rows)))]
        passes += self._passes_without_jump(rows)
        self.assembly = Assembly(self.forms, passes, columns, self.size)
        together(model.comm, self._allocate)

    def run(self, work: Callable[[], Any]) -> Any:
        """Do work on rank 0 with the help of the others; return its result.

        The other ranks wait for the name of a method of :class:`.assembly.Assembly` and
        its arguments, and call it, until rank 0 sends None.
        """
        comm = self.model.comm
        result = None
        error = None
        if comm.rank == 0:
            try:
                result = work()
            except Exception as failure:
                error = failure
            from_first(comm, None)
        else:
            request = from_first(comm, None)
            while request is not None:
                name, *arguments = request
                getattr(self.assembly, name)(*arguments)
                request = from_first(comm, None)
        raise_together(comm, error)
        return from_first(comm, result)

    def residual(self, u_A: np.ndarray) -> np.ndarray:
        """Return the residual R(u_A) [force], on rank 0."""
        self._move(u_A)
        equations = self._on_all_ranks("residual")
        if self.multipliers:
            return equations
        return self.matrix @ u_A - self.loads + equations

    def tangent(self, u_A: np.ndarray) -> np.ndarray:
        """Return dR/du_A at u_A [force/length], (A, A) in Fortran order, on rank 0."""
        self._move(u_A)
        self._sparse.setValuesCOO(self._on_all_ranks("tangent"))
        self._sparse.matMult(self._derivative, self._product)
        dense = self._product.getDenseArray(readonly=True)
        if self.multipliers:
            return dense.copy(order="F")
        return np.asfortranarray(dense + self.matrix)

    def status(self, u_A: np.ndarray) -> np.ndarray:
        """Return the status open (0), slip (1) or stick (2) for u_A, on rank 0.

        There is one at each point of all contact facets.
        """
        self._move(u_A)
        return self._on_all_ranks("status")

    def raise_friction(self, share: float) -> None:
        """Set the share of friction on all ranks."""
        self._on_all_ranks("set_share", share)

    def from_contact(self, u_contact: np.ndarray) -> np.ndarray:
        """Return u_A [length] from the displacement of the contact nodes, on rank 0.

        The other nodes of A are in elastic equilibrium.
        """
        count = len(u_contact)
        _, lift = self.stiffness.reduced(count)
        return self.w[: self.size] + lift[: self.size] @ (u_contact - self.w[:count])

    def multipliers_at(self, u_A: np.ndarray) -> tuple[fem.Function, ...]:
        """Return the nodal multipliers for u_A [force/area]; collective."""
        comm, model = self.model.comm, self.model
        z = None
        if comm.rank == 0 and self.multipliers:
            z = self._fields_at(u_A)
        z = from_first(comm, z)
        multipliers = []
        readers = self.assembly.readers[len(self.forms.displacements) :]
        for contact, (dofs, places) in zip(model.contacts, readers, strict=False):
            multiplier = model.function()
            multiplier.x.array[dofs] = z[places]
            model.to_coefficients(multiplier.x.array.reshape(-1, model.d), [contact], back=True)
            multipliers.append(multiplier)
        return tuple(multipliers)

    def _fields_at(self, u_A: np.ndarray) -> np.ndarray:
        """Return z for u_A, on rank 0."""
        return self._affine[:, :-1] @ u_A + self._affine[:, -1]

    def _move(self, u_A: np.ndarray) -> None:
        """Set the fields of all ranks to u_A, on rank 0; nothing if they are there."""
        if self._last_u_A is None or not np.array_equal(self._last_u_A, u_A):
            self._on_all_ranks("set_fields", self._fields_at(u_A))
            self._last_u_A = u_A.copy()

    def _on_all_ranks(self, name: str, *arguments: Any) -> Any:
        """Call a method of the assembly on all ranks, from rank 0."""
        from_first(self.model.comm, (name, *arguments))
        return getattr(self.assembly, name)(*arguments)

    # -- set up

    def _condense(self, u_L: np.ndarray, slip_A: np.ndarray) -> None:
        """Make the dense matrices on rank 0, with the affine functions of u_L."""
        if self.stiffness.schur is None:
            return
        a = self.size
        w_A = self.w[:a]
        self.schur, lift = self.stiffness.reduced(a)
        self.matrix = self.stiffness.unglued(a)
        self.loads = self.schur @ w_A
        forces = abs(self.matrix) @ np.maximum(abs(w_A), abs(slip_A))
        self.force = float(forces.max()) or 1.0
        if self._map is not None and self._map.coefficients is not None:
            # The nodes of L that are not in A have no coefficients of their own.
            change = self._at_A(self._map.coefficients, self.stiffness.numbers[:a])
            lift = np.vstack([times(change, lift[:a]), lift[a:]])
            change.destroy()
        constant = u_L - lift @ w_A
        self._affine = np.hstack([lift, constant[:, None]])

    def _read_unknowns(self, w: fem.Function) -> fem.Function:
        """Return the unknowns of a displacement as the forms read them, at L [length].

        With a multiplier those at contacts are Bernstein coefficients.
        """
        unknowns = self.model.coordinates.to_x(w).copy()
        if self.multipliers:
            values = unknowns.x.array.reshape(-1, self.model.d)
            self.model.to_coefficients(values, self.model.contacts)
        return unknowns

    def _columns_of_displacements(self, place: np.ndarray, w: fem.Function) -> list[np.ndarray]:
        """Return the places in z of u and the jumps that the forms read; collective.

        Where u is the sum of two unknowns it is added to z.

        Args:
            place: Place in L of each degree of freedom of this rank, -1 elsewhere.
            w: The glued displacement [length].
        """
        model = self.model
        columns = []
        between = [contact for contact in model.contacts if contact.trace.there is not None]
        jumps = dict(zip(self.forms.jumps, between, strict=True))
        for field in self.forms.displacements:
            if field in jumps:
                of_jump = np.full(len(place), -1)
                nodes = np.unique(jumps[field].trace.here.nodes)
                dofs = (nodes[:, None] * model.d + np.arange(model.d)).ravel()
                of_jump[dofs] = place[dofs]
                columns.append(of_jump)
            elif model.coordinates.is_identity:
                columns.append(place)
            else:
                columns.append(self._column_of_sums(place, w))
        return columns

    def _column_of_sums(self, place: np.ndarray, w: fem.Function) -> np.ndarray:
        """Return the places of u in z, with the sums of two unknowns added; collective.

        The arguments are those of :meth:`_columns_of_displacements`.
        """
        model, d = self.model, self.model.d
        coordinates = model.coordinates
        cells = np.concatenate([contact.facets[:, 0] for contact in model.contacts])
        read = np.zeros(model.fixed.shape, dtype=bool)
        read[model.nodes[cells]] = True
        read &= ~model.fixed
        entries = coordinates.entries
        is_sum = entries.other != 0
        rows = entries.rows[is_sum]
        wanted = read.ravel()[rows]
        rows = rows[wanted]
        partners = coordinates.partner[rows // d] * d + rows % d
        own = entries.own[is_sum][wanted]
        other = entries.other[is_sum][wanted]
        numbers = model.global_dofs(rows)
        table = np.column_stack([numbers, partners, own, other, w.x.array[rows]])
        every = np.concatenate(model.comm.allgather(table))
        _, first = np.unique(every[:, 0], return_index=True)
        sums = every[first]
        together(model.comm, self._add_sums, sums)

        column = np.where(read.ravel(), place, -1)
        column[rows] = self.field_size + np.searchsorted(sums[:, 0], numbers)
        self.field_size += len(sums)
        return column

    def _add_sums(self, sums: np.ndarray) -> None:
        """Add sums of two unknowns to the affine functions on rank 0.

        Args:
            sums: Global number of each sum, and of its second unknown; the factors of
                both [-]; the value for w_A [length]; shape (n, 5).
        """
        if self.stiffness.schur is None:
            return
        a = self.size
        _, lift = self.stiffness.reduced(a)
        rows = np.zeros((len(sums), a))
        order = np.argsort(self.stiffness.numbers)
        for number, factor in ((sums[:, 0], sums[:, 2]), (sums[:, 1], sums[:, 3])):
            nearest = np.searchsorted(self.stiffness.numbers, number, sorter=order)
            place = order[np.minimum(nearest, len(order) - 1)]
            # An unknown that a support fixes is not in L, and does not change.
            is_free = self.stiffness.numbers[place] == number
            rows[is_free] += factor[is_free, None] * lift[place[is_free]]
        constant = sums[:, 4] - rows @ self.w[:a]
        self._affine = np.vstack([self._affine, np.column_stack([rows, constant])])

    def _passes_without_jump(self, rows: np.ndarray) -> list[Pass]:
        """Return the pass for unknowns that move both sides of a contact alike.

        A displacement that is a sum of two unknowns has a force on each of them. The
        work on the jump belongs to the jump alone.

        Args:
            rows: Place in u_A of each degree of freedom of this rank, -1 without.

        Returns:
            One pass, or none where the equations of no contact need it.
        """
        model = self.model
        coordinates = model.coordinates
        if not self.forms.test_alike:
            return []
        entries = coordinates.entries
        partners = coordinates.partner_here[entries.rows // model.d]
        of_partner = rows[partners * model.d + entries.rows % model.d]
        # A swapped component has no force on its own unknown beside that on the jump.
        is_swapped = entries.own == 0
        places = np.where(is_swapped, rows[entries.rows], of_partner)
        factors = np.where(is_swapped, -1.0, entries.other)
        row_of = np.full(len(rows), -1)
        row_of[entries.rows] = np.where((factors != 0) & (partners >= 0), places, -1)
        factor_of = np.zeros(len(rows))
        factor_of[entries.rows] = factors
        return [Pass(0.0, row_of, factor_of)]

    def _columns_of_multipliers(self, multiplier_map: MultiplierMap) -> list[np.ndarray]:
        """Return the places in z of the multipliers of each contact, -1 elsewhere."""
        model, d = self.model, self.model.d
        columns = []
        for contact, nodes in zip(model.contacts, multiplier_map.contacts, strict=True):
            # Ghost facets count here: the forms of this rank read their multipliers.
            visible = np.unique(contact.trace.here.nodes)
            number = np.searchsorted(nodes.numbers, model.global_numbers(visible))
            column = np.full((len(model.fixed), d), -1)
            column[visible] = self.field_size + number[:, None] * d + np.arange(d)
            columns.append(column.ravel())
            self.field_size += len(nodes.numbers) * d
        return columns

    def _add_multipliers(self, multiplier_map: MultiplierMap) -> None:
        """Add the multipliers to the affine functions on rank 0."""
        if self.stiffness.schur is None:
            return
        d = self.model.d
        reaction = np.hstack([self.matrix, -self.loads[:, None]])
        rows = [self._affine]
        for nodes, entries in zip(multiplier_map.contacts, multiplier_map.multipliers, strict=True):
            dofs = (nodes.numbers[:, None] * d + np.arange(d)).ravel()
            to_multiplier = self._at_A(entries, dofs)
            rows.append(times(to_multiplier, reaction))
            to_multiplier.destroy()
        self._affine = np.vstack(rows)

    def _at_A(self, entries: Entries, dofs: np.ndarray) -> PETSc.Mat:
        """Make a matrix from A to degrees of freedom, on rank 0.

        Args:
            entries: Its entries.
            dofs: Global degrees of freedom of its rows, ascending.
        """
        rows = np.searchsorted(dofs, entries.rows)
        columns = np.searchsorted(self.stiffness.numbers[: self.size], entries.columns)
        return sparse(len(dofs), self.size, rows, columns, [entries.values])

    def _allocate(self) -> None:
        """Make the matrices whose product is the tangent, on rank 0."""
        if self.assembly.positions is None:
            return
        rows, cols = self.assembly.positions
        a = self.size
        self._sparse = PETSc.Mat().createAIJ((a, self.field_size), comm=PETSc.COMM_SELF)
        self._sparse.setPreallocationCOO(rows.astype(PETSc.IntType), cols.astype(PETSc.IntType))
        # PETSc keeps this array, and wants it column by column.
        derivative = np.asfortranarray(self._affine[:, :-1])
        self._derivative = PETSc.Mat().createDense(
            (self.field_size, a), array=derivative, comm=PETSc.COMM_SELF
        )
        self._product = PETSc.Mat().createDense((a, a), comm=PETSc.COMM_SELF)
        self._product.setUp()


def _slip_before(model: Model) -> fem.Function:
    """Return the slip of the contacts at the end of the last step [length].

    It is the tangential displacement there, and zero without history.
    """
    before = model.function()
    for contact in model.contacts:
        trace = contact.trace
        if trace.before is not None:
            trace.assign(before.x.array, trace.slip_before)
    return before
