"""C kernels of sparse matrices."""

from pathlib import Path

from erc_contact.base.library import Library, library

FOLDER = Path(__file__).parent
"""Where their sources are."""


def matrix_kernels(d: int) -> Library:
    """Return the kernels for blocks of d x d, compiled once on a machine."""
    return library(FOLDER, d)
