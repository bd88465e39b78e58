"""Make of names of parts what files and pictures can bear.

Names come from mesh files of others: they may look like paths or formulas, be longer
than a file system allows, or have characters that a terminal obeys.
"""

from __future__ import annotations

import re
from hashlib import sha256

LONGEST_STEM = 60
"""Greatest number of letters of a name that a name of a file keeps."""
LONGEST_SHOWN = 60
"""Greatest number of letters of a name that a picture shows."""
LONGEST_NAME = 1000
"""Greatest number of letters of a name from a file."""
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


def in_picture(name: str) -> str:
    """Return a name as matplotlib draws it: no formula, and not long."""
    shown = printable(name)
    if len(shown) > LONGEST_SHOWN:
        shown = f"{shown[: LONGEST_SHOWN - 3]}..."
    return shown.replace("$", r"\$")
