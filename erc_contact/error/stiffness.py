"""Compute the stiffness between two steps of a history.

Symbols: F force of a contact on the body, U mean displacement of a part, a direction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.fields import sides_of
from erc_contact.base.exceptions import InputError
from erc_contact.error.bounds import resultant
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.numbers import ROUND_OFF, Bounds
from namedmesh.simplex import rule


def stiffness(
    first: ConstitutiveError,
    second: ConstitutiveError,
    contact: str,
    part: str,
    direction: Sequence[float],
) -> Bounds:
    """Compute the force of a contact over the way of a part, of two steps; collective.

    It is ``-(F_2 - F_1).a / ((U_2 - U_1).a)``, positive where the contact resists the
    way. The forces have their intervals (:func:`erc_contact.resultant`), each given the
    history before its step. The way is known where a support prescribes it. Where it
    does not, or the law has no interval of forces, the stiffness has no bound.

    Args:
        first: The error at the end of a step.
        second: The error at the end of another step.
        contact: Name of the contact.
        part: Name of the boundary part that moves.
        direction: a [-], d numbers, of any length.

    Returns:
        The stiffness [force/length], between -inf and inf where it has no bound.

    Raises:
        InputError: If no contact or part has its name, the direction is not d finite
            numbers, not all zero, or the part does not move along it.

    Example:
        >>> first, second = evolution.errors
        >>> bounds = ec.stiffness(first, second, "bottom", "top", direction=(1.0, 0.0))
        >>> bool(bounds.low <= bounds.value <= bounds.high)
        True
    """
    space = second.model.space
    a = np.asarray(direction, dtype=float)
    if a.shape != (space.d,) or not np.isfinite(a).all() or not a.any():
        raise InputError(
            f"stiffness: the direction is {direction!r}; give {space.d} finite numbers, not all 0."
        )
    a = a / np.linalg.norm(a)
    errors = (first, second)
    before, after = (mean_displacement(error, part) @ a for error in errors)
    way = after - before
    if abs(way) <= ROUND_OFF * space.domain.extent:
        raise InputError(
            f"stiffness: {part!r} does not move along {tuple(direction)} between both steps; give"
            " another direction, part, or steps."
        )
    F_1, F_2 = (error.force(contact).force @ a for error in errors)
    value = -(F_2 - F_1) / way
    if first.model.linearised is not None or not all(_is_prescribed(e, part, a) for e in errors):
        return Bounds(value, -np.inf, np.inf, guaranteed=False)
    of_first, of_second = (resultant(error, contact, a) for error in errors)
    least, most = of_second.low - of_first.high, of_second.high - of_first.low
    low, high = sorted((-least / way, -most / way))
    return Bounds((low + high) / 2, low, high, of_first.guaranteed and of_second.guaranteed)


def mean_displacement(error: ConstitutiveError, part: str) -> np.ndarray:
    """Compute the mean of u^ over a boundary part [length], shape (d,); collective."""
    space = error.model.space
    sides = sides_of(error.model, part)
    points, weights = rule(space.d - 1, space.degree + 1)
    u = space.evaluate(error.admissible.displacement, points, sides)
    areas = space.facet_weights(sides, points, weights)
    local = np.append((areas[..., None] * u).sum(axis=(0, 1)), areas.sum())
    *total, area = space.comm.allreduce(local, MPI.SUM)
    return np.array(total) / area


def _is_prescribed(error: ConstitutiveError, part: str, a: np.ndarray) -> bool:
    """Tell whether supports prescribe the displacement of a part along a direction."""
    held = np.zeros(len(a), dtype=bool)
    for support in error.model.scene.supports:
        if support.facets == part and hasattr(support, "value"):
            held |= np.array([component is not None for component in support.value])
    return bool(held[a != 0.0].all())
