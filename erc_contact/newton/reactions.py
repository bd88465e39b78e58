"""The multipliers of a contact problem as linear functions of the nodal forces.

The force is the reaction, what the elastic equations leave at the nodes of the contact.
The multiplier of a node belongs to the first contact that has the node. There ``a
lambda`` is the force less the multipliers of later contacts. At the nodes of earlier
contacts, and for components that a support fixes, it is the mean of its neighbours in
the contact: its own would be redundant. Where a jump is a sum of unknowns, the contacts
share the forces (:mod:`erc_contact.newton.shared_multipliers`).

For degree 2, the equations of a multiplier use Bernstein coefficients of u and lambda
instead of nodal values. With the coefficients ``c = C u``, the forces on them are
``C^-T`` times the forces at the nodes.

All this is a sparse matrix for each contact. The full problem applies it on each rank
to its own nodes (:class:`Reactions`). The condensed problem multiplies it by
the stiffness of the contact on rank 0 (:mod:`erc_contact.newton.condensed`).

Symbols: A free degrees of freedom of the contact nodes, a area of a node, d dimension,
m nodes of a facet.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from erc_contact.base.sparse import diagonal, sparse, sparse_like
from erc_contact.mesh.simplex import at_nodes, coefficients
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model
from erc_contact.newton.contact_nodes import ContactNodes, Entries, NodesOfAll, neighbours
from erc_contact.newton.jump_sums import JumpSums, shared_nodes
from erc_contact.newton.shared_multipliers import SharedMultipliers


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
        area: Area of the nodes in the contact that their multiplier belongs to
            [length^(d-1)], shape (N,).
        multipliers: For each contact the matrix from nodal forces at A [force] to the
            Bernstein coefficients of the multiplier [force/area].
        coefficients: C at A; None for degree 1.
        on_foundations: C of the displacements of contacts with foundations alone, where
            there are others beside; else None.
        shared: What contacts share at nodes of several bodies; None without.
    """

    def __init__(self, model: Model) -> None:
        self.contacts = [contact_nodes(model, contact) for contact in model.contacts]
        shared = shared_nodes(model, JumpSums(model, with_foundations=True))
        more = np.zeros(0, dtype=np.int64) if shared is None else shared.numbers
        nodes = NodesOfAll(model.d, model.degree, self.contacts, more)
        self._nodes = nodes
        self.numbers = nodes.numbers
        self.free = np.zeros((len(self.numbers), model.d), dtype=bool)
        self.area = np.ones(len(self.numbers))
        # From the last contact to the first, so that the first one has the last word.
        for contact, places in zip(self.contacts[::-1], nodes.places[::-1], strict=True):
            self.free[places] = contact.free
            self.area[places] = contact.area
        self._is_shared = np.isin(self.numbers, more)
        if shared is not None:
            self.free[self._is_shared] = shared.has_equation

        self.coefficients: Entries | None = None
        self.on_foundations: Entries | None = None
        forces = diagonal(self.free.ravel().astype(float))
        if model.degree > 1:
            to_coefficients = coefficients(model.d - 1, model.degree)
            change = nodes.change_of_basis(to_coefficients, self.contacts, self.free)
            self.coefficients = nodes.entries(change)
            change.destroy()
            if not model.coordinates.is_identity:
                on_foundations = []
                for of_contact, bound in zip(self.contacts, model.contacts, strict=True):
                    if bound.against is None:
                        on_foundations.append(of_contact)
                if on_foundations:
                    change = nodes.change_of_basis(to_coefficients, on_foundations)
                    self.on_foundations = nodes.entries(change)
                    change.destroy()
            forces.destroy()
            to_forces = at_nodes(model.d - 1, model.degree).T
            forces = nodes.change_of_basis(to_forces, self.contacts, self.free)
        matrices = self._from_forces(forces)
        forces.destroy()
        self.shared: SharedMultipliers | None = None
        if shared is not None:
            self.shared = SharedMultipliers(nodes, shared, matrices)
            if self.coefficients is not None:
                self.coefficients = self.shared.replaced(self.coefficients)
        self.multipliers = [nodes.entries(matrix) for matrix in matrices]
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
            earlier = self._is_shared.copy()
            for places in self._nodes.places[:k]:
                earlier[places] = True
            active = self.contacts[k].free & ~earlier[self._nodes.places[k]][:, None]
            completion = self._completion(k, active)
            of_contact = completion.matMult(forces)
            maps.append(of_contact)

            # What a node of an earlier contact has here, that one need not bear.
            passive_area = np.zeros(self.free.shape)
            area = self.contacts[k].area[:, None]
            passive_area[self._nodes.places[k]] = np.where(active, 0.0, area)
            if passive_area.any():
                bearing = diagonal(passive_area.ravel())
                borne = bearing.matMult(of_contact)
                forces.axpy(-1.0, borne)
                bearing.destroy()
                borne.destroy()
            completion.destroy()
        return maps[::-1]

    def _completion(self, k: int, active: np.ndarray) -> PETSc.Mat:
        """Return the matrix from forces to the multiplier of one contact alone.

        It divides by areas, and takes means over neighbours where a component is not
        active.

        Args:
            k: Place of the contact.
            active: Components with a multiplier of their own, shape (n, d).
        """
        d = self._nodes.d
        contact = self.contacts[k]
        places = self._nodes.places[k]
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
        return sparse(self.free.size, self.free.size, rows, columns, [own_value, mean_value])


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
        shared: What contacts share at nodes of several bodies; None without.
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
