"""Pictures of bodies by pyvista, in frames by matplotlib.

All functions are collective: data are gathered to rank 0 of the mesh's communicator, which draws; the other ranks
import neither. What fails on rank 0 is raised on all ranks. No display is needed.

Bodies of degree 2 are drawn with their curved edges. A body in space is seen twice: with the foundation below it, and
from below, where the contact is.

Symbols: u^ and sigma^ admissible displacement and stress, g gap, n normal of the foundation, eps relative error, eps_E
its share of one element, X place before the deformation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible import Admissible
from erc_contact.bodies import Skin, foundation, ground, skin_of
from erc_contact.domain import Domain
from erc_contact.drawing import new_figure, save_figure
from erc_contact.error import ConstitutiveError
from erc_contact.exceptions import InputError
from erc_contact.fields import (
    body_mesh,
    body_nodes,
    mean_stress,
    nodal_displacement,
    tells_out_of_plane,
    von_mises,
    whole_contact,
)
from erc_contact.files import gathered, grid_of, on_root
from erc_contact.percent import percent
from erc_contact.plots import weighted_level
from erc_contact.sizes import Sizes

PIXELS = 1800
"""Longer side of the image of a body."""
WIDE = 1.6
"""A body that is so much wider than high has its colour bar below."""
FEW = 15_000
"""Maps of more elements show no edges, which would hide the colours."""


def draw_meshes(meshes: Sequence[tuple[Domain, np.ndarray]], path: str | Path) -> None:
    """Draw a sequence of meshes side by side, at most six with the first and the last; collective.

    Args:
        meshes: Domain and eps_E of its owned cells, as in ``History.meshes``.
        path: Picture file.

    Raises:
        InputError: If there is no mesh.
    """
    if not meshes:
        raise InputError("draw_meshes: no mesh is given; give pairs (domain, eps_E), as in history.meshes.")
    chosen = [meshes[i] for i in np.unique(np.linspace(0, len(meshes) - 1, 6).round().astype(int))]
    comm, dim = chosen[0][0].mesh.comm, chosen[0][0].dim
    bodies = [(gathered(comm, **body_mesh(domain)), domain.cells) for domain, _ in chosen]
    errors = [float(np.sqrt(comm.allreduce(float(np.sum(cells**2)), MPI.SUM))) for _, cells in chosen]

    def draw() -> None:
        view = next(iter(_views(dim, np.eye(3)[1]).values()))
        widths = np.clip([45 / np.sqrt(cells) for _, cells in bodies], 0.5, 1.5)  # thin lines on fine meshes
        skins = [skin_of(**body, d=dim) for body, _ in bodies]
        images = [
            _rendered([s.faces(s.points, color="#dce6f0"), s.edges(s.points, color="#1f2d3d", line_width=width)], view)
            for s, width in zip(skins, widths, strict=True)
        ]
        left, right, low, high = images[0][1]
        ratio = (right - left) / (high - low)
        shapes = [(-(-len(images) // columns), columns) for columns in range(1, len(images) + 1)]
        rows, columns = min(shapes, key=lambda s: abs(np.log(ratio * s[1] / s[0] / 2)) + s[0] * s[1] - len(images))
        height = min(5.5, 9.0 / (ratio * columns), 9.0 / rows)
        figure = new_figure(max(ratio * height, 1.2) * columns + 0.6, (height + 0.5) * rows + 0.5, "compressed")
        figure.get_layout_engine().set(w_pad=0.12)
        panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
        for panel, skin, image, (_, cells), eps in zip(panels, skins, images, bodies, errors, strict=False):
            between = ", " if ratio * height > 2 else "\n"
            panel.set_title(f"{cells} cells{between}eps = {percent(eps, 3)}", fontsize=10)
            _show(panel, image, view, skin.points)
            panel.label_outer(remove_inner_ticks=True)
        for panel in panels[len(images) :]:
            panel.set_axis_off()
        save_figure(figure, path)

    on_root(comm, path, draw)


def draw_error(error: ConstitutiveError, path: str | Path) -> None:
    """Draw eps_E of each element on a logarithmic colour scale; collective.

    Args:
        error: Its ``cells`` are drawn.
        path: Picture file.
    """

    def scale(eps: np.ndarray) -> _Scale:
        from matplotlib.colors import LogNorm, Normalize  # noqa: PLC0415

        top = float(eps.max())
        low = min(max(float(np.percentile(eps, 1)), 1e-4 * top), 0.5 * top)
        return _Scale(LogNorm(low, top) if top > 0 else Normalize(0, 1), "min", "eps_E [-]")

    _draw_cells(error.admissible, error.cells, scale, path)


def draw_sizes(sizes: Sizes, path: str | Path) -> None:
    """Draw r_E of each element, the ratio of its new size to its old, on a logarithmic colour scale; collective.

    Args:
        sizes: Its ``ratio`` is drawn, on the mesh that it was made from.
        path: Picture file.
    """

    def scale(ratio: np.ndarray) -> _Scale:
        from matplotlib.colors import LogNorm  # noqa: PLC0415

        return _Scale(LogNorm(float(ratio.min()) / 1.05, float(ratio.max()) * 1.05), "neither", "r_E [-]")

    _draw_cells(sizes.error.admissible, sizes.ratio, scale, path)


def draw_deformed(error: ConstitutiveError, path: str | Path, factor: float | None = None) -> None:
    """Draw the deformed body on its foundation, coloured by the von Mises stress of sigma^; collective.

    Points are drawn at X + factor u^, those of the foundation at X + factor g n, so that a closed gap looks closed and
    an open one open; the foundation is left out where it would lie far away. Lines show the body before. The stress is
    the mean of each element; out of plane it is what the material says (``out_of_plane``), and if it does not say, the
    von Mises stress is that of the part in plane.

    Args:
        error: Its admissible pair is drawn.
        path: Picture file.
        factor: Magnification of u^ and of the gap [-]; by default the largest u^ appears as 6% of the body's size, or
            as it is where it is larger than 5%.
    """
    admissible, model = error.admissible, error.admissible.solution.model
    comm, size, d = model.comm, model.domain.size, model.d
    body = gathered(comm, **body_nodes(model), u=nodal_displacement(admissible))
    volume = admissible.cells.volume[: model.domain.owned_cells]
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
        skin, shown = skin_of(**body, d=d), [contact for contact in contacts if contact is not None]
        outline = grid_of(body["points"], body["cells"][:, : d + 1], d)
        outline = outline.extract_feature_edges(feature_angle=30.0, manifold_edges=False)
        foundations = [foundation(contact, times, size) for contact in shown]
        top = weighted_level(mises, cells["volume"], 0.998) or 1.0  # a singular corner must not take all colours
        scale, x = _Scale(Normalize(0, top), "max", label), skin.points + times * u
        figure = _map(skin, x, mises, scale, _views(d, up), outline, foundations)
        gaps = any(contact.gap.any() for contact in shown)
        figure.suptitle(f"displacement {'and gap ' if gaps else ''}× {times:g}", fontsize=11)
        save_figure(figure, path)

    on_root(comm, path, draw)


def _draw_cells(admissible: Admissible, values: np.ndarray, scale: Callable[..., _Scale], path: str | Path) -> None:
    """Draw values of owned cells on the body as it was; collective."""
    domain = admissible.solution.domain
    comm, up = domain.mesh.comm, _up(admissible)
    body, cells = gathered(comm, **body_mesh(domain)), gathered(comm, values=values)

    def draw() -> None:
        skin, values = skin_of(**body, d=domain.dim), cells["values"]
        save_figure(_map(skin, skin.points, values, scale(values), _views(domain.dim, up)), path)

    on_root(comm, path, draw)


@dataclass(frozen=True)
class _Scale:
    """Colours of values: their norm, the ends of the bar that are exceeded ("min", "max", "neither"), its label."""

    norm: Any
    extend: str
    label: str


# -- pictures, on rank 0 -------------------------------------------------------------------------------------------


def _up(admissible: Admissible) -> np.ndarray:
    """The coordinate axis that points away from the first foundation, the upward direction of a picture; collective."""
    total, model = np.zeros(3), admissible.solution.model
    for traction in admissible.tractions[:1]:
        own = traction.contact.facets[:, 0] < model.domain.owned_cells
        total[: model.d] = traction.area[own] @ traction.contact.direction[own]
    total = np.array(model.comm.allgather(total)).sum(axis=0)
    axis = int(abs(total).argmax()) if total.any() else 1
    return np.eye(3)[axis] * (-1.0 if total[axis] > 0 else 1.0)


def _views(d: int, up: np.ndarray) -> dict[str, np.ndarray]:
    """Names and axes (across, upward, towards the eye; 3 x 3) of the views of a body: one in 2D, two in 3D."""
    if d == 2:
        return {"": np.eye(3)}
    aside = 0.75 * np.roll(abs(up), 1) + 0.55 * np.roll(abs(up), 2)
    views = {}
    for name, towards in (("from above", aside + 0.4 * up), ("from below", aside - 0.6 * up)):
        across = np.cross(up, towards)
        axes = np.array([across, np.cross(towards, across), towards])
        views[name] = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return views


def _rendered(parts: Sequence[tuple[Any, dict[str, Any]]], view: np.ndarray) -> tuple[np.ndarray, tuple[float, ...]]:
    """Image of (data, look) in parallel projection, and its extent in the plane of the view [length]."""
    import pyvista  # noqa: PLC0415

    seen = np.concatenate([data.points for data, _ in parts]) @ view.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = float(np.linalg.norm(high - low))
    low, high, middle = low - 0.01 * size, high + 0.01 * size, (low + high) / 2 @ view
    pixels = np.maximum(PIXELS * (high - low)[:2] / (high - low)[:2].max(), 16).round().astype(int)
    flat = abs(view[2, 2]) == 1.0
    with pyvista.vtk_verbosity("off"):  # without a display VTK complains before it finds another way
        plotter = pyvista.Plotter(off_screen=True, window_size=pixels.tolist())
        plotter.set_background("white")
        for data, look in parts:
            lines = data.n_lines > 0  # to be seen before the surface that they lie on
            shown = data.translate(1e-3 * size * view[2]) if lines else data
            plotter.add_mesh(shown, show_scalar_bar=False, lighting=not flat, ambient=0.65, diffuse=0.4, **look)
        plotter.enable_parallel_projection()
        plotter.camera_position = [tuple(middle + 2 * size * view[2]), tuple(middle), tuple(view[1])]
        plotter.camera.parallel_scale = (high - low)[1] / 2
        plotter.reset_camera_clipping_range()
        image = np.asarray(plotter.screenshot(return_img=True))
        plotter.close()
    return image, (low[0], high[0], low[1], high[1])


def _show(axes: Any, drawn: tuple[np.ndarray, tuple[float, ...]], view: np.ndarray, points: np.ndarray) -> None:
    """Put the image of these points in axes, with coordinates; in 3D along three edges of a box around them."""
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

    axes.imshow(drawn[0], extent=drawn[1])
    axes.spines[:].set_visible(False)
    if view[2, 2] == 1.0:
        axes.set(xlabel="$x$ [length]", ylabel="$y$ [length]")
        return
    axes.set_axis_off()
    ends = np.array([points.min(axis=0), points.max(axis=0)])
    step = 0.03 * float(np.linalg.norm(ends[1] - ends[0]))
    corners = np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(-1, 3)
    for i, name in enumerate("xyz"):
        starts, direction = corners[corners[:, i] == ends[0, i]], view[:2, i]
        outward = np.array([0.0, -1.0]) if abs(direction[0]) > abs(direction[1]) else np.array([-1.0, 0.0])
        outward -= (outward @ direction) / (direction @ direction) * direction
        outward *= step / np.linalg.norm(outward)
        start = view[:2] @ starts[(starts @ view[:2].T @ outward).argmax()]  # an edge of the box's outline
        ticks = MaxNLocator(3, steps=[1, 2, 5, 10]).tick_values(*ends[:, i])
        ticks = ticks[(ticks >= ends[0, i]) & (ticks <= ends[1, i])]
        at = start + (np.array([*ends[:, i], ends[:, i].mean(), *ticks]) - ends[0, i])[:, None] * direction
        look = {"color": "0.3", "lw": 0.8, "clip_on": False}
        axes.plot(*at[:2].T, **look)
        axes.plot(*np.stack([at[3:], at[3:] + 0.4 * outward]).transpose(2, 0, 1), **look)
        for place, tick in zip(at[3:] + outward, ticks, strict=True):
            axes.text(*place, f"{tick:.4g}", ha="center", va="center", fontsize=9)
        far = 2.5 if outward[1] < -abs(outward[0]) else 4.5  # texts are wider than high
        axes.text(*(at[2] + far * outward), f"${name}$ [length]", ha="center", va="center", fontsize=10)


def _ticks(bar: Any, norm: Any, *, known: bool) -> None:
    """Plain numbers at a colour bar; where nothing is known to show but zeros, only that."""
    from matplotlib.colors import LogNorm  # noqa: PLC0415
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator  # noqa: PLC0415

    if not known:
        bar.set_ticks([0.0])
    elif isinstance(norm, LogNorm):
        bar.locator = LogLocator(subs=(1, 2, 5) if norm.vmax / norm.vmin < 200 else (1,))
        bar.formatter = FuncFormatter(lambda value, _: f"{value:g}")
        bar.minorlocator = NullLocator()


def _map(
    skin: Skin,
    x: np.ndarray,
    values: np.ndarray,
    scale: _Scale,
    views: dict[str, np.ndarray],
    before: Any = None,
    foundations: Sequence[Any] = (),
) -> Any:
    """Figure of a body with coloured elements and a colour bar.

    Args:
        skin: The body.
        x: Where its nodes are drawn [length], shape (n, 3).
        values: Values of the elements, shape (m,).
        scale: Their colours.
        views: Of :func:`_views`.
        before: Lines that show the body as it was.
        foundations: Results of :func:`foundation`; in 3D they are drawn from above only, as they hide the contact.
    """
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415

    colours = ScalarMappable(scale.norm, "viridis")
    rgb = colours.to_rgba(np.clip(values, scale.norm.vmin, scale.norm.vmax), bytes=True)[:, :3]
    parts = [skin.faces(x, scalars=rgb, rgb=True, preference="cell")]
    if len(values) <= FEW:
        parts.append(skin.edges(x, color="#404040", opacity=0.4, line_width=0.8))
    if before is not None:
        parts.append((before, {"color": "black", "line_width": 3.0}))
    flat = len(views) == 1
    size = float(np.ptp(x, axis=0).max())
    grounds = [part for surface in foundations for part in ground(surface, size)]
    shown = {name: parts + grounds * (name != "from below") for name in views}
    images = {name: _rendered(shown[name], view) for name, view in views.items()}
    sizes = np.array([[right - left, high - low] for _, (left, right, low, high) in images.values()])
    ratio = sizes[:, 0].sum() / sizes[:, 1].max()
    below = flat and ratio > WIDE
    width = min(6.0, 6.0 * ratio) if flat else min(10.0, 5.0 * ratio)
    figure = new_figure(
        max(width, 1.5) + (0.7 if below else 1.9), width / ratio + (1.6 if below else 0.9), "compressed"
    )
    panels = figure.subplots(1, len(views), width_ratios=sizes[:, 0], squeeze=False)[0]
    for panel, (name, view) in zip(panels, views.items(), strict=True):
        _show(panel, images[name], view, np.concatenate([data.points for data, _ in shown[name]]))
        panel.set_title(name, fontsize=11)
    place = {"location": "bottom", "shrink": 0.7, "aspect": 40} if below else {"shrink": 0.8, "aspect": 30}
    bar = figure.colorbar(colours, ax=panels, extend=scale.extend, **place)
    _ticks(bar, scale.norm, known=bool(values.any()))
    if below:
        bar.set_label(scale.label)
    else:
        bar.ax.set_title(scale.label.replace(" [", "\n["), fontsize=11, loc="left")
    return figure
