"""Numbers and places in words, for messages and tables."""

from __future__ import annotations

from collections.abc import Iterable
from math import floor, log10

PLURALS = {"vertex": "vertices", "hexahedron": "hexahedra", "tetrahedron": "tetrahedra"}
"""Plurals that do not end with an s."""


def percent(ratio: float, digits: int = 4) -> str:
    """Return a ratio in percent, with about so many significant digits.

    Examples are 12.3%, 0.0123%, 1.2e-5% and 2345%. With 3 digits it takes at most 7
    characters, so that it fits a column.

    Args:
        ratio: The ratio, >= 0 [-].
        digits: Significant digits; numbers with an exponent have one less, and
            round-off has two less.
    """
    size = 100.0 * ratio
    if size < 1e6 and float(f"{size:.{digits}g}") >= 100:
        return f"{size:.0f}%"
    if size == 0 or 0.01 <= size < 100:
        return f"{size:.{digits}g}%"
    is_round_off = size < 1e-9
    mantissa, power, exponent = f"{size:.{max(digits - 2 - is_round_off, 0)}e}".partition("e")
    return f"{mantissa}e{int(exponent)}%" if power else f"{mantissa}%"


def enough(number: float) -> str:
    """Write a number of two digits that is a little greater than a number >= 0.

    Example:
        >>> enough(0.0312), enough(2.0), enough(0.0)
        ('0.032', '2.1', '0')
    """
    if number <= 0:
        return "0"
    digit = 10.0 ** (floor(log10(number)) - 1)
    return f"{(floor(number / digit * (1 + 1e-9)) + 1) * digit:.2g}"


def counted(number: int, kind: str) -> str:
    """Return a number of things in words.

    Example:
        >>> counted(1, "face"), counted(2, "face"), counted(2, "tetrahedron")
        ('1 face', '2 faces', '2 tetrahedra')
    """
    return f"{number} {kind}" if number == 1 else f"{number} {PLURALS.get(kind, kind + 's')}"


def place_words(coordinates: Iterable[float], digits: int = 4) -> str:
    """Return a place or a direction in words, with so many significant digits.

    Example:
        >>> place_words((0.5, -0.0))
        '(0.5, 0)'
    """
    # Adding zero turns -0 into 0.
    words = [f"{coordinate + 0.0:.{digits}g}" for coordinate in coordinates]
    return f"({', '.join(words)})"
