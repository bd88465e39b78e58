"""Draw bodies in the plane as polygons and lines of matplotlib; on rank 0.

Vector formats keep them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

MANY_LINES = 30_000
"""Number of lines above which vector formats hold an image of them."""
MANY_FACES = 10_000
"""Number of triangles above which they are drawn together, in half the time.

Vector formats then hold an image of them.
"""
LINES_OF_PATH = 5000
"""Greatest number of lines in a path of matplotlib, whose renderer has a limit."""
POINTS_OF_PIXEL = 0.3
"""Width of lines in matplotlib for one pixel of pyvista's [points]."""


def draw_flat(axes: Any, parts: Sequence[tuple[Any, dict[str, Any]]], letters: str = "xyz") -> None:
    """Draw parts of a body in axes of matplotlib.

    Args:
        axes: Axes of matplotlib.
        parts: Data of pyvista, lines or faces with the same number of corners, and the
            options with which pyvista would draw them: ``color`` or ``scalars``
                (colours of the faces), ``line_width`` and ``opacity``.
        letters: Names of the coordinates.
    """
    for data, look in parts:
        add_flat(axes, data, look)
    axes.set_aspect("equal")
    axes.spines[:].set_visible(False)
    axes.set(xlabel=f"{letters[0]} [length]", ylabel=f"{letters[1]} [length]")


def add_flat(axes: Any, data: Any, look: dict[str, Any]) -> None:
    """Add one part; see :func:`draw_flat`."""
    from matplotlib.collections import PolyCollection  # noqa: PLC0415

    x = data.points[:, :2]
    if data.n_lines > 0:
        lines = x[data.lines.reshape(-1, 3)[:, 1:]]
        _add_lines(axes, lines, look)
        return
    faces = x[data.regular_faces]
    if "scalars" in look and len(faces) > MANY_FACES:
        _add_many(axes, faces, look["scalars"] / 255.0)
        return
    colours = look["scalars"] / 255.0 if "scalars" in look else look["color"]
    # Edges of the same colour close the white seams between neighbours.
    seams = {"edgecolors": "face", "linewidths": 0.3}
    drawn = PolyCollection(faces, facecolors=colours, alpha=look.get("opacity"), **seams)
    # Limits and layout belong to the axes, and are not found from each polygon.
    drawn.set_in_layout(False)
    axes.add_collection(drawn, autolim=False)


def _add_many(axes: Any, faces: np.ndarray, colours: np.ndarray) -> None:
    """Add many triangles (n, 3, 2) with their colours (n, 3)."""
    from matplotlib.collections import TriMesh  # noqa: PLC0415
    from matplotlib.tri import Triangulation  # noqa: PLC0415

    x, y = faces.reshape(-1, 2).T
    # A triangle has corners of its own, so that its colour ends at its edges.
    triangulation = Triangulation(x, y, np.arange(len(x)).reshape(-1, 3))
    opaque = np.ones((len(colours), 1))
    of_corners = np.repeat(np.hstack([colours, opaque]), 3, axis=0)
    drawn = TriMesh(triangulation, facecolors=of_corners)
    drawn.set_rasterized(True)
    drawn.set_in_layout(False)
    axes.add_collection(drawn, autolim=False)


def _add_lines(axes: Any, lines: np.ndarray, look: dict[str, Any]) -> None:
    """Add straight lines (n, 2, 2) of one colour and width.

    Some thousand of them are one path of matplotlib: a path for each line takes ten
    times as long.
    """
    from matplotlib.collections import PathCollection  # noqa: PLC0415
    from matplotlib.path import Path  # noqa: PLC0415

    paths = []
    for first in range(0, len(lines), LINES_OF_PATH):
        part = lines[first : first + LINES_OF_PATH]
        codes = np.tile([Path.MOVETO, Path.LINETO], len(part))
        paths.append(Path(part.reshape(-1, 2), codes))
    width = POINTS_OF_PIXEL * look.get("line_width", 1.0)
    colour = {"facecolors": "none", "edgecolors": look["color"], "alpha": look.get("opacity")}
    drawn = PathCollection(paths, linewidths=width, **colour)
    drawn.set_rasterized(len(lines) > MANY_LINES)
    drawn.set_in_layout(False)
    axes.add_collection(drawn, autolim=False)


def limits(low: np.ndarray, high: np.ndarray) -> dict[str, tuple[float, float]]:
    """Return limits of axes that show all from a low to a high corner."""
    return {"xlim": (float(low[0]), float(high[0])), "ylim": (float(low[1]), float(high[1]))}
