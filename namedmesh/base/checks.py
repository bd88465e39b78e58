"""Check numbers that users give; types of Python and of numpy are welcome."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from math import isfinite
from numbers import Integral, Real
from typing import Any

import numpy as np

from namedmesh.base.exceptions import InputError

LONGEST_VALUE = 80
"""Characters of a value that a message shows."""


def description(value: Any) -> str:
    """Return a value in words that are not too many, for a message."""
    words = repr(value)
    return words if len(words) <= LONGEST_VALUE else f"an object of type {type(value).__name__}"


def is_number(value: Any) -> bool:
    """Tell whether a value is a finite number, and no truth value."""
    return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)


def positive(what: str, value: Any, meaning: str) -> float:
    """Return a finite number > 0.

    Args:
        what: Name of the argument.
        value: What the user gave.
        meaning: What it must be, in words.

    Raises:
        InputError: If it is none.
    """
    if not is_number(value) or not float(value) > 0:
        raise InputError(f"{what} is {value!r}; it must be {meaning}.")
    return float(value)


def fraction(what: str, value: Any) -> float:
    """Return a number in (0, 1].

    Raises:
        InputError: If it is none.
    """
    if not is_number(value) or not 0 < float(value) <= 1:
        raise InputError(f"{what} is {value!r}; it must lie in (0, 1].")
    return float(value)


def whole(what: str, value: Any, least: int) -> int:
    """Return a whole number; 1e6 is one, too.

    Raises:
        InputError: If it is none, or below ``least``.
    """
    is_whole = isinstance(value, Integral)
    if isinstance(value, Real) and not is_whole:
        is_whole = float(value).is_integer()
    if isinstance(value, bool) or not is_whole or int(value) < least:
        raise InputError(f"{what} is {value!r}; it must be a whole number, >= {least}.")
    return int(value)


def accuracy(what: str, value: Any) -> float:
    """Return a relative error > 0 [-].

    Raises:
        InputError: If it is none.
    """
    return positive(what, value, "a relative error > 0, e.g. 0.02 for 2%")


def increasing(what: str, values: Any) -> list[float]:
    """Return finite numbers that increase.

    Raises:
        InputError: If they are none, or there is none.
    """
    entries: list[Any] = []
    if isinstance(values, Iterable) and not isinstance(values, str):
        entries = list(values)
    are_numbers = all(isinstance(entry, Real) and isfinite(entry) for entry in entries)
    if not entries or not are_numbers:
        raise InputError(
            f"{what} is {description(values)}; give finite numbers that increase, e.g. "
            "np.linspace(0, 1, 21)."
        )
    numbers = [float(entry) for entry in entries]
    for previous, following in pairwise(numbers):
        if not following > previous:
            raise InputError(f"{what} must increase; {following:g} comes after {previous:g}.")
    return numbers


def cells_to_refine(cells: Any, owned: int) -> np.ndarray:
    """Return the numbers of cells to refine, from 0 to ``owned - 1``; None is all.

    Raises:
        InputError: If they are not numbers of cells of this rank.
    """
    if cells is None:
        return np.arange(owned, dtype=np.int32)
    numbers = np.asarray(cells)
    if numbers.size == 0:
        return np.empty(0, dtype=np.int32)
    if numbers.ndim != 1 or not np.issubdtype(numbers.dtype, np.integer):
        raise InputError(
            f"refined: the cells are {description(cells)}; give numbers of cells of this "
            "rank, e.g. np.flatnonzero(mask)."
        )
    if numbers.min() < 0 or numbers.max() >= owned:
        raise InputError(
            f"refined: the cells go from {numbers.min()} to {numbers.max()}; this rank has 0 to "
            f"{owned - 1}."
        )
    return numbers.astype(np.int32)
