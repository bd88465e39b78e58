"""The multipliers of a contact problem as linear functions of the nodal forces.

The force is the reaction, what the elastic equations leave at the nodes of the contact.
The multiplier of a node belongs to the first contact that has the node. There ``a
lambda`` is the force less the multipliers of later contacts. At the nodes of earlier
contacts, and for components that a support fixes, it is the mean of its neighbours in
the contact: its own would be redundant. Where a jump is a sum of unknowns, the contacts
share the forces (:mod:`erc_contact.newton.shared_forces`).

For degree 2, the equations of a multiplier use Bernstein coefficients of u and lambda
instead of nodal values. With the coefficients ``c = C u``, the forces on them are
``C^-T`` times the forces at the nodes.

All this is a sparse matrix for each contact. The full problem applies it on each rank
to its own nodes (:class:`Reactions`). The condensed problem multiplies it by the
stiffness of the contact on rank 0 (:mod:`erc_contact.newton.condensed`).

Symbols: A free degrees of freedom of the contact nodes, a area of a node, d dimension,
m nodes of a facet.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from petsc4py import PETSc

from erc_contact.base.sparse import diagonal, sparse, sparse_like
from erc_contact.mesh.simplex import at_nodes, coefficients
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.model.trace import dofs_of
from erc_contact.newton.jump_sums import JumpSums
from erc_contact.newton.shared_forces import Entries, SharedNodes, among, shared_nodes, shares

NO_ENTRY = 1e-14
"""Entry of a matrix of Bernstein coefficients that is round-off [-]."""


@dataclass(frozen=True, eq=False)
class ContactNodes:
    """Hold the nodes and facets of a contact of all ranks, the same on all ranks.

    Attributes:
        numbers: Global numbers of the nodes, ascending, shape (n,).
        facets: Nodes of each facet as places in `numbers`, shape (f, m).
        area: Areas of the nodes [length^(d-1)], shape (n,).
        stiffness: Stiffness of the bodies over these areas, that of two bodies as of
            springs in a row [force/length], shape (n,).
        free: Components that no support fixes, shape (n, d).
    """

    numbers: np.ndarray
    facets: np.ndarray
    area: np.ndarray
    stiffness: np.ndarray
    free: np.ndarray


def contact_nodes(model: Model, contact: BoundContact) -> ContactNodes:
    """Gather the nodes and facets of a contact; collective."""
    side = contact.trace.here
    nodes = side.nodes[side.owned]
    m = nodes.shape[1]
    shares = np.repeat(side.areas[side.owned][:, None] / m, m, axis=1)
    springs = shares * contact.trace.stiffness[side.owned][:, None]
    free = ~model.coordinates.fixed[nodes]
    parts = model.comm.allgather((model.global_numbers(nodes), shares, springs, free))
    all_numbers, all_shares, all_springs, all_free = (
        np.concatenate(part) for part in zip(*parts, strict=True)
    )
    numbers, place = np.unique(all_numbers.ravel(), return_inverse=True)
    area = np.bincount(place, all_shares.ravel())
    stiffness = np.bincount(place, all_springs.ravel())
    free = np.zeros((len(numbers), model.d), dtype=bool)
    free[place] = all_free.reshape(-1, model.d)
    return ContactNodes(numbers, place.reshape(-1, m), area, stiffness, free)


class MultiplierMap:
    """Hold the matrices from nodal forces to multipliers, the same on all ranks.

    Construction is collective.

    Args:
        model: The scene on a mesh.

    Attributes:
        contacts: Nodes and facets of each contact.
        numbers: Global numbers of the nodes of all contacts, ascending, shape (N,).
        free: Components that have an equation: no support fixes them, and they do work
            on a contact, shape (N, d).
        is_shared: Nodes whose forces contacts share, shape (N,).
        area: Area of the nodes in the contact that their multiplier belongs to
            [length^(d-1)], shape (N,).
        multipliers: For each contact the matrix from nodal forces at A [force] to the
            Bernstein coefficients of the multiplier [force/area].
        coefficients: C at A; None for degree 1.
        on_foundations: C of the displacements of contacts with foundations alone, where
            there are others beside; else None.
        jumps: For each contact the matrix from the unknowns to those Bernstein
            coefficients of its jump that are sums of several; empty where none is.
    """

    def __init__(self, model: Model) -> None:
        self._d = model.d
        self._degree = model.degree
        self.contacts = [contact_nodes(model, contact) for contact in model.contacts]
        shared = shared_nodes(model, JumpSums(model, with_foundations=True))
        of_contacts = [c.numbers for c in self.contacts]
        if shared is not None:
            of_contacts.append(shared.numbers)
        self.numbers = np.unique(np.concatenate(of_contacts))
        self._places = [np.searchsorted(self.numbers, c.numbers) for c in self.contacts]
        self.free = np.zeros((len(self.numbers), model.d), dtype=bool)
        self.area = np.ones(len(self.numbers))
        # From the last contact to the first, so that the first one has the last word.
        for contact, places in zip(self.contacts[::-1], self._places[::-1], strict=True):
            self.free[places] = contact.free
            self.area[places] = contact.area
        self.is_shared = np.zeros(len(self.numbers), dtype=bool)
        if shared is not None:
            places = np.searchsorted(self.numbers, shared.numbers)
            self.is_shared[places] = True
            self.free[places] = shared.has_equation

        self.coefficients: Entries | None = None
        self.on_foundations: Entries | None = None
        forces = diagonal(self.free.ravel().astype(float))
        if model.degree > 1:
            to_coefficients = coefficients(model.d - 1, model.degree)
            change = self._change_of_basis(to_coefficients, self.contacts)
            self.coefficients = self._entries(change)
            change.destroy()
            if not model.coordinates.is_identity:
                on_foundations = []
                for of_contact, bound in zip(self.contacts, model.contacts, strict=True):
                    if bound.against is None:
                        on_foundations.append(of_contact)
                if on_foundations:
                    change = self._change_of_basis(
                        to_coefficients, on_foundations, everywhere=True
                    )
                    self.on_foundations = self._entries(change)
                    change.destroy()
            forces.destroy()
            to_forces = at_nodes(model.d - 1, model.degree).T
            forces = self._change_of_basis(to_forces, self.contacts)
        matrices = self._from_forces(forces)
        forces.destroy()
        self.jumps: list[Entries] = []
        self.shares_of_area: list[Entries] = []
        self.shared: SharedNodes | None = None
        if shared is not None:
            self.shared = shared
            self._share(shared, matrices)
            self.jumps = [self._sums(k, shared.jumps[k]) for k in range(len(matrices))]
            if self.coefficients is not None:
                self._replace_coefficients(self.coefficients)
        self.multipliers = [self._entries(matrix) for matrix in matrices]
        for matrix in matrices:
            matrix.destroy()

    def _from_forces(self, forces: PETSc.Mat) -> list[PETSc.Mat]:
        """Return the matrices from nodal forces to the multipliers of all contacts.

        At shared nodes the multipliers are means of neighbours.

        Args:
            forces: The matrix from nodal forces to those on Bernstein coefficients; it
                becomes that to the forces that earlier contacts leave, in place.
        """
        maps = []
        for k in reversed(range(len(self.contacts))):
            earlier = self.is_shared.copy()
            for places in self._places[:k]:
                earlier[places] = True
            active = self.contacts[k].free & ~earlier[self._places[k]][:, None]
            completion = self._completion(k, active)
            of_contact = completion.matMult(forces)
            maps.append(of_contact)

            # What a node of an earlier contact has here, that one need not bear.
            passive_area = np.zeros(self.free.shape)
            area = self.contacts[k].area[:, None]
            passive_area[self._places[k]] = np.where(active, 0.0, area)
            if passive_area.any():
                bearing = diagonal(passive_area.ravel())
                borne = bearing.matMult(of_contact)
                forces.axpy(-1.0, borne)
                bearing.destroy()
                borne.destroy()
            completion.destroy()
        return maps[::-1]

    def _share(self, shared: SharedNodes, matrices: list[PETSc.Mat]) -> None:
        """Add to multipliers what the forces of shared nodes leave, in place.

        Args:
            shared: These nodes.
            matrices: Those from nodal forces to the multipliers of all contacts.
        """
        dofs = dofs_of(self.numbers, self._d)
        areas = []
        for contact, places in zip(self.contacts, self._places, strict=True):
            area = np.zeros(self.free.shape)
            area[places] = contact.area[:, None]
            areas.append(area.ravel())

        # What means of neighbours leave of the forces.
        is_shared = self.free & self.is_shared[:, None]
        rest = diagonal(is_shared.ravel().astype(float))
        for k, matrix in enumerate(matrices):
            force = _scaled(areas[k], matrix)
            if self._degree > 1:
                of_facet = coefficients(self._d - 1, self._degree).T
                force = self._in_other_basis(k, of_facet, force)
            jump = among(dofs, shared.jumps[k])
            borne = jump.transposeMatMult(force)
            rest.axpy(-1.0, borne)
            for done in (force, jump, borne):
                done.destroy()

        springs = []
        for contact, jumps in zip(self.contacts, shared.jumps, strict=True):
            place = np.searchsorted(contact.numbers, jumps.rows // self._d)
            springs.append(contact.stiffness[place])
        for k, share in enumerate(shares(shared.jumps, springs)):
            to_contact = among(dofs, share)
            force = to_contact.matMult(rest)
            if self._degree > 1:
                of_facet = at_nodes(self._d - 1, self._degree).T
                force = self._in_other_basis(k, of_facet, force)
            inverse = np.divide(1.0, areas[k], out=np.zeros_like(areas[k]), where=areas[k] > 0)
            of_area = inverse[np.searchsorted(dofs, share.rows)]
            self.shares_of_area.append(Entries(share.rows, share.columns, of_area * share.values))
            added = _scaled(inverse, force)
            matrices[k].axpy(1.0, added)
            for done in (to_contact, force, added):
                done.destroy()
        rest.destroy()

    def _in_other_basis(self, k: int, of_facet: np.ndarray, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return a matrix with its rows in another basis of a contact; destroy it."""
        change = self._change_of_basis(of_facet, [self.contacts[k]], everywhere=True)
        result = change.matMult(matrix)
        change.destroy()
        matrix.destroy()
        return result

    def _sums(self, k: int, jumps: Entries) -> Entries:
        """Return the coefficients of a jump that are sums, from the unknowns.

        Args:
            k: Place of the contact.
            jumps: The rows of its jump at shared nodes.
        """
        contact = self.contacts[k]
        is_sum = self.is_shared[self._places[k]]
        if self._degree == 1:
            return jumps
        # A coefficient of a facet is that of values at several of its nodes.
        of_facets = np.zeros(len(is_sum), dtype=bool)
        of_facets[contact.facets[is_sum[contact.facets].any(axis=1)]] = True
        dofs = dofs_of(self.numbers, self._d)
        others = dofs_of(contact.numbers[~is_sum], self._d)
        rows = np.concatenate([jumps.rows, others])
        columns = np.concatenate([jumps.columns, others])
        values = np.concatenate([jumps.values, np.ones(len(others))])
        of_facet = coefficients(self._d - 1, self._degree)
        matrix = self._in_other_basis(k, of_facet, among(dofs, Entries(rows, columns, values)))
        entries = self._entries(matrix)
        matrix.destroy()
        used = np.isin(entries.rows // self._d, contact.numbers[of_facets])
        return Entries(entries.rows[used], entries.columns[used], entries.values[used])

    def _completion(self, k: int, active: np.ndarray) -> PETSc.Mat:
        """Return the matrix from forces to the multiplier of one contact alone.

        It divides by areas, and takes means over neighbours where a component is not
        active.

        Args:
            k: Place of the contact.
            active: Components with a multiplier of their own, shape (n, d).
        """
        contact = self.contacts[k]
        places = self._places[k]
        node, component = np.nonzero(active)
        i, j = _neighbours(contact.facets, ~active.all(axis=1))
        pair, pair_component = np.nonzero(~active[i] & active[j])
        i, j = i[pair], j[pair]
        count = np.zeros(active.shape)
        np.add.at(count, (i, pair_component), 1.0)

        own_value = 1.0 / contact.area[node]
        mean_value = 1.0 / (count[i, pair_component] * contact.area[j])
        own_dof = places[node] * self._d + component
        rows = np.concatenate([own_dof, places[i] * self._d + pair_component])
        columns = np.concatenate([own_dof, places[j] * self._d + pair_component])
        return sparse(self.free.size, self.free.size, rows, columns, [own_value, mean_value])

    def _replace_coefficients(self, coefficients: Entries) -> None:
        """Replace the rows of C that depend on jumps at shared nodes, but for those."""
        d = self._d
        rows, columns, values = [], [], []
        done = self.numbers[self.is_shared]
        free = dofs_of(self.numbers, d)[self.free.ravel()]
        for jumps in self.jumps:
            used = ~np.isin(jumps.rows // d, done)
            used &= np.isin(jumps.rows, free) & np.isin(jumps.columns, free)
            rows.append(jumps.rows[used])
            columns.append(jumps.columns[used])
            values.append(jumps.values[used])
            done = np.union1d(done, jumps.rows // d)
        # An unknown that is on side 1 of no contact has no coefficient beside its value.
        alone = np.setdiff1d(free, coefficients.rows)
        rows.append(alone)
        columns.append(alone)
        values.append(np.ones(len(alone)))
        replaced = np.concatenate(rows)
        kept = ~np.isin(coefficients.rows, replaced)
        self.coefficients = Entries(
            np.concatenate([coefficients.rows[kept], replaced]),
            np.concatenate([coefficients.columns[kept], *columns]),
            np.concatenate([coefficients.values[kept], *values]),
        )

    def _change_of_basis(
        self, of_facet: np.ndarray, contacts: list[ContactNodes], *, everywhere: bool = False
    ) -> PETSc.Mat:
        """Return a change of basis of polynomials on facets as a matrix for A.

        Args:
            of_facet: The change on a facet, (m, m), the same from all facets of a node.
            contacts: The contacts with these facets.
            everywhere: Whether components count that are not free.
        """
        p, q = np.nonzero(abs(of_facet) > NO_ENTRY)
        size = len(self.numbers)
        keys = []
        values = []
        for contact in contacts:
            nodes = np.searchsorted(self.numbers, contact.numbers)[contact.facets]
            keys.append((nodes[:, p] * size + nodes[:, q]).ravel())
            values.append(np.tile(of_facet[p, q], len(nodes)))
        # Facets that share two nodes give the same entry, which counts once.
        unique, first = np.unique(np.concatenate(keys), return_index=True)
        value = np.concatenate(values)[first]
        i, j = np.divmod(unique, size)
        pair, component = np.nonzero((self.free[i] & self.free[j]) | everywhere)
        rows = i[pair] * self._d + component
        columns = j[pair] * self._d + component
        return sparse(self.free.size, self.free.size, rows, columns, [value[pair]])

    def _entries(self, matrix: PETSc.Mat) -> Entries:
        """Return the entries of a matrix between the nodes of all contacts."""
        begin, columns, values = matrix.getValuesCSR()
        rows = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
        dofs = dofs_of(self.numbers, self._d)
        return Entries(dofs[rows], dofs[columns], values)


class Reactions:
    """Map nodal forces to multipliers, each rank for its own nodes.

    Construction and products are collective.

    Args:
        model: The scene on a mesh.
        like: A matrix for the degrees of freedom of the model.

    Attributes:
        free: Which degrees of freedom of the nodes that this rank owns are in A, shape
            (nodes, d).
        area: Area of these nodes in the contact that their multiplier belongs to
            [length^(d-1)], elsewhere 1, shape (nodes,).
        matrices: For each contact the matrix from nodal forces [force] to the Bernstein
            coefficients of the multiplier [force/area].
        coefficients: C at A; None for degree 1.
    """

    def __init__(self, model: Model, like: PETSc.Mat) -> None:
        multiplier_map = MultiplierMap(model)
        low, high = model.V.dofmap.index_map.local_range
        owned = (multiplier_map.numbers >= low) & (multiplier_map.numbers < high)
        nodes = multiplier_map.numbers[owned] - low
        self.free = np.zeros((high - low, model.d), dtype=bool)
        self.free[nodes] = multiplier_map.free[owned]
        self.area = np.ones(high - low)
        self.area[nodes] = multiplier_map.area[owned]
        self.matrices = [_distributed(like, entries) for entries in multiplier_map.multipliers]
        self.shared = multiplier_map.shared
        self.shares = multiplier_map.shares_of_area
        self.coefficients: PETSc.Mat | None = None
        if multiplier_map.coefficients is not None:
            self.coefficients = _distributed(like, multiplier_map.coefficients)

    def destroy(self) -> None:
        """Free PETSc's objects."""
        for matrix in self.matrices:
            matrix.destroy()
        if self.coefficients is not None:
            self.coefficients.destroy()


def _distributed(like: PETSc.Mat, entries: Entries) -> PETSc.Mat:
    """Make a matrix of all ranks from entries that all of them have; collective."""
    low, high = like.getOwnershipRange()
    owned = (entries.rows >= low) & (entries.rows < high)
    matrix = sparse_like(like, entries.rows[owned], entries.columns[owned])
    matrix.setValuesCOO(entries.values[owned])
    return matrix


def _scaled(factors: np.ndarray, matrix: PETSc.Mat) -> PETSc.Mat:
    """Return a matrix with its rows times factors, a new one."""
    result = matrix.copy()
    scale = result.createVecLeft()
    scale.array[:] = factors
    result.diagonalScale(L=scale)
    scale.destroy()
    return result


def _neighbours(facets: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of different nodes that have a facet in common, each once.

    Args:
        facets: Nodes of the facets, shape (f, m).
        first: Which nodes may be the first of a pair, shape (n,).
    """
    # A pair as one number: to sort numbers is faster than to sort rows of a table.
    keys = []
    for p, q in permutations(range(facets.shape[1]), 2):
        begins = first[facets[:, p]]
        keys.append(facets[begins, p] * len(first) + facets[begins, q])
    return np.divmod(np.unique(np.concatenate(keys)), len(first))
