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

A node may face itself: where a contact ends inside a body, ``w = 0``, and on the axis
of sectors, ``w = (I - R^T) u``. With the angle 2 pi/n of R this is ``c = 2 sin(pi/n)``
times u across the axis, turned about it, and nothing along it. So B has the entries c,
c and 0, and the frame of w is turned besides.

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
        whole: B with the columns that supports fix, shape (G, d, R, C).
        is_free: Components that no support fixes, shape (G, d, C).
        jumps: B, shape (G, d, R, C).
        frames_of_rows: Frames in which rows read what B says.
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
        self.slot = numbers_in(self.group)
        self.group_of_row = self.group[first]
        self.slot_of_row = numbers_in(self.group_of_row)

        count = int(self.group.max(initial=-1)) + 1
        height = int(self.slot_of_row.max(initial=-1)) + 1
        width = int(self.slot.max(initial=-1)) + 1
        d = free.shape[1]
        self.whole = np.zeros((count, d, height, width))
        of_rows = self.group_of_row, slice(None), self.slot_of_row
        self.whole[*of_rows, self.slot[first]] = 1.0
        of_pairs = self.group_of_row[is_pair], slice(None), self.slot_of_row[is_pair]
        self.whole[*of_pairs, self.slot[second]] = -1.0
        faces_itself = here == there
        alone = first[faces_itself]
        of_alone = self.group[alone], slice(None), self.slot_of_row[faces_itself]
        self.whole[*of_alone, self.slot[alone]] = frames.at(alone).factors
        self.frames_of_rows = frames.at(first).of_jumps(faces_itself)
        self.is_free = np.zeros((count, d, width), dtype=bool)
        self.is_free[self.group, :, self.slot] = free
        self.jumps = self.whole * self.is_free[:, :, None]

    @cached_property
    def _patterns(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the different B, (b, R, C), their free nodes, (b, C), and places.

        There are few of them, and none where a rank has no pairs. Places are of shape
        (G d,).
        """
        height, width = self.jumps.shape[2:]
        if self.jumps.size == 0:
            nothing = np.empty((0, height, width))
            return nothing, np.empty((0, width)), np.empty(0, dtype=np.int64)
        blocks = np.concatenate([self.jumps, self.is_free[:, :, None]], axis=2)
        flat = blocks.reshape(-1, (height + 1) * width)
        unique, place = np.unique(flat, axis=0, return_inverse=True)
        unique = unique.reshape(-1, height + 1, width)
        return unique[:, :-1], unique[:, -1], place.ravel()

    @cached_property
    def inverse(self) -> np.ndarray:
        """Return B^+, shape (G, d, C, R)."""
        unique, _, place = self._patterns
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
        _, is_free, place = self._patterns
        is_not = 2.0 * (1.0 - is_free)
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
        rows, columns = self._table[group, i], self._table[group, j]
        of_rows, of_columns = self.frames.at(rows), self.frames.at(columns)
        turned = of_rows.entries(of_columns, component, blocks[group, component, i, j])
        place, row, column, values = turned
        rows, columns = (self.numbers[nodes[place]] * self._d for nodes in (rows, columns))
        return rows + row, columns + column, values

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
        nodes = self._table[group, i]
        turned = self.frames.at(nodes).entries(None, component, blocks[group, component, i, k])
        place, row, _, values = turned
        columns = column_of[group, component, k][place]
        return self.numbers[nodes[place]] * self._d + row, columns, values

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
        nodes = self._table[self.group_of_row[row], j]
        frames = self.frames_of_rows.at(row)
        turned = frames.entries(self.frames.at(nodes), component, of_rows[row, component, j])
        place, of_row, column, values = turned
        dofs = self.numbers[nodes[place]] * self._d + column
        return row[place] * self._d + of_row, dofs, values

    @property
    def _d(self) -> int:
        """Return the dimension."""
        return self.is_free.shape[1]

    @cached_property
    def _table(self) -> np.ndarray:
        """Return the places of the nodes of each group among all, shape (G, C)."""
        table = np.full((self.whole.shape[0], self.whole.shape[3]), NOBODY)
        table[self.group, self.slot] = np.arange(len(self.numbers))
        return table


def numbers_in(group: np.ndarray) -> np.ndarray:
    """Return the number of each member among the members of its group, shape (n,)."""
    order = np.argsort(group, kind="stable")
    ascending = group[order]
    numbers = np.empty(len(group), dtype=np.int64)
    numbers[order] = np.arange(len(group)) - np.searchsorted(ascending, ascending)
    return numbers
