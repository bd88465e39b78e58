"""C kernels of the reconstruction: what is done for each cell, facet and patch again and again."""

from pathlib import Path

from erc_contact.base.library import Library, library

FOLDER = Path(__file__).parent
"""Where their sources are."""


def kernels() -> Library:
    """The compiled kernels; they are compiled at the first call on a machine."""
    return library(FOLDER)
