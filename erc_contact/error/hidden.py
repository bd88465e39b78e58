"""Bound what the data of a law do to integrals between the points of quadrature.

Data that vary inside cells, as a yield stress with a narrow dip, may leave the range
that they have at the points of a piece. Where the range in the whole piece is known
(:mod:`erc_contact.model.data.ranges`), the integrand with the data at the ends of this
range, less the integrand with the data at the ends of the range at the points, bounds
what is between them. One number after the other is taken so.

Symbols: n pieces, q points, m numbers of a point, i integrands.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from erc_contact.model.data.quadrature import Hidden, piece_points
from erc_contact.model.law.point_law import PointLaw

OUTSIDE = 1e-5
"""Distance of a range from the data at the points that counts as none, over the range.

The points near the boundary of a piece do not lie on it.
"""
ROUND_OFF = 1e-12
"""The same over the data themselves."""

OfLaw = Callable[[PointLaw, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""A function of a law that returns integrands, else a :data:`.quadrature.Integrand`."""


def hidden_by_data(law: PointLaw, of_cells: np.ndarray, integrands: OfLaw) -> Hidden | None:
    """Make the bound of what integrands of a law may do between points.

    It is None where the data do not vary in cells, or their ranges are not known.

    Args:
        law: The law.
        of_cells: Numbers of the cells that are simplices of the integral.
        integrands: The integrands.
    """
    if not law.knows_ranges:
        return None

    def hidden(
        cell: np.ndarray, corners: np.ndarray, places: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        low, high = law.data_ranges(corners, of_cells[cell])
        data = law.data_at(x, of_cells[cell])
        every_weight = piece_points(x.shape[2]).weights
        inside = np.flatnonzero(every_weight)
        weights = every_weight[inside]
        least = data.min(axis=1)
        greatest = data.max(axis=1)
        allowed = OUTSIDE * (greatest - least) + ROUND_OFF * abs(data).max(axis=1)
        total: np.ndarray | float = 0.0
        for end, at_points, is_beyond in (
            (low, least, low < least - allowed),
            (high, greatest, high > greatest + allowed),
        ):
            for number in np.flatnonzero(is_beyond.any(axis=0)):
                row = np.flatnonzero(is_beyond[:, number])
                values = []
                # The points show what the data do up to their own ends, so that only
                # the rise from there counts.
                for bound in (end, at_points):
                    changed = data[row][:, inside]
                    changed[..., number] = bound[row, None, number]
                    where = cell[row], places[row][:, inside], x[row][:, inside]
                    values.append(integrands(law.with_data(changed), *where))
                rise = abs(np.tensordot(values[0] - values[1], weights, axes=(1, 0)))
                # What is no number for such data may be as large as all of it.
                of_points = abs(values[1]).max(axis=(1, 2))[:, None]
                rise = np.where(np.isfinite(rise), rise, of_points)
                whole = np.zeros((len(cell), rise.shape[1]))
                whole[row] = rise
                total = total + whole
        # Where no range goes beyond the points, nothing hides between them.
        return np.zeros((len(cell), 1)) + total

    return hidden
