"""Plot the traction on a contact and its status by matplotlib.

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, b
friction bound, n normal of the foundation, t tangent of the contact, s coordinate along
t, d dimension.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.simplex import bernstein
from erc_contact.model.profile import OPEN, SLIP, STICK
from erc_contact.output.along import along, through_means
from erc_contact.output.drawing import (
    coordinate,
    draw_figure,
    log_ticks,
    new_figure,
    panels_of,
    tangents,
    weighted_level,
    words,
)
from erc_contact.output.files import PARTS, subdivided
from erc_contact.output.gathered import AXIS, mean_normal, whole_contact
from erc_contact.results.profile import contact_status

STATUS = ("open", "slip", "stick")
"""Names of the codes OPEN, SLIP and STICK."""
COLOURS = ("#f0f0f0", "#fbdcb4", "#c9e0f2")
"""Colours of open, slip and stick, which the colour-blind can tell apart.

They are grey, orange and blue.
"""
PRESSURE, SHEAR = "#0072B2", "#D55E00"
"""Colours of the curves of pressure and shear."""
PEAK = 8.0
"""Factor from the 90% level of a traction to its peak [-].

Where it is exceeded, the axis is logarithmic above the level.
"""


def plot_contact(
    admissible: Admissible, name: str, path: str | Path | None = None, *, ax: Any = None
) -> Any:
    """Draw the traction r^ on a contact and its status; collective.

    In 2D curves show the pressure, the shear along t = (-n_2, n_1), and the band from
    -b to b. Of degree 2 they are r^, facet by facet. Of degree 1 r^ jumps from one
    facet to the next as much as it is wrong; the curves then are continuous and have
    the mean of r^ on each facet (:func:`erc_contact.output.along.through_means`), and
    thin lines show r^. So the area under the curve of the pressure is the normal force.
    Strips in the background have the colours of the status of the facets
    (:func:`erc_contact.results.contact_status`). The abscissa s is the coordinate along
    a straight contact, or the arc length of a curved one. Nothing is cut off: where a
    peak is high, the axis is logarithmic above a dotted line. No bound of r^ at single
    points is known, so none is drawn.

    In 3D maps in the tangent plane, as the foundation sees it, show the pressure, the
    length of the shear, and the status of the facets. The tractions are r^ itself,
    which jumps from one facet to the next as much as it is wrong, so maps of degree 1
    on coarse meshes look rough. They are not smoothed: a continuous map of degree 1 has
    one value at a node, there are about twice as many facets as nodes, and so it cannot
    have the mean of r^ on each of them.

    Args:
        admissible: The admissible pair.
        name: Name of the contact.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, one in 2D and three in 3D; by default those
            of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.

    Raises:
        InputError: If no contact has this name, or it has no facet, or there is another
            number of axes.
    """
    model = admissible.model
    names = [t.contact.name for t in admissible.tractions]
    if name not in names:
        raise InputError(
            f"plot_contact: no contact is called {name!r}; the scene has "
            f"{', '.join(names) or 'none'}."
        )
    surface = whole_contact(admissible, admissible.tractions[names.index(name)])
    if not model.comm.bcast(surface is not None and len(surface.x)):
        raise InputError(
            f"plot_contact: {name!r} has no facet; contacts of this scene: {', '.join(names)}."
        )
    draw = contact_curves if model.d == 2 else contact_maps
    return draw_figure(model.comm, path, ax, lambda ax: draw(surface, ax))


def contact_curves(surface: Any, ax: Any = None) -> Any:
    """Draw the axes of :func:`plot_contact` in 2D; on rank 0."""
    from matplotlib.lines import Line2D  # noqa: PLC0415
    from matplotlib.patches import Patch  # noqa: PLC0415

    traction, n, status = (
        surface.traction,
        surface.traction.contact.direction,
        contact_status(surface.traction),
    )
    s, label = along(surface)
    order, turned = np.argsort(s.min(axis=1)), (s[:, 0] > s[:, 1])[:, None]
    points = subdivided(1, PARTS)[0]
    at = np.sort(s[:, :1] + points.T * (s[:, 1:] - s[:, :1]), axis=1)[order]
    parts = np.flatnonzero(at[1:, 0] - at[:-1, -1] > AXIS * np.ptp(at)) + 1

    def computed(coefficients: np.ndarray) -> np.ndarray:
        """Return r^ at points of the facets, in order along the contact, (n, q)."""
        sampled = coefficients @ bernstein(1, surface.degree, points).T
        return np.where(turned, sampled[:, ::-1], sampled)[order]

    def curve(coefficients: np.ndarray) -> np.ndarray:
        """Return the values that are drawn, shape (n, q)."""
        if surface.degree > 1:
            return computed(coefficients)
        return through_means(
            coefficients.mean(axis=1)[order], np.ptp(at, axis=1), parts, points[:, 0]
        )

    def path(sampled: np.ndarray) -> np.ndarray:
        """Return values (n, q) in one row, with nan between parts that do not touch."""
        return np.insert(sampled, parts, np.nan, axis=0).ravel()

    t = np.column_stack([-n[:, 1], n[:, 0]])
    pressure, shear = (
        -traction.normal_component,
        np.einsum("fmi,fi->fm", traction.tangential_part, t),
    )
    axes = (
        new_figure(7.2, 4.0).subplots() if ax is None else panels_of(ax, 1, "plot_contact in 2D")[0]
    )
    for code, colour in enumerate(COLOURS):
        strips = np.column_stack([s.min(axis=1), np.ptp(s, axis=1)])[status == code]
        look = {"facecolors": colour, "lw": 0, "antialiased": False, "zorder": 0}
        axes.broken_barh(strips, (0, 1), transform=axes.get_xaxis_transform(), **look)
    bound = curve(traction.friction_bound)
    axes.fill_between(
        path(at),
        -path(bound),
        path(bound),
        fc="0.35",
        ec="none",
        alpha=0.25,
        label="friction bound",
    )
    shown = words(t[0]) if np.allclose(t, t[0]) else "$(-n_2, n_1)$"
    for values, colour, name in (
        (pressure, PRESSURE, "pressure $-r_n$"),
        (shear, SHEAR, f"shear $r_t$ along {shown}"),
    ):
        axes.plot(path(at), path(curve(values)), color=colour, lw=1.6, label=name)
        if surface.degree == 1:
            axes.plot(path(at), path(computed(values)), color=colour, lw=0.5, alpha=0.7)
    axes.axhline(0.0, color="0.4", lw=0.6)
    closed = s[status != OPEN] if np.any(status != OPEN) else s
    around = closed.min() - np.ptp(closed), closed.max() + np.ptp(closed)
    axes.set(xlabel=label, ylabel="traction [force/area]", xlim=np.clip(around, s.min(), s.max()))
    greatest = np.maximum(pressure, traction.friction_bound).max(axis=1)
    _keep_peaks(axes, weighted_level(greatest, traction.area, 0.9), float(greatest.max()))
    handles, labels = axes.get_legend_handles_labels()
    if surface.degree == 1:
        handles, labels = (
            [*handles, Line2D([], [], color="0.3", lw=0.5)],
            [*labels, "facet by facet"],
        )
    for code in np.unique(status):
        handles, labels = [*handles, Patch(fc=COLOURS[code], ec="0.6")], [*labels, STATUS[code]]
    place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": 4, "frameon": False}
    axes.legend(handles, labels, columnspacing=1.2, **place)
    return axes


def _keep_peaks(axes: Any, level: float, peak: float) -> None:
    """Make an axis of traction logarithmic above its level if a peak needs it.

    The peak would else flatten everything beside it.
    """
    from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator  # noqa: PLC0415

    if not 0 < PEAK * level < peak:
        return
    axes.set_yscale("symlog", linthresh=level, linscale=2.0)
    low, high = axes.get_ylim()
    ticks = MaxNLocator(4).tick_values(max(low, -level), level)
    beyond = [
        np.sign(end) * log_ticks(1.3 * level, abs(end))
        for end in (low, high)
        if abs(end) > 4 * level
    ]
    ticks = np.concatenate([ticks[abs(ticks) <= level], *beyond])
    axes.yaxis.set_major_locator(FixedLocator(ticks[(ticks >= low) & (ticks <= high)]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))
    axes.axhline(level, color="0.4", lw=0.8, ls=":")


def contact_maps(surface: Any, ax: Any = None) -> Any:
    """Draw the axes of :func:`plot_contact` in 3D; on rank 0."""
    from matplotlib.colors import BoundaryNorm, ListedColormap  # noqa: PLC0415

    traction, status, n = surface.traction, contact_status(surface.traction), mean_normal(surface)
    points, parts = subdivided(2, 4)
    shape, corners = bernstein(2, surface.degree, points), bernstein(2, 1, points)
    plane = tangents(n)
    s, t = plane @ np.matmul(corners, surface.x[:, :3]).reshape(-1, 3).T
    triangles = (np.arange(len(surface.x))[:, None, None] * len(points) + parts).reshape(-1, 3)
    shear = np.linalg.norm(np.matmul(shape, traction.tangential_part), axis=-1)
    u, v = plane @ surface.x[:, :3].reshape(-1, 3).T
    facets = np.arange(len(u)).reshape(-1, 3)
    closed = facets[status != OPEN] if np.any(status != OPEN) else facets
    ends = [_around(of, of[closed]) for of in (u, v)]
    ratio = float(np.ptp(ends[1]) / np.ptp(ends[0]))
    panels = (
        new_figure(10.0, max(2.6, 1.2 + 3.0 * ratio)).subplots(1, 3, sharex=True, sharey=True)
        if ax is None
        else panels_of(ax, 3, "plot_contact in 3D")
    )
    figure = panels[0].figure
    for panel, title, values in zip(
        panels,
        ("pressure $-r_n$", "shear $|r_t|$"),
        (-traction.normal_component @ shape.T, shear),
        strict=False,
    ):
        known = {"vmin": min(values.min(), 0.0), "vmax": values.max() or 1.0}
        drawn = panel.tripcolor(
            s, t, triangles, values.ravel(), shading="gouraud", rasterized=True, **known
        )
        bar = figure.colorbar(
            drawn, ax=panel, label=f"{title} [force/area]", location="bottom", shrink=0.9
        )
        if not values.any():
            bar.set_ticks([0.0])
    look = {
        "cmap": ListedColormap(COLOURS),
        "norm": BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3),
        "edgecolors": "0.6",
    }
    drawn = panels[2].tripcolor(u, v, facets, facecolors=status.astype(float), lw=0.2, **look)
    bar = figure.colorbar(
        drawn,
        ax=panels[2],
        location="bottom",
        shrink=0.9,
        ticks=[OPEN, SLIP, STICK],
        label="status",
    )
    bar.ax.set_xticklabels(STATUS)
    below = np.cross(*plane) @ n < 0  # the eye is in the foundation
    for panel in panels:
        panel.set(
            aspect="equal",
            xlabel=coordinate(plane[0]),
            xlim=ends[0],
            ylim=ends[1][:: -1 if below else 1],
        )
    panels[0].set_ylabel(coordinate(plane[1]))
    panels[1].set_title("seen from the foundation", fontsize=11)
    return panels


def _around(all_of_it: np.ndarray, closed: np.ndarray) -> np.ndarray:
    """Find the ends of an axis that shows the closed part and as much around it."""
    margin = 0.5 * np.ptp(closed)
    return np.clip([closed.min() - margin, closed.max() + margin], all_of_it.min(), all_of_it.max())
