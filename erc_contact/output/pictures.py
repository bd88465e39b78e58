"""Pictures of bodies: in the plane by matplotlib, in space images by pyvista in figures by matplotlib.

Bodies of degree 2 are drawn with curved edges. A body in space is seen twice: from above with the foundation, and from
the other side and below without it, to show the contact.

Symbols: u^ and sigma^ admissible displacement and stress, g gap, n normal of the foundation, X position before the
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
from erc_contact.output.bodies import WORDS, Skin, foundation, ground, seen, show, skin_of, views_of
from erc_contact.output.drawing import draw_figure, log_ticks, new_figure, only_in_2d, weighted_level
from erc_contact.output.files import gathered, grid_of
from erc_contact.output.gathered import body_mesh, body_nodes, nodal_displacement, whole_contact
from erc_contact.results.stresses import mean_stress, vertex_stress

WIDE = 1.6
"""A body whose width over its height is larger than this has its colour bar below [-]."""
FEW = 15_000
"""Greatest number of elements whose edges are shown in a map. More edges would hide the colours."""


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
        return Scale(LogNorm(low, top) if top > 0 else Normalize(0, 1), "min", r"$\varepsilon_E$ [-]")

    return draw_cells(error.admissible, error.indicators, scale, path, ax)


def draw_deformed(
    error: ConstitutiveError, path: str | Path | None = None, factor: float | None = None, *, ax: Any = None
) -> Any:
    """Draw the deformed body on its foundation, coloured by the von Mises stress of sigma^; collective.

    Points of the body are drawn at X + factor u^, and points of the foundation at X + factor g n. So a closed gap looks
    closed, and an open one looks open. The foundation is left out where it would be far from the body. Black lines show
    the outline of the body before the deformation. The von Mises stress is that of the mean of sigma^ in each element;
    for degree 2 it is linear there (:func:`erc_contact.results.stresses.vertex_stress`). If the material does not tell
    the stress out of plane (``out_of_plane``), it is that of the part in plane.

    Args:
        error: The error, whose admissible pair is drawn.
        path: Picture file, or None.
        factor: Magnification of u^ and of the gap [-]. By default the largest u^ is drawn with 6% of the body's size;
            if it is larger than 5%, it is not magnified.
        ax: Axes of matplotlib to draw on, in 2D; by default those of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks; in 3D an array of two.
    """
    admissible, model = error.admissible, error.solution.model
    comm, size, d = model.comm, model.domain.extent, model.d
    body = gathered(comm, **body_nodes(model), u=nodal_displacement(admissible))
    volume = admissible.cell_geometry.volume[: model.domain.owned_cells]
    numbers = model.global_numbers(admissible.cell_geometry.vertices[: model.domain.owned_cells])
    cells = gathered(comm, mises=_shown_stress(admissible), volume=volume, numbers=numbers)
    contacts = [whole_contact(admissible, t) for t in admissible.tractions]
    up = _up(admissible)
    label = f"von Mises stress{'' if tells_out_of_plane(model) else ' of the plane part'} [force/area]"

    def draw(ax: Any) -> Any:
        from matplotlib.colors import Normalize  # noqa: PLC0415

        only_in_2d("draw_deformed", ax, d)
        u, mises = body.pop("u"), cells["mises"]
        largest = float(np.linalg.norm(u, axis=1).max())
        default = float(f"{0.06 * size / largest:.2g}") if 0 < largest < 0.05 * size else 1.0
        times = default if factor is None else factor
        skin, volume = skin_of(**body, d=d), cells["volume"]
        shown = [contact for contact in contacts if contact is not None and len(contact.x)]
        outline = grid_of(body["points"], body["cells"][:, : d + 1], d)
        outline = outline.extract_feature_edges(feature_angle=30.0, manifold_edges=False)
        foundations = [foundation(contact, times, size) for contact in shown]
        top = weighted_level(mises.max(axis=1), volume, 0.998) or 1.0  # a singular corner must not take all colours
        if model.degree > 1:
            corners = (cells["numbers"][skin.cell, None] == skin.triangles[:, :3, None]).argmax(axis=2)
            mises = np.take_along_axis(mises[skin.cell], corners, axis=1)
        else:
            mises = mises[:, 0]
        scale, x = Scale(Normalize(0, top), "max", label), skin.points + times * u
        axes = _map(ax, skin, x, mises, scale, views_of(d, up), outline, foundations)
        title = f"displacement {'and gap ' * any(contact.gap.any() for contact in shown)}× {times:g}"
        if d == 2:
            axes.set_title(title, fontsize=11)
        else:
            axes[0].figure.suptitle(title, fontsize=11)
        return axes

    return draw_figure(comm, path, ax, draw)


def _shown_stress(admissible: Admissible) -> np.ndarray:
    """Von Mises stress of sigma^ in each owned cell, for degree 2 at its vertices, shape (owned, 1 or d+1)."""
    if admissible.solution.model.degree == 1:
        return von_mises(mean_stress(admissible))[:, None]
    stress = vertex_stress(admissible)
    return np.stack([von_mises(stress[:, vertex]) for vertex in range(stress.shape[1])], axis=1)


def draw_cells(
    admissible: Admissible, values: np.ndarray, scale: Callable[..., Scale], path: str | Path | None, ax: Any
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
    domain = admissible.solution.domain
    comm, up = domain.mesh.comm, _up(admissible)
    body, cells = gathered(comm, **body_mesh(domain)), gathered(comm, values=values)

    def draw(ax: Any) -> Any:
        only_in_2d("A picture of a body", ax, domain.dim)
        skin, values = skin_of(**body, d=domain.dim), cells["values"]
        return _map(ax, skin, skin.points, values, scale(values), views_of(domain.dim, up))

    return draw_figure(comm, path, ax, draw)


@dataclass(frozen=True)
class Scale:
    """The colours of values.

    Attributes:
        norm: matplotlib's norm, from values to colours.
        extend: Ends of the colour bar beyond which there are values: "min", "max" or "neither".
        label: Label of the colour bar.
    """

    norm: Any
    extend: str
    label: str


# -- pictures, on rank 0 -------------------------------------------------------------------------------------------


def _up(admissible: Admissible) -> np.ndarray:
    """The upward direction of a picture, shape (3,); collective.

    It is the coordinate axis, with its sign, that points away from the first foundation.
    """
    total, model = np.zeros(3), admissible.solution.model
    for traction in admissible.tractions[:1]:
        own = model.owned(traction.contact.facets)
        total[: model.d] = traction.area[own] @ traction.contact.direction[own]
    total = np.array(model.comm.allgather(total)).sum(axis=0)
    axis = int(abs(total).argmax()) if total.any() else 1
    return np.eye(3)[axis] * (-1.0 if total[axis] > 0 else 1.0)


def _ticks(bar: Any, norm: Any, *, known: bool) -> None:
    """Write plain numbers at a colour bar, or only 0 if no value other than zero is known."""
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
) -> Any:
    """Axes with a body, with coloured elements and a colour bar.

    Args:
        ax: Axes of the user's in 2D, or None.
        skin: The body.
        x: Positions at which its nodes are drawn [length], shape (n, 3).
        values: Values of the elements, or at the corners of triangles of the skin, see :meth:`Skin.of_parts`.
        scale: Their colours.
        views: The views, from :func:`views_of`.
        before: Lines of pyvista that show the body before the deformation.
        foundations: Foundations, from :func:`foundation`. In 3D only the view from above has them, because they hide
            the contact.
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
    flat = len(views) == 1
    size = float(np.ptp(x, axis=0).max())
    grounds = [part for surface in foundations for part in ground(surface, size)]
    shown = {name: parts + grounds * (name != "from below") for name in views}
    sizes = np.array([np.ptp(seen(shown[name], view), axis=0)[:2] for name, view in views.items()])
    ratio = sizes[:, 0].sum() / sizes[:, 1].max()
    below = flat and ratio > WIDE
    if ax is None:
        width = min(6.0, 6.0 * ratio) if flat else min(10.0, 5.0 * ratio)
        words = (0.7 if below else 1.9) + (0.0 if flat else 2 * WORDS)
        figure = new_figure(max(width, 1.5) + words, width / ratio + (1.6 if below else 0.9), "compressed")
        ax = figure.subplots(1, len(views), width_ratios=sizes[:, 0])
    panels = np.ravel(ax)
    for panel, (name, view) in zip(panels, views.items(), strict=True):
        show(panel, shown[name], view)
        if not flat:
            panel.set_title(name, fontsize=11)
    place = {"location": "bottom", "shrink": 0.7, "aspect": 40} if below else {"shrink": 0.8, "aspect": 30}
    bar = panels[0].figure.colorbar(colours, ax=panels, extend=scale.extend, **place)
    _ticks(bar, scale.norm, known=bool(values.any()))
    if below:
        bar.set_label(scale.label)
    else:
        bar.ax.set_title(scale.label.replace(" [", "\n["), fontsize=11, loc="left")
    return ax
