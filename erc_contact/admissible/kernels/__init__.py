"""C kernels of the reconstruction: the work for each cell, facet and patch."""

from pathlib import Path

from erc_contact.base.library import Library, compile_ahead, library

FOLDER = Path(__file__).parent
"""Where their sources are."""


def kernels(d: int) -> Library:
    """Return the kernels of a dimension, compiled at the first call on a machine."""
    return library(FOLDER, d)


def kernels_ahead(d: int) -> None:
    """Compile the kernels beside what follows, at the first call on a machine."""
    compile_ahead(FOLDER, d)
