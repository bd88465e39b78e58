"""Make figures of matplotlib on rank 0, and save them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from namedmesh.base.exceptions import InputError, on_rank

STYLE = "namedmesh.pictures.style"
"""Name of the style of our figures, as matplotlib takes it."""
COLOUR_CYCLE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
"""Colours of curves that the colour-blind can tell apart.

Source: Okabe, Ito, Color Universal Design (2008).
"""
DPI = 150
"""Pixels of a picture [1/inch]; a picture is then as wide as a page on a screen."""
PNG_LEVEL = 4
"""Level of compression of a png file: half the time of the default, 5% more bytes."""


def on_root(comm: MPI.Comm, path: str | Path | None, draw: Callable[[], None]) -> None:
    """Draw or write on rank 0, and raise an exception there on all ranks; collective.

    Args:
        comm: Communicator.
        path: File whose folder is made if it is missing; None if there is no file.
        draw: Draws and writes the file.

    Raises:
        InputError: If a library for pictures is not installed.
    """

    def make() -> None:
        if path is not None:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
        try:
            draw()
        except ModuleNotFoundError as reason:
            raise InputError(
                f"Pictures and files for ParaView need {reason.name}, which is not installed: "
                "pip install 'erc-contact[pictures]' brings it. All else works without."
            ) from reason

    on_rank(comm, 0, make)


def draw_figure(
    comm: MPI.Comm,
    path: str | Path | None,
    ax: Any,
    draw: Callable[[Any], Any],
    label: Callable[[str], str] | None = None,
) -> Any:
    """Draw on axes of the user's or in a new figure, and save it; collective.

    It is saved if there is a path.

    Args:
        comm: Communicator.
        path: Picture file, or None. Its suffix gives the format.
        ax: Axes of the user's on rank 0, whose style stays as it is; None makes a
            figure.
        draw: Gets ``ax``, draws, and returns the axes; it is called on rank 0.
        label: Returns a label with units in place of dimensions; None leaves them.

    Returns:
        The axes on rank 0, None on the other ranks.
    """
    drawn = []

    def make() -> None:
        from matplotlib import style  # noqa: PLC0415
        from matplotlib.text import Text  # noqa: PLC0415

        with style.context(STYLE) if ax is None else nullcontext():
            axes = draw(ax)
            figure = np.ravel(axes)[0].figure
            if label is not None:
                for text in figure.findobj(Text):
                    words = text.get_text()
                    if label(words) != words:
                        text.set_text(label(words))
            if path is not None:
                # Where all has its place nothing must be measured again.
                is_placed = ax is None and figure.get_layout_engine() is None
                bounds = None if is_placed else "tight"
                figure.savefig(path, dpi=DPI, bbox_inches=bounds, **_compression(path))
            elif ax is None:
                figure.draw_without_rendering()  # words get their font now
        drawn.append(axes)

    on_root(comm, path, make)
    return drawn[0] if drawn else None


def _compression(path: str | Path) -> dict[str, Any]:
    """Return how a file is compressed, as matplotlib takes it; only png files are."""
    if Path(path).suffix.lower() != ".png":
        return {}
    return {"pil_kwargs": {"compress_level": PNG_LEVEL}}


def new_figure(width: float, height: float, layout: str | None = None) -> Any:
    """Make an empty figure of this width and height [inches].

    Without one of matplotlib's layouts its axes are placed by the caller.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415

    return Figure(figsize=(width, height), layout=layout)


def only_in_2d(what: str, ax: Any, d: int) -> None:
    """Refuse axes for a body in 3D, whose pictures have several."""
    if ax is not None and d == 3:
        raise InputError(
            f"{what} in 3D makes a figure of its own; leave ax out, and take the axes that are "
            "returned."
        )
