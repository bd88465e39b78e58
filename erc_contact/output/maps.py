"""Draw a body with coloured elements and a colour bar; on rank 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from erc_contact.output.bodies import Skin
from erc_contact.output.drawing import log_ticks, new_figure
from erc_contact.output.views import SPACE, WORDS, Part, seen, show

WIDE_BODY = 1.6
"""Width over height of a body above which its colour bar is below [-]."""
FEW_CELLS = 15_000
"""Greatest number of elements whose edges are shown in a map.

More edges would hide the colours.
"""


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
    lines: Sequence[Part] = (),
    grounds: Sequence[Part] = (),
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
        lines: Lines that are drawn on the body.
        grounds: Parts of foundations, from :func:`ground`. In 3D only the view from
            above has them, because they hide the contact.
    """
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415

    colours = ScalarMappable(scale.norm, "viridis")
    shades = np.clip(skin.of_parts(values), scale.norm.vmin, scale.norm.vmax)
    rgb = colours.to_rgba(shades, bytes=True)[:, :3]
    parts = [skin.faces(x, scalars=rgb, rgb=True, preference="cell")]
    if skin.cell.max() < FEW_CELLS:
        parts.append(skin.edges(x, color="#404040", opacity=0.4, line_width=0.8))
    parts += lines
    shown = {}
    corners = []
    for name, view in views.items():
        # Foundations come first, so the body is never hidden by them.
        shown[name] = parts if name == "from below" else [*grounds, *parts]
        corners.append(np.ptp(seen(shown[name], view), axis=0)[:2])
    sizes = np.array(corners)
    ratio = float(sizes[:, 0].sum() / sizes[:, 1].max())
    is_flat = len(views) == 1
    is_below = is_flat and ratio > WIDE_BODY
    if ax is None:
        figure = _figure_of(ratio, is_flat=is_flat, is_below=is_below)
        ax = figure.subplots(1, len(views), width_ratios=sizes[:, 0])
    panels = np.ravel(ax)
    for panel, (name, view) in zip(panels, views.items(), strict=True):
        show(panel, shown[name], view)
        if not is_flat:
            panel.set_title(name, fontsize=11)
    bar = _colour_bar(panels, colours, scale, is_below=is_below)
    _write_ticks(bar, scale.norm, any_value=bool(values.any()))
    return ax


def _figure_of(ratio: float, *, is_flat: bool, is_below: bool) -> Any:
    """Make a figure for views with a ratio of width to height, and a colour bar."""
    width = min(6.0, 6.0 * ratio) if is_flat else min(SPACE, 3.0 * ratio)
    height = width / ratio
    words_beside = 0.7 if is_below else 1.9
    words_below = 1.6 if is_below else 0.9
    # Each of the two views in 3D has coordinates.
    coordinates = 0.0 if is_flat else 2 * WORDS
    wide = max(width, 1.5) + (words_beside + coordinates)
    return new_figure(wide, height + words_below, "compressed")


def _colour_bar(panels: np.ndarray, colours: Any, scale: Scale, *, is_below: bool) -> Any:
    """Draw a colour bar with its label, below a wide body or else at its right."""
    place: dict[str, Any] = {"shrink": 0.8, "aspect": 30}
    if is_below:
        place = {"location": "bottom", "shrink": 0.7, "aspect": 40}
    bar = panels[0].figure.colorbar(colours, ax=panels, extend=scale.extend, **place)
    if is_below:
        bar.set_label(scale.label)
    else:
        label = scale.label.replace(" [", "\n[")
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
