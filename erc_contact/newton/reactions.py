"""The multipliers of a contact problem as linear functions of the nodal forces.

The force is the reaction r, what the elastic equations leave at the nodes of the
contact. It does the work of forces g on what the contacts read, ``r = B^T g``
(:mod:`erc_contact.model.contact.groups`), a row of B for each node or pair. Where rows
are independent r tells g. The multiplier of a row belongs to the first contact that has
it. There ``area lambda`` is g less the multipliers of later contacts. In these, and for
components that a support fixes, it is the mean of its neighbours in the contact: its
own would be redundant.

Where the rows of a group are dependent, as the rows of three contacts of three bodies,
r does not tell all g. There is an estimate g0 besides: the force of multipliers that
are means of their neighbours. Of all forces that fit r the nearest to these are taken,
in the sense of ``sum |g - g0|^2 / k`` with the stiffness k of the bodies at each
contact, so that a soft body gets no force that stiff ones leave:

    g = g0 + k B (B^T k B)^+ (r - B^T g0).

A constant stress has so its own tractions. The order of the contacts does not matter.
Where a contact meets the sides of copies it has as many rows as there are copies of its
node there. They have one multiplier, as the one node of the whole: the mean of their
estimates, and stiffnesses like their areas. The sides take what is left, as if k were
infinite there.

For degree 2, the equations of a multiplier use Bernstein coefficients of u and lambda
instead of nodal values. With the coefficients ``c = C u``, the forces on them are
``C^-T`` times the forces at the nodes.

All this is a sparse matrix for each contact. The full problem applies it on each rank
to its own nodes (:class:`Reactions`). The condensed problem multiplies it by
the stiffness of the contact on rank 0 (:mod:`erc_contact.newton.condensed`).

Symbols: d dimension, m nodes of a facet, n rows, N nodes.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_array, diags_array, eye_array  # type: ignore[import-untyped]

from erc_contact.base.sparse import local_matrix
from erc_contact.model.contact.connections import gather_prescribed
from erc_contact.model.contact.groups import Groups
from erc_contact.model.contact.trace import NOBODY, dofs_of
from erc_contact.model.model import Model
from erc_contact.newton.contact_nodes import Entries, RowsOfAll, contact_nodes, neighbours
from namedmesh.for_solvers import components
from namedmesh.simplex import at_nodes, coefficients

BEYOND = 1e7
"""Stiffness of sides of copies, over the stiffness of bodies in a row [-]."""


class MultiplierMap:
    """Hold the matrices from nodal forces to multipliers, the same on all ranks.

    Construction is collective.

    Args:
        model: The scene on a mesh.

    Attributes:
        contacts: Nodes and facets of each contact.
        rows: What all contacts read.
        groups: B of these rows.
        free: Components of rows that not all supports fix, shape (n, d).
        is_shared: Free components of dependent rows, whose forces contacts share, shape
            (n, d).
        multipliers: For each contact the matrix from nodal forces [force] to the
            Bernstein coefficients of the multiplier at nodes of this side [force/area].
    """

    def __init__(self, model: Model) -> None:
        space = model.space
        self._model = model
        self.contacts = [contact_nodes(space, contact) for contact in model.contacts]
        rows = RowsOfAll(space.d, space.degree, self.contacts)
        self.rows = rows
        nodes = np.unique(np.concatenate([rows.here, rows.there[rows.there != NOBODY]]))
        free = ~gather_prescribed(space, nodes, model.fixed)
        frames = model.connections.frames(nodes)
        self.groups = Groups(rows.here, rows.there, nodes, free, frames)
        self._dofs = dofs_of(nodes, space.d)
        of_rows = (self.groups.group_of_row, slice(None), self.groups.slot_of_row)
        self.free = self.groups.jumps[of_rows].any(axis=2)
        is_independent = self.groups.is_independent
        self.is_shared = self.free & ~is_independent

        inverse = self.groups.inverse.swapaxes(2, 3)
        forces = self._from_nodes(inverse, self.free & is_independent)
        if space.degree > 1:
            to_forces = at_nodes(space.d - 1, space.degree).T
            every = range(len(self.contacts))
            change = rows.change_of_basis(to_forces, every, self.free & is_independent)
            forces = change @ forces
        matrices = self._from_forces(forces)
        if self.is_shared.any():
            matrices = self._with_shares(matrices)
        self.multipliers = [self._entries(matrix) for matrix in matrices]

    def coefficients_of(self, contact: int | None) -> Entries | None:
        """Return C of what readers read; None for degree 1.

        Args:
            contact: Number of a contact between bodies; None for all foundations.
        """
        space = self._model.space
        if space.degree == 1:
            return None
        numbers = self.numbers_of(contact)
        to_coefficients = coefficients(space.d - 1, space.degree)
        change = self.rows.change_of_basis(to_coefficients, numbers, self.free).tocoo()
        rows, columns = change.coords
        return Entries(self.rows.dofs[rows], self.rows.dofs[columns], change.data)

    def numbers_of(self, contact: int | None) -> list[int]:
        """Return the numbers of all foundations for None, else the contact alone."""
        if contact is not None:
            return [contact]
        return [k for k, bound in enumerate(self._model.contacts) if bound.against is None]

    def forces_on(self, numbers: list[int]) -> Entries:
        """Return the matrix from forces ``B^T e`` to e of some contacts.

        Where rows are dependent e are the least ones.
        """
        of_contacts = np.zeros(len(self.rows.here), dtype=bool)
        for number in numbers:
            of_contacts[self.rows.places[number]] = True
        used = self.free & of_contacts[:, None]
        return self._entries(self._from_nodes(self.groups.inverse.swapaxes(2, 3), used))

    def free_at(self, numbers: list[int]) -> np.ndarray:
        """Return which components of the rows of contacts are read, (n, d).

        They are in the order of :meth:`areas_of`.
        """
        used = np.zeros(len(self.rows.here), dtype=bool)
        for number in numbers:
            used[self.rows.places[number]] = True
        return self.free[used]

    def areas_of(self, numbers: list[int]) -> tuple[np.ndarray, np.ndarray]:
        """Return here-nodes of contacts, and areas in each node's first contact."""
        area = np.zeros(len(self.rows.here))
        for number in reversed(numbers):
            area[self.rows.places[number]] = self.contacts[number].area
        used = area > 0
        return self.rows.here[used], area[used]

    def _from_nodes(self, blocks: np.ndarray, used: np.ndarray) -> csr_array:
        """Return a matrix from nodes to rows of B.

        Args:
            blocks: Its blocks, shape (G, d, R, C).
            used: Components of rows that are not zero, shape (n, d).
        """
        rows, columns, values = self.groups.from_nodes(blocks)
        is_used = used.ravel()[rows]
        columns = np.searchsorted(self._dofs, columns[is_used])
        shape = (used.size, len(self._dofs))
        return local_matrix(shape, rows[is_used], columns, values[is_used])

    def _entries(self, matrix: csr_array) -> Entries:
        """Return the entries of a matrix from nodes to rows, by nodes of this side."""
        entries = matrix.tocoo()
        rows, columns = entries.coords
        used = entries.data != 0
        return Entries(self.rows.dofs[rows[used]], self._dofs[columns[used]], entries.data[used])

    def _from_forces(self, forces: csr_array) -> list[csr_array]:
        """Return the matrices from nodal forces to the multipliers of all contacts.

        The multipliers of dependent rows are means of neighbours.

        Args:
            forces: The matrix from nodal forces to forces on Bernstein coefficients of
                rows.
        """
        maps = []
        for k in reversed(range(len(self.contacts))):
            places = self.rows.places[k]
            earlier = np.zeros(len(self.rows.here), dtype=bool)
            for of_earlier in self.rows.places[:k]:
                earlier[of_earlier] = True
            active = (self.free & ~self.is_shared)[places] & ~earlier[places][:, None]
            of_contact = self._completion(k, active) @ forces
            maps.append(of_contact)

            # What a row of an earlier contact has here, that one need not bear.
            passive_area = np.zeros(self.free.shape)
            passive_area[places] = np.where(active, 0.0, self.contacts[k].area[:, None])
            if passive_area.any():
                forces = forces - diags_array(passive_area.ravel()) @ of_contact
        return maps[::-1]

    def _completion(self, k: int, active: np.ndarray) -> csr_array:
        """Return the matrix from forces to the multiplier of one contact alone.

        It divides by areas, and takes means over neighbours where a component is not
        active.

        Args:
            k: Place of the contact.
            active: Components with a multiplier of their own, shape (n, d).
        """
        d = self.rows.d
        contact = self.contacts[k]
        places = self.rows.places[k]
        node, component = np.nonzero(active)
        i, j = neighbours(contact.facets, ~active.all(axis=1))
        pair, pair_component = np.nonzero(~active[i] & active[j])
        i, j = i[pair], j[pair]
        count = np.zeros(active.shape)
        np.add.at(count, (i, pair_component), 1.0)

        own_value = 1.0 / contact.area[node]
        mean_value = 1.0 / (count[i, pair_component] * contact.area[j])
        own_dof = places[node] * d + component
        rows = np.concatenate([own_dof, places[i] * d + pair_component])
        columns = np.concatenate([own_dof, places[j] * d + pair_component])
        values = np.concatenate([own_value, mean_value])
        return local_matrix((self.free.size, self.free.size), rows, columns, values)

    def _with_shares(self, estimates: list[csr_array]) -> list[csr_array]:
        """Return the matrices with what dependent rows have besides: forces fit r.

        Args:
            estimates: The matrices from nodal forces to multipliers before.
        """
        rows, groups = self.rows, self.groups
        stiffness = np.zeros(len(rows.here))
        copies, of_sides = self._copies()
        means = []
        for k in reversed(range(len(self.contacts))):
            mean, stiffness[rows.places[k]] = self._of_copies(k, copies)
            means.append(mean)
        stiffness[of_sides] *= BEYOND
        of_copies = zip(estimates, means[::-1], strict=True)
        estimates = [matrix if mean is None else mean @ matrix for matrix, mean in of_copies]
        jumps = self._from_nodes(groups.jumps, self.free)
        # What the estimates leave of r, where forces are shared.
        missing = eye_array(len(self._dofs), format="csr")
        scales = [np.repeat(area, rows.d) for area in rows.areas]
        for k, matrix in enumerate(estimates):
            force = diags_array(scales[k]) @ matrix
            if rows.degree > 1:
                of_facet = coefficients(rows.d - 1, rows.degree).T
                force = rows.change_of_basis(of_facet, [k]) @ force
            missing = missing - jumps.T @ force

        share = self._from_nodes(groups.shares(stiffness), self.is_shared) @ missing
        matrices = []
        done = np.zeros(len(rows.here), dtype=bool)
        for k, scale in enumerate(scales):
            first = np.zeros(len(rows.here), dtype=bool)
            first[rows.places[k]] = True
            first &= ~done
            done |= first
            force = diags_array(np.repeat(first, rows.d).astype(float)) @ share
            if rows.degree > 1:
                of_facet = at_nodes(rows.d - 1, rows.degree).T
                force = rows.change_of_basis(of_facet, [k]) @ force
            inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
            matrices.append(estimates[k] + diags_array(inverse) @ force)
        return matrices

    def _copies(self) -> tuple[np.ndarray, np.ndarray]:
        """Number rows at copies of a node alike, and mark rows of sides, (n,) each.

        Rows of sides, and rows that are not shared, have a number of their own.
        """
        rows, numbers = self.rows, self.groups.numbers
        of_sides = np.zeros(len(rows.here), dtype=bool)
        for contact, places in zip(self._model.contacts, rows.places, strict=True):
            of_sides[places] |= contact.is_periodic
        pairs = np.column_stack([rows.here[of_sides], rows.there[of_sides]])
        copies = components(len(numbers), np.searchsorted(numbers, pairs))
        own_number = len(numbers) + np.arange(len(rows.here))
        has_copies = self.is_shared.any(axis=1) & ~of_sides
        of_rows = copies[np.searchsorted(numbers, rows.here)]
        return np.where(has_copies, of_rows, own_number), of_sides

    def _of_copies(self, k: int, copies: np.ndarray) -> tuple[csr_array | None, np.ndarray]:
        """Return the mean of multipliers over copies of nodes, and stiffnesses.

        Args:
            k: Place of the contact.
            copies: A number for each row, as :meth:`_copies` returns it.

        Returns:
            The matrix between multipliers of the contact, None where no row has a copy;
            and the stiffness of each row of the contact [force/length].
        """
        contact, places, d = self.contacts[k], self.rows.places[k], self.rows.d
        _, of_row = np.unique(copies[places], return_inverse=True)
        if len(np.unique(of_row)) == len(places):
            return None, contact.stiffness
        area = np.bincount(of_row, contact.area)
        stiffness = np.bincount(of_row, contact.stiffness) / area
        # Vectors of the rows in the frame of their group, where copies are the same.
        row, component = (part.ravel() for part in np.indices((len(places), d)))
        turned = self.groups.frames_of_rows.at(places[row]).entries(
            None, component, np.ones(len(row))
        )
        entry, of_vector, _, values = turned
        at_rows = places[row[entry]] * d + of_vector
        at_copies = of_row[row[entry]] * d + component[entry]
        shape = (len(self.rows.here) * d, len(area) * d)
        row = row[entry]
        spread = local_matrix(shape, at_rows, at_copies, values / area[of_row[row]])
        gather = local_matrix(shape[::-1], at_copies, at_rows, values * contact.area[row])
        return spread @ gather, contact.area * stiffness[of_row]


class Reactions:
    """Map nodal forces to multipliers, each rank for its own nodes.

    Construction and products are collective.

    Args:
        model: The scene on a mesh.

    Attributes:
        map: The matrices, the same on all ranks.
        is_read: Which degrees of freedom of this rank contacts read, shape (owned,).
        matrices: For each contact the matrix from nodal forces [force] to the Bernstein
            coefficients of the multiplier [force/area].
    """

    def __init__(self, model: Model) -> None:
        space = model.space
        self.map = MultiplierMap(model)
        self._model = model
        groups = self.map.groups
        owned, nodes = space.find_owned(groups.numbers)
        is_free = groups.is_free[groups.group, :, groups.slot]
        is_read = np.zeros((space.V.dofmap.index_map.size_local, space.d), dtype=bool)
        is_read[nodes] = is_free[owned]
        self.is_read = is_read.ravel()
        self.matrices = []
        for entries in self.map.multipliers:
            self.matrices.append(entries.of_all_ranks(space))

    def reading(self, contact: int | None) -> PETSc.Mat | None:
        """Return B from u to what a reader reads, None for I; collective.

        At degree 2 these are Bernstein coefficients. It is I at nodes that are not
        read.

        Args:
            contact: Number of a contact between bodies; None for all foundations.
        """
        change = self.map.coefficients_of(contact)
        jump: PETSc.Mat | None = None
        if contact is not None:
            jump = self._model.connections.jump(contact)
        if change is None:
            return None if jump is None else jump.copy()
        matrix = change.of_all_ranks(self._model.space, identity=True)
        if jump is None:
            return matrix
        result = matrix.matMult(jump)
        matrix.destroy()
        return result

    def destroy(self) -> None:
        """Free PETSc's objects."""
        for matrix in self.matrices:
            matrix.destroy()
