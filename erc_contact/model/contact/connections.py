"""Find the nodes that contacts between bodies connect.

What contacts read of these nodes is in :mod:`erc_contact.model.contact.groups`. All
ranks have the pairs of nodes of all contacts between bodies.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from erc_contact.model.contact.frames import Upright, frames_of
from erc_contact.model.contact.groups import Groups
from erc_contact.model.contact.trace import NOBODY, Trace, dofs_of
from erc_contact.model.data.over_ranks import matrix_of_common_entries, product
from erc_contact.model.space import Space
from namedmesh.base.ranks import distinct_rows


class Connections:
    """Hold the pairs of nodes of contacts between bodies, and their groups.

    Construction is collective.

    Args:
        space: The mesh.
        traces: The displacements of the contacts.
        fixed: Which components supports prescribe at each node, shape (nodes, d).

    Attributes:
        pairs: For each contact the global numbers of its pairs of nodes, on this side
            and on the other one, each once, shape (p, 2); no rows for a foundation.
            Where a contact ends inside a body, and on the axis of sectors, both are one
            node.
        any: Whether there is a contact between bodies.
        groups: B of all contacts at these nodes.
    """

    def __init__(self, space: Space, traces: Sequence[Trace], fixed: np.ndarray) -> None:
        self._space = space
        self.pairs = [_pairs(space, trace) for trace in traces]
        self.any = any(len(pairs) > 0 for pairs in self.pairs)
        nothing = np.zeros((0, 2), dtype=np.int64)
        between = np.unique(np.concatenate([nothing, *self.pairs]), axis=0)
        numbers = np.unique(between)
        on_foundations = np.zeros(0, dtype=np.int64)
        if self.any:
            on_foundations = np.intersect1d(_on_foundations(space, traces), numbers)
        here = np.concatenate([between[:, 0], on_foundations])
        there = np.concatenate([between[:, 1], np.full(len(on_foundations), NOBODY)])
        self._pair_count = len(between)
        free = ~gather_prescribed(space, numbers, fixed)
        rotations = [trace.rotation for trace in traces]
        frames = frames_of(self.pairs, rotations, numbers, space.d)
        frames.check_alike(free)
        self.groups = Groups(here, there, numbers, free, frames)
        self._free = free

    @cached_property
    def is_paired(self) -> np.ndarray:
        """Tell which nodes of this rank are in pairs, shape (nodes,)."""
        return self._mark(np.ones(len(self.groups.numbers), dtype=bool))

    @cached_property
    def is_joint(self) -> np.ndarray:
        """Tell which of them are in groups of several pairs, shape (nodes,)."""
        return self._mark((self._rows_read(self._pair_count) > 1)[self.groups.group])

    @cached_property
    def has_several(self) -> np.ndarray:
        """Tell in which groups a support or a second contact acts, shape (nodes,)."""
        groups = self.groups
        rows = self._rows_read(len(groups.group_of_row))
        is_fixed = np.zeros(len(rows), dtype=bool)
        is_fixed[groups.group[~self._free.all(axis=1)]] = True
        return self._mark(((rows > 1) | is_fixed & (rows > 0))[groups.group])

    def _rows_read(self, count: int) -> np.ndarray:
        """Count the rows of each group that have a jump, among the first rows, (G,)."""
        groups = self.groups
        group, slot = groups.group_of_row[:count], groups.slot_of_row[:count]
        has_jump = groups.whole[group, :, slot].any(axis=(1, 2))
        return np.bincount(group[has_jump], minlength=len(groups.whole))

    def least_displacement(self, u: fem.Function) -> fem.Function:
        """Return the least displacement of free components with the jumps of u.

        Where no jump reads u it is u; collective.
        """
        return product(self._space, self.projection, u) if self.any else u

    @cached_property
    def projection(self) -> PETSc.Mat:
        """Return the map of :meth:`least_displacement`."""
        groups = self.groups
        blocks = np.matmul(groups.inverse, groups.whole)
        is_read = groups.whole.any(axis=2)[groups.group, :, groups.slot]
        changed = dofs_of(groups.numbers, self._space.d)[is_read.ravel()]
        return matrix_of_common_entries(self._space, groups.between_nodes(blocks), changed)

    def let_go(self, x: PETSc.Vec, y: PETSc.Vec, is_read: np.ndarray) -> None:
        """Set y to the part ``(I - P) x`` that contacts do not read; collective.

        Args:
            x: Nodal displacements or forces.
            y: Another vector.
            is_read: Degrees of freedom of this rank that contacts read, shape (owned,).
        """
        if self.any:
            self._alike.mult(x, y)
            y.array[:] = np.where(is_read, y.array_r, x.array_r)
        else:
            x.copy(y)
            y.array[is_read] = 0.0

    @cached_property
    def _alike(self) -> PETSc.Mat:
        """Return I - P at the free components of groups; elsewhere it is zero."""
        groups = self.groups
        is_free = np.zeros(groups.projector.shape[:3])
        is_free[groups.group, :, groups.slot] = self._free
        identity = is_free[..., None] * np.eye(is_free.shape[-1])
        entries = groups.between_nodes(identity - groups.projector)
        return matrix_of_common_entries(self._space, entries)

    @cached_property
    def couplings(self) -> PETSc.Mat:
        """Return a matrix with entries between all nodes of each group."""
        blocks = np.matmul(abs(self.groups.whole).swapaxes(2, 3), abs(self.groups.whole))
        # Two nodes may be connected by a third one.
        for _ in range(blocks.shape[-1] - 2):
            blocks = np.matmul(blocks, blocks)
        return matrix_of_common_entries(self._space, self.groups.between_nodes(np.sign(blocks)))

    def jump(self, number: int) -> PETSc.Mat:
        """Return the map from u to the jump of a contact at its nodes on this side.

        At other nodes it is u.

        Args:
            number: Number of the contact, one between bodies.
        """
        if number not in self._jumps:
            self._jumps[number] = self.differences(self.pairs[number])
        return self._jumps[number]

    def differences(self, pairs: np.ndarray) -> PETSc.Mat:
        """Return the map from u to the difference of each pair at its first node.

        At other nodes it is u; collective.

        Args:
            pairs: Global numbers of the nodes, all first ones different, shape (p, 2).
        """
        here = dofs_of(pairs[:, 0], self._space.d)
        rows, columns, values = self.there_in_jumps(pairs)
        entries = (
            np.concatenate([here, rows]),
            np.concatenate([here, columns]),
            np.concatenate([np.ones(len(here)), values]),
        )
        return matrix_of_common_entries(self._space, entries, here)

    def there_in_jumps(self, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what jumps of pairs read of their second nodes, ``-u`` or ``-R^T u``.

        Args:
            pairs: Global numbers of the nodes, shape (p, 2).

        Returns:
            Degrees of freedom of the first nodes and of the second nodes, and values,
            of entries that add up.
        """
        d = self._space.d
        here, there = (nodes[:, None] * d + np.arange(d) for nodes in pairs.T)
        turns = self.turns(pairs)
        pair, row, column = np.nonzero(turns)
        return here[pair, row], there[pair, column], -turns[pair, row, column]

    def turns(self, pairs: np.ndarray) -> np.ndarray:
        """Return ``R^T`` of pairs of nodes, shape (p, d, d)."""
        return self.frames(pairs.ravel()).turns(pairs, self._space.d)

    def frames(self, numbers: np.ndarray) -> Upright:
        """Return the frames of nodes, of which some may be in no pair."""
        return self.groups.frames.among(self.groups.numbers, numbers)

    def pairs_at(self, numbers: np.ndarray) -> np.ndarray:
        """Return the pairs whose first node is among some nodes, shape (p, 2).

        A node of several pairs has the first one.

        Args:
            numbers: Global numbers of the nodes.
        """
        pairs = np.concatenate(self.pairs)
        _, first = np.unique(pairs[:, 0], return_index=True)
        pairs = pairs[first]
        return pairs[np.isin(pairs[:, 0], numbers)]

    @cached_property
    def _jumps(self) -> dict[int, PETSc.Mat]:
        """Return the maps to jumps that were made."""
        return {}

    def _mark(self, which: np.ndarray) -> np.ndarray:
        """Mark nodes of groups (N,) among the nodes of this rank, shape (nodes,)."""
        marked = np.zeros(self._space.node_count, dtype=bool)
        local = self._space.local_nodes(self.groups.numbers[which])
        marked[local[local >= 0]] = True
        return marked


def gather_prescribed(space: Space, numbers: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Gather which components supports prescribe at nodes, shape (N, d); collective.

    Args:
        space: The mesh.
        numbers: Global numbers of the nodes, the same on all ranks, shape (N,).
        fixed: Which components they prescribe at the nodes of this rank, (nodes, d).
    """
    table = np.zeros((len(numbers), space.d), dtype=np.int8)
    if len(numbers) == 0:
        return table > 0
    owned, nodes = space.find_owned(numbers)
    table[owned] = fixed[nodes]
    return np.asarray(space.comm.allreduce(table, MPI.SUM)) > 0


def _pairs(space: Space, trace: Trace) -> np.ndarray:
    """Gather the pairs of nodes of a contact, each once, shape (p, 2); collective."""
    here = trace.here.nodes[trace.facing]
    node_pairs = np.column_stack([here.ravel(), trace.partners.ravel()])
    of_rank = space.global_numbers(np.unique(node_pairs, axis=0))
    return distinct_rows(space.comm, of_rank)


def _on_foundations(space: Space, traces: Sequence[Trace]) -> np.ndarray:
    """Gather the global numbers of the nodes on foundations; collective."""
    nodes = [trace.here.nodes[trace.on_foundation].ravel() for trace in traces]
    of_rank = space.global_numbers(np.unique(np.concatenate(nodes)))
    return distinct_rows(space.comm, of_rank)
