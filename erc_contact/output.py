"""Pictures of a run: curves by matplotlib, bodies by pyvista.

All functions are collective: data are gathered to rank 0 of the mesh's communicator, which draws; the other ranks
import neither matplotlib nor pyvista. What fails on rank 0 is raised on all ranks. No display is needed. The folder
of a path is made if it is missing; the suffix of a picture chooses its format (png, pdf, svg).

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, mu friction coefficient,
n normal of the foundation, t tangent of the contact, eps relative error, eps_E its share of one element.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible import Admissible
from erc_contact.admissible.contact import ContactTraction
from erc_contact.domain import Domain
from erc_contact.error import ConstitutiveError
from erc_contact.exceptions import InputError
from erc_contact.fields import (
    OPEN,
    SLIP,
    STICK,
    body_mesh,
    contact_status,
    gathered,
    grid_of,
    mean_stress,
    nodal_displacement,
    on_root,
    von_mises,
    whole_contact,
)
from erc_contact.history import History
from erc_contact.sizes import Sizes

STATUS = ("open", "slip", "stick")
COLOURS = ("#ececec", "#fdeacc", "#d9ecd6")
"""Colours of open, slip and stick."""
PIXELS = 1800
"""Longer side of the image of a body."""
FEW = 15_000
"""Maps of more elements show no edges, which would hide the colours."""


def plot_history(histories: Mapping[str, History], path: str | Path) -> None:
    """Draw the relative error against run time and against degrees of freedom, log-log; collective.

    One curve a history, with its measured slope against the degrees of freedom, the prescribed accuracies, and the
    slope -1/d, the best that linear elements can do.

    Args:
        histories: Name -> history, e.g. ``{"adaptive": history, "uniform": other}``.
        path: Picture file.

    Raises:
        InputError: If there is no history.
    """
    if not histories:
        raise InputError("plot_history: no history is given; give at least one, e.g. {'adaptive': history}.")
    domain = next(iter(histories.values())).best.admissible.solution.domain

    def draw() -> None:
        many = len(histories) > 3
        figure = _figure(8.6, 3.9 + 0.13 * len(histories) * many)
        figure.get_layout_engine().set(wspace=0.06)
        left, right = figure.subplots(1, 2, sharey=True)
        for (name, history), marker in zip(histories.items(), "osD^vP*X" * len(histories), strict=False):
            slope = history.slope("dofs")
            label = name if np.isnan(slope) else f"{name} (slope ${slope:.2f}$)"
            for axes, column in ((left, "seconds"), (right, "dofs")):
                axes.plot(history.column(column), 100 * history.column("eps"), f"{marker}-", ms=4, lw=1.2, label=label)
        left.set(xlabel="run time [s]", ylabel="relative error [%]")
        right.set_xlabel("degrees of freedom")
        for accuracy in sorted({100 * h.accuracy for h in histories.values()}):
            for axes in (left, right):
                axes.axhline(accuracy, color="0.35", lw=0.9, ls=":")
            left.text(0.02, accuracy, f"accuracy {accuracy:.3g}%", transform=left.get_yaxis_transform(), va="bottom")
        dofs, eps = (np.concatenate([h.column(c) for h in histories.values()]) for c in ("dofs", "eps"))
        ends = np.array([dofs.max() ** 0.5 * dofs.min() ** 0.5, dofs.max()])
        degree = max(h.best.admissible.solution.model.degree for h in histories.values())
        order = Fraction(degree, domain.dim)
        below = 75 * float(np.min((eps * dofs ** float(order))[dofs >= ends[0]]))
        if below > 0 and ends[1] > ends[0]:
            right.plot(ends, below * ends ** -float(order), "k--", lw=0.9, label=f"slope $-{order}$")
        if many:
            figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
        else:
            right.legend(loc="best", frameon=False)
        for axes in (left, right):
            axes.grid(which="major", color="0.9", lw=0.6)
            _log_scale(axes.xaxis, *axes.dataLim.intervalx)
        _log_scale(left.yaxis, *right.dataLim.intervaly)
        _save(figure, path)

    on_root(domain.mesh.comm, path, draw)


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
        look = {"color": "#dce6f0", "edge_color": "#1f2d3d", "show_edges": True}
        widths = np.clip([45 / np.sqrt(cells) for _, cells in bodies], 0.5, 1.5)  # thin lines on fine meshes
        parts = [(grid_of(**body), look | {"line_width": w}) for (body, _), w in zip(bodies, widths, strict=True)]
        images = [_rendered([part], dim) for part in parts]
        left, right, low, high = images[0][1]
        ratio = (right - left) / (high - low)
        shapes = [(-(-len(images) // columns), columns) for columns in range(1, len(images) + 1)]
        rows, columns = min(shapes, key=lambda s: abs(np.log(ratio * s[1] / s[0] / 2)) + s[0] * s[1] - len(images))
        height = min(5.5, 9.0 / (ratio * columns), 9.0 / rows)
        figure = _figure(max(ratio * height, 1.2) * columns + 0.6, (height + 0.5) * rows + 0.5)
        panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
        for panel, (image, extent), (_, cells), eps in zip(panels, images, bodies, errors, strict=False):
            between = ", " if ratio * height > 2 else "\n"
            panel.set_title(f"{cells} cells{between}eps = {100 * eps:.3g}%", fontsize=10)
            _show(panel, image, extent, dim)
            panel.label_outer(remove_inner_ticks=True)
        for panel in panels[len(images) :]:
            panel.set_axis_off()
        _save(figure, path)

    on_root(comm, path, draw)


def draw_error(error: ConstitutiveError, path: str | Path) -> None:
    """Draw eps_E of each element on a logarithmic colour scale; collective.

    Args:
        error: Its ``cells`` are drawn.
        path: Picture file.
    """
    domain = error.admissible.solution.domain
    body = gathered(domain.mesh.comm, **body_mesh(domain))
    cells = gathered(domain.mesh.comm, eps=error.cells)

    def draw() -> None:
        from matplotlib.colors import LogNorm  # noqa: PLC0415

        top = float(cells["eps"].max()) or 1.0
        low = max(float(np.percentile(cells["eps"], 1)), 1e-4 * top)
        norm = LogNorm(min(low, 0.5 * top), top)
        figure = _map([grid_of(**body)], domain.dim, cells["eps"], norm=norm, extend="min", label="eps_E [-]")
        _save(figure, path)

    on_root(domain.mesh.comm, path, draw)


def draw_sizes(sizes: Sizes, path: str | Path) -> None:
    """Draw r_E of each element, the ratio of its new size to its old, on a logarithmic colour scale; collective.

    Args:
        sizes: Its ``ratio`` is drawn, on the mesh that it was made from.
        path: Picture file.
    """
    domain = sizes.error.admissible.solution.domain
    body = gathered(domain.mesh.comm, **body_mesh(domain))
    cells = gathered(domain.mesh.comm, ratio=sizes.ratio)

    def draw() -> None:
        from matplotlib.colors import LogNorm  # noqa: PLC0415

        ratio = cells["ratio"]
        norm = LogNorm(float(ratio.min()) / 1.05, float(ratio.max()) * 1.05)
        _save(_map([grid_of(**body)], domain.dim, ratio, norm=norm, extend="neither", label="r_E [-]"), path)

    on_root(domain.mesh.comm, path, draw)


def draw_deformed(error: ConstitutiveError, path: str | Path, factor: float | None = None) -> None:
    """Draw the deformed body, coloured by the von Mises stress of sigma^, and the outline before; collective.

    The stress is the mean of each element. Out of plane it is ``nu (s_xx + s_yy)`` for :class:`Elastic` in plane
    strain, else 0.

    Args:
        error: Its admissible pair is drawn.
        path: Picture file.
        factor: Magnification of u^ [-]; by default the largest u^ appears as 6% of the body's size, or as it is where
            it is larger than 5%.
    """
    admissible, domain = error.admissible, error.admissible.solution.domain
    body = gathered(domain.mesh.comm, **body_mesh(domain), u=nodal_displacement(admissible))
    volume = admissible.cells.volume[: domain.owned_cells]
    cells = gathered(domain.mesh.comm, mises=von_mises(mean_stress(admissible)), volume=volume)
    size = domain.size

    def draw() -> None:
        from matplotlib.colors import Normalize  # noqa: PLC0415

        u, mises = body.pop("u"), cells["mises"]
        largest = float(np.linalg.norm(u, axis=1).max())
        default = float(f"{0.06 * size / largest:.2g}") if 0 < largest < 0.05 * size else 1.0
        times = default if factor is None else factor
        before = grid_of(**body).extract_feature_edges(feature_angle=30.0, manifold_edges=False)
        body["points"] = body["points"] + times * u
        top = _level(mises, cells["volume"], 0.998) or 1.0  # a singular corner must not take all colours
        label = "von Mises stress\n[force/area]"
        figure = _map([grid_of(**body), before], domain.dim, mises, norm=Normalize(0, top), extend="max", label=label)
        figure.axes[0].set_title(f"displacement × {times:g}", fontsize=11)
        _save(figure, path)

    on_root(domain.mesh.comm, path, draw)


def plot_contact(admissible: Admissible, name: str, path: str | Path) -> None:
    """Draw r^ and the state of a contact; collective.

    In 2D: pressure, shear along t = (-n_2, n_1) and the cone +-mu |r_n|, facet by facet, over strips coloured by
    :func:`contact_status`; a singular peak is cut off and its height told. In 3D: pressure, size of the shear and
    status on the facets, in the tangent plane.

    Args:
        admissible: The pair with its tractions.
        name: Name of the contact.
        path: Picture file.

    Raises:
        InputError: If no contact has this name, or it has no facet.
    """
    model = admissible.solution.model
    names = [t.contact.name for t in admissible.tractions]
    if name not in names:
        raise InputError(f"plot_contact: no contact is called {name!r}; the scene has {', '.join(names) or 'none'}.")
    traction, x = whole_contact(admissible, admissible.tractions[names.index(name)])
    if not model.comm.bcast(len(x)):
        raise InputError(f"plot_contact: {name!r} has no facet; contacts of this scene: {', '.join(names)}.")
    draw = _draw_contact_2d if model.d == 2 else _draw_contact_3d
    on_root(model.comm, path, lambda: draw(traction, x, path))


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure  # noqa: PLC0415

    return Figure(figsize=(width, height), layout="constrained")


def _save(figure: Any, path: str | Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415

    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=200, bbox_inches="tight")


def _log_scale(axis: Any, low: float, high: float) -> None:
    """Logarithmic axis between two of 1, 2, 5, 10, ... with plain numbers at the ticks; linear if low is 0."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter  # noqa: PLC0415

    if not low > 0:
        return
    ends = np.outer(10.0 ** np.arange(-15, 16), [1, 2, 5]).ravel()
    low, high = ends[ends <= low / 1.08].max(), ends[ends >= high * 1.08].min()
    axis.axes.set(**{f"{axis.axis_name}scale": "log", f"{axis.axis_name}lim": (low, high)})
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high / low < 200 else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}" if value < 1e5 else f"{value / 1e3:g}k"))
    axis.set_minor_formatter(NullFormatter())


def _level(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """The value that a share of the weight does not exceed."""
    order = np.argsort(values)
    carried = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(carried, share * carried[-1])])


def _rendered(parts: Sequence[tuple[Any, dict[str, Any]]], dim: int) -> tuple[np.ndarray, tuple[float, ...]]:
    """Image of (data, look) in parallel projection, seen along z in 2D, and its extent [length]."""
    import pyvista  # noqa: PLC0415

    towards = np.array([[0.0, 0.0, 1.0], [0.55, 0.4, 0.75]][dim - 2])
    across = np.cross([0.0, 1.0, 0.0], towards)
    view = np.array([across, np.cross(towards, across), towards])
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    seen = np.concatenate([data.points for data, _ in parts]) @ view.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = float(np.linalg.norm(high - low))
    low, high, middle = low - 0.01 * size, high + 0.01 * size, (low + high) / 2 @ view
    pixels = np.maximum(PIXELS * (high - low)[:2] / (high - low)[:2].max(), 16).round().astype(int)
    with pyvista.vtk_verbosity("off"):  # without a display VTK complains before it finds another way
        plotter = pyvista.Plotter(off_screen=True, window_size=pixels.tolist())
        plotter.set_background("white")
        for data, look in parts:
            plotter.add_mesh(data, show_scalar_bar=False, lighting=dim == 3, ambient=0.65, diffuse=0.4, **look)
        plotter.enable_parallel_projection()
        plotter.camera_position = [tuple(middle + 2 * size * view[2]), tuple(middle), (0.0, 1.0, 0.0)]
        plotter.camera.parallel_scale = (high - low)[1] / 2
        plotter.reset_camera_clipping_range()
        image = np.asarray(plotter.screenshot(return_img=True))
        plotter.close()
    return image, (low[0], high[0], low[1], high[1])


def _show(axes: Any, image: np.ndarray, extent: tuple[float, ...], dim: int) -> None:
    """Put the image of a body in axes, with coordinates in 2D."""
    axes.imshow(image, extent=extent)
    axes.spines[:].set_visible(False)
    axes.set(xlabel="$x$ [length]", ylabel="$y$ [length]")
    axes.axison = dim == 2


def _map(parts: list[Any], dim: int, values: np.ndarray, *, norm: Any, extend: str, label: str) -> Any:
    """Figure of a body with coloured cells, a colour bar, and lines if there is a second part."""
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415

    colours = ScalarMappable(norm, "viridis")
    look = {"scalars": colours.to_rgba(values, bytes=True)[:, :3], "rgb": True, "preference": "cell"}
    look |= {"show_edges": len(values) <= FEW, "edge_color": "#404040", "edge_opacity": 0.4, "line_width": 0.8}
    lines = {"color": "black", "line_width": 3.0}
    image, extent = _rendered(list(zip(parts, (look, lines), strict=False)), dim)
    ratio = (extent[1] - extent[0]) / (extent[3] - extent[2])
    height = min(6.0, 6.0 / ratio)
    figure = _figure(max(ratio * height, 1.5) + 1.9, height + 0.8)
    axes = figure.subplots()
    _show(axes, image, extent, dim)
    figure.colorbar(colours, ax=axes, extend=extend, shrink=0.8, aspect=30).ax.set_title(label, fontsize=11, loc="left")
    return figure


def _mean_normal(traction: ContactTraction) -> np.ndarray:
    """The normal of the foundation, the mean direction where it varies, shape (d,)."""
    n = traction.area @ traction.contact.direction
    return n / np.linalg.norm(n)


def _tangents(n: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """d-1 orthonormal tangents, along the coordinate axes that are nearest to the contact, and their names."""
    axes = np.sort(np.argsort(abs(n), kind="stable")[: len(n) - 1])
    q, r = np.linalg.qr(np.column_stack([n, np.eye(len(n))[:, axes]]))
    tangents = (q * np.sign(np.diag(r)))[:, 1:].T
    if abs(n).max() > 1 - 1e-12:
        return tangents, [f"${'xyz'[axis]}$ [length]" for axis in axes]
    return tangents, ["along ({}) [length]".format(", ".join(f"{c:.2g}" for c in t + 0.0)) for t in tangents]


def _draw_contact_2d(traction: ContactTraction, x: np.ndarray, path: Any) -> None:
    from matplotlib.patches import Patch  # noqa: PLC0415

    n = _mean_normal(traction)
    (tangent,), (name,) = _tangents(n)
    s = x[..., :2] @ tangent
    order = np.argsort(s, axis=1)
    facets = np.argsort(s.min(axis=1))

    def along(values: np.ndarray) -> np.ndarray:
        """Values at the corners in the order of the contact, with a break after each facet."""
        values = np.take_along_axis(values, order, axis=1)[facets]
        return np.pad(values, ((0, 0), (0, 1)), constant_values=np.nan).ravel()

    pressure, shear = -traction.normal, traction.tangential @ np.array([-n[1], n[0]])
    along_t = "({:g}, {:g})".format(*(np.round([-n[1], n[0]], 3) + 0.0))
    figure = _figure(7.2, 4.0)
    axes = figure.subplots()
    status = contact_status(traction)
    for code, colour in enumerate(COLOURS):
        strips = np.column_stack([s.min(axis=1), np.ptp(s, axis=1)])[status == code]
        look = {"facecolors": colour, "lw": 0, "antialiased": False, "zorder": 0}
        axes.broken_barh(strips, (0, 1), transform=axes.get_xaxis_transform(), **look)
    bound = traction.bound
    cone = along(bound)
    axes.fill_between(along(s), -cone, cone, fc="#5b84b1", ec="none", alpha=0.35, label=r"friction bound")
    low, high = (1.6 * _level(v.max(axis=1), traction.area, 0.98) for v in (bound, np.maximum(pressure, bound)))
    peak = f" (peak {pressure.max():.3g})" if pressure.max() > high > 0 else ""
    axes.plot(along(s), along(pressure), color="#1f3b73", lw=1.6, label=f"pressure $-r_n${peak}")
    axes.plot(along(s), along(shear), color="#b22222", lw=1.6, label=f"shear $r_t$ along {along_t}")
    axes.axhline(0.0, color="0.4", lw=0.6)
    if peak:  # a singular end must not flatten all the rest
        axes.set_ylim(-low, high)
    axes.set(xlabel=name, ylabel="traction [force/area]", xlim=(s.min(), s.max()))
    handles, labels = axes.get_legend_handles_labels()
    for code in np.unique(status):
        handles, labels = [*handles, Patch(fc=COLOURS[code], ec="0.6")], [*labels, STATUS[code]]
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, columnspacing=1.2)
    _save(figure, path)


def _draw_contact_3d(traction: ContactTraction, x: np.ndarray, path: Any) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap  # noqa: PLC0415

    tangents, names = _tangents(_mean_normal(traction))
    s, t = tangents @ x.reshape(-1, 3).T
    figure = _figure(10.0, max(2.6, 1.2 + 3.0 * float(np.ptp(t) / np.ptp(s))))
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    fields = {"pressure $-r_n$": -traction.normal, "shear $|r_t|$": np.linalg.norm(traction.tangential, axis=-1)}
    for panel, (title, values) in zip(panels, fields.items(), strict=False):
        drawn = panel.tripcolor(s, t, traction.nodes, values.ravel(), shading="gouraud")
        figure.colorbar(drawn, ax=panel, label=f"{title} [force/area]", location="bottom", shrink=0.9)
    status = contact_status(traction).astype(float)
    look = {"cmap": ListedColormap(COLOURS), "norm": BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3), "edgecolors": "0.6"}
    drawn = panels[2].tripcolor(s, t, traction.nodes, facecolors=status, lw=0.2, **look)
    bar = figure.colorbar(drawn, ax=panels[2], location="bottom", shrink=0.9, ticks=[OPEN, SLIP, STICK], label="status")
    bar.ax.set_xticklabels(STATUS)
    for panel in panels:
        panel.set(aspect="equal", xlabel=names[0])
    panels[0].set_ylabel(names[1])
    _save(figure, path)
