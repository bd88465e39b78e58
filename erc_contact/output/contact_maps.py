"""Draw the traction on a contact in 3D and its status by matplotlib; on rank 0.

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, n
normal of the foundation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.mesh.simplex import bernstein
from erc_contact.model.profile import OPEN, SLIP, STICK
from erc_contact.output.drawing import (
    STATUS_COLOURS,
    STATUS_NAMES,
    coordinate,
    new_figure,
    panels_of,
    tangents,
)
from erc_contact.output.files import subdivided
from erc_contact.output.gathered import Surface, mean_normal
from erc_contact.results.profile import contact_status

MAP_DIVISIONS = 4
"""Number of parts of an edge of a facet in the maps of tractions."""


def contact_maps(surface: Surface, ax: Any = None) -> Any:
    """Draw the axes of :func:`erc_contact.output.plot_contact` in 3D; on rank 0."""
    traction = surface.traction
    status = contact_status(traction)
    n = mean_normal(surface)
    plane = tangents(n)
    u, v = plane @ surface.x[:, :3].reshape(-1, 3).T
    facets = np.arange(len(u)).reshape(-1, 3)
    closed = facets[status != OPEN] if np.any(status != OPEN) else facets
    ends = [_around(u, u[closed]), _around(v, v[closed])]
    if ax is None:
        ratio = float(np.ptp(ends[1]) / np.ptp(ends[0]))
        figure = new_figure(10.0, max(2.6, 1.2 + 3.0 * ratio))
        panels = figure.subplots(1, 3, sharex=True, sharey=True)
    else:
        panels = panels_of(ax, 3, "plot_contact in 3D")
    points, parts = subdivided(2, MAP_DIVISIONS)
    shape = bernstein(2, surface.degree, points)
    pressure = -traction.normal_component @ shape.T
    shear = np.linalg.norm(np.matmul(shape, traction.tangential_part), axis=-1)
    # Facets are cut into triangles, with points of their own: r^ jumps between facets.
    corners = bernstein(2, 1, points)
    s, t = plane @ np.matmul(corners, surface.x[:, :3]).reshape(-1, 3).T
    offset = np.arange(len(surface.x))[:, None, None] * len(points)
    triangles = (offset + parts).reshape(-1, 3)
    _draw_traction(panels[0], s, t, triangles, pressure, "pressure")
    _draw_traction(panels[1], s, t, triangles, shear, "shear")
    _draw_status(panels[2], u, v, facets, status)
    # The eye is in what the body touches, so one of the two axes may be turned round.
    is_turned = np.cross(*plane) @ n < 0
    ylim = ends[1][::-1] if is_turned else ends[1]
    for panel in panels:
        panel.set(aspect="equal", xlabel=coordinate(plane[0]), xlim=ends[0], ylim=ylim)
    panels[0].set_ylabel(coordinate(plane[1]))
    contact = traction.contact
    seen = "seen from the foundation"
    if surface.partners is not None:
        seen = f"{contact.name} seen from {contact.against}"
    panels[1].set_title(seen, fontsize=11)
    return panels


def _draw_traction(
    panel: Any, s: np.ndarray, t: np.ndarray, triangles: np.ndarray, values: np.ndarray, title: str
) -> None:
    """Draw a map of a traction [force/area] with its colour bar.

    Args:
        panel: Axes of matplotlib.
        s: First coordinate of the points [length], shape (p,).
        t: Second coordinate [length], shape (p,).
        triangles: Numbers of their points, shape (f, 3).
        values: Values at the points, with p entries.
        title: Title of the colour bar.
    """
    # Zero has its own colour, and a map of zeros needs a range.
    colours = {"vmin": min(values.min(), 0.0), "vmax": values.max() or 1.0}
    look = {"shading": "gouraud", "rasterized": True}
    drawn = panel.tripcolor(s, t, triangles, values.ravel(), **look, **colours)
    # The axes hold it; a layout with each of its triangles takes longer than drawing.
    drawn.set_in_layout(False)
    label = f"{title} [force/area]"
    bar = panel.figure.colorbar(drawn, ax=panel, label=label, location="bottom", shrink=0.9)
    if not values.any():
        bar.set_ticks([0.0])


def _draw_status(
    panel: Any, u: np.ndarray, v: np.ndarray, facets: np.ndarray, status: np.ndarray
) -> None:
    """Draw a map of the status of the facets with its colour bar."""
    from matplotlib.colors import BoundaryNorm, ListedColormap  # noqa: PLC0415

    colours = ListedColormap(STATUS_COLOURS)
    norm = BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3)
    look = {"cmap": colours, "norm": norm, "edgecolors": "0.6", "lw": 0.2}
    drawn = panel.tripcolor(u, v, facets, facecolors=status.astype(float), **look)
    drawn.set_in_layout(False)
    place = {"location": "bottom", "shrink": 0.9}
    ticks = [OPEN, SLIP, STICK]
    bar = panel.figure.colorbar(drawn, ax=panel, ticks=ticks, label="status", **place)
    bar.ax.set_xticklabels(STATUS_NAMES)


def _around(whole: np.ndarray, closed: np.ndarray) -> np.ndarray:
    """Find the ends of an axis that shows the closed part and as much around it."""
    margin = 0.5 * np.ptp(closed)
    ends = [closed.min() - margin, closed.max() + margin]
    return np.clip(ends, whole.min(), whole.max())
