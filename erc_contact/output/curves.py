"""Plot the error of adaptive runs by matplotlib.

Symbols: eps relative error, d dimension, k degree.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.error.runs import AdaptiveRun
from erc_contact.output.drawing import log_ticks
from erc_contact.output.placing import panels
from namedmesh.base.percent import percent
from namedmesh.pictures import COLOUR_CYCLE, draw_figure

SPAN = 4.0
"""Factor by which unknowns must grow over the meshes of which a slope is told [-]."""
PANEL_SIZE = (3.7, 3.2)
"""Width and height of both axes [inches]."""
FEW_CURVES = 3
"""Greatest number of curves whose legend is inside the axes."""
MARKERS = "osD^vP*X"
"""Marks of the curves, one after another."""


def plot_history(
    histories: Mapping[str, AdaptiveRun], path: str | Path | None = None, *, ax: Any = None
) -> Any:
    """Draw the relative error against run time and degrees of freedom; collective.

    The axes are logarithmic. Each history has one curve. Its label has the measured
    slope against the degrees of freedom, if there are three meshes or more and the
    degrees of freedom grow by a factor of 4. Dotted lines show the prescribed
    accuracies. Where the degrees of freedom of all histories have that factor, too, a
    dashed line shows the slope -k/d, the best one for elements of degree k.

    Args:
        histories: The histories by their names, e.g. ``{"adaptive": history, "uniform":
            other}``.
        path: Picture file, or None.
        ax: Two axes of matplotlib to draw on, for run time and for degrees of freedom;
            by default of a new figure.

    Returns:
        The two axes on rank 0, None on the other ranks.

    Raises:
        InputError: If there is no history, or not two axes are given.
    """
    if not histories:
        raise InputError(
            "plot_history: no history is given; give at least one, e.g. {'adaptive': history}."
        )
    domain = next(iter(histories.values())).error.domain

    def draw(ax: Any) -> np.ndarray:
        with panels("plot_history", ax, [PANEL_SIZE, PANEL_SIZE], sharey=True) as row:
            left, right = row
            _draw_errors(left, right, histories)
            left.set(xlabel="run time [s]", ylabel="relative error [%]")
            right.set_xlabel("degrees of freedom")
            _draw_accuracies(left, right, histories)
            _draw_best_slope(right, histories, domain.dim)
            if len(histories) > FEW_CURVES:
                place = "lower center" if ax is None else "outside lower center"
                where = {"loc": place, "ncols": 2, "frameon": False}
                left.figure.legend(*right.get_legend_handles_labels(), **where)
            else:
                right.legend(loc="best", frameon=False)
            for panel in row:
                panel.grid(which="major", color="0.9", lw=0.6)
                _log_scale(panel.xaxis, *panel.dataLim.intervalx)
                # Both axes have the errors of the right one, without the words of the
                # left.
                _log_scale(panel.yaxis, *right.dataLim.intervaly)
        return row

    return draw_figure(domain.comm, path, ax, draw)


def _draw_errors(left: Any, right: Any, histories: Mapping[str, AdaptiveRun]) -> None:
    """Draw the relative errors over run time and over degrees of freedom."""
    for number, (name, history) in enumerate(histories.items()):
        slope = history.slope("dofs")
        label = name if np.isnan(slope) else f"{name} (slope {slope:.2f})"
        look = {
            "label": label,
            "color": COLOUR_CYCLE[number % len(COLOUR_CYCLE)],
            "marker": MARKERS[number % len(MARKERS)],
            "ls": "-",
            "ms": 4,
            "lw": 1.2,
        }
        eps = 100 * history.column("eps")
        left.plot(history.column("seconds"), eps, **look)
        right.plot(history.column("dofs"), eps, **look)


def _draw_accuracies(left: Any, right: Any, histories: Mapping[str, AdaptiveRun]) -> None:
    """Draw the prescribed accuracies, with words at their left ends."""
    where = {"transform": left.get_yaxis_transform(), "va": "bottom"}
    for accuracy in sorted({history.accuracy for history in histories.values()}):
        level = 100 * accuracy
        left.axhline(level, color="0.35", lw=0.9, ls=":")
        right.axhline(level, color="0.35", lw=0.9, ls=":")
        left.text(0.02, level, f"accuracy {percent(accuracy, 3)}", **where)


def _draw_best_slope(axes: Any, histories: Mapping[str, AdaptiveRun], d: int) -> None:
    """Draw a line of the slope -k/d below the errors, if the meshes grow enough."""
    dofs = np.concatenate([history.column("dofs") for history in histories.values()])
    eps = np.concatenate([history.column("eps") for history in histories.values()])
    degree = max(history.error.degree for history in histories.values())
    slope = Fraction(degree, d)
    order = float(slope)
    # The line is drawn over the upper half of the range, at 3/4 of the least error.
    ends = np.array([np.sqrt(dofs.max() * dofs.min()), dofs.max()])
    constants = (eps * dofs**order)[dofs >= ends[0]]
    below = 75 * float(np.min(constants, initial=np.inf))
    if 0 < below < np.inf and dofs.max() >= SPAN * dofs.min():
        axes.plot(ends, below * ends**-order, "k--", lw=0.9, label=f"slope -{slope}")


def _log_scale(axis: Any, low: float, high: float) -> None:
    """Make an axis logarithmic, with plain numbers at its ticks.

    It stays linear if the least value is not positive.
    """
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator  # noqa: PLC0415

    if not low > 0:
        axis.axes.margins(**{axis.axis_name: 0.15})
        return
    margin = 1.08 * (high / low) ** 0.04
    low, high = low / margin, high * margin
    axis.axes.set(**{f"{axis.axis_name}scale": "log", f"{axis.axis_name}lim": (low, high)})
    # The inner axes of a row have no words at the left.
    if axis.get_label_text():
        axis.set_label_text(f"{axis.get_label_text()}, log scale")
    ticks = log_ticks(low, high)
    axis.set_minor_locator(NullLocator())
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter(FuncFormatter(lambda tick, _: _plain(tick)))


def _plain(number: float) -> str:
    """Write a number without powers of ten; thousands have a k."""
    return f"{number:.6g}" if number < 1e5 else f"{number / 1e3:g}k"
