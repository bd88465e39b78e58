"""Fields that contact equations read, as affine functions of condensed unknowns.

The equations of a method read u in the cells at the contact, its jumps between bodies,
and the multipliers. All of these are affine functions of u_A:

    z = Z (u_A, 1).

First in z are the unknowns L. At contacts between bodies they are jumps
(:mod:`erc_contact.model.coordinates`); u at their nodes, a sum of two unknowns, follows
them. Then come the multipliers. For degree 2, the equations of a multiplier use
Bernstein coefficients of u, jumps and lambda instead of nodal values; z contains this
change (:mod:`erc_contact.newton.reactions`).

The dense matrix Z is on rank 0. Symbols: A, L, K and s as in
:mod:`erc_contact.newton.condensed`; C from nodal values to Bernstein coefficients; T
from unknowns to displacements.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from erc_contact.base.exceptions import together
from erc_contact.base.sparse import sparse, times
from erc_contact.model.trace import dofs_of
from erc_contact.newton.forms import ContactForms, Pass
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.reactions import Entries, MultiplierMap


class FieldMap:
    """Hold the matrix Z, and the places of all fields in z; construction is collective.

    Args:
        forms: The equations of the method; their fields are set to the glued
            displacement.
        stiffness: The condensed elastic stiffness.
        unknowns: Size of A.
        w: The glued displacement [length].
        matrix: K on rank 0 [force/length], shape (A, A).
        loads: s on rank 0 [force], shape (A,).

    Attributes:
        size: Size of z.
        affine: Z, shape (size, A + 1), on rank 0; without rows elsewhere.
        columns: For each field that the forms are derived by, the place in z of each
            degree of freedom of this rank, -1 where it has none.
        passes: The assemblies of the equations.
        in_equilibrium: Rows of A with the equilibrium, as an index; with a multiplier
            its equations stand in place of that of its nodes.
    """

    def __init__(
        self,
        forms: ContactForms,
        stiffness: Stiffness,
        unknowns: int,
        w: fem.Function,
        matrix: np.ndarray,
        loads: np.ndarray,
    ) -> None:
        self._forms = forms
        self._model = forms.model
        self._stiffness = stiffness
        self._unknowns = unknowns
        self.size = len(stiffness.numbers)
        self.in_equilibrium: slice | np.ndarray = slice(None)
        self._map: MultiplierMap | None = None
        if forms.multipliers:
            self._map = MultiplierMap(self._model)
            dofs = dofs_of(self._map.numbers, self._model.d)
            self.in_equilibrium = np.flatnonzero(~np.isin(stiffness.numbers[:unknowns], dofs))
        self._w_A = stiffness.gather(w)[:unknowns]
        z_L = stiffness.gather_x(self._read_unknowns(w))
        self.affine = together(self._model.comm, self._of_unknowns, z_L)

        place = np.full(len(w.x.array), -1)
        place[stiffness.local] = stiffness.place
        self.columns = self._columns_of_displacements(place)
        if self._map is not None:
            self.columns += self._columns_of_multipliers(self._map)
            together(self._model.comm, self._add_multipliers, self._map, matrix, loads)
        rows = np.where(place < unknowns, place, -1)
        self.passes = [Pass(1.0, rows, np.ones(len(rows)))]
        if forms.test_alike:
            self.passes.append(self._pass_without_jump(rows))

    # -- displacements

    def _read_unknowns(self, w: fem.Function) -> fem.Function:
        """Return the unknowns of a displacement, with a multiplier as coefficients."""
        unknowns = self._model.coordinates.to_x(w).copy()
        if self._forms.multipliers:
            values = unknowns.x.array.reshape(-1, self._model.d)
            self._model.to_coefficients(values, self._model.contacts)
        return unknowns

    def _of_unknowns(self, z_L: np.ndarray) -> np.ndarray:
        """Return the rows of Z for L, on rank 0.

        Args:
            z_L: Values of these fields for the glued displacement [length].
        """
        if self._stiffness.schur is None:
            return np.zeros((0, 0))
        a = self._unknowns
        _, lift = self._stiffness.reduced(a)
        if self._map is not None and self._map.coefficients is not None:
            # The nodes of L that are not in A have no coefficients of their own.
            change = self._at_A(self._map.coefficients, self._stiffness.numbers[:a])
            lift = np.vstack([times(change, lift[:a]), lift[a:]])
            change.destroy()
        constant = z_L - lift @ self._w_A
        return np.hstack([lift, constant[:, None]])

    def _columns_of_displacements(self, place: np.ndarray) -> list[np.ndarray]:
        """Return the places in z of u and the jumps that the forms read; collective.

        Args:
            place: Place in L of each degree of freedom of this rank, -1 elsewhere.
        """
        model = self._model
        jumps = self._forms.jumps
        columns = []
        for field in self._forms.displacements:
            if field in jumps:
                dofs = dofs_of(np.unique(jumps[field].trace.here.nodes), model.d)
                of_jump = np.full(len(place), -1)
                of_jump[dofs] = place[dofs]
                columns.append(of_jump)
            elif model.coordinates.is_identity:
                columns.append(place)
            else:
                columns.append(self._column_of_sums(place))
        return columns

    def _column_of_sums(self, place: np.ndarray) -> np.ndarray:
        """Return the places of u in z, and add to z what is no unknown; collective.

        Args:
            place: Place in L of each degree of freedom of this rank, -1 elsewhere.
        """
        model = self._model
        comm = model.comm
        d = model.d
        is_sum = np.zeros(model.fixed.size, dtype=bool)
        entries = model.coordinates.entries
        is_sum[entries.rows[entries.other != 0]] = True
        read = np.zeros(model.fixed.shape, dtype=bool)
        changed = is_sum.reshape(read.shape).copy()
        for contact in model.contacts:
            read[model.nodes[contact.facets[:, 0]]] = True
            if self._map is not None and contact.trace.there is None:
                # Coefficients of a facet change with each of its nodes.
                nodes = contact.trace.here.nodes
                changed[nodes[changed[nodes].any(axis=(1, 2))]] = True
        added = np.flatnonzero((read & changed & ~model.fixed).ravel())
        numbers = model.global_dofs(added)
        values = self._forms.u.x.array[added]
        rows, first = np.unique(np.concatenate(comm.allgather(numbers)), return_index=True)
        all_values = np.concatenate(comm.allgather(values))[first]
        # T of all ranks, by the rows that are not those of the identity.
        partners = model.coordinates.partner[entries.rows // d] * d + entries.rows % d
        of_rank = [model.global_dofs(entries.rows), partners, entries.own, entries.other]
        table = np.concatenate(comm.allgather(np.column_stack(of_rank)))
        _, first = np.unique(table[:, 0], return_index=True)
        together(comm, self._add_sums, rows, all_values, table[first])

        column = np.where((read & ~model.fixed).ravel(), place, -1)
        column[added] = self.size + np.searchsorted(rows, numbers)
        self.size += len(rows)
        return column

    def _add_sums(self, rows: np.ndarray, values: np.ndarray, table: np.ndarray) -> None:
        """Add u at degrees of freedom that are no unknowns to Z, on rank 0.

        Args:
            rows: Their global numbers, ascending, shape (n,).
            values: Their values for the glued displacement [length], shape (n,).
            table: Rows of T: number, number of the partner, and the factors of both
                [-], by ascending number, shape (m, 4).
        """
        if self._stiffness.schur is None:
            return
        # Which displacements a row adds up, and with what factors.
        row, column, factor = np.arange(len(rows)), rows, np.ones(len(rows))
        if self._map is not None and self._map.on_foundations is not None:
            entries = self._map.on_foundations
            used = np.isin(entries.rows, rows)
            row = np.searchsorted(rows, entries.rows[used])
            column, factor = entries.columns[used], entries.values[used]
        # Those are sums of unknowns.
        place = np.minimum(np.searchsorted(table[:, 0], column), len(table) - 1)
        in_table = table[place, 0] == column
        own = np.where(in_table, table[place, 2], 1.0)
        other = np.where(in_table, table[place, 3], 0.0)
        partner = np.where(in_table, table[place, 1], column)

        numbers = self._stiffness.numbers
        order = np.argsort(numbers)
        _, lift = self._stiffness.reduced(self._unknowns)
        added = np.zeros((len(rows), self._unknowns))
        for unknown, share in ((column, own), (partner, other)):
            nearest = np.searchsorted(numbers, unknown, sorter=order)
            place = order[np.minimum(nearest, len(order) - 1)]
            # An unknown that a support fixes is not in L, and does not change.
            is_free = numbers[place] == unknown
            weight = (factor * share)[is_free, None]
            np.add.at(added, row[is_free], weight * lift[place[is_free]])
        constant = values - added @ self._w_A
        self.affine = np.vstack([self.affine, np.column_stack([added, constant])])

    def _pass_without_jump(self, rows: np.ndarray) -> Pass:
        """Return the assembly for unknowns that move both sides of a contact alike.

        A displacement that is a sum of two unknowns has a force on each of them. The
        work on the jump belongs to the jump alone.

        Args:
            rows: Place in u_A of each degree of freedom of this rank, -1 without.
        """
        coordinates = self._model.coordinates
        d = self._model.d
        entries = coordinates.entries
        partners = coordinates.partner_here[entries.rows // d]
        of_partner = rows[partners * d + entries.rows % d]
        # A swapped component has no force on its own unknown beside that on the jump.
        is_swapped = entries.own == 0
        places = np.where(is_swapped, rows[entries.rows], of_partner)
        factors = np.where(is_swapped, -1.0, entries.other)
        row_of = np.full(len(rows), -1)
        row_of[entries.rows] = np.where((factors != 0) & (partners >= 0), places, -1)
        factor_of = np.zeros(len(rows))
        factor_of[entries.rows] = factors
        return Pass(0.0, row_of, factor_of)

    # -- multipliers

    def _columns_of_multipliers(self, multiplier_map: MultiplierMap) -> list[np.ndarray]:
        """Return the places in z of the multipliers of each contact, -1 elsewhere."""
        model, d = self._model, self._model.d
        columns = []
        for contact, nodes in zip(model.contacts, multiplier_map.contacts, strict=True):
            # Ghost facets count here: the forms of this rank read their multipliers.
            visible = np.unique(contact.trace.here.nodes)
            number = np.searchsorted(nodes.numbers, model.global_numbers(visible))
            column = np.full((len(model.fixed), d), -1)
            column[visible] = self.size + number[:, None] * d + np.arange(d)
            columns.append(column.ravel())
            self.size += len(nodes.numbers) * d
        return columns

    def _add_multipliers(
        self, multiplier_map: MultiplierMap, matrix: np.ndarray, loads: np.ndarray
    ) -> None:
        """Add the multipliers to Z, on rank 0."""
        if self._stiffness.schur is None:
            return
        reaction = np.hstack([matrix, -loads[:, None]])
        rows = [self.affine]
        for nodes, entries in zip(multiplier_map.contacts, multiplier_map.multipliers, strict=True):
            to_multiplier = self._at_A(entries, dofs_of(nodes.numbers, self._model.d))
            rows.append(times(to_multiplier, reaction))
            to_multiplier.destroy()
        self.affine = np.vstack(rows)

    def _at_A(self, entries: Entries, dofs: np.ndarray) -> PETSc.Mat:
        """Make a matrix from A to degrees of freedom, on rank 0.

        Args:
            entries: Its entries.
            dofs: Global degrees of freedom of its rows, ascending.
        """
        rows = np.searchsorted(dofs, entries.rows)
        columns = np.searchsorted(self._stiffness.numbers[: self._unknowns], entries.columns)
        return sparse(len(dofs), self._unknowns, rows, columns, [entries.values])
