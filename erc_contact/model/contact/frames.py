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

    def turns(self, pairs: int) -> np.ndarray | None:
        """Return ``R^T`` of pairs of nodes, (pairs, d, d); None where nothing turns."""
        return None

    def entries(
        self,
        numbers: np.ndarray,
        here: np.ndarray,
        there: np.ndarray | None,
        component: np.ndarray,
        values: np.ndarray,
    ) -> Entries:
        """Turn entries on a diagonal in the frame of a group to the frames of nodes.

        Args:
            numbers: Numbers of the nodes, ascending, shape (N,).
            here: Node of the row of each entry, shape (n,).
            there: Node of its column; None for a column that is no node.
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
    """

    def __init__(self, q: np.ndarray) -> None:
        self._q = q

    def at(self, places: np.ndarray) -> Frames:
        """Return the frames of nodes at places among the nodes, shape (n,)."""
        return Frames(self._q[places])

    def among(self, numbers: np.ndarray, wanted: np.ndarray) -> Frames:
        """Return the frames of wanted nodes, see :meth:`Upright.among`."""
        q = np.tile(np.eye(self._q.shape[1]), (len(wanted), 1, 1))
        known = np.isin(wanted, numbers)
        q[known] = self._q[np.searchsorted(numbers, wanted[known])]
        return Frames(q)

    def inward(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors at the nodes in the frames of their groups, ``Q v``."""
        return np.asarray(np.matmul(self._q, vectors[..., None])[..., 0])

    def outward(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors in the frames of groups at the nodes, ``Q^T v``."""
        return np.asarray(np.matmul(vectors[:, None], self._q)[:, 0])

    def turns(self, pairs: int) -> np.ndarray | None:
        """Return ``R^T`` of pairs of nodes, shape (pairs, d, d)."""
        here, there = self._q.reshape(pairs, 2, *self._q.shape[1:]).swapaxes(0, 1)
        return np.asarray(np.matmul(here.swapaxes(1, 2), there))

    def entries(
        self,
        numbers: np.ndarray,
        here: np.ndarray,
        there: np.ndarray | None,
        component: np.ndarray,
        values: np.ndarray,
    ) -> Entries:
        """Turn entries on a diagonal, see :meth:`Upright.entries`."""
        rows = self._q[np.searchsorted(numbers, here), component]
        columns = np.eye(self._q.shape[1])[component]
        if there is not None:
            columns = self._q[np.searchsorted(numbers, there), component]
        turned = values[:, None, None] * rows[:, :, None] * columns[:, None]
        place, row, column = np.nonzero(turned)
        return place, row, column, turned[place, row, column]

    def check_alike(self, free: np.ndarray) -> None:
        """Check that supports hold what turns, see :meth:`Upright.check_alike`."""
        turned = np.matmul(self._q * free[:, None], self._q.swapaxes(1, 2))
        if abs(turned - free[..., None] * np.eye(free.shape[1])).max(initial=0.0) > SAME_FRAME:
            raise InputError(
                "A support holds some components at Cyclic sides that turn into others. Hold all"
                " components there, or along the axis alone; a part whose sectors move radially"
                " has a bilateral Contact with normal= in place of the support. Where no support"
                " is, all vertices lie at these sides; refine the mesh."
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
        numbers: Numbers of the nodes of pairs of two nodes, ascending, shape (N,).
        d: The dimension.

    Raises:
        InputError: If a node is on the axis, or rotations do not close.
    """
    if all(rotation is None for rotation in rotations):
        return UPRIGHT
    all_turns = []
    for of_contact, rotation in zip(pairs, rotations, strict=True):
        if rotation is not None and (of_contact[:, 0] == of_contact[:, 1]).any():
            raise InputError(
                "A body with Cyclic sides has nodes on its axis, which both sides share. Leave a"
                " small bore around the axis."
            )
        turn = np.eye(d) if rotation is None else rotation
        all_turns.append(np.broadcast_to(turn, (len(of_contact), d, d)))
    every = np.concatenate(pairs)
    differ = every[:, 0] != every[:, 1]
    turns = np.concatenate(all_turns)[differ]
    here, there = np.searchsorted(numbers, every[differ]).T
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
    misfit = frames[there] - frames[here] @ turns.swapaxes(1, 2)
    if abs(misfit).max(initial=0.0) > SAME_FRAME:
        raise InputError(
            "The motions of periodic and cyclic sides do not close where the sides meet; give"
            " cyclic sides of one axis, and periodic sides along it."
        )
    return Frames(frames)
