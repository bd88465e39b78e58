"""The nodes of all contacts with their areas, and matrices between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from dolfinx import fem
from petsc4py import PETSc
from scipy.sparse import csr_array  # type: ignore[import-untyped]

from erc_contact.base.sparse import local_matrix
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import NOBODY, dofs_of, places_of
from erc_contact.model.data.over_ranks import matrix_of_common_entries
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.base.ranks import of_all

NO_ENTRY = 1e-14
"""Entry of a matrix of Bernstein coefficients that is round-off [-]."""
PRESSING = 1e-5
"""Length by which a state is pressed, over the size of the displacement [-].

Where a point touches without pressure the equations of a contact have a kink. The
tangent at the state and the tangent under pressure differ there, and the second may be
singular alone. So both are looked at.
"""


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

    def of_all_ranks(self, space: Space, *, identity: bool = False) -> PETSc.Mat:
        """Make a matrix of all ranks, which all have these entries; collective.

        Args:
            space: The mesh.
            identity: Whether rows without entries are rows of the identity.
        """
        entries = self.rows, self.columns, self.values
        return matrix_of_common_entries(space, entries, self.rows if identity else None)

    def matrix(self, rows: np.ndarray, columns: np.ndarray, *, identity: bool) -> csr_array:
        """Make a matrix between degrees of freedom, on this rank.

        Args:
            rows: Numbers of its rows, shape (n,).
            columns: Numbers of its columns.
            identity: Whether rows without entries are rows of the identity.
        """
        row = places_of(self.rows, rows)
        column = places_of(self.columns, columns)
        others = np.setdiff1d(np.arange(len(rows)), row)
        if not identity:
            others = others[:0]
        return local_matrix(
            (len(rows), len(columns)),
            np.concatenate([row, others]),
            np.concatenate([column, others]),
            np.concatenate([self.values, np.ones(len(others))]),
        )


@dataclass(frozen=True, eq=False)
class Reading:
    """Tell what the forces of one reader are in the condensed problem.

    Attributes:
        row_of: Row of each degree of freedom of this rank, -1 without.
        matrix: From unknowns A to what is read at these rows, on rank 0; None
            elsewhere.
    """

    row_of: np.ndarray
    matrix: csr_array | None


@dataclass(frozen=True, eq=False)
class ContactNodes:
    """Hold the nodes and facets of a contact of all ranks, the same on all ranks.

    Attributes:
        here: Global numbers of the nodes on this side, ascending, shape (n,).
        there: Global numbers of the nodes of the other body, or ``NOBODY``, shape (n,).
        facets: Nodes of each facet as places in `here`, shape (f, m).
        area: Areas of the nodes [length^(d-1)], shape (n,).
        stiffness: Stiffness of the bodies over these areas, of two bodies as of springs
            in a row [force/length], shape (n,).
    """

    here: np.ndarray
    there: np.ndarray
    facets: np.ndarray
    area: np.ndarray
    stiffness: np.ndarray


def contact_nodes(space: Space, contact: ContactOnMesh) -> ContactNodes:
    """Gather the nodes and facets of a contact; collective."""
    trace = contact.trace
    side = trace.here
    nodes = side.nodes[side.owned]
    m = nodes.shape[1]
    shares = np.repeat(side.areas[side.owned][:, None] / m, m, axis=1)
    springs = shares * trace.stiffness[side.owned][:, None]
    there = np.full(side.nodes.shape, NOBODY)
    there[trace.facing] = space.global_numbers(trace.partners)
    all_here, all_there, all_shares, all_springs = of_all(
        space.comm, space.global_numbers(nodes), there[side.owned], shares, springs
    )
    here, first, place = np.unique(all_here.ravel(), return_index=True, return_inverse=True)
    area = np.bincount(place.ravel(), all_shares.ravel())
    stiffness = np.bincount(place.ravel(), all_springs.ravel())
    there = all_there.ravel()[first]
    return ContactNodes(here, there, place.reshape(-1, m), area, stiffness)


class RowsOfAll:
    """Number what all contacts read at their nodes: a *row* for each node or pair.

    Matrices between rows are of this rank.

    Args:
        d: The dimension.
        degree: Degree of the displacement.
        contacts: The nodes and facets of each contact.

    Attributes:
        d: The dimension.
        degree: Degree of the displacement.
        contacts: The nodes and facets of each contact.
        here: Global number of the node on this side of each row, shape (n,).
        there: Global number of the node of the other body, or ``NOBODY``, shape (n,).
        places: The rows of the nodes of each contact.
        areas: For each contact the areas of all rows, zero off the contact
            [length^(d-1)], shape (n,). A contact has no pair of nodes twice.
    """

    def __init__(self, d: int, degree: int, contacts: list[ContactNodes]) -> None:
        self.d = d
        self.degree = degree
        self.contacts = contacts
        pairs = np.concatenate([np.column_stack([c.here, c.there]) for c in contacts])
        unique, places = np.unique(pairs, axis=0, return_inverse=True)
        self.here, self.there = unique.T
        ends = np.cumsum([len(contact.here) for contact in contacts])
        # numpy 2 gives the places another shape.
        self.places = np.split(places.ravel(), ends[:-1])
        self.areas = []
        for contact, rows in zip(contacts, self.places, strict=True):
            area = np.zeros(len(self.here))
            area[rows] = contact.area
            self.areas.append(area)

    def change_of_basis(
        self, of_facet: np.ndarray, numbers: Sequence[int], free: np.ndarray | None = None
    ) -> csr_array:
        """Return a change of basis of polynomials on facets as a matrix between rows.

        Args:
            of_facet: The change on a facet, (m, m), the same from all facets of a node.
            numbers: Numbers of the contacts with these facets.
            free: Which components count, shape (n, d); all with None.
        """
        p, q = np.nonzero(abs(of_facet) > NO_ENTRY)
        size = len(self.here)
        keys = []
        values = []
        for number in numbers:
            rows = self.places[number][self.contacts[number].facets]
            keys.append((rows[:, p] * size + rows[:, q]).ravel())
            values.append(np.tile(of_facet[p, q], len(rows)))
        # Facets that share two nodes give the same entry, which counts once.
        unique, first = np.unique(np.concatenate(keys), return_index=True)
        value = np.concatenate(values)[first]
        i, j = np.divmod(unique, size)
        if free is None:
            free = np.ones((size, self.d), dtype=bool)
        pair, component = np.nonzero(free[i] & free[j])
        rows = i[pair] * self.d + component
        columns = j[pair] * self.d + component
        shape = (size * self.d, size * self.d)
        return local_matrix(shape, rows, columns, value[pair])

    @property
    def dofs(self) -> np.ndarray:
        """Return the global degrees of freedom of the nodes on this side, (n d,)."""
        return dofs_of(self.here, self.d)


def contact_normals(model: Model) -> fem.Function:
    """Return the displacement along all normals at the contacts [-]; collective.

    Between bodies it is the least one with the normals as jumps. It is zero elsewhere.
    """
    normals = model.space.function()
    for contact in model.contacts:
        contact.trace.assign(normals.x.array, contact.trace.normals)
    normals.x.scatter_forward()
    return model.connections.least_displacement(normals)


def neighbours(facets: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
