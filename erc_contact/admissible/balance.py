"""Contact tractions that balance all other forces on rigid motions.

They are the nearest to wanted ones, see :mod:`erc_contact.admissible.nearest`.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cones import clip
from erc_contact.admissible.nearest import (
    IMBALANCE_ROUND_OFF,
    SMALL_IMBALANCE,
    BalancePart,
    Nearest,
)

SHIFT_STAGES = 8
"""Limit of the number of shares of a shift; one or two are usual."""
LONGEST_SHARE = 100.0
"""Longest share of a shift, over the largest traction [-]."""
LONGEST_OUTSIDE = 10.0
"""Longest vector outside a set that is kept, over the largest traction [-]."""


def balance(
    comm: MPI.Comm, parts: list[BalancePart], works: np.ndarray, give: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray, float]:
    """Balance other forces with the tractions nearest to start + shift; collective.

    A shift that is much longer than the tractions loses digits and needs many Newton
    steps, so it is applied in shares. The part of a share that is beyond the set keeps
    the tractions at their place on its surface, even if this part is shortened.

    Args:
        comm: Communicator.
        parts: The contacts.
        works: Work of the other forces on the motions [force], shape (K,).
        give: D, what springs take up for multipliers of the motions [area], shape
            (K, K).

    Returns:
        The tractions, the imbalance on the motions that is left [force], and the sum of
        the contact forces.
    """
    local_area = sum(float(part.weight.sum()) * part.start.shape[1] for part in parts)
    area = comm.allreduce(local_area, MPI.SUM)
    tractions = [part.start for part in parts]
    if largest_component(comm, tractions) == 0.0 and not works.any():
        return tractions, np.zeros_like(works), 0.0
    remaining = [part.shift for part in parts]
    outside = [np.zeros_like(r) for r in tractions]
    multipliers = np.zeros_like(works)
    before = np.inf
    for _ in range(SHIFT_STAGES):
        # The other forces tell the size of tractions that are still zero.
        usual = max(largest_component(comm, tractions), float(np.linalg.norm(works)) / area)
        wanted = []
        for i, r in enumerate(tractions):
            share = _at_most(LONGEST_SHARE * usual, remaining[i])
            wanted.append(r + _at_most(LONGEST_OUTSIDE * usual, outside[i]) + share)
            remaining[i] = remaining[i] - share
        state = Nearest(comm, parts, wanted, works, give, multipliers, area).solve()
        multipliers = state.multipliers
        tractions = state.tractions
        outside = state.outside
        # Another solve from here can still improve the last digits of the balance.
        exact = state.size <= 10 * IMBALANCE_ROUND_OFF * state.forces
        small = state.size <= SMALL_IMBALANCE * state.forces
        stagnates = small and state.size > 0.5 * before
        if largest_component(comm, remaining) == 0.0 and (exact or stagnates):
            break
        before = state.size
    return tractions, state.imbalance, state.forces


def largest_component(comm: MPI.Comm, arrays: list[np.ndarray]) -> float:
    """Return the largest absolute value of the arrays of all ranks; collective."""
    largest = 0.0
    for array in arrays:
        largest = max(largest, float(abs(array).max(initial=0.0)))
    return comm.allreduce(largest, MPI.MAX)


def _at_most(length: float, vectors: np.ndarray) -> np.ndarray:
    """Shorten vectors (..., d) to a length where they are longer."""
    sizes = np.linalg.norm(vectors, axis=-1)
    return clip(vectors, sizes, np.full(sizes.shape, length))
