"""Foresee time and number of cells of a run, and warn before the time is spent.

Symbols: eps relative error, d dimension, k degree.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log, sqrt

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.sizes import PREDICTIVE_ERROR, is_out_of_reach, size_map
from erc_contact.run.step import Step
from namedmesh.base.percent import percent

FORESEEN_FALL = 2.0
"""Greatest fall of the error to an accuracy over which cells are foreseen [-].

Where more is missing a mesh does not see yet where its elements have to be.
"""
FORESEEN_FALL_BY_SIZES = 4.0
"""The same where the optimal mesh tells, which a run makes in one step so far [-]."""


def mesh_under_way(steps: Sequence[Step], cells: int, accuracy: float | None) -> str:
    """Say which mesh is under way, from which error to which, and how long it takes.

    Its time is the time of the last mesh, in proportion to the cells.

    Args:
        steps: The rows of the meshes before it.
        cells: Number of its cells.
        accuracy: The relative error that is asked for; None in a run with a goal.

    Example:
        >>> mesh_under_way(steps, 23000, 0.05)
        'mesh 4, 23 000 cells, 12% -> 5%, about 40 s'
    """
    number = f"{cells:,}".replace(",", " ")
    words = f"mesh {len(steps) + 1}, {number} cells"
    if not steps:
        return words
    last = steps[-1]
    if accuracy is not None:
        words += f", {percent(last.total, 2)} -> {percent(accuracy, 2)}"
    of_last = last.solve_seconds + last.equilibrate_seconds + last.error_seconds
    return words + duration(of_last * cells / last.cells)


def duration(seconds: float) -> str:
    """Return ", about 40 s" of a time that is foreseen; nothing of a short one [s]."""
    for unit, name in ((3600.0, "h"), (60.0, "min"), (1.0, "s")):
        if seconds >= 1.5 * unit:
            return f", about {float(f'{seconds / unit:.1g}'):g} {name}"
    return ""


def foresee_cells(steps: Sequence[Step], accuracy: float, order: float) -> float | None:
    """Foresee the number of cells with which a run reaches an accuracy.

    The last two meshes tell a power of eps by which cells grow. It is at least the
    power of smooth solutions, and at most twice as much: the first meshes of a run
    lower eps faster, when they find a singular point, or slower, when they find an
    edge.

    Args:
        steps: The rows of the run.
        accuracy: The relative error.
        order: k/d, the best slope of eps over cells.

    Returns:
        The number of cells, on most scenes right to 20%; None where the meshes are too
        coarse to tell.
    """
    if len(steps) < 2:
        return None
    before, last = steps[-2:]
    if max(before.total, last.total) > PREDICTIVE_ERROR:
        return None
    fall = last.total / accuracy
    if fall > FORESEEN_FALL or not before.total > last.total:
        return None
    power = log(last.cells / before.cells) / log(before.total / last.total)
    smooth = 1 / order
    return float(last.cells * fall ** min(max(power, smooth), 2 * smooth))


def foresee_by_sizes(
    steps: Sequence[Step], error: ConstitutiveError, accuracy: float
) -> float | None:
    """Foresee the number of cells of a run that meshes again by sizes; collective.

    The cells of the optimal mesh are a second prediction, which integrates what the
    last mesh has found, and needs no row before it. It tends to be too small, because
    no mesh has just the sizes that are asked for, and the power of the last two meshes
    too large, because part of the cells of the one before are at wrong places. So their
    geometric mean is told where both are known.

    Args:
        steps: The rows of the run.
        error: The error of the last of them.
        accuracy: The relative error.

    Returns:
        The number of cells; None where the meshes are too coarse to tell.
    """
    if len(steps) < 2 or error.total > PREDICTIVE_ERROR:
        return None
    if error.total / accuracy > FORESEEN_FALL_BY_SIZES:
        return None
    optimal = size_map(error, accuracy).predicted_cells
    by_power = foresee_cells(steps, accuracy, error.degree / error.domain.dim)
    return optimal if by_power is None else sqrt(optimal * by_power)


def too_many_cells(
    steps: Sequence[Step], error: ConstitutiveError, accuracy: float, max_cells: int, by_sizes: bool
) -> str:
    """Say in words that an accuracy takes more cells than allowed, or nothing.

    The call is collective. A number is told only where it can be foreseen. Elsewhere
    the optimal mesh must exceed what is allowed by a factor.

    Args:
        steps: The rows of the run.
        error: The error of the last of them.
        accuracy: The relative error that is asked for.
        max_cells: Greatest number of cells that is allowed.
        by_sizes: Whether the run meshes again by sizes.
    """
    # The first mesh is mostly too coarse to know.
    if len(steps) < 2 or error.total > PREDICTIVE_ERROR:
        return ""
    order = error.degree / error.domain.dim
    # Most runs need no look at the sizes of the optimal mesh, which takes time.
    equal = steps[-1].cells * (error.total / accuracy) ** (1 / order)
    cells = foresee_cells(steps, accuracy, order)
    if by_sizes and max(equal, cells or 0.0) > max_cells / 2:
        cells = foresee_by_sizes(steps, error, accuracy)
    ending = f", it seems; max_cells = {max_cells} will end the run."
    if cells is not None:
        number = f"{percent(accuracy)} takes about {cells:.2g} cells"
        return number + ending if cells > max_cells else ""
    if not is_out_of_reach(error, accuracy, max_cells):
        return ""
    return f"{percent(accuracy)} takes more cells than are allowed" + ending
