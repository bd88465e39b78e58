"""Draw bodies in the plane as polygons and lines of matplotlib; on rank 0.

Vector formats keep them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

MANY_SHAPES = 30_000
"""Number of polygons or lines above which vector formats hold an image of them."""
POINTS_OF_PIXEL = 0.3
"""Width of lines in matplotlib for one pixel of pyvista's [points]."""


def draw_flat(axes: Any, parts: Sequence[tuple[Any, dict[str, Any]]]) -> None:
    """Draw parts of a body in axes of matplotlib.

    Args:
        axes: Axes of matplotlib.
        parts: Data of pyvista, lines or faces with the same number of corners, and the
            options with which pyvista would draw them: ``color`` or ``scalars``
                (colours of the faces), ``line_width`` and ``opacity``.
    """
    for data, look in parts:
        add_flat(axes, data, look)
    axes.set_aspect("equal")
    axes.spines[:].set_visible(False)
    axes.set(xlabel="$x$ [length]", ylabel="$y$ [length]")


def add_flat(axes: Any, data: Any, look: dict[str, Any]) -> None:
    """Add one part; see :func:`draw_flat`."""
    from matplotlib.collections import LineCollection, PolyCollection  # noqa: PLC0415

    x = data.points[:, :2]
    common = {"alpha": look.get("opacity")}
    if data.n_lines > 0:
        shown = x[data.lines.reshape(-1, 3)[:, 1:]]
        width = POINTS_OF_PIXEL * look.get("line_width", 1.0)
        drawn: Any = LineCollection(shown, colors=look["color"], linewidths=width, **common)
    else:
        shown = x[data.regular_faces]
        colours = look["scalars"] / 255.0 if "scalars" in look else look["color"]
        # Edges of the same colour close the white seams between neighbours.
        seams = {"edgecolors": "face", "linewidths": 0.3}
        drawn = PolyCollection(shown, facecolors=colours, **seams, **common)
    drawn.set_rasterized(len(shown) > MANY_SHAPES)
    axes.add_collection(drawn)


def limits(low: np.ndarray, high: np.ndarray) -> dict[str, tuple[float, float]]:
    """Return limits of axes that show all from a low to a high corner."""
    return {"xlim": (float(low[0]), float(high[0])), "ylim": (float(low[1]), float(high[1]))}
