"""C kernels of axisymmetric bodies: the work for each cell and patch.

They are a library of their own: who has no axisymmetric body does not compile them.
"""

from pathlib import Path

from erc_contact.base.library import Library, library

FOLDER = Path(__file__).parent
"""Where their sources are."""
BLOCK = 8
"""Numbers that they work on at once: rows of tables are whole blocks of them."""


def ring_kernels() -> Library:
    """Return the kernels, compiled at the first call on a machine."""
    return library(FOLDER, 2)
