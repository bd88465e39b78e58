"""Plot the error of adaptive runs by matplotlib.

Symbols: eps relative error, d dimension, k degree.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.base.percent import percent
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.output.drawing import COLOUR_CYCLE, draw_figure, log_ticks, new_figure, panels_of

SPAN = 4.0
"""Factor by which unknowns must grow over the meshes of which a slope is told [-]."""


class Run(Protocol):
    """Represent an adaptive run, as far as it is drawn.

    A ``History`` has these members.
    """

    @property
    def accuracy(self) -> float:
        """Return the prescribed relative error."""

    @property
    def error(self) -> ConstitutiveError:
        """Return the best result."""

    def column(self, name: str) -> np.ndarray:
        """Return one value for each mesh: "dofs", "eps" or "seconds"."""

    def slope(self, against: str) -> float:
        """Fit the slope of log(eps) against the logarithm of a column.

        It is nan if there are too few meshes for it.
        """


def plot_history(
    histories: Mapping[str, Run], path: str | Path | None = None, *, ax: Any = None
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
            by default those of a new figure.

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
    many = len(histories) > 3

    def draw(ax: Any) -> np.ndarray:
        if ax is None:
            figure = new_figure(8.6, 3.9 + 0.13 * len(histories) * many)
            figure.get_layout_engine().set(wspace=0.06)
            ax = figure.subplots(1, 2, sharey=True)
        left, right = axes = panels_of(ax, 2, "plot_history")
        for number, ((name, history), marker) in enumerate(
            zip(histories.items(), "osD^vP*X" * len(histories), strict=False)
        ):
            slope = history.slope("dofs")
            look = {"label": name if np.isnan(slope) else f"{name} (slope ${slope:.2f}$)"}
            look["color"] = COLOUR_CYCLE[number % len(COLOUR_CYCLE)]
            for panel, column in ((left, "seconds"), (right, "dofs")):
                panel.plot(
                    history.column(column),
                    100 * history.column("eps"),
                    f"{marker}-",
                    ms=4,
                    lw=1.2,
                    **look,
                )
        left.set(xlabel="run time [s]", ylabel="relative error [%]")
        right.set_xlabel("degrees of freedom")
        for accuracy in sorted({h.accuracy for h in histories.values()}):
            for panel in axes:
                panel.axhline(100 * accuracy, color="0.35", lw=0.9, ls=":")
            place = {"transform": left.get_yaxis_transform(), "va": "bottom"}
            left.text(0.02, 100 * accuracy, f"accuracy {percent(accuracy, 3)}", **place)
        dofs, eps = (
            np.concatenate([h.column(c) for h in histories.values()]) for c in ("dofs", "eps")
        )
        ends = np.array([np.sqrt(dofs.max() * dofs.min()), dofs.max()])
        degree = max(h.error.degree for h in histories.values())
        order = Fraction(degree, domain.dim)
        below = 75 * float(np.min((eps * dofs ** float(order))[dofs >= ends[0]], initial=np.inf))
        if 0 < below < np.inf and dofs.max() >= SPAN * dofs.min():
            right.plot(
                ends, below * ends ** -float(order), "k--", lw=0.9, label=f"slope $-{order}$"
            )
        if many:
            place = {"loc": "outside lower center", "ncols": 2, "frameon": False}
            left.figure.legend(*right.get_legend_handles_labels(), **place)
        else:
            right.legend(loc="best", frameon=False)
        for panel in axes:
            panel.grid(which="major", color="0.9", lw=0.6)
            _log_scale(panel.xaxis, *panel.dataLim.intervalx)
            _log_scale(panel.yaxis, *right.dataLim.intervaly)
        return axes

    return draw_figure(domain.mesh.comm, path, ax, draw)


def _log_scale(axis: Any, low: float, high: float) -> None:
    """Make an axis logarithmic, with plain numbers at its ticks.

    It stays linear if the least value is not positive.
    """
    from matplotlib.ticker import NullLocator  # noqa: PLC0415

    if not low > 0:
        axis.axes.margins(**{axis.axis_name: 0.15})
        return
    margin = 1.08 * (high / low) ** 0.04
    low, high = low / margin, high * margin
    axis.axes.set(**{f"{axis.axis_name}scale": "log", f"{axis.axis_name}lim": (low, high)})
    ticks = log_ticks(low, high)
    axis.set_ticks(
        ticks, labels=[f"{tick:.6g}" if tick < 1e5 else f"{tick / 1e3:g}k" for tick in ticks]
    )
    axis.set_minor_locator(NullLocator())
