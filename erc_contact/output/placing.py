"""Place the axes of a figure side by side, with room for their words; on rank 0.

matplotlib's own layouts measure the words of a figure five times, which takes longer
than all else of a picture. Here boxes have their sizes in inches, words are measured
once, and the figure gets the size of what is in it. So nothing is cut off or squeezed.

A box is an array (4,): left end, low end, width and height [inches]. Margins are an
array (4,), too: what words need at the left, below, at the right and above [inches].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from erc_contact.output.drawing import panels_of
from namedmesh.pictures import new_figure

GAP = 0.15
"""Distance between neighbours [inches]."""
PAD = 0.1
"""Distance between words and the end of the figure [inches]."""


@contextmanager
def panels(what: str, ax: Any, sizes: Sequence[tuple[float, float]], **how: Any) -> Iterator[Any]:
    """Give axes to draw on: the user's, or axes of a new figure that are placed then.

    Args:
        what: The function of the user's call, for a message.
        ax: Axes of the user's, or None.
        sizes: Width and height of the boxes of the axes [inches].
        how: How matplotlib makes them.

    Yields:
        As many axes as sizes, in an array.

    Raises:
        InputError: If there is another number of axes.
    """
    boxes = np.array(sizes)
    if ax is None:
        figure = new_figure(boxes[:, 0].sum(), boxes[:, 1].max())
        row = np.ravel(figure.subplots(1, len(boxes), **how))
        yield row
        place(row, boxes)
    else:
        yield panels_of(ax, len(boxes), what)


def place(
    row: Any,
    sizes: np.ndarray,
    bars: Sequence[Any] = (),
    bar_sizes: np.ndarray | None = None,
    *,
    beside: bool = False,
) -> None:
    """Place panels in a row, their colour bars, and what is written on the figure.

    Text of the figure stands above all, a legend of the figure below.

    Args:
        row: Axes of one figure, from left to right.
        sizes: Width and height of their boxes [inches], shape (n, 2).
        bars: Axes of colour bars: one below each panel, or one for all.
        bar_sizes: Width and height of these [inches], shape (m, 2).
        beside: Whether the bar for all is at the right, and not below.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415

    figure = row[0].figure
    renderer = FigureCanvasAgg(figure).get_renderer()
    boxes, margins = _row(row, sizes, renderer)
    axes = list(row)
    if bar_sizes is not None:
        axes += bars
        of_bars = [_margins(bar, size, renderer) for bar, size in zip(bars, bar_sizes, strict=True)]
        if beside:
            bar_boxes = _at_right(boxes, margins, bar_sizes, of_bars[0])
        else:
            bar_boxes = _below(boxes, margins, bar_sizes, of_bars)
        boxes = np.concatenate([boxes, bar_boxes])
        margins = np.concatenate([margins, of_bars])
    low = (boxes[:, :2] - margins[:, :2]).min(axis=0)
    high = (boxes[:, :2] + boxes[:, 2:] + margins[:, 2:]).max(axis=0)
    centre = (boxes[0, 0] + (boxes[: len(row), 0] + boxes[: len(row), 2]).max()) / 2
    low, high, places = _around(figure, renderer, low, high, centre)
    origin = low - PAD
    whole = high + PAD - origin
    figure.set_size_inches(whole)
    for one_axes, box in zip(axes, boxes, strict=True):
        one_axes.set_position([*((box[:2] - origin) / whole), *(box[2:] / whole)])
    for words, anchor in places:
        share = (anchor - origin) / whole
        if hasattr(words, "set_bbox_to_anchor"):
            words.set_bbox_to_anchor(share, figure.transFigure)
        else:
            words.set(x=share[0], y=share[1], ha="center", va="bottom")


def _margins(axes: Any, size: np.ndarray, renderer: Any) -> np.ndarray:
    """Measure what the words of axes need around a box of this size [inches]."""
    figure = axes.figure
    axes.set_position([0.0, 0.0, *(size / figure.get_size_inches())])
    words = axes.get_tightbbox(renderer).get_points().ravel()
    box = axes.get_window_extent(renderer).get_points().ravel()
    return (words - box) * np.array([-1, -1, 1, 1]) / figure.dpi


def _row(panels: Any, sizes: np.ndarray, renderer: Any) -> tuple[np.ndarray, np.ndarray]:
    """Place panels side by side with their middles on a line.

    Returns:
        Box (left, bottom, width, height) and margins of each panel, shape (n, 4) each.
    """
    boxes = []
    margins = []
    right = 0.0
    for panel, size in zip(panels, sizes, strict=True):
        margin = _margins(panel, size, renderer)
        left = right + GAP + margin[0]
        boxes.append([left, -size[1] / 2, *size])
        margins.append(margin)
        right = left + size[0] + margin[2]
    return np.array(boxes), np.array(margins)


def _at_right(
    boxes: np.ndarray, margins: np.ndarray, sizes: np.ndarray, margin: np.ndarray
) -> np.ndarray:
    """Place a colour bar at the right of all panels; its box (1, 4) [inches]."""
    right = (boxes[:, 0] + boxes[:, 2] + margins[:, 2]).max()
    return np.array([[right + GAP + margin[0], -sizes[0, 1] / 2, *sizes[0]]])


def _below(
    boxes: np.ndarray,
    margins: np.ndarray,
    sizes: np.ndarray,
    of_bars: Sequence[np.ndarray],
) -> np.ndarray:
    """Place colour bars below panels, or one bar below all; boxes (m, 4) [inches]."""
    low = (boxes[:, 1] - margins[:, 1]).min()
    centres = boxes[:, 0] + boxes[:, 2] / 2
    if len(sizes) < len(boxes):
        centres = np.array([(boxes[0, 0] + (boxes[:, 0] + boxes[:, 2]).max()) / 2])
    bars = []
    for centre, size, margin in zip(centres, sizes, of_bars, strict=True):
        bars.append([centre - size[0] / 2, low - GAP - margin[3] - size[1], *size])
    return np.array(bars)


def _around(
    figure: Any, renderer: Any, low: np.ndarray, high: np.ndarray, centre: float
) -> tuple[np.ndarray, np.ndarray, list[tuple[Any, np.ndarray]]]:
    """Find the places of text above and of a legend below what is in a figure.

    Args:
        figure: The figure.
        renderer: Renderer that measures words.
        low: Low corner of all axes with their words [inches], shape (2,).
        high: High corner [inches].
        centre: Middle of the panels [inches].

    Returns:
        Both corners with what is written, and the words with the middle of their low
        ends [inches].
    """
    low = low.copy()
    high = high.copy()
    places = []
    for words in (*figure.texts, *figure.legends):
        width, height = words.get_window_extent(renderer).size / figure.dpi
        is_above = words in figure.texts
        bottom = high[1] + GAP if is_above else low[1] - GAP - height
        if is_above:
            high[1] = bottom + height
        else:
            low[1] = bottom
        low[0] = min(low[0], centre - width / 2)
        high[0] = max(high[0], centre + width / 2)
        places.append((words, np.array([centre, bottom])))
    return low, high, places
