"""Make of names of parts what files, pictures and messages can bear.

Names come from mesh files of others: they may look like paths or formulas, be longer
than a file system allows, or have characters that a terminal obeys.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches
from hashlib import sha256
from itertools import accumulate

LONGEST_STEM = 60
"""Greatest number of letters of a name that a name of a file keeps."""
LONGEST_SHOWN = 60
"""Greatest number of letters of a name that a picture shows."""
LONGEST_NAME = 1000
"""Greatest number of letters of a name from a file."""
MOST_SHOWN = 12
"""Greatest number of names that a line shows."""
LINE_WIDTH = 72
"""Greatest number of letters of a line of several names."""
HASHED = re.compile(r"-[0-9a-f]{8}")
"""End of the name of a file that does not tell all of a name."""


def file_stem(name: str) -> str:
    """Return what stands for a name in the name of a file.

    Letters, digits, dashes and underscores stay. A name that has others, or is long,
    gets a hash at its end, so that different names stay different.

    Example:
        >>> file_stem("bottom"), file_stem("nut/bolt")
        ('bottom', 'nut-bolt-81c04b8a')
    """
    stem = re.sub(r"[^A-Za-z0-9_-]+", "-", name)[:LONGEST_STEM]
    if stem == name and stem and not HASHED.fullmatch(stem[-9:]):
        return stem
    digest = sha256(name.encode(errors="surrogatepass")).hexdigest()
    return f"{stem.strip('-')}-{digest[:8]}"


def printable(name: str) -> str:
    """Return a name in one line, not long, without characters that cannot be seen."""
    seen = "".join(letter if letter.isprintable() else "?" for letter in name)
    return seen if len(seen) <= LONGEST_NAME else f"{seen[:LONGEST_NAME]}..."


def listed(names: Iterable[str]) -> str:
    """Return names in alphabetical order as text, or "none"."""
    return ", ".join(sorted(names)) or "none"


def known_names(name: object, names: Iterable[str]) -> str:
    """End a message about an unknown name: list the known names, and the nearest one.

    Args:
        name: What was given in the place of a name.
        names: The known names.

    Example:
        >>> known_names("botom", ["top", "bottom"])
        "bottom, top. Did you mean 'bottom'?"
        >>> known_names("foot", [])
        'none.'
    """
    known = list(names)
    near = get_close_matches(str(name), known, n=1)
    question = f" Did you mean {near[0]!r}?" if near else ""
    return f"{listed(known)}.{question}"


def first_names(names: Iterable[str]) -> str:
    """List names in a line of a terminal, and of many only the first names.

    Example:
        >>> first_names(str(number) for number in range(104))
        '0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11 and 92 more'
    """
    known = list(names)
    widths = accumulate(len(name) + len(", ") for name in known[1:MOST_SHOWN])
    count = 1 + sum(len(known[0]) + width <= LINE_WIDTH for width in widths) if known else 0
    shown = ", ".join(known[:count])
    more = len(known) - count
    return f"{shown} and {more} more" if more > 0 else shown


def in_picture(name: str) -> str:
    """Return a name as matplotlib draws it: no formula, and not long."""
    shown = printable(name)
    if len(shown) > LONGEST_SHOWN:
        shown = f"{shown[: LONGEST_SHOWN - 3]}..."
    return shown.replace("$", r"\$")
