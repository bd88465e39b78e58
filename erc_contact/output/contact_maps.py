"""Draw the traction on a contact in 3D and its status by matplotlib; on rank 0.

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, n
normal of the foundation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.model.contact.status import OPEN
from erc_contact.output.drawing import (
    STATUS_COLOURS,
    STATUS_NAMES,
    bar_axes,
    coordinate,
    panels_of,
    tangents,
)
from erc_contact.output.gathered import WholeContact, mean_normal
from erc_contact.output.placing import place
from namedmesh.base.names import in_picture
from namedmesh.pictures import new_figure, subdivide
from namedmesh.simplex import bernstein

MAP_DIVISIONS = 4
"""Number of parts of an edge of a facet in the maps of tractions."""
MAP_WIDTH = 2.9
"""Width of a map [inches]."""
ROUND_OFF = 1e-10
"""Shear that is round-off, over the greatest pressure [-]."""
BAR_SHARE = 0.9
"""Length of a colour bar over the width of its map [-]."""
BAR_ASPECT = 20.0
"""Length of a colour bar over its width [-]."""


def contact_maps(surface: WholeContact, ax: Any = None) -> Any:
    """Draw the axes of :func:`erc_contact.output.plot_contact` in 3D; on rank 0."""
    traction = surface.traction
    status = surface.status
    n = mean_normal(surface)
    plane = tangents(n)
    u, v = plane @ surface.x[:, :3].reshape(-1, 3).T
    facets = np.arange(len(u)).reshape(-1, 3)
    closed = facets[status != OPEN] if np.any(status != OPEN) else facets
    ends = [_around(u, u[closed]), _around(v, v[closed])]
    has_shear = bool(traction.friction_bound.any())
    count = 3 if has_shear else 2
    if ax is None:
        ratio = float(np.ptp(ends[1]) / np.ptp(ends[0]))
        figure = new_figure(count * MAP_WIDTH, MAP_WIDTH * ratio)
        panels = figure.subplots(1, count, sharex=True, sharey=True)
        bars = [bar_axes(figure) for _ in panels]
    else:
        panels = panels_of(ax, count, "plot_contact in 3D")
        bars = [None] * count
    points, parts = subdivide(2, MAP_DIVISIONS)
    pressure, tangential = traction.at_points(points)
    shear = np.linalg.norm(tangential, axis=-1)
    # Facets are cut into triangles, with points of their own: r^ jumps between facets.
    corners = bernstein(2, 1, points)
    s, t = plane @ np.matmul(corners, surface.x[:, :3]).reshape(-1, 3).T
    offset = np.arange(len(surface.x))[:, None, None] * len(points)
    triangles = (offset + parts).reshape(-1, 3)
    _draw_traction(panels[0], s, t, triangles, pressure, "pressure", bars[0])
    if has_shear:
        # Round-off must not fill a range of colours of its own.
        shear = np.where(shear > ROUND_OFF * abs(pressure).max(), shear, 0.0)
        _draw_traction(panels[1], s, t, triangles, shear, "shear", bars[1])
    _draw_status(panels[-1], u, v, facets, status, bars[-1])
    # The eye is in what the body touches, so one of the two axes may be turned round.
    is_turned = np.cross(*plane) @ n < 0
    ylim = ends[1][::-1] if is_turned else ends[1]
    labels = [coordinate(tangent, surface.letters) for tangent in plane]
    for panel in panels:
        panel.set(aspect="equal", xlabel=labels[0], xlim=ends[0], ylim=ylim)
    panels[0].set_ylabel(labels[1])
    contact = traction.contact
    seen = "seen from the foundation"
    if contact.against is not None:
        seen = f"{in_picture(contact.name)} seen from {in_picture(contact.against)}"
    panels[count // 2].set_title(seen, fontsize=11)
    if ax is None:
        sizes = np.tile([MAP_WIDTH, MAP_WIDTH * ratio], (count, 1))
        bar_size = [BAR_SHARE * MAP_WIDTH, BAR_SHARE * MAP_WIDTH / BAR_ASPECT]
        bar_sizes = np.tile(bar_size, (count, 1))
        place(panels, sizes, bars, bar_sizes)
    return panels


def _draw_traction(
    panel: Any,
    s: np.ndarray,
    t: np.ndarray,
    triangles: np.ndarray,
    values: np.ndarray,
    title: str,
    room: Any,
) -> None:
    """Draw a map of a traction [force/area] with its colour bar.

    Args:
        panel: Axes of matplotlib.
        s: First coordinate of the points [length], shape (p,).
        t: Second coordinate [length], shape (p,).
        triangles: Numbers of their points, shape (f, 3).
        values: Values at the points, with p entries.
        title: Title of the colour bar.
        room: Axes of the colour bar; None takes its room from the panel.
    """
    # Zero has its own colour, and a map of zeros needs a range.
    colours = {"vmin": min(values.min(), 0.0), "vmax": values.max() or 1.0}
    look = {"shading": "gouraud", "rasterized": True}
    drawn = panel.tripcolor(s, t, triangles, values.ravel(), **look, **colours)
    # The axes hold it; a layout with each of its triangles takes longer than drawing.
    drawn.set_in_layout(False)
    label = f"{title} [force/area]"
    bar = _bar(panel, drawn, room, label=label)
    if not values.any():
        bar.set_ticks([0.0])


def _draw_status(
    panel: Any, u: np.ndarray, v: np.ndarray, facets: np.ndarray, status: np.ndarray, room: Any
) -> None:
    """Draw a map of the status of the facets with its colour bar.

    The bar has the states that occur.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap  # noqa: PLC0415

    codes, numbers = np.unique(status, return_inverse=True)
    colours = ListedColormap([STATUS_COLOURS[code] for code in codes])
    norm = BoundaryNorm(np.arange(len(codes) + 1) - 0.5, len(codes))
    look = {"cmap": colours, "norm": norm, "edgecolors": "0.6", "lw": 0.2}
    drawn = panel.tripcolor(u, v, facets, facecolors=numbers.astype(float), **look)
    drawn.set_in_layout(False)
    bar = _bar(panel, drawn, room, ticks=np.arange(len(codes)), label="status")
    bar.ax.set_xticklabels([STATUS_NAMES[code] for code in codes])


def _bar(panel: Any, drawn: Any, room: Any, **look: Any) -> Any:
    """Draw the colour bar of a panel in its axes, or else below the panel."""
    if room is not None:
        return panel.figure.colorbar(drawn, cax=room, orientation="horizontal", **look)
    where = {"location": "bottom", "shrink": BAR_SHARE}
    return panel.figure.colorbar(drawn, ax=panel, **where, **look)


def _around(whole: np.ndarray, closed: np.ndarray) -> np.ndarray:
    """Find the ends of an axis that shows the closed part and as much around it."""
    margin = 0.5 * np.ptp(closed)
    ends = [closed.min() - margin, closed.max() + margin]
    return np.clip(ends, whole.min(), whole.max())
