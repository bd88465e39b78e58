"""Draw a picture of the sizes of the next mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.error.sizes import Sizes
from erc_contact.output.maps import Scale
from erc_contact.output.pictures import draw_cells


def draw_sizes(sizes: Sizes, path: str | Path | None = None, *, ax: Any = None) -> Any:
    """Draw r_E of each element on a logarithmic colour scale; collective.

    This is the ratio of its new size to its old size.

    Args:
        sizes: The sizes, whose ``ratio`` is drawn on the mesh from which they follow.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, in 2D; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks; in 3D an array of two.
    """

    def scale(ratio: np.ndarray) -> Scale:
        from matplotlib.colors import LogNorm  # noqa: PLC0415

        # A range of no width would have no colours.
        low = float(ratio.min()) / 1.05
        high = float(ratio.max()) * 1.05
        return Scale(LogNorm(low, high), "neither", "new over old size [-], log scale")

    return draw_cells(sizes.error.admissible, sizes.ratio, scale, path, ax)
