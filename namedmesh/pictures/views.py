"""Show parts of bodies in axes of matplotlib.

A part is a pair: data of pyvista, and the options with which they are drawn. Bodies in
the plane are polygons and lines of matplotlib, which vector formats keep. Bodies in
3D are images by pyvista.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import numpy as np

from namedmesh.base.exceptions import InputError

ShownPart = tuple[Any, dict[str, Any]]
"""Data of pyvista, and options with which they are drawn."""
PIXELS = 800
"""Number of pixels of the longer side of the image of a body."""
SPACE = 5.5
"""Greatest width of all views in 3D that are side by side in a figure, without words
[inches]. The figure is then not much wider than a page, on which its words can be read.
"""
WORDS = 1.1
"""Width in a figure of the labels of a view in 3D [inches]."""
OFF_SCREEN = (9, 4)
"""The first release of VTK that draws without a display."""
LIFT = 1e-3
"""Shift of lines towards the eye, as a share of the size of the picture [-]."""
INTERVALS = 4
"""Number of intervals between ticks, about, on the longest side of a body in 3D."""
TICK = 0.015
"""Length of a tick as a share of the longest side of the body [-]."""
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


def views_of(d: int, up: np.ndarray) -> dict[str, np.ndarray]:
    """Return names and axes of the views of a body.

    There is one view in 2D, and two from opposite sides in 3D. The rows of the axes,
    shape (3, 3), point to the right, upward, and towards the eye. ``up`` is the
    coordinate axis that points upward in 3D, shape (3,).
    """
    if d == 2:
        return {"": np.eye(3)}
    aside = 0.75 * np.roll(abs(up), 1) + 0.55 * np.roll(abs(up), 2)
    return {
        "from above": _axes_of_view(aside + 0.4 * up, up),
        "from below": _axes_of_view(-aside - 0.6 * up, up),
    }


def _axes_of_view(towards: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Compute the axes of a view from a direction towards the eye, shape (3, 3)."""
    across = np.cross(up, towards)
    axes = np.array([across, np.cross(towards, across), towards])
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


def corners_seen(parts: Sequence[ShownPart], view: np.ndarray) -> np.ndarray:
    """Find the low and the high corner of parts in the axes of a view [length].

    They have a margin; shape (2, 3).
    """
    points = np.concatenate([data.points for data, _ in parts]) @ view.T
    low = points.min(axis=0)
    high = points.max(axis=0)
    margin = 0.01 * float(np.linalg.norm(high - low))
    return np.array([low - margin, high + margin])


def images(
    parts: Sequence[ShownPart], motions: Sequence[tuple[np.ndarray, np.ndarray]]
) -> list[ShownPart]:
    """Return the images of parts by motions ``x -> R x + t``.

    Args:
        parts: The parts.
        motions: R, shape (3, 3), and t, shape (3,), of each.
    """
    moved = []
    for linear, shift in motions:
        for data, look in parts:
            image = data.copy()
            image.points = np.asarray(data.points @ linear.T + shift)
            moved.append((image, look))
    return moved


def render(pictures: Sequence[tuple[Sequence[ShownPart], np.ndarray]]) -> list[np.ndarray]:
    """Draw images of parts in parallel projection.

    Each shows what :func:`corners_seen` encloses. All are drawn in one window, because
    a window costs more than a second view of the same parts.

    Args:
        pictures: Parts (data of pyvista, and options with which they are drawn) and
            the axes of the view, shape (3, 3), of each image.

    Returns:
        The pixels of each, shape (height, width, 3).
    """
    import pyvista  # noqa: PLC0415

    lack = lack_of_window()
    if lack:
        raise InputError(f"Bodies in 3D cannot be drawn: {lack}.")
    images = []
    # Without a display VTK complains before it finds another way, which old releases of
    # pyvista cannot keep it from.
    quiet = pyvista.vtk_verbosity("off") if hasattr(pyvista, "vtk_verbosity") else nullcontext()
    with quiet:
        plotter = pyvista.Plotter(off_screen=True)
        # Without a graphics card several samples of a pixel cost most of the time. The
        # image has more pixels than the picture, which smooths its lines.
        plotter.render_window.SetMultiSamples(0)
        plotter.set_background("white")
        plotter.enable_parallel_projection()
        actors: dict[int, Any] = {}
        for parts, view in pictures:
            images.append(_image(plotter, actors, parts, view))
        plotter.close()
    return images


def lack_of_window() -> str:
    """Return what VTK lacks to draw without a display, "" if nothing.

    Old releases would end Python then.
    """
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401, PLC0415 - a window is of its kind then
    from vtkmodules.vtkCommonCore import vtkVersion  # noqa: PLC0415
    from vtkmodules.vtkRenderingCore import vtkRenderWindow  # noqa: PLC0415

    version = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion())
    needs_display = version < OFF_SCREEN and "XOpenGL" in type(vtkRenderWindow()).__name__
    if not needs_display or os.environ.get("DISPLAY"):
        return ""
    return (
        f"without a display this needs VTK 9.4 or newer, and this is {version[0]}.{version[1]}; "
        "pip install 'vtk>=9.4', or start Python by xvfb-run"
    )


def _image(
    plotter: Any, actors: dict[int, Any], parts: Sequence[ShownPart], view: np.ndarray
) -> np.ndarray:
    """Draw the image of one view in a window.

    Args:
        plotter: The window of pyvista.
        actors: What the window has, by the identity of the data; new parts are added.
        parts: What is seen.
        view: Axes of the view, shape (3, 3).
    """
    low, high = corners_seen(parts, view)
    size = float(np.linalg.norm(high - low))
    middle = (low + high) / 2 @ view
    sides = (high - low)[:2]
    pixels = np.maximum(PIXELS * sides / sides.max(), 16).round().astype(int)
    # What follows would else draw the image several times.
    plotter.suppress_rendering = True
    plotter.window_size = pixels.tolist()
    light = {"ambient": 0.65, "diffuse": 0.4, "show_scalar_bar": False}
    for actor in actors.values():
        actor.visibility = False
    for data, look in parts:
        if id(data) not in actors:
            actors[id(data)] = plotter.add_mesh(data, **light, **look)
        actor = actors[id(data)]
        actor.visibility = True
        # Lines are to be seen before the surface that they lie on.
        if data.n_lines > 0:
            actor.position = LIFT * size * view[2]
    eye = middle + 2 * size * view[2]
    plotter.camera_position = [tuple(eye), tuple(middle), tuple(view[1])]
    plotter.camera.parallel_scale = sides[1] / 2
    plotter.reset_camera_clipping_range()
    plotter.suppress_rendering = False
    plotter.render()
    return np.array(plotter.screenshot(return_img=True))


def show(
    panels: Any, pictures: Sequence[tuple[Sequence[ShownPart], np.ndarray]], letters: str = "xyz"
) -> None:
    """Show parts of a body in axes of matplotlib, with coordinates.

    In 3D these stand along three edges of a box around the parts.

    Args:
        panels: Axes of matplotlib, as many as pictures.
        pictures: Parts and the axes of their view, shape (3, 3), which are the identity
            for a body in the plane.
        letters: Names of the coordinates.
    """
    if pictures[0][1][2, 2] == 1.0:
        for axes, (parts, view) in zip(panels, pictures, strict=True):
            low, high = corners_seen(parts, view)
            draw_flat(axes, parts, letters)
            axes.set(**limits(low, high))
        return
    images = render(pictures)
    for axes, (parts, view), image in zip(panels, pictures, images, strict=True):
        low, high = corners_seen(parts, view)
        axes.imshow(image, extent=(low[0], high[0], low[1], high[1]))
        axes.spines[:].set_visible(False)
        axes.set_axis_off()
        points = np.concatenate([data.points for data, _ in parts])
        box = np.array([points.min(axis=0), points.max(axis=0)])
        for i in range(3):
            _draw_coordinate(axes, box, view, i)


def _draw_coordinate(axes: Any, box: np.ndarray, view: np.ndarray, i: int) -> None:
    """Draw the axis of a coordinate along an edge of the outline of a box.

    Args:
        axes: Axes of matplotlib with a picture in 3D.
        box: Low and high corner of the box [length], shape (2, 3).
        view: Axes of the view, shape (3, 3).
        i: Number of the coordinate.
    """
    direction = view[:2, i]
    longest = float((np.ptp(box, axis=0) * np.linalg.norm(view[:2], axis=0)).max())
    # Words are below an axis that is rather level, and else at its left.
    is_level = abs(direction[0]) > abs(direction[1])
    outward = np.array([0.0, -1.0]) if is_level else np.array([-1.0, 0.0])
    outward -= (outward @ direction) / (direction @ direction) * direction
    outward /= np.linalg.norm(outward)
    # Of the four parallel edges, the outermost one hides nothing of the body.
    corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
    starts = corners[corners[:, i] == box[0, i]]
    outermost = (starts @ view[:2].T @ outward).argmax()
    start = view[:2] @ starts[outermost]
    ticks = _ticks_of(box, view, i)
    ends = start + (box[:, i] - box[0, i])[:, None] * direction
    middle = start + (box[:, i].mean() - box[0, i]) * direction
    feet = start + (ticks - box[0, i])[:, None] * direction
    tips = feet + TICK * longest * outward
    look = {"color": "0.3", "lw": 0.8, "clip_on": False}
    axes.plot(*ends.T, **look)
    axes.plot(*np.stack([feet, tips]).transpose(2, 0, 1), **look)
    # Words grow away from the body.
    side = int(np.sign(outward[0])) * (abs(outward[0]) > 0.3)
    alignment = ("center", "left", "right")[side]
    words = {"textcoords": "offset points", "ha": alignment, "va": "center"}
    for foot, tick in zip(feet, ticks, strict=True):
        axes.annotate(f"{tick:.4g}", foot, 10 * outward, fontsize=9, **words)
    distance = 26 if is_level else 38
    axes.annotate(f"{'xyz'[i]} [length]", middle, distance * outward, fontsize=10, **words)


def _ticks_of(box: np.ndarray, view: np.ndarray, i: int) -> np.ndarray:
    """Find the ticks of a coordinate in a picture of a box [length].

    A side that looks short has fewer of them.
    """
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

    lengths = np.ptp(box, axis=0) * np.linalg.norm(view[:2], axis=0)
    intervals = max(1, round(INTERVALS * lengths[i] / lengths.max()))
    # An end of the box has its tick in spite of round-off.
    low = box[0, i] - 1e-6 * lengths.max()
    high = box[1, i] + 1e-6 * lengths.max()
    ticks = MaxNLocator(intervals, steps=[1, 2, 5, 10]).tick_values(low, high)
    return ticks[(ticks >= low) & (ticks <= high)]


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
