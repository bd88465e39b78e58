"""The multipliers at the nodes whose forces several contacts share.

With the matrices L_c from forces to multipliers, those at shared nodes the means of
their neighbours, and with C_c from nodal values to Bernstein coefficients, the forces
of :mod:`erc_contact.newton.shared_forces` add to L_c

    (C_c a_c)^-T Q_c (I - sum_b M_b^T C_b^T a_b L_b).
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from erc_contact.base.sparse import diagonal
from erc_contact.mesh.simplex import at_nodes, coefficients
from erc_contact.model.trace import dofs_of
from erc_contact.newton.contact_nodes import Entries, NodesOfAll
from erc_contact.newton.shared_forces import SharedNodes, shares


class SharedMultipliers:
    """Complete multipliers at shared nodes, and tell the jumps that are sums there.

    Args:
        nodes: The nodes of all contacts.
        shared: Those whose forces contacts share.
        matrices: The matrices L_c, which become complete, in place.

    Attributes:
        at: The shared nodes.
        areas: Areas of these nodes in each contact, zero elsewhere [length^(d-1)].
        shares: ``Q_c / a_c`` of each contact.
        jumps: For each contact the matrix from the unknowns to those Bernstein
            coefficients of its jump that are sums of several.
    """

    def __init__(self, nodes: NodesOfAll, shared: SharedNodes, matrices: list[PETSc.Mat]) -> None:
        self._nodes = nodes
        self.at = shared
        place = np.searchsorted(nodes.numbers, shared.numbers)
        self.areas = [area[place] for area in nodes.areas]
        self.shares: list[Entries] = []
        rest = self._rest(matrices)
        springs = []
        for contact, jumps in zip(nodes.contacts, shared.jumps, strict=True):
            place = np.searchsorted(contact.numbers, jumps.rows // nodes.d)
            springs.append(contact.stiffness[place])
        for k, share in enumerate(shares(shared.jumps, springs)):
            self._complete(k, share, rest, matrices[k])
        rest.destroy()
        self.jumps = [self._sums(k) for k in range(len(matrices))]

    def _rest(self, matrices: list[PETSc.Mat]) -> PETSc.Mat:
        """Return the matrix to what means of neighbours leave of the forces."""
        nodes, shared = self._nodes, self.at
        has_equation = np.zeros((len(nodes.numbers), nodes.d))
        has_equation[np.searchsorted(nodes.numbers, shared.numbers)] = shared.has_equation
        rest = diagonal(has_equation.ravel())
        for k, matrix in enumerate(matrices):
            force = _scaled(np.repeat(nodes.areas[k], nodes.d), matrix)
            if nodes.degree > 1:
                of_facet = coefficients(nodes.d - 1, nodes.degree).T
                force = self._in_other_basis(k, of_facet, force)
            jump = nodes.matrix(shared.jumps[k])
            borne = jump.transposeMatMult(force)
            rest.axpy(-1.0, borne)
            for done in (force, jump, borne):
                done.destroy()
        return rest

    def _complete(self, k: int, share: Entries, rest: PETSc.Mat, matrix: PETSc.Mat) -> None:
        """Add the share of a contact to its multiplier, in place.

        Args:
            k: Place of the contact.
            share: Its Q_c.
            rest: The matrix to what means of neighbours leave of the forces.
            matrix: Its L_c.
        """
        nodes = self._nodes
        area = np.repeat(nodes.areas[k], nodes.d)
        inverse = np.divide(1.0, area, out=np.zeros_like(area), where=area > 0)
        of_area = inverse[np.searchsorted(nodes.dofs, share.rows)]
        self.shares.append(Entries(share.rows, share.columns, of_area * share.values))
        to_contact = nodes.matrix(share)
        force = to_contact.matMult(rest)
        if nodes.degree > 1:
            of_facet = at_nodes(nodes.d - 1, nodes.degree).T
            force = self._in_other_basis(k, of_facet, force)
        added = _scaled(inverse, force)
        matrix.axpy(1.0, added)
        for done in (to_contact, force, added):
            done.destroy()

    def _in_other_basis(self, k: int, of_facet: np.ndarray, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return a matrix with its rows in another basis of a contact; destroy it."""
        change = self._nodes.change_of_basis(of_facet, [self._nodes.contacts[k]])
        result = change.matMult(matrix)
        change.destroy()
        matrix.destroy()
        return result

    def _sums(self, k: int) -> Entries:
        """Return the coefficients of a jump that are sums, from the unknowns."""
        nodes, jumps = self._nodes, self.at.jumps[k]
        if nodes.degree == 1:
            return jumps
        contact = nodes.contacts[k]
        is_shared = np.isin(contact.numbers, self.at.numbers)
        # A coefficient of a facet is that of values at several of its nodes.
        of_facets = np.zeros(len(is_shared), dtype=bool)
        of_facets[contact.facets[is_shared[contact.facets].any(axis=1)]] = True
        others = dofs_of(contact.numbers[~is_shared], nodes.d)
        rows = np.concatenate([jumps.rows, others])
        columns = np.concatenate([jumps.columns, others])
        values = np.concatenate([jumps.values, np.ones(len(others))])
        of_facet = coefficients(nodes.d - 1, nodes.degree)
        nodal = nodes.matrix(Entries(rows, columns, values))
        matrix = self._in_other_basis(k, of_facet, nodal)
        entries = nodes.entries(matrix)
        matrix.destroy()
        used = np.isin(entries.rows // nodes.d, contact.numbers[of_facets])
        return Entries(entries.rows[used], entries.columns[used], entries.values[used])

    def replaced(self, change: Entries) -> Entries:
        """Return C with the rows that depend on jumps at shared nodes, but for those.

        Args:
            change: C of unknowns as if each were a jump.
        """
        d, numbers = self._nodes.d, self.at.numbers
        free = dofs_of(numbers, d)[self.at.has_equation.ravel()]
        free = np.union1d(free, change.rows)
        rows, columns, values = [], [], []
        done = numbers
        for jumps in self.jumps:
            used = ~np.isin(jumps.rows // d, done)
            used &= np.isin(jumps.rows, free) & np.isin(jumps.columns, free)
            rows.append(jumps.rows[used])
            columns.append(jumps.columns[used])
            values.append(jumps.values[used])
            done = np.union1d(done, jumps.rows // d)
        # An unknown on side 1 of no contact has no coefficient beside its value.
        alone = np.setdiff1d(free, change.rows)
        rows.append(alone)
        columns.append(alone)
        values.append(np.ones(len(alone)))
        kept = ~np.isin(change.rows, np.concatenate(rows))
        return Entries(
            np.concatenate([change.rows[kept], *rows]),
            np.concatenate([change.columns[kept], *columns]),
            np.concatenate([change.values[kept], *values]),
        )


def _scaled(factors: np.ndarray, matrix: PETSc.Mat) -> PETSc.Mat:
    """Return a matrix with its rows times factors, a new one."""
    result = matrix.copy()
    scale = result.createVecLeft()
    scale.array[:] = factors
    result.diagonalScale(L=scale)
    scale.destroy()
    return result
