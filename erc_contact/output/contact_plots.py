"""Plot the traction on a contact and its status by matplotlib.

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, b
friction bound, n normal of the contact out of the body.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.admissible.pair import pair_of
from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.status import OPEN
from erc_contact.output.along import along, through_means
from erc_contact.output.contact_maps import contact_maps
from erc_contact.output.drawing import (
    STATUS_COLOURS,
    STATUS_NAMES,
    log_ticks,
    weighted_level,
    words,
)
from erc_contact.output.files import PARTS
from erc_contact.output.gathered import AXIS, WholeContact, whole_contact
from erc_contact.output.placing import panels
from erc_contact.scene.periodic import HELD
from namedmesh.base.names import in_picture, known_names
from namedmesh.pictures import draw_figure, subdivide
from namedmesh.simplex import bernstein

PRESSURE, SHEAR = "#0072B2", "#D55E00"
"""Colours of the curves of pressure and shear."""
CURVES_SIZE = (6.3, 2.9)
"""Width and height of the axes in 2D [inches]."""
IN_ONE_LINE = 4
"""Greatest number of entries of a legend in one line."""
LABEL_DISTANCE = 0.05
"""Least distance of two labels of an axis, as a share of its length [-]."""
BESIDE: dict[str, Any] = {
    "xycoords": ("axes fraction", "data"),
    "textcoords": "offset points",
    "fontsize": 8,
    "color": "0.35",
}
"""Where words stand at the left end of a level, and their look."""
PEAK = 8.0
"""Factor from the 90% level of a traction to its peak [-].

Where it is exceeded, the axis is logarithmic above the level.
"""


def plot_contact(result: Any, name: str, path: str | Path | None = None, *, ax: Any = None) -> Any:
    """Draw the traction r^ on a contact and its status; collective.

    In 2D curves show the pressure, the shear along (-n_2, n_1), and the band from
    -b to b; without friction the pressure alone. Of degree 2 they are r^, facet by
    facet. Of degree 1 r^ jumps from one facet to the next as much as it is wrong; the
    curves then are continuous and have the mean of r^ on each facet
    (:func:`erc_contact.output.along.through_means`), and thin lines show r^. So the
    area under the curve of the pressure is the normal force. Strips in the background
    have the colours of the status of the facets
    (:func:`erc_contact.results.contact_status`). The abscissa is the coordinate along
    a straight contact, or the arc length of a curved one. Nothing is cut off: where a
    peak is high, the axis is logarithmic above a dotted line. No bound of r^ at single
    points is known, so none is drawn.

    In 3D maps in the tangent plane, as the foundation or the other body sees it, show
    the pressure, with friction the length of the shear, and the status of the facets.
    The tractions are r^ itself, which jumps from one facet to the next as much as it is
    wrong, so maps of degree 1 on coarse meshes look rough. They are not smoothed: a
    continuous map of degree 1 has one value at a node, there are about twice as many
    facets as nodes, and so it cannot have the mean of r^ on each of them.

    Args:
        result: An admissible pair, an error, or a history.
        name: Name of the contact.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, one in 2D and three in 3D, two of them
            without friction; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.

    Raises:
        InputError: If no contact has this name, or it has no facet, or there is another
            number of axes.
    """
    admissible = pair_of(result)
    model = admissible.model
    names = [joint.name for joint in (*model.contacts, *model.ties)]
    if name not in names:
        raise InputError(
            f"plot_contact: no contact is called {name!r}; the scene has {known_names(name, names)}"
        )
    surface = whole_contact(admissible, admissible.per_area(admissible.traction(name)))
    # Only rank 0 knows all facets, and all ranks raise.
    has_facets = model.space.comm.bcast(surface is not None and len(surface.x))
    if not has_facets:
        raise InputError(
            f"plot_contact: {name!r} has no facet; contacts of this scene: {', '.join(names)}."
        )

    def draw(ax: Any) -> Any:
        assert surface is not None
        return contact_curves(surface, ax) if model.space.d == 2 else contact_maps(surface, ax)

    return draw_figure(model.space.comm, path, ax, draw, model.scene.label)


def contact_curves(surface: WholeContact, ax: Any = None) -> Any:
    """Draw the axes of :func:`plot_contact` in 2D; on rank 0."""
    traction = surface.traction
    n = traction.contact.trace.normals
    status = surface.status
    abscissa, label = along(surface)
    line = _Samples(surface, abscissa)
    with panels("plot_contact in 2D", ax, [CURVES_SIZE]) as (axes,):
        _draw_strips(axes, abscissa, status)
        # Joints and copies have no bound, and without friction there is no shear.
        limited = bool((traction.friction_bound < 0.5 * HELD.LIMIT).all())
        has_shear = bool(traction.friction_bound.any())
        if limited and has_shear:
            bound = line.path(line.curve(traction.friction_bound))
            look = {"fc": "0.35", "ec": "none", "alpha": 0.25}
            axes.fill_between(line.abscissa, -bound, bound, label="friction bound", **look)
        tangent = np.stack([-n[..., 1], n[..., 0]], axis=-1)
        direction = words(tangent[0, 0]) if np.allclose(tangent, tangent[0, 0]) else "$(-n_2, n_1)$"
        pressure = -traction.normal_component
        shear = (traction.tangential_part * tangent).sum(axis=-1)
        _draw_traction(axes, line, pressure, PRESSURE, "pressure")
        if has_shear:
            _draw_traction(axes, line, shear, SHEAR, f"shear along {direction}")
        axes.axhline(0.0, color="0.4", lw=0.6)
        closed = abscissa[status != OPEN] if np.any(status != OPEN) else abscissa
        # The closed part is shown with as much beside it, where the contact goes on.
        around = closed.min() - np.ptp(closed), closed.max() + np.ptp(closed)
        of_pair = ""
        if traction.contact.against is not None:
            over = in_picture(traction.contact.against)
            of_pair = f" of {over}\non {in_picture(traction.contact.name)}"
        axes.set(xlabel=label, ylabel=f"traction{of_pair} [force/area]")
        axes.set_xlim(np.clip(around, abscissa.min(), abscissa.max()))
        greatest = np.maximum(pressure, traction.friction_bound if limited else abs(shear)).max(
            axis=1
        )
        _keep_peaks(axes, weighted_level(greatest, traction.area, 0.9), float(greatest.max()))
        _write_legend(axes, status, surface.degree)
    return axes


class _Samples:
    """Sample values on the facets along a contact in 2D.

    Attributes:
        abscissa: Coordinate of the sampled points in one row, see :meth:`path`.
    """

    def __init__(self, surface: WholeContact, ends: np.ndarray) -> None:
        """Place q points on each facet, in order along the contact.

        Args:
            surface: The contact.
            ends: Coordinate of the ends of its facets [length], shape (n, 2).
        """
        self.degree = surface.degree
        self.order = np.argsort(ends.min(axis=1))
        self.turned = (ends[:, 0] > ends[:, 1])[:, None]
        self.points = subdivide(1, PARTS)[0]
        places = np.sort(ends[:, :1] + self.points.T * np.diff(ends), axis=1)[self.order]
        self.lengths = np.ptp(places, axis=1)
        # Facets that do not touch the one before begin a new part of the contact.
        jumps = places[1:, 0] - places[:-1, -1]
        self.parts = np.flatnonzero(jumps > AXIS * np.ptp(places)) + 1
        self.abscissa = self.path(places)

    def sample(self, coefficients: np.ndarray) -> np.ndarray:
        """Return r^ at points of the facets, in order along the contact, (n, q)."""
        values = coefficients @ bernstein(1, self.degree, self.points).T
        return np.where(self.turned, values[:, ::-1], values)[self.order]

    def curve(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the values that are drawn, shape (n, q)."""
        if self.degree > 1:
            return self.sample(coefficients)
        means = coefficients.mean(axis=1)[self.order]
        return through_means(means, self.lengths, self.parts, self.points[:, 0])

    def path(self, values: np.ndarray) -> np.ndarray:
        """Return values (n, q) in one row, with nan between parts that do not touch."""
        return np.insert(values, self.parts, np.nan, axis=0).ravel()


def _draw_strips(axes: Any, abscissa: np.ndarray, status: np.ndarray) -> None:
    """Draw strips behind the curves in the colours of the status of the facets."""
    look = {"lw": 0, "antialiased": False, "zorder": 0}
    strips = np.column_stack([abscissa.min(axis=1), np.ptp(abscissa, axis=1)])
    # Strips are as high as the axes, whatever the tractions.
    transform = axes.get_xaxis_transform()
    for code, colour in enumerate(STATUS_COLOURS):
        chosen = strips[status == code]
        axes.broken_barh(chosen, (0, 1), transform=transform, facecolors=colour, **look)


def _draw_traction(axes: Any, line: _Samples, values: np.ndarray, colour: str, name: str) -> None:
    """Draw the curve of a component of r^, and for degree 1 r^ itself by thin lines."""
    axes.plot(line.abscissa, line.path(line.curve(values)), color=colour, lw=1.6, label=name)
    if line.degree == 1:
        computed = line.path(line.sample(values))
        axes.plot(line.abscissa, computed, color=colour, lw=0.5, alpha=0.7)


def _write_legend(axes: Any, status: np.ndarray, degree: int) -> None:
    """Write the legend of curves and strips above the axes."""
    from matplotlib.lines import Line2D  # noqa: PLC0415
    from matplotlib.patches import Patch  # noqa: PLC0415

    handles, labels = axes.get_legend_handles_labels()
    if degree == 1:
        handles.append(Line2D([], [], color="0.3", lw=0.5))
        labels.append("facet by facet")
    for code in np.unique(status):
        handles.append(Patch(fc=STATUS_COLOURS[code], ec="0.6"))
        labels.append(STATUS_NAMES[code])
    # Two lines share the entries, so that none stands alone.
    columns = len(labels) if len(labels) <= IN_ONE_LINE else (len(labels) + 1) // 2
    where = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "frameon": False}
    where["ncols"] = columns
    axes.legend(handles, labels, columnspacing=1.2, **where)


def _keep_peaks(axes: Any, level: float, peak: float) -> None:
    """Make an axis of traction logarithmic above its level if a peak needs it.

    The peak would else flatten everything beside it.
    """
    from matplotlib.ticker import (  # noqa: PLC0415
        FixedLocator,
        FuncFormatter,
        MaxNLocator,
        NullLocator,
    )

    if not 0 < PEAK * level < peak:
        return
    axes.set_yscale("symlog", linthresh=level, linscale=2.0)
    low, high = axes.get_ylim()
    linear = MaxNLocator(4).tick_values(max(low, -level), level)
    linear = linear[abs(linear) <= level]
    ticks = [linear]
    for end in (low, high):
        # A short logarithmic part has no room for ticks.
        if abs(end) > 4 * level:
            ticks.append(np.sign(end) * log_ticks(1.3 * level, abs(end)))
    places = np.concatenate(ticks)
    places = _legible(axes, places[(places >= low) & (places <= high)])
    axes.yaxis.set_major_locator(FixedLocator(places))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))
    axes.axhline(level, color="0.4", lw=0.8, ls=":")
    axes.annotate("log scale above", (0.01, level), (0, 2), **BESIDE)


def _legible(axes: Any, ticks: np.ndarray) -> np.ndarray:
    """Leave out ticks of the axis of traction whose labels would overlap.

    Of two that are near, the one nearer to zero stays.
    """
    scale = axes.yaxis.get_transform()
    low, high = scale.transform(np.array(axes.get_ylim()))
    ticks = ticks[np.argsort(abs(ticks), kind="stable")]
    kept: list[float] = []
    for tick, height in zip(ticks, scale.transform(ticks), strict=True):
        distances = abs(scale.transform(np.array(kept)) - height) / (high - low)
        if distances.min(initial=1.0) >= LABEL_DISTANCE:
            kept.append(tick)
    return np.array(kept)
