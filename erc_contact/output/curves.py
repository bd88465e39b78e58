"""Plots by matplotlib: the error of adaptive runs, and the traction on a contact.

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, b friction bound, n normal of the
foundation, t tangent of the contact, s coordinate along t, eps relative error, d dimension, k degree.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError
from erc_contact.base.percent import percent
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.simplex import bernstein
from erc_contact.model.profile import OPEN, SLIP, STICK
from erc_contact.output.drawing import coordinate, new_figure, save_figure, tangents, weighted_level, words
from erc_contact.output.files import PARTS, on_root, subdivided
from erc_contact.output.gathered import AXIS, Surface, mean_normal, whole_contact
from erc_contact.results.profile import contact_status

STATUS = ("open", "slip", "stick")
"""Names of the codes OPEN, SLIP and STICK."""
COLOURS = ("#ececec", "#fdeacc", "#d9ecd6")
"""Colours of open, slip and stick."""


class Run(Protocol):
    """An adaptive run, as far as it is drawn. A ``History`` has these members."""

    @property
    def accuracy(self) -> float:
        """The prescribed relative error."""

    @property
    def error(self) -> ConstitutiveError:
        """The best result."""

    def column(self, name: str) -> np.ndarray:
        """One value for each mesh: "dofs", "eps" or "seconds"."""

    def slope(self, against: str) -> float:
        """Slope of log(eps) against the logarithm of a column; nan if there is none."""


def plot_history(histories: Mapping[str, Run], path: str | Path) -> None:
    """Draw the relative error against run time and against degrees of freedom, with logarithmic axes; collective.

    Each history has one curve, and its label has the measured slope against the degrees of freedom. Dotted lines show
    the prescribed accuracies. A dashed line shows the slope -k/d, the best one for elements of degree k.

    Args:
        histories: The histories by their names, e.g. ``{"adaptive": history, "uniform": other}``.
        path: Picture file.

    Raises:
        InputError: If there is no history.
    """
    if not histories:
        raise InputError("plot_history: no history is given; give at least one, e.g. {'adaptive': history}.")
    domain = next(iter(histories.values())).error.domain

    def draw() -> None:
        many = len(histories) > 3
        figure = new_figure(8.6, 3.9 + 0.13 * len(histories) * many)
        figure.get_layout_engine().set(wspace=0.06)
        left, right = figure.subplots(1, 2, sharey=True)
        for (name, history), marker in zip(histories.items(), "osD^vP*X" * len(histories), strict=False):
            slope = history.slope("dofs")
            label = name if np.isnan(slope) else f"{name} (slope ${slope:.2f}$)"
            for axes, column in ((left, "seconds"), (right, "dofs")):
                axes.plot(history.column(column), 100 * history.column("eps"), f"{marker}-", ms=4, lw=1.2, label=label)
        left.set(xlabel="run time [s]", ylabel="relative error [%]")
        right.set_xlabel("degrees of freedom")
        for accuracy in sorted({h.accuracy for h in histories.values()}):
            for axes in (left, right):
                axes.axhline(100 * accuracy, color="0.35", lw=0.9, ls=":")
            place = {"transform": left.get_yaxis_transform(), "va": "bottom"}
            left.text(0.02, 100 * accuracy, f"accuracy {percent(accuracy, 3)}", **place)
        dofs, eps = (np.concatenate([h.column(c) for h in histories.values()]) for c in ("dofs", "eps"))
        ends = np.array([np.sqrt(dofs.max() * dofs.min()), dofs.max()])
        degree = max(h.error.degree for h in histories.values())
        order = Fraction(degree, domain.dim)
        below = 75 * float(np.min((eps * dofs ** float(order))[dofs >= ends[0]], initial=np.inf))
        if 0 < below < np.inf and dofs.max() > dofs.min():
            right.plot(ends, below * ends ** -float(order), "k--", lw=0.9, label=f"slope $-{order}$")
        if many:
            figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
        else:
            right.legend(loc="best", frameon=False)
        for axes in (left, right):
            axes.grid(which="major", color="0.9", lw=0.6)
            _log_scale(axes.xaxis, *axes.dataLim.intervalx)
        _log_scale(left.yaxis, *right.dataLim.intervaly)
        save_figure(figure, path)

    on_root(domain.mesh.comm, path, draw)


def plot_contact(admissible: Admissible, name: str, path: str | Path) -> None:
    """Draw the traction r^ on a contact and its status; collective.

    In 2D curves show the pressure, the shear along t = (-n_2, n_1), and the band from -b to b. On each facet they are
    polynomials, and they jump from one facet to the next. Strips in the background have the colours of the status of
    the facets (:func:`erc_contact.results.contact_status`). The abscissa s is the coordinate along a straight contact,
    or the arc length of a curved one. So the area under the curve of the pressure is the normal force. A singular peak
    is cut off, and the label gives its height.

    In 3D maps in the tangent plane show the pressure, the length of the shear, and the status of the facets.

    Args:
        admissible: The admissible pair.
        name: Name of the contact.
        path: Picture file.

    Raises:
        InputError: If no contact has this name, or it has no facet.
    """
    model = admissible.solution.model
    names = [t.contact.name for t in admissible.tractions]
    if name not in names:
        raise InputError(f"plot_contact: no contact is called {name!r}; the scene has {', '.join(names) or 'none'}.")
    surface = whole_contact(admissible, admissible.tractions[names.index(name)])
    if not model.comm.bcast(surface is not None and len(surface.x)):
        raise InputError(f"plot_contact: {name!r} has no facet; contacts of this scene: {', '.join(names)}.")
    draw = contact_curves if model.d == 2 else contact_maps
    on_root(model.comm, path, lambda: save_figure(draw(surface), path))


def contact_curves(surface: Any) -> Any:
    """The figure of :func:`plot_contact` in 2D; on rank 0."""
    from matplotlib.collections import LineCollection  # noqa: PLC0415
    from matplotlib.patches import Patch  # noqa: PLC0415

    traction, n = surface.traction, surface.traction.contact.direction
    s, label = _along(surface)
    order = np.argsort(s.min(axis=1))
    points, _ = subdivided(1, 1 if surface.degree == 1 else PARTS)
    shape = bernstein(1, surface.degree, points)
    turned = (s[:, 0] > s[:, 1])[:, None]

    at = np.sort(s[:, :1] + points.T * (s[:, 1:] - s[:, :1]), axis=1)[order]
    parts = np.flatnonzero(at[1:, 0] - at[:-1, -1] > AXIS * np.ptp(at)) + 1

    def values(coefficients: np.ndarray) -> np.ndarray:
        """Values at points of the facets, in their order along the contact, shape (n, q)."""
        sampled = coefficients @ shape.T
        return np.where(turned, sampled[:, ::-1], sampled)[order]

    def path(sampled: np.ndarray) -> np.ndarray:
        """Values (n, q) in one row, with nan between parts of the contact that do not touch."""
        return np.insert(sampled, parts, np.nan, axis=0).ravel()

    t = np.column_stack([-n[:, 1], n[:, 0]])
    bound, pressure = values(traction.friction_bound), values(-traction.normal_component)
    shear = values(np.einsum("fmi,fi->fm", traction.tangential_part, t))
    figure = new_figure(7.2, 4.0)
    axes = figure.subplots()
    status = contact_status(traction)
    for code, colour in enumerate(COLOURS):
        strips = np.column_stack([s.min(axis=1), np.ptp(s, axis=1)])[status == code]
        look = {"facecolors": colour, "lw": 0, "antialiased": False, "zorder": 0}
        axes.broken_barh(strips, (0, 1), transform=axes.get_xaxis_transform(), **look)
    axes.fill_between(path(at), -path(bound), path(bound), fc="#5b84b1", ec="none", alpha=0.35, label="friction bound")
    area = traction.area[order]
    low, high = (1.6 * weighted_level(v.max(axis=1), area, 0.98) for v in (bound, np.maximum(pressure, bound)))
    peak = f" (peak {pressure.max():.3g})" if pressure.max() > high > 0 else ""
    along = words(t[0]) if np.allclose(t, t[0]) else "$(-n_2, n_1)$"
    for curve, colour, name in (
        (pressure, "#1f3b73", f"pressure $-r_n${peak}"),
        (shear, "#b22222", f"shear $r_t$ along {along}"),
    ):
        axes.plot(path(at), path(curve), color=colour, lw=0.5)  # with the jumps between facets
        axes.add_collection(LineCollection(np.stack([at, curve], axis=-1), colors=colour, lw=1.6, label=name))
    axes.axhline(0.0, color="0.4", lw=0.6)
    if peak:  # a singular end must not flatten all the rest
        axes.set_ylim(-low, high)
    closed = s[status != OPEN] if np.any(status != OPEN) else s
    around = closed.min() - np.ptp(closed), closed.max() + np.ptp(closed)
    axes.set(xlabel=label, ylabel="traction [force/area]", xlim=np.clip(around, s.min(), s.max()))
    handles, labels = axes.get_legend_handles_labels()
    for code in np.unique(status):
        handles, labels = [*handles, Patch(fc=COLOURS[code], ec="0.6")], [*labels, STATUS[code]]
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, columnspacing=1.2)
    return figure


def contact_maps(surface: Any) -> Any:
    """The figure of :func:`plot_contact` in 3D; on rank 0."""
    from matplotlib.colors import BoundaryNorm, ListedColormap  # noqa: PLC0415

    traction = surface.traction
    points, parts = subdivided(2, 4)
    shape, corners = bernstein(2, surface.degree, points), bernstein(2, 1, points)
    plane = tangents(mean_normal(surface))
    s, t = plane @ np.matmul(corners, surface.x[:, :3]).reshape(-1, 3).T
    triangles = (np.arange(len(surface.x))[:, None, None] * len(points) + parts).reshape(-1, 3)
    shear = np.linalg.norm(np.matmul(shape, traction.tangential_part), axis=-1)
    figure = new_figure(10.0, max(2.6, 1.2 + 3.0 * float(np.ptp(t) / np.ptp(s))))
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    for panel, title, values in zip(
        panels, ("pressure $-r_n$", "shear $|r_t|$"), (-traction.normal_component @ shape.T, shear), strict=False
    ):
        known = {"vmin": min(values.min(), 0.0), "vmax": values.max() or 1.0}
        drawn = panel.tripcolor(s, t, triangles, values.ravel(), shading="gouraud", **known)
        bar = figure.colorbar(drawn, ax=panel, label=f"{title} [force/area]", location="bottom", shrink=0.9)
        if not values.any():
            bar.set_ticks([0.0])
    u, v = plane @ surface.x[:, :3].reshape(-1, 3).T
    facets = np.arange(len(u)).reshape(-1, 3)
    look = {"cmap": ListedColormap(COLOURS), "norm": BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3), "edgecolors": "0.6"}
    drawn = panels[2].tripcolor(u, v, facets, facecolors=contact_status(traction).astype(float), lw=0.2, **look)
    bar = figure.colorbar(drawn, ax=panels[2], location="bottom", shrink=0.9, ticks=[OPEN, SLIP, STICK], label="status")
    bar.ax.set_xticklabels(STATUS)
    for panel in panels:
        panel.set(aspect="equal", xlabel=coordinate(plane[0]))
    panels[0].set_ylabel(coordinate(plane[1]))
    return figure


def _along(surface: Surface) -> tuple[np.ndarray, str]:
    """The coordinate s of the vertices of each facet in 2D [length], shape (n, 2), and its label."""
    (tangent,) = tangents(mean_normal(surface))
    s = surface.x[:, :2, :2] @ tangent
    if np.allclose(np.ptp(s, axis=1), surface.traction.area, rtol=10 * AXIS, atol=0.0):
        return s, coordinate(tangent)
    return _arc_length(surface)


def _arc_length(surface: Surface) -> tuple[np.ndarray, str]:
    """The arc length s along a curved contact, which may have several parts or be closed, and its label.

    Each facet first knows its successor, then the facet 2, 4, ... places further on, until it knows the end of its part
    and the length to it (pointer jumping). A closed part is cut far from the mean place of the pressure, where s is
    zero.
    """
    traction, ends = surface.traction, surface.x[:, :2, :2]
    n, area, many = traction.contact.direction, traction.area, len(traction.area)
    forward = np.einsum("fi,fi->f", ends[:, 1] - ends[:, 0], np.column_stack([-n[:, 1], n[:, 0]])) > 0
    first, last = np.where(forward, surface.vertices.T, surface.vertices.T[::-1])
    force = area * np.maximum(-traction.normal_component, 0).mean(axis=1)
    centre = np.average(ends.mean(axis=1), axis=0, weights=force if force.any() else area)
    order = np.argsort(first)
    found = order[np.minimum(np.searchsorted(first, last, sorter=order), many - 1)]
    successor = np.where(first[found] == last, found, np.arange(many))
    while True:
        rest, end = np.where(successor == np.arange(many), 0.0, area), successor
        for _ in range(many.bit_length()):
            rest, end = rest + rest[end], end[end]
        closed = np.flatnonzero(successor[end] != end)
        if len(closed) == 0:
            break
        cut = closed[np.linalg.norm(ends[closed, 0] - centre, axis=1).argmax()]
        successor[cut] = cut
    start, offset = np.empty(many), 0.0
    for part in np.unique(end):
        at = end == part
        start[at] = offset + rest[at].max() - rest[at]
        offset = float((start[at] + area[at]).max()) + 0.05 * area.sum()
    s = np.where(forward, [start, start + area], [start + area, start]).T
    facet, vertex = np.unravel_index(np.linalg.norm(ends - centre, axis=2).argmin(), s.shape)
    return s - s[facet, vertex], f"arc length from {words(ends[facet, vertex], area.sum())} [length]"


def _log_scale(axis: Any, low: float, high: float) -> None:
    """Make an axis logarithmic, with plain numbers at its ticks and ends of the form 1, 2 or 5 times a power of 10.

    It stays linear if the least value is not positive.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter  # noqa: PLC0415

    if not low > 0:
        axis.axes.margins(**{axis.axis_name: 0.15})
        return
    ends = np.outer(10.0 ** np.arange(-18, 16), [1, 2, 5]).ravel()
    low, high = ends[ends <= low / 1.08].max(), ends[ends >= high * 1.08].min()
    axis.axes.set(**{f"{axis.axis_name}scale": "log", f"{axis.axis_name}lim": (low, high)})
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high / low < 200 else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}" if value < 1e5 else f"{value / 1e3:g}k"))
    axis.set_minor_formatter(NullFormatter())
