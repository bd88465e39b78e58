"""Give the nodes of sectors that are turned against each other a common frame.

See :mod:`erc_contact.model.contact.groups`, whose Q these frames are.

Symbols: N nodes, p pairs, d dimension.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from erc_contact.base.exceptions import InputError
from namedmesh.for_solvers import components

SAME_FRAME = 1e-9
"""Difference of two rotations that counts as none [-]."""
Entries = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Of which entry each turned entry is, its components in row and column, its value."""


class Upright:
    """Leave vectors at nodes as they are: nothing turns."""

    def at(self, places: np.ndarray) -> Upright:
        """Return the frames of nodes at places among the nodes, shape (n,)."""
        return self

    def among(self, numbers: np.ndarray, wanted: np.ndarray) -> Upright:
        """Return the frames of wanted nodes, of which some may have none.

        Args:
            numbers: Numbers of the nodes, ascending, shape (N,).
            wanted: Numbers of the wanted nodes, shape (n,).
        """
        return self

    def inward(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors at the nodes in the frames of their groups, ``Q v``."""
        return vectors

    def outward(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors in the frames of groups at the nodes, ``Q^T v``."""
        return vectors

    def turns(self, pairs: np.ndarray, d: int) -> np.ndarray:
        """Return ``R^T`` of pairs, shape (p, d, d).

        Args:
            pairs: Numbers of the nodes, whose frames these are, pair by pair, shape (p,
                2).
            d: The dimension.
        """
        return np.broadcast_to(np.eye(d), (len(pairs), d, d))

    @property
    def factors(self) -> np.ndarray | float:
        """Return what nodes that face themselves jump, over their displacement [-].

        It is zero where nothing turns, else of shape (N, d).
        """
        return 0.0

    def of_jumps(self, faces_itself: np.ndarray) -> Upright:
        """Return the frames in which jumps have the factors.

        Args:
            faces_itself: At which nodes the jump is between the node and itself, (N,).
        """
        return self

    def entries(
        self, columns: Upright | None, component: np.ndarray, values: np.ndarray
    ) -> Entries:
        """Turn entries on a diagonal in the frame of a group to the frames of nodes.

        These are the frames of the row of each entry.

        Args:
            columns: The frames of its column; None for a column that is no node.
            component: Its component in the frame of the group, shape (n,).
            values: The entries, shape (n,).
        """
        return np.arange(len(values)), component, component, values

    def check_alike(self, free: np.ndarray) -> None:
        """Check that supports hold what turns with the frames of nodes.

        Args:
            free: Components that no support fixes, shape (N, d).

        Raises:
            InputError: If they hold components that turn into others.
        """


class Frames(Upright):
    """Turn vectors at nodes to the frame of their group, and back.

    Args:
        q: Q of each node, shape (N, d, d).
        around: R of nodes on the axis, which face themselves, and I elsewhere, shape
            (N, d, d).
    """

    def __init__(self, q: np.ndarray, around: np.ndarray) -> None:
        self._q = q
        self._around = around

    def at(self, places: np.ndarray) -> Frames:
        """Return the frames of nodes at places among the nodes, shape (n,)."""
        return Frames(self._q[places], self._around[places])

    def among(self, numbers: np.ndarray, wanted: np.ndarray) -> Frames:
        """Return the frames of wanted nodes, see :meth:`Upright.among`."""
        upright = np.tile(np.eye(self._q.shape[1]), (len(wanted), 1, 1))
        frames = Frames(upright, upright.copy())
        known = np.isin(wanted, numbers)
        places = np.searchsorted(numbers, wanted[known])
        frames._q[known] = self._q[places]
        frames._around[known] = self._around[places]
        return frames

    def inward(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors at the nodes in the frames of their groups, ``Q v``."""
        return np.asarray(np.matmul(self._q, vectors[..., None])[..., 0])

    def outward(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors in the frames of groups at the nodes, ``Q^T v``."""
        return np.asarray(np.matmul(vectors[:, None], self._q)[:, 0])

    def turns(self, pairs: np.ndarray, d: int) -> np.ndarray:
        """Return ``R^T`` of pairs, see :meth:`Upright.turns`."""
        here, there = self._q.reshape(len(pairs), 2, d, d).swapaxes(0, 1)
        turns = np.matmul(here.swapaxes(1, 2), there)
        faces_itself = pairs[:, 0] == pairs[:, 1]
        turns[faces_itself] = self._around[::2][faces_itself].swapaxes(1, 2)
        return turns

    @property
    def _jumps(self) -> np.ndarray:
        """Return ``I - R^T`` of nodes that face themselves, in the frames of groups."""
        turned = np.matmul(self._q, np.matmul(self._around.swapaxes(1, 2), self._q.swapaxes(1, 2)))
        return np.eye(self._q.shape[1]) - turned

    @property
    def factors(self) -> np.ndarray:
        """Return ``c = 2 sin(pi/n)`` across the axis, and 0 along it, shape (N, d)."""
        lengths: np.ndarray = np.linalg.norm(self._jumps, axis=1)
        return np.where(lengths > SAME_FRAME, lengths, 0.0)

    def of_jumps(self, faces_itself: np.ndarray) -> Frames:
        """Return the frames of jumps, see :meth:`Upright.of_jumps`.

        The jump ``I - R^T`` is the factor times a turn T about the axis.
        """
        factors = self.factors[:, None]
        identity = np.broadcast_to(np.eye(self._q.shape[1]), self._q.shape)
        turn = np.divide(self._jumps, factors, out=identity.copy(), where=factors > 0.0)
        q = np.where(faces_itself[:, None, None], turn.swapaxes(1, 2) @ self._q, self._q)
        return Frames(q, self._around)

    def entries(
        self, columns: Upright | None, component: np.ndarray, values: np.ndarray
    ) -> Entries:
        """Turn entries on a diagonal, see :meth:`Upright.entries`."""
        n = np.arange(len(values))
        rows = self._q[n, component]
        of_columns = np.eye(self._q.shape[1])[component]
        if isinstance(columns, Frames):
            of_columns = columns._q[n, component]
        turned = values[:, None, None] * rows[:, :, None] * of_columns[:, None]
        place, row, column = np.nonzero(turned)
        return place, row, column, turned[place, row, column]

    def check_alike(self, free: np.ndarray) -> None:
        """Check that supports hold what turns, see :meth:`Upright.check_alike`."""
        in_place = free[..., None] * np.eye(free.shape[1])
        for turn in (self._q, self._around):
            turned = np.matmul(turn * free[:, None], turn.swapaxes(1, 2))
            if abs(turned - in_place).max(initial=0.0) > SAME_FRAME:
                raise InputError(
                    "A support holds some components at Cyclic sides that turn into others. Hold"
                    " all components there, or along the axis alone; a part whose sectors move"
                    " radially has a bilateral Contact with normal= in place of the support. Where"
                    " no support is, all vertices lie at these sides; refine the mesh."
                )


UPRIGHT = Upright()
"""Frames of nodes where nothing turns."""


def frames_of(
    pairs: Sequence[np.ndarray], rotations: Sequence[np.ndarray | None], numbers: np.ndarray, d: int
) -> Upright:
    """Return the frames of nodes that pairs connect.

    Args:
        pairs: Numbers of the nodes of the pairs of each contact, shape (p, 2).
        rotations: R of each contact, or None.
        numbers: Numbers of the nodes of pairs, ascending, shape (N,).
        d: The dimension.

    Raises:
        InputError: If rotations do not close, or nodes are on an axis that is none of
            the mesh.
    """
    if all(rotation is None for rotation in rotations):
        return UPRIGHT
    all_turns = []
    for of_contact, rotation in zip(pairs, rotations, strict=True):
        turn = np.eye(d) if rotation is None else rotation
        all_turns.append(np.broadcast_to(turn, (len(of_contact), d, d)))
    turns = np.concatenate(all_turns)
    here, there = np.searchsorted(numbers, np.concatenate(pairs)).T
    faces_itself = here == there
    around = np.tile(np.eye(d), (len(numbers), 1, 1))
    around[here[faces_itself]] = turns[faces_itself]
    frames = np.zeros((len(numbers), d, d))
    # The first node of each group has its own frame.
    known = components(len(numbers), np.column_stack([here, there])) == np.arange(len(numbers))
    frames[known] = np.eye(d)
    while not known.all():
        onward = known[here] & ~known[there]
        frames[there[onward]] = frames[here[onward]] @ turns[onward].swapaxes(1, 2)
        known[there[onward]] = True
        backward = known[there] & ~known[here]
        frames[here[backward]] = frames[there[backward]] @ turns[backward]
        known[here[backward]] = True
    turned = np.matmul(frames[here], turns.swapaxes(1, 2))
    misfit = np.where(faces_itself[:, None, None], around[here] - turns, frames[there] - turned)
    if abs(misfit).max(initial=0.0) > SAME_FRAME:
        raise InputError(
            "The motions of periodic and cyclic sides do not close where the sides meet; give"
            " cyclic sides of one axis, turned in one sense, and periodic sides along it."
        )
    # What a node on the axis jumps is told component by component.
    along = np.diagonal(around, axis1=1, axis2=2).max(axis=1, initial=-1.0)
    if d == 3 and (along < 1.0 - SAME_FRAME).any():
        raise InputError(
            "A body with Cyclic sides has nodes on its axis, which is along none of x, y and z."
            " Turn the body so that the axis is along one of them, or leave a bore around it."
        )
    return Frames(frames, around)
