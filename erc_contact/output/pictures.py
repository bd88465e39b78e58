"""Draw pictures of bodies: by matplotlib in the plane, by pyvista in space.

Bodies of degree 2 are drawn with curved edges. A body in space is seen twice: from
above with the foundation, and from the other side and below without it, to show the
contact.

Symbols: u^ and sigma^ admissible displacement and stress, X position before the
deformation, eps relative error, eps_E share of one element of eps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.model.stress import tells_out_of_plane, von_mises
from erc_contact.output.bodies import SPACE, WORDS, Skin, seen, show, skin_of, views_of
from erc_contact.output.drawing import (
    draw_figure,
    log_ticks,
    new_figure,
    only_in_2d,
    weighted_level,
)
from erc_contact.output.files import gathered, grid_of
from erc_contact.output.foundations import (
    CLOSED,
    UNSEEN,
    Foundation,
    closed_part,
    drawn_foundation,
    foundation_of,
    greatest_factor,
    ground,
    rounded,
)
from erc_contact.output.gathered import body_mesh, body_nodes, nodal_displacement, whole_contact
from erc_contact.results.stresses import mean_stress, vertex_stress

WIDE = 1.6
"""Width over height of a body above which its colour bar is below [-]."""
FEW = 15_000
"""Greatest number of elements whose edges are shown in a map.

More edges would hide the colours.
"""


def draw_error(error: ConstitutiveError, path: str | Path | None = None, *, ax: Any = None) -> Any:
    """Draw eps_E of each element on a logarithmic colour scale; collective.

    Args:
        error: The error, whose ``indicators`` are drawn.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, in 2D; by default those of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks; in 3D an array of two.
    """

    def scale(eps: np.ndarray) -> Scale:
        from matplotlib.colors import LogNorm, Normalize  # noqa: PLC0415

        top = float(eps.max())
        low = min(max(float(np.percentile(eps, 1)), 1e-4 * top), 0.5 * top)
        return Scale(
            LogNorm(low, top) if top > 0 else Normalize(0, 1), "min", r"$\varepsilon_E$ [-]"
        )

    return draw_cells(error.admissible, error.indicators, scale, path, ax)


def draw_deformed(
    error: ConstitutiveError,
    path: str | Path | None = None,
    factor: float | None = None,
    *,
    ax: Any = None,
) -> Any:
    """Draw the deformed body on its foundation; collective.

    The colours are those of the von Mises stress of sigma^. Points of the body are
    drawn at X + factor u^. The foundation is drawn as it is, and not magnified: what is
    flat is flat. It is moved with the body, so that what is closed looks closed as
    nearly as a rigid motion can make it (:mod:`erc_contact.output.foundations`). It is
    left out where it would be far from the body. Orange lines show what is closed, in
    3D its border, and black ones the outline of the body before the deformation.

    The von Mises stress is that of the mean of sigma^ in each element; for degree 2 it
    is linear there (:func:`erc_contact.results.stresses.vertex_stress`). If the
    material does not tell the stress out of plane (``out_of_plane``), it is that of the
    part in plane.

    Args:
        error: The error, whose admissible pair is drawn.
        path: Picture file, or None.
        factor: Magnification of u^ [-]. By default the largest u^ is drawn with 6% of
            the body's size, or with less if otherwise a closed contact would look open
            or entered by more than 0.3% of the size, as a curved body on a plane does.
            A displacement that is larger than 5% of the size is not magnified. With a
            factor of your own the title says how much the contact looks open or
            entered.
        ax: Axes of matplotlib to draw on, in 2D; by default those of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks; in 3D an array of two.
    """
    admissible, model = error.admissible, error.model
    comm, size, d = model.comm, model.domain.extent, model.d
    body = gathered(comm, **body_nodes(model), u=nodal_displacement(admissible))
    volume = admissible.cell_geometry.volume[: model.domain.owned_cells]
    numbers = model.global_numbers(admissible.cell_geometry.vertices[: model.domain.owned_cells])
    cells = gathered(comm, mises=_shown_stress(admissible), volume=volume, numbers=numbers)
    contacts = [whole_contact(admissible, t) for t in admissible.tractions]
    up = _up(admissible)
    stressless = error.scale == 0 or error.solution.at_rest  # all stress is round-off
    label = (
        f"von Mises stress{'' if tells_out_of_plane(model) else ' of the plane part'} [force/area]"
    )

    def draw(ax: Any) -> Any:
        from matplotlib.colors import Normalize  # noqa: PLC0415

        only_in_2d("draw_deformed", ax, d)
        u, mises = body.pop("u"), cells["mises"]
        foundations = [
            foundation_of(contact) for contact in contacts if contact is not None and len(contact.x)
        ]
        largest = float(np.linalg.norm(u, axis=1).max())
        times = rounded(greatest_factor(foundations, largest, size)) if factor is None else factor
        skin, volume = skin_of(**body, d=d), cells["volume"]
        outline = grid_of(body["points"], body["cells"][:, : d + 1], d)
        outline = outline.extract_feature_edges(feature_angle=30.0, manifold_edges=False)
        grounds = [drawn_foundation(foundation, times, size) for foundation in foundations]
        top = (
            weighted_level(mises.max(axis=1), volume, 0.998) or 1.0
        )  # a singular corner must not take all colours
        if stressless:
            mises = 0 * mises
        if model.degree > 1:
            corners = (cells["numbers"][skin.cell, None] == skin.triangles[:, :3, None]).argmax(
                axis=2
            )
            mises = np.take_along_axis(mises[skin.cell], corners, axis=1)
        else:
            mises = mises[:, 0]
        scale, x = Scale(Normalize(0, top), "max", label), skin.points + times * u
        closed = [closed_part(foundation.surface, x) for foundation in foundations]
        closed = [lines for lines in closed if lines is not None]
        axes = _map(ax, skin, x, mises, scale, views_of(d, up), outline, grounds, closed)
        title = _title(foundations, times, size)
        title += "\norange: closed contact" * bool(closed)
        if d == 2:
            axes.set_title(title, fontsize=11)
        else:
            axes[0].figure.suptitle(title, fontsize=11)
        return axes

    return draw_figure(comm, path, ax, draw)


def magnification(error: ConstitutiveError) -> float:
    """Find the greatest magnification of a deformed body [-]; collective.

    It is infinite if nothing moves.
    """
    admissible, model = error.admissible, error.model
    contacts = [whole_contact(admissible, traction) for traction in admissible.tractions]
    largest = error.maximum("displacement").value
    factor = np.inf
    if model.comm.rank == 0:
        foundations = [
            foundation_of(contact) for contact in contacts if contact is not None and len(contact.x)
        ]
        factor = greatest_factor(foundations, largest, model.domain.extent)
    return model.comm.bcast(factor)


def _title(foundations: Sequence[Foundation], factor: float, size: float) -> str:
    """Say what a picture of a deformed body magnifies, and what then looks wrong."""
    title = f"displacement × {factor:g}"
    if factor != 1.0 and any(foundation.moves for foundation in foundations):
        title += ", foundation moved with it"
    entry = max((foundation.entry(factor) for foundation in foundations), default=0.0)
    if entry > 1.1 * UNSEEN * size:  # more than rounding of the magnification makes of it
        title += f"\nand so the contact looks open or entered by up to {entry:.2g} [length]"
    return title


def _shown_stress(admissible: Admissible) -> np.ndarray:
    """Compute the von Mises stress of sigma^ in each owned cell [force/area].

    For degree 2 it is that at the vertices; shape (owned, 1 or d+1).
    """
    if admissible.model.degree == 1:
        return von_mises(mean_stress(admissible))[:, None]
    stress = vertex_stress(admissible)
    return np.stack([von_mises(stress[:, vertex]) for vertex in range(stress.shape[1])], axis=1)


def draw_cells(
    admissible: Admissible,
    values: np.ndarray,
    scale: Callable[..., Scale],
    path: str | Path | None,
    ax: Any,
) -> Any:
    """Draw a value in each element on the body before the deformation; collective.

    Args:
        admissible: A pair on the mesh of the body.
        values: Values of the owned cells, shape (owned,).
        scale: Gives the colours for the values of all cells; called on rank 0.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, in 2D, or None.

    Returns:
        The axes on rank 0, None on the other ranks.
    """
    domain = admissible.domain
    comm, up = domain.mesh.comm, _up(admissible)
    body, cells = gathered(comm, **body_mesh(domain)), gathered(comm, values=values)

    def draw(ax: Any) -> Any:
        only_in_2d("A picture of a body", ax, domain.dim)
        skin, values = skin_of(**body, d=domain.dim), cells["values"]
        return _map(ax, skin, skin.points, values, scale(values), views_of(domain.dim, up))

    return draw_figure(comm, path, ax, draw)


@dataclass(frozen=True)
class Scale:
    """Hold the colours of values.

    Attributes:
        norm: matplotlib's norm, from values to colours.
        extend: Ends of the colour bar beyond which there are values: "min", "max" or
            "neither".
        label: Label of the colour bar.
    """

    norm: Any
    extend: str
    label: str


# -- pictures, on rank 0 ---------------------------------------------------------------


def _up(admissible: Admissible) -> np.ndarray:
    """Find the upward direction of a picture, shape (3,); collective.

    It is the coordinate axis, with its sign, that points away from the first
    foundation.
    """
    total, model = np.zeros(3), admissible.model
    for traction in admissible.tractions[:1]:
        own = traction.contact.trace.here.owned
        total[: model.d] = traction.area[own] @ traction.contact.direction[own]
    total = np.array(model.comm.allgather(total)).sum(axis=0)
    axis = int(abs(total).argmax()) if total.any() else 1
    return np.eye(3)[axis] * (-1.0 if total[axis] > 0 else 1.0)


def _ticks(bar: Any, norm: Any, *, known: bool) -> None:
    """Write plain numbers at a colour bar, or only 0 if all values are zero."""
    from matplotlib.colors import LogNorm  # noqa: PLC0415

    if not known:
        bar.set_ticks([0.0])
    elif isinstance(norm, LogNorm):
        ticks = log_ticks(norm.vmin, norm.vmax)
        bar.set_ticks(ticks, labels=[f"{tick:.4g}" for tick in ticks], minor=False)
        bar.minorticks_off()


def _map(
    ax: Any,
    skin: Skin,
    x: np.ndarray,
    values: np.ndarray,
    scale: Scale,
    views: dict[str, np.ndarray],
    before: Any = None,
    foundations: Sequence[Any] = (),
    closed: Sequence[Any] = (),
) -> Any:
    """Draw a body with coloured elements and a colour bar in axes.

    Args:
        ax: Axes of the user's in 2D, or None.
        skin: The body.
        x: Positions at which its nodes are drawn [length], shape (n, 3).
        values: Values of the elements, or at the corners of triangles of the skin, see
            :meth:`Skin.of_parts`.
        scale: Their colours.
        views: The views, from :func:`views_of`.
        before: Lines of pyvista that show the body before the deformation.
        foundations: Foundations, from :func:`drawn_foundation`. In 3D only the view
            from above has them, because they hide the contact.
        closed: Lines that show what is closed, from :func:`closed_part`.
    """
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415

    colours = ScalarMappable(scale.norm, "viridis")
    shades = np.clip(skin.of_parts(values), scale.norm.vmin, scale.norm.vmax)
    rgb = colours.to_rgba(shades, bytes=True)[:, :3]
    parts = [skin.faces(x, scalars=rgb, rgb=True, preference="cell")]
    if skin.cell.max() < FEW:
        parts.append(skin.edges(x, color="#404040", opacity=0.4, line_width=0.8))
    if before is not None and before.n_points > 0:  # a ball has no edges
        parts.append((before, {"color": "black", "line_width": 3.0}))
    parts += [(lines, {"color": CLOSED, "line_width": 8.0}) for lines in closed]
    flat = len(views) == 1
    size = float(np.ptp(x, axis=0).max())
    grounds = [part for surface in foundations for part in ground(surface, size)]
    shown = {
        name: grounds * (name != "from below") + parts for name in views
    }  # the body is never hidden
    sizes = np.array([np.ptp(seen(shown[name], view), axis=0)[:2] for name, view in views.items()])
    ratio = sizes[:, 0].sum() / sizes[:, 1].max()
    below = flat and ratio > WIDE
    if ax is None:
        width = min(6.0, 6.0 * ratio) if flat else min(SPACE, 3.0 * ratio)
        words = (0.7 if below else 1.9) + (0.0 if flat else 2 * WORDS)
        figure = new_figure(
            max(width, 1.5) + words, width / ratio + (1.6 if below else 0.9), "compressed"
        )
        ax = figure.subplots(1, len(views), width_ratios=sizes[:, 0])
    panels = np.ravel(ax)
    for panel, (name, view) in zip(panels, views.items(), strict=True):
        show(panel, shown[name], view)
        if not flat:
            panel.set_title(name, fontsize=11)
    place = (
        {"location": "bottom", "shrink": 0.7, "aspect": 40}
        if below
        else {"shrink": 0.8, "aspect": 30}
    )
    bar = panels[0].figure.colorbar(colours, ax=panels, extend=scale.extend, **place)
    _ticks(bar, scale.norm, known=bool(values.any()))
    if below:
        bar.set_label(scale.label)
    else:
        bar.ax.set_title(scale.label.replace(" [", "\n["), fontsize=11, loc="left")
    return ax
