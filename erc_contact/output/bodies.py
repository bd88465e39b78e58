"""Draw bodies as triangles and lines, in 3D as images by pyvista; on rank 0.

Triangles and lines of degree 2 are cut into straight parts, so that curved edges look
curved.

Symbols: d dimension, k degree, m number of nodes of a simplex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from erc_contact.mesh.simplex import bernstein, edges, lagrange, node_between, node_vertices
from erc_contact.output.files import DPI, degree_of, grid_of, subdivided
from erc_contact.output.flat import draw_flat, limits

DIVISIONS = 6
"""Greatest number of straight parts of a curved edge."""
TRIANGLES = 40_000
"""Greatest number of straight triangles, about, in which curved ones are cut.

Edges have fewer parts if need be.
"""
PIXELS = 1100
"""Greatest number of pixels of the longer side of the image of a body, for which the
widths of lines are given.
"""
FINER = 2.0
"""Pixels of the image of a body over the pixels of its place in a saved figure [-]."""
SPACE = 5.5
"""Greatest width of all views in 3D that are side by side in a figure, without words
[inches]. The figure is then not much wider than a page, on which its words can be read.
"""
WORDS = 1.1
"""Width in a figure of the labels of a view in 3D [inches]."""


@dataclass(frozen=True, eq=False)
class Skin:
    """Hold the visible part of a body: triangles of degree k, and their edges.

    In 2D the triangles are the elements.

    Attributes:
        points: Nodes of the body [length], shape (n, 3).
        triangles: Numbers of the nodes of each triangle, shape (f, 3 or 6).
        cell: Number of the element that each triangle belongs to, shape (f,).
        lines: Numbers of the nodes of each edge, shape (e, 2 or 3).
    """

    points: np.ndarray
    triangles: np.ndarray
    cell: np.ndarray
    lines: np.ndarray

    @property
    def divisions(self) -> int:
        """Return the number of straight parts in which an edge is drawn."""
        many = int(np.sqrt(TRIANGLES / len(self.triangles)))
        return 1 if degree_of(self.lines, 1) == 1 else min(max(many, 1), DIVISIONS)

    def faces(self, x: np.ndarray, **look: Any) -> tuple[Any, dict[str, Any]]:
        """Return the triangles for pyvista, and the options with which they are drawn.

        The nodes are at x [length], shape (n, 3). The option ``scalars`` has one colour
        for each of their parts, in the order of :meth:`of_parts`.
        """
        return straight(*sampled(x[self.triangles], 2, self.divisions)), look

    def of_parts(self, values: np.ndarray) -> np.ndarray:
        """Return values in the straight parts of the triangles, triangle by triangle.

        Args:
            values: One value for each element, shape (m,), or three at the corners of
                each triangle, shape (f, 3).
        """
        points, parts = subdivided(2, self.divisions)
        if values.ndim == 1:
            return np.repeat(values[self.cell], len(parts))
        return (values @ bernstein(2, 1, points[parts].mean(axis=1)).T).ravel()

    def edges(self, x: np.ndarray, **look: Any) -> tuple[Any, dict[str, Any]]:
        """Return the edges for pyvista, and the options with which they are drawn.

        The nodes are at x [length], shape (n, 3).
        """
        return straight(*sampled(x[self.lines], 1, self.divisions)), look


def skin_of(points: np.ndarray, cells: np.ndarray, d: int) -> Skin:
    """Find the skin of a body.

    Args:
        points: Nodes [length], shape (n, 3).
        cells: Numbers of the nodes of each element, shape (e, N).
        d: Dimension.
    """
    k = degree_of(cells, d)
    surface = grid_of(points, cells[:, : d + 1], d).extract_surface(algorithm="dataset_surface")
    cell = surface.cell_data["vtkOriginalCellIds"]
    corners = surface.point_data["vtkOriginalPointIds"][surface.regular_faces]
    local = (cells[cell, None, : d + 1] == corners[:, :, None]).argmax(axis=2)

    def between(pairs: np.ndarray) -> np.ndarray:
        """Return nodes between pairs of vertices of each triangle, shape (f, pairs)."""
        first, second = local[:, pairs.reshape(-1, 2).T].swapaxes(0, 1)
        return np.take_along_axis(cells[cell], node_between(d, k)[first, second], axis=1)

    lines = between(edges(2)[:, node_vertices(1, k)]).reshape(-1, k + 1)
    first, second = np.sort(lines[:, :2], axis=1).T
    _, once = np.unique(first * len(points) + second, return_index=True)
    return Skin(points, between(node_vertices(2, k)), cell, lines[once])


def sampled(x: np.ndarray, d: int, divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate values at the nodes of lines or triangles on smaller straight ones.

    Args:
        x: Values at the nodes, shape (n, m, c), for instance their positions with c =
            3.
        d: Dimension of the lines or triangles, 1 or 2.
        divisions: Number of parts of an edge.

    Returns:
        Values at the points, shape (p, c), and the numbers of the points of each
        straight one, shape (s, d+1).
    """
    points, parts = subdivided(d, divisions)
    at = np.matmul(lagrange(d, degree_of(x, d), points), x)
    return at.reshape(-1, x.shape[-1]), (
        np.arange(len(x))[:, None, None] * len(points) + parts
    ).reshape(-1, d + 1)


def straight(points: np.ndarray, parts: np.ndarray) -> Any:
    """Make straight lines or triangles for pyvista.

    They are given by points (p, 3) and numbers of points (n, 2) or (n, 3).
    """
    import pyvista  # noqa: PLC0415

    if parts.shape[1] == 3:
        return pyvista.PolyData.from_regular_faces(points, parts)
    return pyvista.PolyData(points, lines=np.insert(parts, 0, 2, axis=1))


def views_of(d: int, up: np.ndarray) -> dict[str, np.ndarray]:
    """Return names and axes of the views of a body.

    There is one view in 2D, and two from opposite sides in 3D. The rows of the axes,
    shape (3, 3), point to the right, upward, and towards the eye. ``up`` is the
    coordinate axis that points upward in 3D, shape (3,).
    """
    if d == 2:
        return {"": np.eye(3)}
    aside = 0.75 * np.roll(abs(up), 1) + 0.55 * np.roll(abs(up), 2)
    views = {}
    for name, towards in (("from above", aside + 0.4 * up), ("from below", -aside - 0.6 * up)):
        across = np.cross(up, towards)
        axes = np.array([across, np.cross(towards, across), towards])
        views[name] = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return views


def seen(parts: Sequence[tuple[Any, dict[str, Any]]], view: np.ndarray) -> np.ndarray:
    """Find the low and the high corner of parts in the axes of a view [length].

    They have a margin; shape (2, 3).
    """
    points = np.concatenate([data.points for data, _ in parts]) @ view.T
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.01 * float(np.linalg.norm(high - low))
    return np.array([low - margin, high + margin])


def rendered(
    parts: Sequence[tuple[Any, dict[str, Any]]], view: np.ndarray, longest: float
) -> np.ndarray:
    """Draw the image of parts in parallel projection; it ends where :func:`seen` says.

    Args:
        parts: Data of pyvista, and options with which they are drawn.
        view: Axes of the view, shape (3, 3).
        longest: Number of pixels of its longer side.

    Returns:
        The pixels, shape (height, width, 3).
    """
    import pyvista  # noqa: PLC0415

    low, high = seen(parts, view)
    size, middle = float(np.linalg.norm(high - low)), (low + high) / 2 @ view
    pixels = np.maximum(longest * (high - low)[:2] / (high - low)[:2].max(), 16).round().astype(int)
    with pyvista.vtk_verbosity(
        "off"
    ):  # without a display VTK complains before it finds another way
        plotter = pyvista.Plotter(off_screen=True, window_size=pixels.tolist())
        plotter.set_background("white")
        for data, look in parts:
            lines = data.n_lines > 0  # to be seen before the surface that they lie on
            shown = data.translate(1e-3 * size * view[2]) if lines else data
            width = max(look.get("line_width", 1.0) * longest / PIXELS, 1.0)  # else dashed
            light = {"ambient": 0.65, "diffuse": 0.4, "show_scalar_bar": False}
            plotter.add_mesh(shown, **light, **(look | {"line_width": width}))
        plotter.enable_parallel_projection()
        plotter.camera_position = [
            tuple(middle + 2 * size * view[2]),
            tuple(middle),
            tuple(view[1]),
        ]
        plotter.camera.parallel_scale = (high - low)[1] / 2
        plotter.reset_camera_clipping_range()
        image = np.asarray(plotter.screenshot(return_img=True))
        plotter.close()
    return image


def show(axes: Any, parts: Sequence[tuple[Any, dict[str, Any]]], view: np.ndarray) -> None:
    """Show parts of a body in axes of matplotlib, with coordinates.

    In 3D these stand along three edges of a box around the parts.

    Args:
        axes: Axes of matplotlib.
        parts: Data of pyvista, and options with which they are drawn.
        view: Axes of the view, shape (3, 3), the identity for a body in the plane.
    """
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

    low, high = seen(parts, view)
    if view[2, 2] == 1.0:
        draw_flat(axes, parts)
        axes.set(**limits(low, high))
        return
    # More pixels than are shown cost time, and matplotlib takes their mean.
    place = axes.get_position().size * axes.figure.get_size_inches() * DPI
    pixels = min(FINER * float(place.max()), PIXELS)
    axes.imshow(rendered(parts, view, pixels), extent=(low[0], high[0], low[1], high[1]))
    axes.spines[:].set_visible(False)
    points = np.concatenate([data.points for data, _ in parts])
    axes.set_axis_off()
    ends = np.array([points.min(axis=0), points.max(axis=0)])
    corners = np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(-1, 3)
    lengths = np.ptp(ends, axis=0) * np.linalg.norm(view[:2], axis=0)
    for i, name in enumerate("xyz"):
        starts, direction = corners[corners[:, i] == ends[0, i]], view[:2, i]
        level = abs(direction[0]) > abs(direction[1])
        outward = np.array([0.0, -1.0]) if level else np.array([-1.0, 0.0])
        outward -= (outward @ direction) / (direction @ direction) * direction
        outward /= np.linalg.norm(outward)
        start = (
            view[:2] @ starts[(starts @ view[:2].T @ outward).argmax()]
        )  # an edge of the box's outline
        number = max(1, round(4 * lengths[i] / lengths.max()))
        low, high = ends[:, i] + 1e-6 * lengths.max() * np.array([-1, 1])
        ticks = MaxNLocator(number, steps=[1, 2, 5, 10]).tick_values(low, high)
        ticks = ticks[(ticks >= low) & (ticks <= high)]
        at = (
            start
            + (np.array([*ends[:, i], ends[:, i].mean(), *ticks]) - ends[0, i])[:, None] * direction
        )
        look = {"color": "0.3", "lw": 0.8, "clip_on": False}
        axes.plot(*at[:2].T, **look)
        axes.plot(
            *np.stack([at[3:], at[3:] + 0.015 * lengths.max() * outward]).transpose(2, 0, 1), **look
        )
        side = int(np.sign(outward[0])) * (abs(outward[0]) > 0.3)  # words grow away from the body
        words = {
            "textcoords": "offset points",
            "ha": ("center", "left", "right")[side],
            "va": "center",
        }
        for place, tick in zip(at[3:], ticks, strict=True):
            axes.annotate(f"{tick:.4g}", place, 10 * outward, fontsize=9, **words)
        axes.annotate(
            f"${name}$ [length]", at[2], (26 if level else 38) * outward, fontsize=10, **words
        )
