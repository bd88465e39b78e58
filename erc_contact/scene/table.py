"""Declare tables: measured or computed values between which data are linear.

A table is a callable of the position, as all data of a scene are. In UFL it is an
operator of its own (:mod:`erc_contact.base.ufl_tables`). Where a scene meets its mesh,
numpy evaluates it (:mod:`erc_contact.model.data.tables`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_tables import TableData, TableValue
from namedmesh.base.checks import description


class table:
    """Declare data by values at points, linear between them.

    It is a value wherever a scene takes a callable of x: a gap, a friction coefficient,
    a load, a modulus, a temperature. ``table(x, values)`` itself is one of the first
    coordinate, or of the first two; called with UFL, as in
    ``lambda x: profile(ufl.sqrt(x[0] ** 2 + x[1] ** 2))``, it is one of a radius. Of
    numbers and arrays it returns numbers. Beyond its ends it keeps the value at the
    end, as ``np.interp`` does.

    Args:
        x: Points in increasing order, shape (n,); or a pair of these, of the two
            coordinates of a grid, shapes (n,) and (m,).
        values: The values, shape (n,), or (n, m) on a grid. On a grid they are linear
            in each coordinate.

    Raises:
        InputError: If the points do not increase, the shapes differ, or a number is not
            finite.

    Example:
        >>> rough = ec.table([0.0, 1.0, 2.0], [0.0, 0.01, 0.0])
        >>> ec.Contact("bottom", gap=rough).gap(0.5)
        0.005
    """

    def __init__(self, x: Any, values: Any) -> None:
        grid = x if _is_pair(x) else [x]
        points = [_numbers("x", coordinate) for coordinate in grid]
        self.x = points if _is_pair(x) else points[0]
        self.values = _numbers("values", values)
        for coordinate in points:
            if coordinate.ndim != 1 or len(coordinate) < 2:
                raise InputError(
                    f"table: x has the shape {coordinate.shape}; give two points or more, in a"
                    " list, or a pair of two lists."
                )
            steps = np.diff(coordinate)
            if steps.min() <= 0:
                place = int(steps.argmin())
                raise InputError(
                    f"table: x goes from {coordinate[place]:g} to {coordinate[place + 1]:g} at"
                    f" number {place}; sort the points, each of them once. A jump is a steep"
                    " piece: two points near each other."
                )
        shape = tuple(len(coordinate) for coordinate in points)
        if self.values.shape != shape:
            raise InputError(
                f"table: values have the shape {self.values.shape}, and the points need {shape}:"
                " one value for each."
            )

    @cached_property
    def _digest(self) -> str:
        """Return a text that tells these numbers from other numbers."""
        code = b"|".join(array.tobytes() for array in [*self._grid, self.values])
        return hashlib.sha256(code).hexdigest()[:16]

    @property
    def _grid(self) -> list[np.ndarray]:
        """Return the points along each coordinate."""
        return self.x if isinstance(self.x, list) else [self.x]

    def __repr__(self) -> str:
        """Describe the table in a line."""
        counts = " x ".join(str(len(points)) for points in self._grid)
        return f"<table of {counts} points>"

    def __call__(self, *coordinates: Any) -> Any:
        """Return the value at coordinates: UFL of UFL, numbers of numbers.

        Args:
            coordinates: One scalar for each coordinate of the table; or the position x,
                of which it takes the first ones.

        Raises:
            InputError: If their number is another one.
        """
        count = len(self._grid)
        if len(coordinates) == 1 and _is_vector(coordinates[0], count):
            coordinates = tuple(coordinates[0][i] for i in range(count))
        if len(coordinates) != count:
            raise InputError(
                f"A table of {count} coordinates was called with {len(coordinates)}; give"
                f" {count}, or the position x."
            )
        if any(isinstance(value, ufl.core.expr.Expr) for value in coordinates):
            scalars = [ufl.as_ufl(value) for value in coordinates]
            if any(scalar.ufl_shape for scalar in scalars):
                raise InputError(
                    "A table was called with a vector; give scalars, e.g. x[0], or the position."
                )
            return TableValue(*scalars, TableData(self, self._digest))
        arrays = np.broadcast_arrays(*[np.asarray(value, dtype=float) for value in coordinates])
        values = self.interpolated(np.stack(arrays, axis=-1))
        return values if values.ndim else float(values)

    def interpolated(self, places: np.ndarray, slope: int | None = None) -> np.ndarray:
        """Evaluate the table, or a slope of it, at places (..., count) by numpy.

        Args:
            places: Coordinates; the last axis counts the coordinates of the table.
            slope: Number of the coordinate whose derivative is meant; None for the
                values.
        """
        grid = self._grid
        if len(grid) == 1 and slope is None:
            return np.interp(places[..., 0], grid[0], self.values)
        # On a grid the weights of neighbours multiply, coordinate by coordinate.
        result = np.zeros(places.shape[:-1])
        lower = []
        weights = []
        for number, points in enumerate(grid):
            place = places[..., number]
            piece = np.clip(np.searchsorted(points, place, "right") - 1, 0, len(points) - 2)
            step = points[piece + 1] - points[piece]
            share = np.clip((place - points[piece]) / step, 0.0, 1.0)
            pair = [1 - share, share]
            if number == slope:
                outside = (place < points[0]) | (place > points[-1])
                rate = np.where(outside, 0.0, 1 / step)
                pair = [-rate, rate]
            lower.append(piece)
            weights.append(pair)
        for corner in np.ndindex(*[2] * len(grid)):
            place_in_table = tuple(piece + side for piece, side in zip(lower, corner, strict=True))
            product = self.values[place_in_table]
            for pair, side in zip(weights, corner, strict=True):
                product = product * pair[side]
            result += product
        return result

    @property
    def kinks(self) -> list[np.ndarray]:
        """Return the points of each coordinate at which the slope changes."""
        return self._grid


def _is_pair(x: Any) -> bool:
    """Tell whether points are given by two coordinates."""
    sequences = Sequence | np.ndarray
    if not isinstance(x, sequences) or isinstance(x, str) or len(x) != 2:
        return False
    return all(isinstance(points, sequences) and not isinstance(points, str) for points in x)


def _is_vector(value: Any, count: int) -> bool:
    """Tell whether a value is a position, of which a table takes the first numbers."""
    if isinstance(value, ufl.core.expr.Expr):
        return len(value.ufl_shape) == 1
    return count > 1 and np.ndim(value) >= 1


def _numbers(what: str, values: Any) -> np.ndarray:
    """Return values as an array of finite numbers, a copy that nobody can change.

    Raises:
        InputError: If they are none.
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(
            f"table: {what} is {description(values)}; give finite numbers, in a list or an array."
        ) from None
    if not np.isfinite(array).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(
            f"table: {what} is {array[place]} at {place if len(place) != 1 else place[0]}; leave"
            " such points out."
        )
    array.setflags(write=False)
    return array
