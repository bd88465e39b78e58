"""Pictures of bodies: images by pyvista, in figures by matplotlib.

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
from mpi4py import MPI

from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError
from erc_contact.base.percent import percent
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.domain import Domain
from erc_contact.model.stress import tells_out_of_plane, von_mises
from erc_contact.output.bodies import Skin, foundation, ground, rendered, show, skin_of, views_of
from erc_contact.output.drawing import new_figure, save_figure, weighted_level
from erc_contact.output.files import gathered, grid_of, on_root
from erc_contact.output.gathered import body_mesh, body_nodes, nodal_displacement, whole_contact
from erc_contact.results.stresses import mean_stress

WORDS = 1.4
"""Width in a figure of the labels of a view in 3D [inches]."""
WIDE = 1.6
"""A body whose width over its height is larger than this has its colour bar below [-]."""
FEW = 15_000
"""Greatest number of elements whose edges are shown in a map. More edges would hide the colours."""


def draw_meshes(meshes: Sequence[tuple[Domain, np.ndarray]], path: str | Path) -> None:
    """Draw meshes of a sequence side by side: the first, the last and some between; collective.

    There are at most six of them in 2D, and four in 3D.

    Args:
        meshes: Pairs of a domain and eps_E of its owned cells, as in ``History.meshes``.
        path: Picture file.

    Raises:
        InputError: If there is no mesh.
    """
    if not meshes:
        raise InputError("draw_meshes: no mesh is given; give pairs (domain, eps_E), as in history.meshes.")
    comm, dim = meshes[0][0].mesh.comm, meshes[0][0].dim
    most = 6 if dim == 2 else 4
    chosen = [meshes[i] for i in np.unique(np.linspace(0, len(meshes) - 1, most).round().astype(int))]
    bodies = [(gathered(comm, **body_mesh(domain)), domain.cells) for domain, _ in chosen]
    errors = [float(np.sqrt(comm.allreduce(float(np.sum(cells**2)), MPI.SUM))) for _, cells in chosen]

    def draw() -> None:
        widths = np.clip([45 / np.sqrt(cells) for _, cells in bodies], 0.5, 1.5)  # thin lines on fine meshes
        skins = [skin_of(**body, d=dim) for body, _ in bodies]
        shown = [
            [skin.faces(skin.points, color="#dce6f0"), skin.edges(skin.points, color="#1f2d3d", line_width=width)]
            for skin, width in zip(skins, widths, strict=True)
        ]
        views = list(views_of(dim, np.eye(3)[1]).values())
        images = [rendered(parts, view) for view in views for parts in shown]
        left, right, low, high = images[0][1]
        ratio = (right - left) / (high - low)
        many = len(chosen)
        shapes = [(-(-many // columns), columns) for columns in range(1, many + 1)] if dim == 2 else [(2, many)]
        rows, columns = min(shapes, key=lambda s: abs(np.log(ratio * s[1] / s[0] / 2)) + s[0] * s[1] - many)
        height = min(5.5, 9.0 / (ratio * columns), 9.0 / rows)
        wide, high = max(ratio * height, 1.2) + WORDS * (dim - 2), height + 0.5 * (dim - 1)
        figure = new_figure(wide * columns + 0.6, high * rows + 0.5, "compressed")
        figure.get_layout_engine().set(w_pad=0.12)
        panels = figure.subplots(rows, columns, squeeze=False, sharex=dim == 2, sharey=dim == 2).ravel()
        for number, (panel, image) in enumerate(zip(panels, images, strict=False)):
            view, mesh = divmod(number, many)
            show(panel, image, views[view], skins[mesh].points)
            panel.label_outer(remove_inner_ticks=True)
        for panel, (_, cells), eps in zip(panels, bodies, errors, strict=False):
            between = ", " if ratio * height > 2 else "\n"
            panel.set_title(f"{cells} cells{between}eps = {percent(eps, 3)}", fontsize=10)
        for panel in panels[len(images) :]:
            panel.set_axis_off()
        save_figure(figure, path)

    on_root(comm, path, draw)


def draw_error(error: ConstitutiveError, path: str | Path) -> None:
    """Draw eps_E of each element on a logarithmic colour scale; collective.

    Args:
        error: The error, whose ``indicators`` are drawn.
        path: Picture file.
    """

    def scale(eps: np.ndarray) -> Scale:
        from matplotlib.colors import LogNorm, Normalize  # noqa: PLC0415

        top = float(eps.max())
        low = min(max(float(np.percentile(eps, 1)), 1e-4 * top), 0.5 * top)
        return Scale(LogNorm(low, top) if top > 0 else Normalize(0, 1), "min", "eps_E [-]")

    draw_cells(error.admissible, error.indicators, scale, path)


def draw_deformed(error: ConstitutiveError, path: str | Path, factor: float | None = None) -> None:
    """Draw the deformed body on its foundation, coloured by the von Mises stress of sigma^; collective.

    Points of the body are drawn at X + factor u^, and points of the foundation at X + factor g n. So a closed gap looks
    closed, and an open one looks open. The foundation is left out where it would be far from the body. Black lines show
    the outline of the body before the deformation. The von Mises stress is that of the mean of sigma^ in each element.
    If the material does not tell the stress out of plane (``out_of_plane``), it is that of the part in plane.

    Args:
        error: The error, whose admissible pair is drawn.
        path: Picture file.
        factor: Magnification of u^ and of the gap [-]. By default the largest u^ is drawn with 6% of the body's size;
            if it is larger than 5%, it is not magnified.
    """
    admissible, model = error.admissible, error.solution.model
    comm, size, d = model.comm, model.domain.extent, model.d
    body = gathered(comm, **body_nodes(model), u=nodal_displacement(admissible))
    volume = admissible.cell_geometry.volume[: model.domain.owned_cells]
    cells = gathered(comm, mises=von_mises(mean_stress(admissible)), volume=volume)
    contacts = [whole_contact(admissible, t) for t in admissible.tractions]
    up = _up(admissible)
    label = f"von Mises stress{'' if tells_out_of_plane(model) else ' of the plane part'} [force/area]"

    def draw() -> None:
        from matplotlib.colors import Normalize  # noqa: PLC0415

        u, mises = body.pop("u"), cells["mises"]
        largest = float(np.linalg.norm(u, axis=1).max())
        default = float(f"{0.06 * size / largest:.2g}") if 0 < largest < 0.05 * size else 1.0
        times = default if factor is None else factor
        skin, shown = skin_of(**body, d=d), [contact for contact in contacts if contact is not None and len(contact.x)]
        outline = grid_of(body["points"], body["cells"][:, : d + 1], d)
        outline = outline.extract_feature_edges(feature_angle=30.0, manifold_edges=False)
        foundations = [foundation(contact, times, size) for contact in shown]
        top = weighted_level(mises, cells["volume"], 0.998) or 1.0  # a singular corner must not take all colours
        scale, x = Scale(Normalize(0, top), "max", label), skin.points + times * u
        figure = _map(skin, x, mises, scale, views_of(d, up), outline, foundations)
        gaps = any(contact.gap.any() for contact in shown)
        figure.suptitle(f"displacement {'and gap ' if gaps else ''}× {times:g}", fontsize=11)
        save_figure(figure, path)

    on_root(comm, path, draw)


def draw_cells(admissible: Admissible, values: np.ndarray, scale: Callable[..., Scale], path: str | Path) -> None:
    """Draw a value in each element on the body before the deformation; collective.

    Args:
        admissible: A pair on the mesh of the body.
        values: Values of the owned cells, shape (owned,).
        scale: Gives the colours for the values of all cells; called on rank 0.
        path: Picture file.
    """
    domain = admissible.solution.domain
    comm, up = domain.mesh.comm, _up(admissible)
    body, cells = gathered(comm, **body_mesh(domain)), gathered(comm, values=values)

    def draw() -> None:
        skin, values = skin_of(**body, d=domain.dim), cells["values"]
        save_figure(_map(skin, skin.points, values, scale(values), views_of(domain.dim, up)), path)

    on_root(comm, path, draw)


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
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

    if not known:
        bar.set_ticks([0.0])
    elif isinstance(norm, LogNorm):
        low, high, powers = norm.vmin, norm.vmax, 10.0 ** np.arange(-20, 20)
        series = [np.outer(powers, steps).ravel() for steps in ((1,), (1, 2, 5))]
        series = [s[(s >= low) & (s <= high)] for s in [*series, MaxNLocator(5).tick_values(low, high)]]
        ticks = next((s for s in series if len(s) > 2), series[-1])
        bar.set_ticks(ticks, labels=[f"{tick:.4g}" for tick in ticks], minor=False)
        bar.minorticks_off()


def _map(
    skin: Skin,
    x: np.ndarray,
    values: np.ndarray,
    scale: Scale,
    views: dict[str, np.ndarray],
    before: Any = None,
    foundations: Sequence[Any] = (),
) -> Any:
    """Figure of a body with coloured elements and a colour bar.

    Args:
        skin: The body.
        x: Positions at which its nodes are drawn [length], shape (n, 3).
        values: Values of the elements, shape (m,).
        scale: Their colours.
        views: The views, from :func:`views_of`.
        before: Lines of pyvista that show the body before the deformation.
        foundations: Foundations, from :func:`foundation`. In 3D only the view from above has them, because they hide
            the contact.
    """
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415

    colours = ScalarMappable(scale.norm, "viridis")
    rgb = colours.to_rgba(np.clip(values, scale.norm.vmin, scale.norm.vmax), bytes=True)[:, :3]
    parts = [skin.faces(x, scalars=rgb, rgb=True, preference="cell")]
    if len(values) <= FEW:
        parts.append(skin.edges(x, color="#404040", opacity=0.4, line_width=0.8))
    if before is not None and before.n_points > 0:  # a ball has no edges
        parts.append((before, {"color": "black", "line_width": 3.0}))
    flat = len(views) == 1
    size = float(np.ptp(x, axis=0).max())
    grounds = [part for surface in foundations for part in ground(surface, size)]
    shown = {name: parts + grounds * (name != "from below") for name in views}
    images = {name: rendered(shown[name], view) for name, view in views.items()}
    sizes = np.array([[right - left, high - low] for _, (left, right, low, high) in images.values()])
    ratio = sizes[:, 0].sum() / sizes[:, 1].max()
    below = flat and ratio > WIDE
    width = min(6.0, 6.0 * ratio) if flat else min(10.0, 5.0 * ratio)
    words = (0.7 if below else 1.9) + (0.0 if flat else 2 * WORDS)
    figure = new_figure(max(width, 1.5) + words, width / ratio + (1.6 if below else 0.9), "compressed")
    panels = figure.subplots(1, len(views), width_ratios=sizes[:, 0], squeeze=False)[0]
    for panel, (name, view) in zip(panels, views.items(), strict=True):
        show(panel, images[name], view, np.concatenate([data.points for data, _ in shown[name]]))
        panel.set_title(name, fontsize=11)
    place = {"location": "bottom", "shrink": 0.7, "aspect": 40} if below else {"shrink": 0.8, "aspect": 30}
    bar = figure.colorbar(colours, ax=panels, extend=scale.extend, **place)
    _ticks(bar, scale.norm, known=bool(values.any()))
    if below:
        bar.set_label(scale.label)
    else:
        bar.ax.set_title(scale.label.replace(" [", "\n["), fontsize=11, loc="left")
    return figure
