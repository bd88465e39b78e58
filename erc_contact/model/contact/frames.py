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


def frames_of(
    pairs: Sequence[np.ndarray], rotations: Sequence[np.ndarray | None], numbers: np.ndarray, d: int
) -> np.ndarray | None:
    """Return Q of nodes that pairs connect, shape (N, d, d); None where nothing turns.

    Args:
        pairs: Numbers of the nodes of the pairs of each contact, shape (p, 2).
        rotations: R of each contact, or None.
        numbers: Numbers of the nodes of pairs of two nodes, ascending, shape (N,).
        d: The dimension.

    Raises:
        InputError: If a node is on the axis, or rotations do not close.
    """
    if all(rotation is None for rotation in rotations):
        return None
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
    return frames


def check_alike(frames: np.ndarray | None, free: np.ndarray) -> None:
    """Check that supports hold what turns with the frames of nodes.

    Args:
        frames: Q of the nodes, or None.
        free: Components that no support fixes, shape (N, d).

    Raises:
        InputError: If they hold components that turn into others.
    """
    if frames is None:
        return
    turned = np.matmul(frames * free[:, None], frames.swapaxes(1, 2))
    if abs(turned - free[..., None] * np.eye(free.shape[1])).max(initial=0.0) > SAME_FRAME:
        raise InputError(
            "A support holds some components at Cyclic sides that turn into others. Hold all"
            " components there, or along the axis alone; a part whose sectors move radially has"
            " a bilateral Contact with normal= in place of the support. Where no support is, all"
            " vertices lie at these sides; refine the mesh."
        )
