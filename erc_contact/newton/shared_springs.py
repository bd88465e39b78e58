"""Springs at the nodes whose forces several contacts share: part of a preconditioner.

A group of nodes has the linearised equations

    P x + R r = f,    P = sum_c M_c^T e_u M_c,    R = sum_c M_c^T e_lambda Q_c / a_c,

with the symbols of :mod:`erc_contact.newton.shared_forces`. What the multipliers of
neighbours do is left out. Solved for the reaction r they are springs, as at other nodes
(:mod:`erc_contact.newton.springs`):

    G = H P,    H = (R + P D^-1)^-1.

All ranks have the blocks of all groups, which are few.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.model.joints import components
from erc_contact.newton.contact_nodes import Entries
from erc_contact.newton.shared_multipliers import SharedMultipliers


class SharedSprings:
    """Hold G and H of groups of nodes, the same on all ranks.

    Args:
        comm: The ranks.
        shared: What contacts share at these nodes.
        terms: For each derivative of the equations the numbers of its contacts; all of
            them have the same jumps at common nodes.
        by_forces: Which derivatives are those by multipliers.
        low: First degree of freedom of this rank.
        high: First one of the next rank.

    Attributes:
        rows: Degrees of freedom of this rank of the rows of the blocks, shape (k,).
        columns: Global degrees of freedom of their columns, shape (k,).
    """

    def __init__(
        self,
        comm: MPI.Comm,
        shared: SharedMultipliers,
        terms: list[list[int]],
        by_forces: list[bool],
        low: int,
        high: int,
    ) -> None:
        self._comm = comm
        self._terms = terms
        self._by_forces = by_forces
        at = shared.at
        d = at.has_equation.shape[1]
        self._d = d
        numbers = at.numbers
        edges = np.concatenate([self._edges(numbers, entries) for entries in at.jumps])
        _, group = np.unique(components(len(numbers), edges), return_inverse=True)
        order = np.argsort(group, kind="stable")
        number = np.arange(len(group)) - np.searchsorted(group[order], group[order])
        slot = np.empty(len(group), dtype=np.int64)
        slot[order] = number
        self._shape = (group.max() + 1, (slot.max() + 1) * d)
        self._group, self._slot = group, slot
        jumps = [self._dense(numbers, entries) for entries in at.jumps]
        self._jumps = []
        for first, *others in terms:
            of_term = jumps[first]
            for k in others:
                of_term = np.where(of_term == 0, jumps[k], of_term)
            self._jumps.append(of_term)
        self._shares = [self._dense(numbers, entries) for entries in shared.shares]
        self._no_equation = np.ones(self._shape, dtype=bool)
        places = slot[:, None] * d + np.arange(d)
        self._no_equation[group[:, None], places] = ~at.has_equation

        owned = (numbers * d >= low) & (numbers * d < high)
        self._owned = np.flatnonzero(owned)
        self.nodes = numbers[owned] - low // d
        dofs = np.full(self._shape, -1)
        dofs[group[:, None], places] = numbers[:, None] * d + np.arange(d)
        of_rank = (dofs >= low) & (dofs < high)
        used = of_rank[:, :, None] & (dofs >= 0)[:, None, :]
        self._block, self._row, self._column = np.nonzero(used)
        self.rows = dofs[self._block, self._row]
        self.columns = dofs[self._block, self._column]

    def update(self, blocks: list[np.ndarray], glue: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the entries of G and of H at the places of this rank; collective.

        Args:
            blocks: The block of each node of this rank in each derivative, shape
                (nodes, d, d).
            glue: D of these nodes [force/length], shape (nodes, d).
        """
        d = self._d
        at_owned = [of_term.reshape(len(self.nodes), d * d) for of_term in blocks]
        of_rank = np.column_stack([self._owned, glue, *at_owned])
        table = np.concatenate(self._comm.allgather(of_rank))
        table = table[np.argsort(table[:, 0])]
        stiffness = np.zeros(self._shape)
        places = self._slot[:, None] * d + np.arange(d)
        stiffness[self._group[:, None], places] = table[:, 1 : 1 + d]
        # A node without facets of side 1 has no glue of its own.
        stiffness[:] = stiffness.max(axis=1, keepdims=True)

        by_x = np.zeros((*self._shape, self._shape[1]))
        by_r = np.zeros_like(by_x)
        of_terms = table[:, 1 + d :].reshape(len(table), len(self._terms), d, d)
        for number, (k, *_) in enumerate(self._terms):
            derivative = np.zeros_like(by_x)
            derivative[self._group[:, None, None], places[:, :, None], places[:, None, :]] = (
                of_terms[:, number]
            )
            jumps = self._jumps[number]
            tested = np.matmul(jumps.transpose(0, 2, 1), derivative)
            if self._by_forces[number]:
                by_r += np.matmul(tested, self._shares[k])
            else:
                by_x += np.matmul(tested, jumps)
        inverse = by_r + by_x / stiffness[:, None, :]
        group, place = np.nonzero(self._no_equation)
        inverse[group, place] = 0.0
        inverse[group, :, place] = 0.0
        inverse[group, place, place] = 1.0
        h = np.linalg.inv(inverse)
        springs = np.matmul(h, by_x)
        springs[group, place] = 0.0
        springs[group, :, place] = 0.0
        at_places = (self._block, self._row, self._column)
        return springs[at_places], h[at_places]

    def _edges(self, numbers: np.ndarray, entries: Entries) -> np.ndarray:
        """Return pairs of nodes that an entry couples, as places in `numbers`."""
        d = self._d
        rows = np.searchsorted(numbers, entries.rows // d)
        columns = np.searchsorted(numbers, entries.columns // d)
        return np.column_stack([rows, columns])

    def _dense(self, numbers: np.ndarray, entries: Entries) -> np.ndarray:
        """Return a sparse matrix as blocks of groups, shape (groups, n, n)."""
        d = self._d
        rows = np.searchsorted(numbers, entries.rows // d)
        columns = np.searchsorted(numbers, entries.columns // d)
        blocks = np.zeros((*self._shape, self._shape[1]))
        row_places = self._slot[rows] * d + entries.rows % d
        column_places = self._slot[columns] * d + entries.columns % d
        np.add.at(blocks, (self._group[rows], row_places, column_places), entries.values)
        return blocks
