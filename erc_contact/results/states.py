"""Compute what a body remembers after a load step: plastic strain, say."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.base.exceptions import InputError
from erc_contact.model.law.law_entries import place_of
from erc_contact.scene.material import mandel_basis
from erc_contact.scene.potential import Shapes

ACCUMULATED = "accumulated"
"""Name of the entry that is > 0 where a body has yielded."""


def state(result: Any, name: str) -> np.ndarray:
    """Compute the mean of an entry of the state in each owned cell; collective.

    It is the state at the end of the load step of the result.

    Args:
        result: An admissible pair, an error, or a history.
        name: Name of the entry, of :class:`erc_contact.Plastic` "plastic_strain" or
            "accumulated".

    Returns:
        Numbers, shape (owned,), or tensors, shape (owned, 3, 3).

    Raises:
        InputError: If the law has no state of this name.

    Example:
        >>> ec.results.state(yielded, "accumulated").max() > 0
        True
    """
    pair = pair_of(result)
    shapes = states_of(pair)
    if name not in shapes:
        known = ", ".join(map(repr, shapes)) or "none"
        raise InputError(
            f"state: {type(pair.model.scene.material).__name__} has no state {name!r}; it has "
            f"{known}."
        )
    means = _values(pair)[..., place_of(shapes, name)].mean(axis=1)
    if not shapes[name]:
        return np.asarray(means[:, 0])
    return np.tensordot(means, mandel_basis(3), axes=1)


def plastic_share(result: Any) -> float:
    """Return the share of the volume of the bodies that has yielded [-]; collective.

    Args:
        result: An admissible pair, an error, or a history.

    Raises:
        InputError: If the law has no accumulated plastic strain.

    Example:
        >>> 0.0 < ec.results.plastic_share(yielded) < 1.0
        True
    """
    pair = pair_of(result)
    shapes = states_of(pair)
    if ACCUMULATED not in shapes:
        raise InputError(
            f"plastic_share: {type(pair.model.scene.material).__name__} has no state "
            f"{ACCUMULATED!r}."
        )
    has_yielded = _values(pair)[..., place_of(shapes, ACCUMULATED)] > 0
    cells = pair.cell_geometry
    owned = len(has_yielded)
    middles = cells.corners[:owned].mean(axis=1)
    volume = pair.model.space.section.times(cells.volume[:owned], middles)
    shares = has_yielded.mean(axis=(1, 2))
    comm = pair.domain.comm
    yielded = comm.allreduce(float(volume @ shares), MPI.SUM)
    return yielded / comm.allreduce(float(volume.sum()), MPI.SUM)


def states_of(pair: Admissible) -> Shapes:
    """Return the entries of the state of the law, none of laws without."""
    shapes: Shapes = getattr(pair.model.scene.material, "state", {})
    return shapes


def _values(pair: Admissible) -> np.ndarray:
    """Return the state at the end of the step inside owned cells, (owned, q, size)."""
    model = pair.model
    assert model.linearised is not None
    after = model.linearised.state_at_end(pair.solution.u)
    assert after is not None
    return after.in_cells(model.space.owned_cells)
