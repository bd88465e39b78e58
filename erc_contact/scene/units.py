"""Write the units of a user's numbers in pictures, tables, reports and prints.

Nothing is computed with units: any consistent system will do, and these are its names.
"""

from __future__ import annotations

import re

from erc_contact.base.exceptions import InputError
from namedmesh.base.checks import description

DIMENSION = re.compile(
    r"\[(sqrt\()?(length|force|force/area|force length|force/length\^1\.5)(\))?\]"
)
"""Pattern of a dimension in a label."""


def check_units(units: str) -> str:
    """Check units of length, force and stress, "" or such as "mm, N, MPa"; return them.

    Raises:
        InputError: If they are no three words with commas between them.
    """
    if not isinstance(units, str):
        raise InputError(_refused(f"units is {description(units)}"))
    words = [word.strip() for word in units.split(",")]
    if units and (len(words) != 3 or not all(words)):
        raise InputError(_refused(f"units is {units!r}"))
    return units


def _refused(got: str) -> str:
    """Return what is wrong with units."""
    return f"Scene: {got}; give the units of length, force and stress, as in 'mm, N, MPa'."


def in_units(text: str, units: str) -> str:
    """Return a text with units in place of the dimensions of its labels.

    Args:
        text: The text.
        units: Units of length, force and stress; "" leaves it as it is.

    Example:
        >>> in_units("pressure [force/area] over x [length]", "mm, N, MPa")
        'pressure [MPa] over x [mm]'
    """
    if not units:
        return text
    length, force, stress = (word.strip() for word in units.split(","))
    names = {
        "length": length,
        "force": force,
        "force/area": stress,
        "force length": f"{force}·{length}",
        "force/length^1.5": f"{stress}·√{length}",
    }

    def named(found: re.Match[str]) -> str:
        root, dimension, end = found.groups("")
        return f"[{root}{names[dimension]}{end}]"

    return DIMENSION.sub(named, text)


def unit_of(dimension: str, units: str) -> str:
    """Return the unit of a dimension as it stands behind a number; "" if none is known.

    Args:
        dimension: A dimension of labels, or "" of a pure number.
        units: Units of length, force and stress, or "".

    Example:
        >>> f"12{unit_of('force length', 'mm, N, MPa')}"
        '12 N·mm'
    """
    return f" {in_units(f'[{dimension}]', units)[1:-1]}" if dimension and units else ""
