"""Figures, directions and labels that plots and pictures share. All functions are called on rank 0.

Symbols: n normal of the foundation.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np


def new_figure(width: float, height: float, layout: str = "constrained") -> Any:
    """An empty figure of this width and height [inches].

    The layout is one of matplotlib's: "constrained" for plots, "compressed" for pictures, which keep their shape.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415

    return Figure(figsize=(width, height), layout=layout)


def save_figure(figure: Any, path: str | Path) -> None:
    """Write a figure; the suffix of the path gives the format."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415

    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=200, bbox_inches="tight")


def tangents(n: np.ndarray) -> np.ndarray:
    """d-1 orthonormal tangents for a normal n (d,), shape (d-1, d).

    They are near to the coordinate axes that make the largest angles with the normal.
    """
    axes = np.sort(np.argsort(abs(n), kind="stable")[: len(n) - 1])
    if abs(n).max() in (0.0, 1.0):
        return np.eye(len(n))[axes]
    q, r = np.linalg.qr(np.column_stack([n, np.eye(len(n))[:, axes]]))
    return (q * np.sign(np.diag(r)))[:, 1:].T


def words(vector: np.ndarray, scale: float = 1.0) -> str:
    """The components of a direction or a place as text, rounded to three digits of a scale."""
    digits = 3 - int(np.floor(np.log10(scale)))
    return "({})".format(", ".join(f"{c:.4g}" for c in np.round(vector, digits) + 0.0))


def coordinate(tangent: np.ndarray) -> str:
    """Label of the axis of a coordinate along a tangent."""
    along = f"${'xyz'[tangent.argmax()]}$" if tangent.max() == 1.0 else f"along {words(tangent)}"
    return f"{along} [length]"


def weighted_level(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """The quantile of weighted values: the least value such that values up to it have this share of the weight."""
    order = np.argsort(values)
    carried = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(carried, share * carried[-1])])
