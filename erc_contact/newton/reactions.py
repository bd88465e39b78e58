"""The multipliers of a contact problem as linear functions of the nodal forces.

The force is the reaction, what the elastic equations leave at the nodes of the contact.
The multiplier of a node belongs to the first contact that has the node. There ``a
lambda`` is the force less the multipliers of later contacts. At the nodes of earlier
contacts, and for components that a support fixes, it is the mean of its neighbours in
the contact: its own would be redundant.

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
from erc_contact.newton.jump_sums import raise_at_joints

NO_ENTRY = 1e-14
"""Entry of a matrix of Bernstein coefficients that is round-off [-]."""


@dataclass(frozen=True, eq=False)
class Entries:
    """Hold the entries of a sparse matrix, which add up where they coincide.

    Attributes:
        rows: Global degrees of freedom, shape (n,).
        columns: Global degrees of freedom, shape (n,).
        values: Shape (n,).
    """

    rows: np.ndarray
    columns: np.ndarray
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class ContactNodes:
    """Hold the nodes and facets of a contact of all ranks, the same on all ranks.

    Attributes:
        numbers: Global numbers of the nodes, ascending, shape (n,).
        facets: Nodes of each facet as places in `numbers`, shape (f, m).
        area: Areas of the nodes [length^(d-1)], shape (n,).
        free: Components that no support fixes, shape (n, d).
    """

    numbers: np.ndarray
    facets: np.ndarray
    area: np.ndarray
    free: np.ndarray


def contact_nodes(model: Model, contact: BoundContact) -> ContactNodes:
    """Gather the nodes and facets of a contact; collective."""
    side = contact.trace.here
    nodes = side.nodes[side.owned]
    m = nodes.shape[1]
    shares = np.repeat(side.areas[side.owned][:, None] / m, m, axis=1)
    free = ~model.coordinates.fixed[nodes]
    parts = model.comm.allgather((model.global_numbers(nodes), shares, free))
    all_numbers, all_shares, all_free = (np.concatenate(part) for part in zip(*parts, strict=True))
    numbers, place = np.unique(all_numbers.ravel(), return_inverse=True)
    area = np.bincount(place, all_shares.ravel())
    free = np.zeros((len(numbers), model.d), dtype=bool)
    free[place] = all_free.reshape(-1, model.d)
    return ContactNodes(numbers, place.reshape(-1, m), area, free)


class MultiplierMap:
    """Hold the matrices from nodal forces to multipliers, the same on all ranks.

    Construction is collective.

    Args:
        model: The scene on a mesh.

    Attributes:
        contacts: Nodes and facets of each contact.
        numbers: Global numbers of the nodes of all contacts, ascending, shape (N,).
        free: Components that no support fixes, shape (N, d).
        area: Area of the nodes in the contact that their multiplier belongs to
            [length^(d-1)], shape (N,).
        multipliers: For each contact the matrix from nodal forces at A [force] to the
            Bernstein coefficients of the multiplier [force/area].
        coefficients: C at A; None for degree 1.
        on_foundations: C of the displacements of contacts with foundations alone, where
            there are others beside; else None.
    """

    def __init__(self, model: Model) -> None:
        raise_at_joints(model)
        self._d = model.d
        self.contacts = [contact_nodes(model, contact) for contact in model.contacts]
        self.numbers = np.unique(np.concatenate([c.numbers for c in self.contacts]))
        self._places = [np.searchsorted(self.numbers, c.numbers) for c in self.contacts]
        self.free = np.zeros((len(self.numbers), model.d), dtype=bool)
        self.area = np.ones(len(self.numbers))
        # From the last contact to the first, so that the first one has the last word.
        for contact, places in zip(self.contacts[::-1], self._places[::-1], strict=True):
            self.free[places] = contact.free
            self.area[places] = contact.area

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
                    change = self._change_of_basis(to_coefficients, on_foundations)
                    self.on_foundations = self._entries(change)
                    change.destroy()
            forces.destroy()
            to_forces = at_nodes(model.d - 1, model.degree).T
            forces = self._change_of_basis(to_forces, self.contacts)
        self.multipliers = self._from_forces(forces)
        forces.destroy()

    def _from_forces(self, forces: PETSc.Mat) -> list[Entries]:
        """Return the matrices from nodal forces to the multipliers of all contacts.

        Args:
            forces: The matrix from nodal forces to those on Bernstein coefficients; it
                becomes that to the forces that earlier contacts leave, in place.
        """
        maps = []
        for k in reversed(range(len(self.contacts))):
            earlier = np.zeros(len(self.numbers), dtype=bool)
            for places in self._places[:k]:
                earlier[places] = True
            active = self.contacts[k].free & ~earlier[self._places[k]][:, None]
            completion = self._completion(k, active)
            of_contact = completion.matMult(forces)
            maps.append(self._entries(of_contact))

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
            of_contact.destroy()
        return maps[::-1]

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

    def _change_of_basis(self, of_facet: np.ndarray, contacts: list[ContactNodes]) -> PETSc.Mat:
        """Return a change of basis of polynomials on facets as a matrix for A.

        Args:
            of_facet: The change on a facet, (m, m), the same from all facets of a node.
            contacts: The contacts with these facets.
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
        pair, component = np.nonzero(self.free[i] & self.free[j])
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
