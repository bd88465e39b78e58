"""Draw values in the elements of bodies before the deformation.

Symbols: eps relative error, eps_E share of one element of eps.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.output.bodies import skin_of
from erc_contact.output.drawing import draw_figure, only_in_2d, only_turned
from erc_contact.output.files import gathered
from erc_contact.output.gathered import body_mesh, letters_of
from erc_contact.output.maps import Scale, draw_map
from erc_contact.output.views import upward, views_of


def draw_error(
    error: ConstitutiveError,
    path: str | Path | None = None,
    *,
    mirrored: bool = False,
    ax: Any = None,
) -> Any:
    """Draw eps_E of each element on a logarithmic colour scale; collective.

    Args:
        error: The error, whose ``indicators`` are drawn.
        path: Picture file, or None.
        mirrored: Whether an axisymmetric body is drawn on both sides of its axis.
        ax: Axes of matplotlib to draw on, in 2D; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks; in 3D an array of two.

    Raises:
        InputError: If axes are given in 3D, or a body is to be mirrored that is not
            axisymmetric.
    """
    if mirrored:
        only_turned("draw_error: mirrored", error.model)

    def scale(eps: np.ndarray) -> Scale:
        from matplotlib.colors import LogNorm, Normalize  # noqa: PLC0415

        top = float(eps.max())
        # A few tiny shares must not stretch the colours of the others.
        low = max(float(np.percentile(eps, 1)), 1e-4 * top)
        low = min(low, 0.5 * top)
        norm = LogNorm(low, top) if top > 0 else Normalize(0, 1)
        return Scale(norm, "min", "eps_E [-]")

    return draw_cells(error.admissible, error.indicators, scale, path, ax, mirrored=mirrored)


def draw_cells(
    admissible: Admissible,
    values: np.ndarray,
    scale: Callable[..., Scale],
    path: str | Path | None,
    ax: Any,
    *,
    mirrored: bool = False,
) -> Any:
    """Draw a value in each element on the body before the deformation; collective.

    Args:
        admissible: A pair on the mesh of the body.
        values: Values of the owned cells, shape (owned,).
        scale: Gives the colours for the values of all cells; called on rank 0.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, in 2D, or None.
        mirrored: Whether the mirror image at the axis is drawn, too.

    Returns:
        The axes on rank 0, None on the other ranks.
    """
    domain = admissible.domain
    comm = domain.comm
    up = upward(admissible)
    letters = letters_of(admissible.model)
    body = gathered(comm, **body_mesh(domain))
    cells = gathered(comm, values=values)

    def draw(ax: Any) -> Any:
        only_in_2d("A picture of a body", ax, domain.dim)
        skin = skin_of(**body, d=domain.dim)
        shown = cells["values"]
        views = views_of(domain.dim, up)
        values = (skin, skin.points, shown, scale(shown), views)
        return draw_map(ax, *values, letters=letters, mirrored=mirrored)

    return draw_figure(comm, path, ax, draw)
