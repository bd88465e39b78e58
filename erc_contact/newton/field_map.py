"""Fields that contact equations read, as affine functions of condensed unknowns.

The equations of a method read u in the cells at the contact, its jumps between bodies,
and the multipliers. All of these are affine functions of u_A:

    z = Z (u_A, 1).

For degree 2, the equations of a multiplier use Bernstein coefficients of u, jumps and
lambda instead of nodal values; z contains this change
(:mod:`erc_contact.newton.reactions`).

The dense matrix Z is on rank 0. Symbols: A, K and b_A as in
:mod:`erc_contact.newton.condensed`; L and Q as in
:mod:`erc_contact.newton.linear.stiffness`.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from scipy.sparse import csr_array  # type: ignore[import-untyped]

from erc_contact.base.exceptions import together
from erc_contact.model.contact.trace import dofs_of, places_of
from erc_contact.newton.contact_nodes import Entries, Reading
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.reactions import MultiplierMap
from namedmesh.base.ranks import gathered


class FieldMap:
    """Hold the matrix Z, and the places of all fields in z; construction is collective.

    Args:
        forms: The equations of the method; their fields are set to the glued
            displacement.
        stiffness: The condensed elastic stiffness.
        unknowns: Size of A.
        w_A: The glued displacement at A on rank 0 [length].
        matrix: K on rank 0 [force/length], shape (A, A).
        loads: b_A on rank 0 [force], shape (A,).

    Attributes:
        size: Size of z.
        derivative: The columns of Z for u_A, shape (size, A), on rank 0; without rows
            elsewhere.
        constant: The last column of Z, shape (size,).
        columns: For each field that the forms are derived by, the place in z of each
            degree of freedom of this rank, -1 where it has none.
        readings: What the forces of each reader of the forms are.
        multipliers: What reactions say of multipliers; None for a method without.
    """

    def __init__(
        self,
        forms: ContactForms,
        stiffness: Stiffness,
        unknowns: int,
        w_A: np.ndarray,
        matrix: np.ndarray,
        loads: np.ndarray,
    ) -> None:
        self._forms = forms
        self._model = forms.model
        space = self._model.space
        self._stiffness = stiffness
        self._unknowns = unknowns
        self._w_A = w_A
        self._on_first = stiffness.schur is not None
        self.multipliers = MultiplierMap(self._model) if forms.multipliers else None
        self.size = 0
        self.columns: list[np.ndarray] = []
        parts = [(np.zeros((0, unknowns)), np.zeros(0))]
        numbers = {jump: self._model.contacts.index(c) for jump, c in forms.jumps.items()}
        for field in forms.displacements:
            parts.append(self._displacement(field, numbers.get(field)))
        self.readings = [self._reading(reader.contact) for reader in forms.readers]
        self._set_rows(parts)
        if self.multipliers is not None:
            self._first_multiplier = self.size
            for contact, nodes in zip(self._model.contacts, self.multipliers.contacts, strict=True):
                # The forms of this rank read multipliers of ghost facets, too.
                visible = np.unique(contact.trace.here.nodes)
                self._add_column(dofs_of(visible, space.d), dofs_of(nodes.here, space.d))
            together(space.comm, self.set_reactions, matrix, loads)

    def _set_rows(self, parts: list[tuple[np.ndarray, np.ndarray]]) -> None:
        """Set Z to some rows below each other, each with the constants."""
        derivatives, constants = zip(*parts, strict=True)
        self.derivative = np.concatenate(derivatives)
        self.constant = np.concatenate(constants)

    def _displacement(
        self, field: fem.Function, contact: int | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows of Z for u or a jump, and add it to z; collective.

        Args:
            field: The field at the glued displacement.
            contact: Number of the contact between bodies whose jump it is, else None.
        """
        layer, model = self._stiffness.layer, self._model
        rows, local = layer.numbers, layer.local
        if contact is not None:
            rows = np.unique(dofs_of(model.connections.pairs[contact][:, 0], model.space.d))
            visible = np.unique(model.contacts[contact].trace.here.nodes)
            local = dofs_of(visible, model.space.d)
        parts = gathered(model.space.comm, (self._add_column(local, rows), field.x.array[local]))

        def affine() -> tuple[np.ndarray, np.ndarray]:
            if parts is None:
                return np.zeros((0, self._unknowns)), np.zeros(0)
            values = np.zeros(len(rows))
            for place, part in parts:
                values[place] = part
            change = None
            if self.multipliers is not None:
                change = self.multipliers.coefficients_of(contact)
            read = self._read(contact, rows, change)
            _, lift = self._stiffness.reduce(self._unknowns)
            derivative = read @ lift
            return derivative, values - derivative @ self._w_A

        return together(model.space.comm, affine)

    def _add_column(self, local: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Add a field to z, and return its places at degrees of freedom of this rank.

        Args:
            local: Degrees of freedom of this rank that are read.
            rows: Global numbers of all that are read, shape (n,).
        """
        place = places_of(self._model.space.global_dofs(local), rows)
        column = np.full(self._model.fixed.size, -1)
        column[local] = self.size + place
        self.columns.append(column)
        self.size += len(rows)
        return place

    def _reading(self, contact: int | None) -> Reading:
        """Return what forces on u, or on the jump of a contact, are; collective."""
        layer, model = self._stiffness.layer, self._model
        rows, local = layer.numbers, layer.local
        if not self._forms.method.in_layer:
            rows, local = rows[: layer.contact_size], local[layer.place < layer.contact_size]
        if contact is not None:
            # Supports may fix the node on this side alone.
            here = np.unique(dofs_of(model.connections.pairs[contact][:, 0], model.space.d))
            rows = np.union1d(rows, here)
            visible = dofs_of(np.unique(model.contacts[contact].trace.here.nodes), model.space.d)
            local = np.union1d(local, visible)
        row_of = np.full(model.fixed.size, -1)
        row_of[local] = places_of(model.space.global_dofs(local), rows)
        matrix: csr_array | None = None
        if self._on_first:
            matrix = self._read(contact, rows, None)[:, : self._unknowns]
        return Reading(row_of, matrix)

    def _read(self, contact: int | None, rows: np.ndarray, change: Entries | None) -> csr_array:
        """Return the matrix from unknowns L to u or to a jump, on rank 0.

        Args:
            contact: Number of the contact between bodies, else None.
            rows: Global degrees of freedom that are read, shape (n,).
            change: The change to Bernstein coefficients at contact nodes; None without.
        """
        row, column, value = rows, rows, np.ones(len(rows))
        if contact is not None:
            connections = self._model.connections
            entries = connections.there_in_jumps(connections.pairs[contact])
            row, column, value = (
                np.concatenate(parts) for parts in zip((row, column, value), entries, strict=True)
            )
        read = self._stiffness.basis.read(len(rows), places_of(row, rows), column, value)
        if change is None:
            return read
        return change.matrix(rows, rows, identity=True) @ read

    def set_reactions(self, matrix: np.ndarray, loads: np.ndarray) -> None:
        """Set the multipliers in Z by the reactions ``K u_A - b_A``, on rank 0.

        Args:
            matrix: K [force/length], shape (A, A).
            loads: b_A [force], shape (A,).
        """
        if not self._on_first or self.multipliers is None:
            return
        basis = self._stiffness.basis
        first = self._first_multiplier
        parts = [(self.derivative[:first], self.constant[:first])]
        for nodes, entries in zip(
            self.multipliers.contacts, self.multipliers.multipliers, strict=True
        ):
            dofs = dofs_of(nodes.here, self._model.space.d)
            places = places_of(entries.rows, dofs)
            by_forces = basis.read(len(dofs), places, entries.columns, entries.values)
            of_reactions = by_forces[:, : self._unknowns]
            parts.append((of_reactions @ matrix, -of_reactions @ loads))
        self._set_rows(parts)
