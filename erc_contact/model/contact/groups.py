"""Stack the jumps that contacts read at connected nodes.

A contact reads ``w = B u``: at a node on a foundation u itself, at two facing nodes of
two bodies their difference. The nodes that pairs connect form a *group*. It is mostly a
pair, and more where three bodies meet. B has a row for each contact at a group, and a
column for each node. Components do not mix, so that each has its own B; where a support
fixes a component, its column is missing. Forces g on w do the work of the nodal forces
``B^T g``, and

    P = B^+ B

is the projector to all such nodal forces, and to the displacements that change w; I - P
projects to displacements that move all nodes of a group alike.

Example:
    The pair of nodes 3 and 8, both free, has B = (1, -1) and P = ((1, -1), (-1, 1))/2.
    If a support fixes node 8, B = (1, 0) and P = ((1, 0), (0, 0)).

Sides of sectors are turned against each other. Then all here is in the frame of the
group: Q u of each node, with Q of the first node I and ``Q_there = Q_here R^T`` along a
pair. So components do not mix; they do in matrices between nodes, and in rows, whose w
is in the frame of the node on this side.

Symbols: n rows, N nodes, G groups, R rows of a group, C nodes of a group, d dimension.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from erc_contact.model.contact.frames import UPRIGHT, Upright
from erc_contact.model.contact.trace import NOBODY
from namedmesh.for_solvers import components

NEARLY = 0.9
"""Share of a projector above which it is one, up to round-off [-]."""


class Groups:
    """Hold B of all groups of nodes, the same on all ranks.

    Groups with fewer rows or nodes than others have zeros.

    Args:
        here: Global number of the node on this side of each row, shape (n,).
        there: Global number of the node of the other body, or :data:`NOBODY`, shape
            (n,).
        numbers: Global numbers of all these nodes, ascending, shape (N,).
        free: Components that no support fixes, shape (N, d).
        frames: Frames of the nodes.

    Attributes:
        numbers: As given.
        group: The group of each node, shape (N,).
        slot: Its place in the group, shape (N,).
        group_of_row: The group of each row, shape (n,).
        slot_of_row: Its place in the group, shape (n,).
        whole: B with the columns that supports fix, shape (G, 1, R, C).
        is_free: Components that no support fixes, shape (G, d, C).
        jumps: B, shape (G, d, R, C).
    """

    def __init__(
        self,
        here: np.ndarray,
        there: np.ndarray,
        numbers: np.ndarray,
        free: np.ndarray,
        frames: Upright = UPRIGHT,
    ) -> None:
        is_pair = there != NOBODY
        first = np.searchsorted(numbers, here)
        second = np.searchsorted(numbers, there[is_pair])
        component = components(len(numbers), np.column_stack([first[is_pair], second]))
        _, self.group = np.unique(component, return_inverse=True)
        self.numbers = numbers
        self.frames = frames
        self._first = first
        self.slot = numbers_in(self.group)
        self.group_of_row = self.group[first]
        self.slot_of_row = numbers_in(self.group_of_row)

        count = int(self.group.max(initial=-1)) + 1
        height = int(self.slot_of_row.max(initial=-1)) + 1
        width = int(self.slot.max(initial=-1)) + 1
        self.whole = np.zeros((count, 1, height, width))
        self.whole[self.group_of_row, 0, self.slot_of_row, self.slot[first]] = 1.0
        of_pairs = self.group_of_row[is_pair], 0, self.slot_of_row[is_pair]
        self.whole[*of_pairs, self.slot[second]] = -1.0
        d = free.shape[1]
        self.is_free = np.zeros((count, d, width), dtype=bool)
        self.is_free[self.group, :, self.slot] = free
        self.jumps = self.whole * self.is_free[:, :, None]

    @cached_property
    def _patterns(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the different B, shape (b, R, C), and the place of each, (G d,).

        There are few of them, and none where a rank has no pairs.
        """
        height, width = self.jumps.shape[2:]
        if self.jumps.size == 0:
            return np.empty((0, height, width)), np.empty(0, dtype=np.int64)
        flat = self.jumps.reshape(-1, height * width)
        unique, place = np.unique(flat, axis=0, return_inverse=True)
        return unique.reshape(-1, height, width), place.ravel()

    @cached_property
    def inverse(self) -> np.ndarray:
        """Return B^+, shape (G, d, C, R)."""
        unique, place = self._patterns
        if len(unique) == 0:
            return self.jumps.swapaxes(2, 3)
        return np.linalg.pinv(unique)[place].reshape(self.jumps.swapaxes(2, 3).shape)

    @cached_property
    def projector(self) -> np.ndarray:
        """Return P, shape (G, d, C, C)."""
        return np.matmul(self.inverse, self.jumps)

    @cached_property
    def is_independent(self) -> np.ndarray:
        """Tell for which rows ``B^T g`` tells the force g, shape (n, d)."""
        of_range = np.matmul(self.jumps, self.inverse)
        shares = np.diagonal(of_range, axis1=2, axis2=3)
        return shares[self.group_of_row, :, self.slot_of_row] > 0.5 + 0.5 * NEARLY

    def shares(self, stiffness: np.ndarray) -> np.ndarray:
        """Return ``k B (B^T k B)^+``, from nodal forces to forces on w, (G, d, R, C).

        Args:
            stiffness: k of each row [force/length], shape (n,).
        """
        k = np.zeros((len(self.jumps), 1, self.jumps.shape[2], 1))
        k[self.group_of_row, 0, self.slot_of_row, 0] = stiffness
        vectors, is_jump, _ = self.bases
        basis = vectors * is_jump[:, :, None]
        read = np.matmul(self.jumps, basis)
        gram = np.matmul(read.swapaxes(2, 3), k * read)
        gram += np.where(is_jump, 0.0, 1.0)[..., None] * np.eye(gram.shape[-1])
        weights = np.matmul(np.linalg.inv(gram), basis.swapaxes(2, 3))
        return np.matmul(k * read, weights)

    @cached_property
    def bases(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return an orthonormal basis of the displacements of each group.

        Returns:
            Vectors as columns, shape (G, d, C, C); which of them change w, and which
            move all nodes of the group alike, shape (G, d, C). The others are no
            displacements.
        """
        unique, place = self._patterns
        # Each node of a group is in a row: a column without entries is no displacement.
        is_not = np.where(unique.any(axis=1), 0.0, 2.0)
        projectors = self.projector.reshape(-1, *self.projector.shape[2:])
        _, first = np.unique(place, return_index=True)
        diagonal = is_not[..., None] * np.eye(is_not.shape[-1])
        values, vectors = np.linalg.eigh(projectors[first] + diagonal)
        kind = np.rint(values)[place].reshape(self.is_free.shape)
        return vectors[place].reshape(self.projector.shape), kind == 1.0, kind == 0.0

    def between_nodes(self, blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rows, columns and values of a matrix between nodes that is not zero.

        Args:
            blocks: Its blocks, shape (G, d, C, C).
        """
        group, component, i, j = np.nonzero(blocks)
        values = blocks[group, component, i, j]
        nodes = self._table[group, i], self._table[group, j]
        turned = self.frames.entries(self.numbers, *nodes, component, values)
        place, row, column, values = turned
        d = blocks.shape[1]
        return nodes[0][place] * d + row, nodes[1][place] * d + column, values

    def columns_of(
        self, blocks: np.ndarray, used: np.ndarray, column_of: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rows, columns and values of a matrix to nodes.

        Args:
            blocks: Its blocks, shape (G, d, C, K).
            used: Which entries count, in the same shape.
            column_of: The column of each k of each block, shape (G, d, K).

        Returns:
            Global degrees of freedom, numbers of columns, and values.
        """
        group, component, i, k = np.nonzero(used)
        values = blocks[group, component, i, k]
        nodes = self._table[group, i]
        turned = self.frames.entries(self.numbers, nodes, None, component, values)
        place, row, _, values = turned
        columns = column_of[group, component, k][place]
        return nodes[place] * blocks.shape[1] + row, columns, values

    def from_nodes(self, blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rows, columns and values of a matrix from nodes to the rows of B.

        Args:
            blocks: Its blocks, shape (G, d, R, C).

        Returns:
            Numbers of rows times d plus the component, global degrees of freedom, and
            values that are not zero.
        """
        of_rows = blocks[self.group_of_row, :, self.slot_of_row]
        row, component, j = np.nonzero(of_rows)
        values = of_rows[row, component, j]
        nodes = self.numbers[self._first[row]], self._table[self.group_of_row[row], j]
        turned = self.frames.entries(self.numbers, *nodes, component, values)
        place, of_row, column, values = turned
        d = blocks.shape[1]
        return row[place] * d + of_row, nodes[1][place] * d + column, values

    @cached_property
    def _table(self) -> np.ndarray:
        """Return the global numbers of the nodes of each group, shape (G, C)."""
        table = np.full((self.whole.shape[0], self.whole.shape[3]), NOBODY)
        table[self.group, self.slot] = self.numbers
        return table


def numbers_in(group: np.ndarray) -> np.ndarray:
    """Return the number of each member among the members of its group, shape (n,)."""
    order = np.argsort(group, kind="stable")
    ascending = group[order]
    numbers = np.empty(len(group), dtype=np.int64)
    numbers[order] = np.arange(len(group)) - np.searchsorted(ascending, ascending)
    return numbers
