"""Draw values in the elements of bodies before the deformation.

Symbols: eps relative error, eps_E share of one element of eps.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.runs import Run, error_of
from erc_contact.model.copies import shown_copies
from erc_contact.output.drawing import only_turned
from erc_contact.output.gallery import Gallery
from erc_contact.output.gathered import letters_of, upward
from erc_contact.output.maps import Scale, draw_map
from erc_contact.output.windows import YIELDED, window_around, window_near
from erc_contact.results.states import state, states_of
from namedmesh.base.names import file_stem
from namedmesh.base.ranks import gather_rows
from namedmesh.pictures import body_mesh, draw_figure, only_in_2d, skin_of, views_of


def draw_error(
    error: ConstitutiveError | Run,
    path: str | Path | None = None,
    *,
    near: str | None = None,
    mirrored: bool = False,
    whole: bool = False,
    ax: Any = None,
) -> Any:
    """Draw the error of each element on a logarithmic colour scale; collective.

    It is eps_E in percent; the squares of all elements sum to the square of eps.

    Args:
        error: The error whose ``indicators`` are drawn, or a history.
        path: Picture file, or None.
        near: Name of a contact, in the plane: the picture shows what is closed and what
            has yielded there, with three quarters as much beside it; None for all.
        mirrored: Whether an axisymmetric body is drawn on both sides of its axis.
        whole: Whether its copies are drawn, too, see :func:`draw_deformed`.
        ax: Axes of matplotlib to draw on, in 2D; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks; in 3D an array of two.

    Raises:
        InputError: If axes are given in 3D, a body is to be mirrored that is not
            axisymmetric, or nothing is closed in a small part of a body in the plane.
    """
    error = error_of(error)
    window = window_near("draw_error", error, near)
    if mirrored:
        only_turned("draw_error: mirrored", error.model.space)

    def scale(eps: np.ndarray) -> Scale:
        from matplotlib.colors import LogNorm, Normalize  # noqa: PLC0415

        top = float(eps.max())
        # A few tiny shares must not stretch the colours of the others.
        low = max(float(np.percentile(eps, 1)), 1e-4 * top)
        low = min(low, 0.5 * top)
        norm = LogNorm(low, top) if top > 0 else Normalize(0, 1)
        return Scale(norm, "min", "error of elements [%], log scale")

    percents = 100 * error.indicators
    drawn = (error.admissible, percents, scale, path, ax)
    return draw_cells(*drawn, mirrored=mirrored, whole=whole, window=window)


def draw_state(
    result: Any,
    name: str = "accumulated",
    path: str | Path | None = None,
    *,
    near: str | None = None,
    mirrored: bool = False,
    whole: bool = False,
    ax: Any = None,
) -> Any:
    """Draw a number that the body remembers in each element; collective.

    In the plane a zone that is small beside the body fills the picture.

    Args:
        result: An admissible pair, an error, or a history.
        name: Name of the entry of the state; of a tensor its norm is drawn.
        path: Picture file, or None.
        near: Name of a contact that fills the picture, see :func:`draw_error`.
        mirrored: Whether an axisymmetric body is drawn on both sides of its axis.
        whole: Whether its copies are drawn, too, see :func:`draw_deformed`.
        ax: Axes of matplotlib to draw on, in 2D; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks; in 3D an array of two.

    Raises:
        InputError: If the law has no such state, axes are given in 3D, a body is to be
            mirrored that is not axisymmetric, or nothing is closed near the contact.
    """
    pair = pair_of(result)
    window = window_near("draw_state", pair, near)
    if mirrored:
        only_turned("draw_state: mirrored", pair.model.space)
    values = state(pair, name)
    if values.ndim > 1:
        values = np.linalg.norm(values, axis=(1, 2))

    def scale(shown: np.ndarray) -> Scale:
        from matplotlib.colors import Normalize  # noqa: PLC0415

        top = float(shown.max())
        return Scale(Normalize(0, top if top > 0 else 1), "neither", name.replace("_", " "))

    zooms = near is None
    drawn = (pair, values, scale, path, ax)
    return draw_cells(*drawn, mirrored=mirrored, whole=whole, zooms=zooms, window=window)


def add_states(gallery: Gallery, error: ConstitutiveError, code: str) -> None:
    """Add pictures of the numbers that a body remembers to a gallery; collective.

    Args:
        gallery: The gallery.
        error: The error.
        code: The error as a user writes it.
    """
    for name, shape in states_of(error.admissible).items():
        if shape:
            continue
        file = f"{file_stem(name)}.png"
        words = f"What the body remembers in each element: {name}."
        line = f"erc_contact.output.draw_state({code}, {name!r}, {file!r})"
        gallery.add(file, words, line, partial(draw_state, error, name), is_body=True)


def draw_cells(
    admissible: Admissible,
    values: np.ndarray,
    scale: Callable[..., Scale],
    path: str | Path | None,
    ax: Any,
    *,
    mirrored: bool = False,
    whole: bool = False,
    zooms: bool = False,
    window: np.ndarray | None = None,
) -> Any:
    """Draw a value in each element on the body before the deformation; collective.

    Args:
        admissible: A pair on the mesh of the body.
        values: Values of the owned cells, shape (owned,).
        scale: Gives the colours for the values of all cells; called on rank 0.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, in 2D, or None.
        mirrored: Whether the mirror image at the axis is drawn, too.
        whole: Whether the copies are drawn, too, that make the whole of the body.
        zooms: Whether a small part of a body in the plane fills the picture if all
            other values are small.
        window: Low and high corner of what is shown in the plane [length], shape (2,
            2); None shows all.

    Returns:
        The axes on rank 0, None on the other ranks.
    """
    domain = admissible.domain
    comm = domain.comm
    up = upward(admissible.model)
    letters = letters_of(admissible.model.space)
    body = gather_rows(comm, **body_mesh(domain))
    cells = gather_rows(comm, values=values)
    copies = shown_copies(admissible.model, "A picture of the whole") if whole else []

    def draw(ax: Any) -> Any:
        only_in_2d("A picture of a body", ax, domain.dim)
        skin = skin_of(**body, d=domain.dim)
        shown = cells["values"]
        views = views_of(domain.dim, up)
        values = (skin, skin.points, shown, scale(shown), views)
        shown_part = window
        if mirrored and shown_part is not None:
            low, high = shown_part
            shown_part = np.array([[-high[0], low[1]], high])
        if zooms and domain.dim == 2 and not (mirrored or whole):
            zone = body["cells"][shown > YIELDED * shown.max()]
            corners = body["points"][zone].reshape(-1, 3)
            shown_part = window_around(corners, body["points"], body["points"])
        return draw_map(
            ax,
            *values,
            letters=letters,
            mirrored=mirrored,
            motions=[motion for motion, _ in copies[1:]],
            window=shown_part,
        )

    return draw_figure(comm, path, ax, draw, admissible.solution.scene.label)
