"""The nodes of all contacts with their areas, and matrices between them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from petsc4py import PETSc

from erc_contact.base.sparse import sparse
from erc_contact.model.trace import dofs_of

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
        stiffness: Stiffness of the bodies over these areas, that of two bodies as of
            springs in a row [force/length], shape (n,).
        free: Components that no support fixes, shape (n, d).
    """

    numbers: np.ndarray
    facets: np.ndarray
    area: np.ndarray
    stiffness: np.ndarray
    free: np.ndarray


class NodesOfAll:
    """Number the nodes of all contacts; matrices between them are of this rank.

    Args:
        d: The dimension.
        degree: Degree of the displacement.
        contacts: The nodes and facets of each contact.
        more: Global numbers of nodes that count besides.

    Attributes:
        d: The dimension.
        degree: Degree of the displacement.
        contacts: The nodes and facets of each contact.
        numbers: Global numbers of the nodes, ascending, shape (N,).
        dofs: Their degrees of freedom, shape (N d,).
        places: Places of the nodes of each contact among them.
        areas: Areas of the nodes in each contact, zero elsewhere [length^(d-1)], shape
            (N,).
    """

    def __init__(self, d: int, degree: int, contacts: list[ContactNodes], more: np.ndarray) -> None:
        self.d = d
        self.degree = degree
        self.contacts = contacts
        self.numbers = np.unique(np.concatenate([*(c.numbers for c in contacts), more]))
        self.dofs = dofs_of(self.numbers, d)
        self.places = [np.searchsorted(self.numbers, c.numbers) for c in contacts]
        self.areas = []
        for contact, places in zip(contacts, self.places, strict=True):
            area = np.zeros(len(self.numbers))
            area[places] = contact.area
            self.areas.append(area)

    def matrix(self, entries: Entries) -> PETSc.Mat:
        """Make a matrix from entries between the nodes."""
        size = len(self.dofs)
        rows = np.searchsorted(self.dofs, entries.rows)
        columns = np.searchsorted(self.dofs, entries.columns)
        return sparse(size, size, rows, columns, [entries.values])

    def entries(self, matrix: PETSc.Mat) -> Entries:
        """Return the entries of a matrix between the nodes."""
        begin, columns, values = matrix.getValuesCSR()
        rows = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
        return Entries(self.dofs[rows], self.dofs[columns], values)

    def change_of_basis(
        self, of_facet: np.ndarray, contacts: list[ContactNodes], free: np.ndarray | None = None
    ) -> PETSc.Mat:
        """Return a change of basis of polynomials on facets as a matrix.

        Args:
            of_facet: The change on a facet, (m, m), the same from all facets of a node.
            contacts: The contacts with these facets.
            free: Which components count, shape (N, d); all with None.
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
        if free is None:
            free = np.ones((size, self.d), dtype=bool)
        pair, component = np.nonzero(free[i] & free[j])
        rows = i[pair] * self.d + component
        columns = j[pair] * self.d + component
        return sparse(size * self.d, size * self.d, rows, columns, [value[pair]])


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
