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
from erc_contact.model.foundation import BoundContact
from erc_contact.model.trace import dofs_of
from erc_contact.newton.contact_nodes import Entries
from erc_contact.newton.field_sums import sums_of_displacements, sums_of_jump
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.jump_sums import Sums
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.reactions import MultiplierMap
from erc_contact.newton.shared_multipliers import SharedMultipliers


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
        rows: Place in A of each degree of freedom of this rank, -1 where it has none.
        shared: What contacts share at nodes of several bodies; None without.
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
        self.shared: SharedMultipliers | None = None
        if forms.multipliers:
            self._map = MultiplierMap(self._model)
            self.shared = self._map.shared
            dofs = dofs_of(self._map.numbers, self._model.d)[self._map.free.ravel()]
            self.in_equilibrium = np.flatnonzero(~np.isin(stiffness.numbers[:unknowns], dofs))
        self._w_A = stiffness.gather(w)[:unknowns]
        z_L = stiffness.gather_x(self._read_unknowns(w))
        self.affine = together(self._model.comm, self._of_unknowns, z_L)

        place = np.full(len(w.x.array), -1)
        place[stiffness.local] = stiffness.place
        self.columns = self._columns_of_displacements(place)
        if self._map is not None:
            self._first_multiplier = self.size
            self.columns += self._columns_of_multipliers(self._map)
            together(self._model.comm, self.set_reactions, matrix, loads)
        self.rows = np.where(place < unknowns, place, -1)

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
                columns.append(self._column_of_jump(field, jumps[field], place))
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
        together(comm, self._add_sums, self._sums_of_u(rows), rows, all_values)

        column = np.where((read & ~model.fixed).ravel(), place, -1)
        column[added] = self.size + np.searchsorted(rows, numbers)
        self.size += len(rows)
        return column

    def _column_of_jump(
        self, field: fem.Function, contact: BoundContact, place: np.ndarray
    ) -> np.ndarray:
        """Return the places in z of a jump, and add sums to z; collective.

        Args:
            field: The jump that the forms read.
            contact: Its contact.
            place: Place in L of each degree of freedom of this rank, -1 elsewhere.
        """
        model = self._model
        dofs = dofs_of(np.unique(contact.trace.here.nodes), model.d)
        column = np.full(len(place), -1)
        column[dofs] = place[dofs]
        if not self._forms.jump_sums.any:
            return column
        all_sums, rows = self._sums_of_jump(contact)
        numbers = model.global_dofs(dofs)
        if self._map is not None and self._map.shared is not None:
            # Where supports fix all summands the jump does not change.
            shared = self._map.shared.at.numbers
            column[dofs[np.isin(numbers // model.d, shared)]] = -1
        is_sum = np.isin(numbers, rows)
        dofs, numbers = dofs[is_sum], numbers[is_sum]
        values = np.column_stack([numbers, field.x.array[dofs]])
        of_all = np.concatenate(model.comm.allgather(values))
        _, first = np.unique(of_all[:, 0], return_index=True)
        together(model.comm, self._add_sums, all_sums, rows, of_all[first, 1])

        column[dofs] = self.size + np.searchsorted(rows, numbers)
        self.size += len(rows)
        return column

    def _sums_of_u(self, dofs: np.ndarray) -> Sums:
        """Return what the displacements on foundations are sums of; collective."""
        change = None if self._map is None else self._map.on_foundations
        return sums_of_displacements(self._model, change, dofs)

    def _sums_of_jump(self, contact: BoundContact) -> tuple[Sums, np.ndarray]:
        """Return what a jump is a sum of, see :func:`.sums_of_jump`; collective.

        With a multiplier it is that of its Bernstein coefficients.
        """
        if self._map is None or self._map.shared is None:
            return sums_of_jump(self._model, self._forms.jump_sums.of(contact))
        entries = self._map.shared.jumps[self._model.contacts.index(contact)]
        rows = np.unique(entries.rows)
        return Sums(np.searchsorted(rows, entries.rows), entries.columns, entries.values), rows

    def _add_sums(self, sums: Sums, rows: np.ndarray, values: np.ndarray) -> None:
        """Add fields at degrees of freedom that are no unknowns to Z, on rank 0.

        Args:
            sums: The sums of unknowns that they are, by places in `rows`.
            rows: Global numbers of the degrees of freedom, ascending, shape (n,).
            values: Values of the field for the glued displacement [length], shape (n,).
        """
        if self._stiffness.schur is None:
            return
        numbers = self._stiffness.numbers
        order = np.argsort(numbers)
        _, lift = self._stiffness.reduced(self._unknowns)
        added = np.zeros((len(rows), self._unknowns))
        nearest = np.searchsorted(numbers, sums.columns, sorter=order)
        place = order[np.minimum(nearest, len(order) - 1)]
        # An unknown that a support fixes is not in L, and does not change.
        is_free = numbers[place] == sums.columns
        factor = sums.values[is_free, None]
        np.add.at(added, sums.rows[is_free], factor * lift[place[is_free]])
        constant = values - added @ self._w_A
        self.affine = np.vstack([self.affine, np.column_stack([added, constant])])

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

    def set_reactions(self, matrix: np.ndarray, loads: np.ndarray) -> None:
        """Set the multipliers in Z to those of the reactions ``K u_A - s``, on rank 0.

        Args:
            matrix: K [force/length], shape (A, A).
            loads: s [force], shape (A,).
        """
        if self._stiffness.schur is None or self._map is None:
            return
        reaction = np.hstack([matrix, -loads[:, None]])
        rows = [self.affine[: self._first_multiplier]]
        for nodes, entries in zip(self._map.contacts, self._map.multipliers, strict=True):
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
