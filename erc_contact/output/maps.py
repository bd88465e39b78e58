"""Draw a body with coloured elements and a colour bar; on rank 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from erc_contact.output.drawing import bar_axes, log_ticks
from erc_contact.output.placing import place
from namedmesh.pictures import (
    SPACE,
    ShownPart,
    Skin,
    corners_seen,
    images,
    limits,
    new_figure,
    show,
)

WIDE_BODY = 1.6
"""Width over height of a body above which its colour bar is below [-]."""
FEW_CELLS = 15_000
"""Greatest number of elements whose edges are shown in a map.

More edges would hide the colours.
"""
BAR_BESIDE = 0.8
"""Length of a colour bar at the right of a body over the height of the body [-]."""
BAR_BELOW = 0.7
"""Length of a colour bar below a body over the width of the body [-]."""
BAR_ASPECT = 35.0
"""Length of a colour bar over its width [-]."""
LEAST_BAR = 1.2
"""Least length of a colour bar at the right of a body [inches]."""


@dataclass(frozen=True)
class Scale:
    """Hold the colours of values.

    Attributes:
        norm: matplotlib's norm, from values to colours.
        extend: Ends of the colour bar beyond which there are values: "min", "max" or
            "neither".
        label: Label of the colour bar.
    """

    norm: Any
    extend: str
    label: str


def draw_map(
    ax: Any,
    skin: Skin,
    x: np.ndarray,
    values: np.ndarray,
    scale: Scale,
    views: dict[str, np.ndarray],
    lines: Sequence[ShownPart] = (),
    grounds: Sequence[ShownPart] = (),
    title: str = "",
    letters: str = "xyz",
    *,
    mirrored: bool = False,
    motions: Sequence[tuple[np.ndarray, np.ndarray]] = (),
    window: np.ndarray | None = None,
) -> Any:
    """Draw a body with coloured elements and a colour bar in axes.

    Args:
        ax: Axes of the user's in 2D, or None.
        skin: The body.
        x: Positions at which its nodes are drawn [length], shape (n, 3).
        values: Values of the elements, or at the corners of triangles of the skin, see
            :meth:`Skin.of_parts`.
        scale: Their colours.
        views: The views, from :func:`views_of`.
        lines: Lines that are drawn on the body and its copies.
        grounds: Parts of foundations, from :func:`ground`. In 3D only the view from
            above has them, because they hide the contact.
        title: Title of the body, in 3D of both views.
        letters: Names of the coordinates.
        mirrored: Whether the mirror image at the axis is drawn, too, as of a turned
            body that is cut along its axis.
        motions: R, shape (3, 3), and t [length], shape (3,), of the copies of body and
            foundations that are drawn, too.
        window: Low and high corner of what is shown in the plane [length], shape (2,
            2); None shows all.
    """
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415

    colours = ScalarMappable(scale.norm, "viridis")
    shades = np.clip(skin.of_parts(values), scale.norm.vmin, scale.norm.vmax)
    rgb = colours.to_rgba(shades, bytes=True)[:, :3]
    parts = [skin.faces(x, scalars=rgb, rgb=True, preference="cell")]
    if skin.cell.max() < FEW_CELLS:
        parts.append(skin.edges(x, color="#404040", opacity=0.4, line_width=0.8))
    parts = [*parts, *images(parts, motions), *lines]
    grounds = [*grounds, *images(grounds, motions)]
    if mirrored:
        mirror = [(np.diag([-1.0, 1.0, 1.0]), np.zeros(3))]
        parts += images(parts, mirror)
        grounds += images(grounds, mirror)
    shown = {}
    corners = []
    for name, view in views.items():
        # Foundations come first, so the body is never hidden by them.
        shown[name] = parts if name == "from below" else [*grounds, *parts]
        corners.append(np.ptp(corners_seen(shown[name], view), axis=0)[:2])
    sizes = np.array(corners if window is None else [np.ptp(window, axis=0)])
    ratio = float(sizes[:, 0].sum() / sizes[:, 1].max())
    is_flat = len(views) == 1
    is_below = is_flat and ratio > WIDE_BODY
    is_new = ax is None
    if is_new:
        width = min(6.0, 6.0 * ratio) if is_flat else min(SPACE, 3.0 * ratio)
        sizes *= width / sizes[:, 0].sum()
        ax = new_figure(width, width / ratio).subplots(1, len(views))
    panels = np.ravel(ax)
    show(panels, [(shown[name], view) for name, view in views.items()], letters)
    if window is not None:
        panels[0].set(**limits(*window))
    if mirrored:
        panels[0].xaxis.set_major_formatter(lambda r, _: f"{abs(r):g}")
    if not is_flat:
        for panel, name in zip(panels, views, strict=True):
            panel.set_title(name, fontsize=11)
    if is_flat:
        panels[0].set_title(title, fontsize=11)
    elif title:
        panels[0].figure.text(0.5, 1.0, title, fontsize=11, ha="center")
    bar = _colour_bar(panels, colours, scale, is_new=is_new, is_below=is_below)
    _write_ticks(bar, scale.norm, any_value=bool(values.any()))
    if is_new:
        bar_size = _size_of_bar(sizes, is_below=is_below)
        place(panels, sizes, [bar.ax], bar_size[None], beside=not is_below)
    return ax


def _size_of_bar(sizes: np.ndarray, *, is_below: bool) -> np.ndarray:
    """Return width and height of the colour bar of views [inches], shape (2,)."""
    if is_below:
        length = BAR_BELOW * sizes[:, 0].sum()
        return np.array([length, length / BAR_ASPECT])
    length = max(BAR_BESIDE * sizes[:, 1].max(), LEAST_BAR)
    return np.array([length / BAR_ASPECT, length])


def _colour_bar(
    panels: np.ndarray, colours: Any, scale: Scale, *, is_new: bool, is_below: bool
) -> Any:
    """Draw a colour bar with its label, below a wide body or else at its right.

    In a new figure it has axes of its own, which are placed later.
    """
    where: dict[str, Any] = {"shrink": BAR_BESIDE, "aspect": BAR_ASPECT}
    if is_below:
        where = {"location": "bottom", "shrink": BAR_BELOW, "aspect": BAR_ASPECT}
    figure = panels[0].figure
    if is_new:
        orientation = "horizontal" if is_below else "vertical"
        where = {"cax": bar_axes(figure), "orientation": orientation}
    else:
        where["ax"] = panels
    bar = figure.colorbar(colours, extend=scale.extend, **where)
    if is_below:
        bar.set_label(scale.label)
    else:
        label = scale.label.replace(" [", "\n[").replace(", ", ",\n")
        bar.ax.set_title(label, fontsize=11, loc="left")
    return bar


def _write_ticks(bar: Any, norm: Any, *, any_value: bool) -> None:
    """Write plain numbers at a colour bar, or only 0 if all values are zero."""
    from matplotlib.colors import LogNorm  # noqa: PLC0415

    if not any_value:
        bar.set_ticks([0.0])
    elif isinstance(norm, LogNorm):
        ticks = log_ticks(norm.vmin, norm.vmax)
        labels = [f"{tick:.4g}" for tick in ticks]
        bar.set_ticks(ticks, labels=labels, minor=False)
        bar.minorticks_off()
