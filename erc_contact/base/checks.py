"""Checks of numbers that users give: Python's and numpy's are welcome, the rest is refused in words."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from math import isfinite
from numbers import Integral, Real
from typing import Any

from erc_contact.base.exceptions import InputError

LONG = 80
"""Characters of a value that a message shows."""


def description(value: Any) -> str:
    """Return what was got, in words that are not too many."""
    words = repr(value)
    return words if len(words) <= LONG else f"an object of type {type(value).__name__}"


def positive(what: str, value: Any, meaning: str) -> float:
    """A finite number > 0.

    Args:
        what: Name of the argument.
        value: What the user gave.
        meaning: What it must be, in words.

    Raises:
        InputError: If it is none.
    """
    if (
        isinstance(value, bool)
        or not isinstance(value, Real)
        or not isfinite(value)
        or not float(value) > 0
    ):
        raise InputError(f"{what} is {value!r}; it must be {meaning}.")
    return float(value)


def fraction(what: str, value: Any) -> float:
    """A number in (0, 1].

    Raises:
        InputError: If it is none.
    """
    if isinstance(value, bool) or not isinstance(value, Real) or not 0 < float(value) <= 1:
        raise InputError(f"{what} is {value!r}; it must lie in (0, 1].")
    return float(value)


def whole(what: str, value: Any, least: int) -> int:
    """A whole number; 1e6 is one, too.

    Raises:
        InputError: If it is none, or below ``least``.
    """
    number = isinstance(value, Integral) or (isinstance(value, Real) and float(value).is_integer())
    if isinstance(value, bool) or not number or int(value) < least:
        raise InputError(f"{what} is {value!r}; it must be a whole number, >= {least}.")
    return int(value)


def accuracy(what: str, value: Any) -> float:
    """A relative error.

    Raises:
        InputError: If it is none.
    """
    return positive(what, value, "a relative error > 0, e.g. 0.02 for 2%")


def increasing(what: str, values: Any) -> list[float]:
    """Finite numbers that increase.

    Raises:
        InputError: If they are none, or there is none.
    """
    given = list(values) if isinstance(values, Iterable) and not isinstance(values, str) else []
    if not given or not all(isinstance(v, Real) and isfinite(v) for v in given):
        raise InputError(
            f"{what} is {description(values)}; give finite numbers that increase, e.g. np.linspace(0, 1, 21)."
        )
    numbers = [float(v) for v in given]
    for one, following in pairwise(numbers):
        if not following > one:
            raise InputError(f"{what} must increase; {following:g} comes after {one:g}.")
    return numbers
