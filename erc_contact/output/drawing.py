"""Make axes, directions and labels that plots and pictures share.

Symbols: n normal of the foundation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.model.space import Space
from namedmesh.base.percent import place_words

STATUS_NAMES = ("open", "slip", "stick", "closed")
"""Names of the codes OPEN, SLIP, STICK and CLOSED."""
STATUS_COLOURS = ("#f0f0f0", "#fbdcb4", "#c9e0f2", "#d9e6c8")
"""Colours of open, slip, stick and closed, which the colour-blind can tell apart.

They are grey, orange, blue and green; green is alone or beside grey.
"""


def bar_axes(figure: Any) -> Any:
    """Add axes of a colour bar to a figure, which are placed later."""
    # matplotlib gives this name to the axes that it makes itself.
    return figure.add_axes((0.0, 0.0, 1.0, 1.0), label="<colorbar>")


def panels_of(ax: Any, count: int, what: str) -> np.ndarray:
    """Return the axes that a user gave, as an array.

    Raises:
        InputError: If there are not so many.
    """
    axes = np.ravel(ax)
    if len(axes) != count:
        raise InputError(f"{what}: ax has {len(axes)} axes; it needs {count}.")
    return axes


def only_turned(what: str, space: Space) -> None:
    """Refuse a body that is not axisymmetric."""
    if not space.axisymmetric:
        raise InputError(
            f"{what}: the body is not axisymmetric; give its material the hypothesis "
            "'axisymmetric', or use draw_deformed as it is."
        )


def log_ticks(low: float, high: float) -> np.ndarray:
    """Find ticks of a logarithmic scale with plain numbers.

    They are powers of ten, or more numbers if the range is narrow.
    """
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

    powers = 10.0 ** np.arange(-30, 30)
    candidates = []
    for digits in ((1,), (1, 2, 5), (1, 2, 3, 4, 5, 6, 8)):
        candidates.append(np.outer(powers, digits).ravel())
    candidates.append(MaxNLocator(5).tick_values(low, high))
    # The coarsest series that has three ticks in the range is the one to read.
    ticks = powers
    for candidate in candidates:
        ticks = candidate[(candidate >= low) & (candidate <= high)]
        if len(ticks) > 2:
            break
    return ticks


def tangents(n: np.ndarray) -> np.ndarray:
    """Compute d-1 orthonormal tangents for a normal n (d,), shape (d-1, d).

    They are near to the coordinate axes that make the largest angles with the normal.
    """
    d = len(n)
    axes = np.sort(np.argsort(abs(n), kind="stable")[: d - 1])
    if abs(n).max() in (0.0, 1.0):
        return np.eye(d)[axes]
    q, r = np.linalg.qr(np.column_stack([n, np.eye(d)[:, axes]]))
    # QR leaves signs open; a tangent points along its coordinate axis.
    signs = np.sign(np.diag(r))
    return (q * signs)[:, 1:].T


def words(vector: np.ndarray, scale: float = 1.0) -> str:
    """Write the components of a direction or a place, with three digits of a scale."""
    digits = 3 - int(np.floor(np.log10(scale)))
    return place_words(np.round(vector, digits))


def coordinate(tangent: np.ndarray, letters: str) -> str:
    """Return the label of the axis of a coordinate along a tangent.

    ``letters`` are the names of the coordinates.
    """
    if tangent.max() == 1.0:
        return f"{letters[tangent.argmax()]} [length]"
    return f"along {words(tangent)} [length]"


def weighted_level(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """Compute a quantile of weighted values.

    It is the least value such that values up to it have this share of the weight.
    """
    order = np.argsort(values)
    carried = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(carried, share * carried[-1])])
