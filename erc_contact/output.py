"""Files and pictures of a run: curves by matplotlib, bodies by pyvista, fields for ParaView.

All functions are collective: data are gathered to rank 0 of the mesh's communicator, which draws and writes; the other
ranks import neither matplotlib nor pyvista. What fails on rank 0 is raised on all ranks. No display is needed. The
folder of a path is made if it is missing; the suffix of a picture chooses its format (png, pdf, svg).

Symbols: r^ admissible contact traction, r_n and r_t its normal and tangential parts, mu friction coefficient,
n normal of the foundation, t tangent of the contact, u^ and sigma^ admissible displacement and stress,
eps relative error, eps_E its share of one element.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.adapt import History
from erc_contact.admissible import Admissible
from erc_contact.admissible.contact import ContactTraction
from erc_contact.admissible.macro import tensors
from erc_contact.domain import Domain
from erc_contact.error import ConstitutiveError
from erc_contact.exceptions import InputError, raise_together
from erc_contact.material import Elastic
from erc_contact.model import Model, evaluate

OPEN, SLIP, STICK = 0, 1, 2
"""Codes of :func:`contact_status`."""
STATUS = ("open", "slip", "stick")
COLOURS = ("#f0f0f0", "#fbd9a6", "#c3dcc0")
"""Colours of open, slip and stick."""
STYLE = {"font.family": "STIXGeneral", "mathtext.fontset": "stix", "font.size": 11.0, "savefig.dpi": 200}
PIXELS = 2400
"""Longer side of the image of a body."""
FEW = 20_000
"""Maps of more elements show no edges: they would hide the colours."""


def contact_status(traction: ContactTraction) -> np.ndarray:
    """Whether each facet of a contact is open, slips or sticks, by its admissible traction.

    A facet without pressure is ``OPEN``; one whose nodes all have ``|r_t| >= (1 - 1e-6) mu |r_n|`` is ``SLIP``, so
    every pressed facet of a contact without friction; the others are ``STICK``.

    Args:
        traction: r^ on a contact.

    Returns:
        OPEN, SLIP or STICK for each facet of ``traction.contact.facets``, shape (n,).
    """
    pressure = -traction.normal
    bound = (traction.friction * pressure).sum(axis=1)
    slips = np.linalg.norm(traction.tangential, axis=-1).sum(axis=1) >= (1 - 1e-6) * bound
    opens = pressure.max(axis=1, initial=0.0) <= 1e-10 * pressure.max(initial=0.0)
    return np.where(opens, OPEN, np.where(slips, SLIP, STICK))


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
        figure = _figure(8.4, 3.9)
        left, right = figure.subplots(1, 2, sharey=True)
        for (name, history), marker in zip(histories.items(), "osD^vP*X" * len(histories), strict=False):
            slope = history.slope("dofs")
            label = name if np.isnan(slope) else f"{name} (slope ${slope:.2f}$)"
            for axes, column in ((left, "seconds"), (right, "dofs")):
                axes.plot(history.column(column), 100 * history.column("eps"), f"{marker}-", ms=4, lw=1.2, label=label)
        _log_axes(left, "run time [s]")
        _log_axes(right, "degrees of freedom")
        left.set_ylabel("relative error [%]")
        for accuracy in sorted({100 * h.accuracy for h in histories.values()}):
            for axes in (left, right):
                axes.axhline(accuracy, color="0.35", lw=0.9, ls=":")
            left.text(0.02, accuracy, f"accuracy {accuracy:.3g}%", transform=left.get_yaxis_transform(), va="bottom")
        dofs, eps = (np.concatenate([h.column(c) for h in histories.values()]) for c in ("dofs", "eps"))
        below = 75 * float(np.min(eps * dofs ** (1 / domain.dim)))
        if below > 0 and dofs.max() > dofs.min():
            ends = np.array([dofs.max() ** 0.6 * dofs.min() ** 0.4, dofs.max()])
            right.plot(ends, below * ends ** (-1 / domain.dim), "k--", lw=0.9, label=f"slope $-1/{domain.dim}$")
        right.legend(loc="best", frameon=False)
        figure.savefig(path)

    _on_root(domain.mesh.comm, path, draw)


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
    bodies = [(_gathered(comm, **_body(domain)), domain.cells) for domain, _ in chosen]
    errors = [float(np.sqrt(comm.allreduce(float(np.sum(cells**2)), MPI.SUM))) for _, cells in chosen]

    def draw() -> None:
        look = {"color": "#dce6f0", "edge_color": "#1f2d3d", "show_edges": True, "line_width": 1.5}
        images = [_rendered([(_grid(**body), look)], dim) for body, _ in bodies]
        left, right, low, high = images[0][1]
        ratio = (right - left) / (high - low)
        shapes = [(-(-len(images) // columns), columns) for columns in range(1, len(images) + 1)]
        rows, columns = min(shapes, key=lambda s: abs(np.log(ratio * s[1] / s[0] / 2)))
        height = min(5.5, 9.0 / (ratio * columns), 9.0 / rows)
        figure = _figure(max(ratio * height, 1.2) * columns + 0.6, (height + 0.55) * rows)
        panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
        for panel, (image, extent), (_, cells), eps in zip(panels, images, bodies, errors, strict=False):
            panel.set_title(f"{cells} cells\neps = {100 * eps:.3g}%", fontsize=10)
            _show(panel, image, extent, dim)
            panel.label_outer()
        for panel in panels[len(images) :]:
            panel.set_axis_off()
        figure.savefig(path)

    _on_root(comm, path, draw)


def draw_error(error: ConstitutiveError, path: str | Path) -> None:
    """Draw eps_E of each element on a logarithmic colour scale; collective.

    Args:
        error: Its ``cells`` are drawn.
        path: Picture file.
    """
    domain = error.admissible.solution.domain
    body = _gathered(domain.mesh.comm, **_body(domain))
    cells = _gathered(domain.mesh.comm, eps=error.cells)

    def draw() -> None:
        from matplotlib.colors import LogNorm  # noqa: PLC0415

        top = float(cells["eps"].max()) or 1.0
        low = max(float(np.percentile(cells["eps"], 1)), 1e-4 * top)
        _map(_grid(**body), cells["eps"], LogNorm(min(low, 0.5 * top), top), "min", "eps_E", domain.dim, path)

    _on_root(domain.mesh.comm, path, draw)


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
    body = _gathered(domain.mesh.comm, **_body(domain), u=_nodal(admissible))
    stress = _gathered(domain.mesh.comm, mises=von_mises(mean_stress(admissible)))
    size = domain.size

    def draw() -> None:
        from matplotlib.colors import Normalize  # noqa: PLC0415

        u, mises = body.pop("u"), stress["mises"]
        largest = float(np.linalg.norm(u, axis=1).max())
        default = float(f"{0.06 * size / largest:.2g}") if 0 < largest < 0.05 * size else 1.0
        times = default if factor is None else factor
        before = _grid(**body).extract_feature_edges(feature_angle=30, manifold_edges=False, non_manifold_edges=False)
        body["points"] = body["points"] + times * u
        top = float(np.percentile(mises, 99.8)) or 1.0
        title = f"displacement × {times:g}"
        norm, label = Normalize(0.0, top), "von Mises stress [force/area]"
        _map(_grid(**body), mises, norm, "max", label, domain.dim, path, title, before)

    _on_root(domain.mesh.comm, path, draw)


def plot_contact(admissible: Admissible, name: str, path: str | Path) -> None:
    """Draw r^ and the state of a contact; collective.

    In 2D: pressure, shear along t = (-n_2, n_1) and the cone +-mu |r_n| along the contact, facet by facet, over strips
    coloured by :func:`contact_status`. In 3D: pressure, size of the shear and status on the facets, seen along n.

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
        listed = ", ".join(names) if names else "none"
        raise InputError(f"plot_contact: no contact is called {name!r}; the scene has {listed}.")
    traction, x = _whole(admissible, admissible.tractions[names.index(name)])
    if not model.comm.bcast(len(x)):
        raise InputError(f"plot_contact: {name!r} has no facet; contacts of this scene: {', '.join(names)}.")
    draw = _draw_contact_2d if model.d == 2 else _draw_contact_3d
    _on_root(model.comm, path, lambda: draw(traction, x, path))


def write_fields(error: ConstitutiveError, folder: str | Path) -> None:
    """Write the fields for ParaView; collective.

    ``body.vtu``: at the points ``displacement`` (u^); in the cells ``eps_E`` and means of stresses, ``stress``
    (sigma^), ``stress_fe`` (rebalanced finite element stress; both 3x3, row by row) and ``von_mises`` (of sigma^).
    ``contact_<name>.vtu`` for each contact, each facet with points of its own: at the points ``traction`` (r^),
    ``pressure`` (-r_n) and ``friction`` (mu), in the cells ``status`` (0 open, 1 slip, 2 stick).

    Args:
        error: What is written, with its admissible pair.
        folder: Where; it is made if it is missing.

    Note:
        One .vtu with all fields, written by rank 0, because a VTKHDF file of DOLFINx 0.11 holds one array only.
    """
    admissible, model = error.admissible, error.admissible.solution.model
    body = _gathered(model.comm, **_body(model.domain), u=_nodal(admissible))
    stress = mean_stress(admissible)
    fe = _spatial(model, admissible.fe_stress[: model.domain.owned_cells])
    cells = _gathered(
        model.comm, stress=stress.reshape(-1, 9), stress_fe=fe.reshape(-1, 9), von_mises=von_mises(stress),
        eps_E=error.cells,
    )  # fmt: skip
    contacts = [(t.contact.name, *_whole(admissible, t)) for t in admissible.tractions]

    def write() -> None:
        grid = _grid(body["points"], body["cells"])
        grid.point_data["displacement"] = body["u"]
        grid.cell_data.update(cells)
        grid.save(Path(folder) / "body.vtu")
        for name, traction, x in contacts:
            surface = _grid(x.reshape(-1, 3), np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2]))
            values = traction.values.reshape(-1, model.d)
            surface.point_data["traction"] = np.pad(values, ((0, 0), (0, 3 - model.d)))
            surface.point_data["pressure"] = -traction.normal.ravel()
            surface.point_data["friction"] = traction.friction.ravel()
            surface.cell_data["status"] = contact_status(traction)
            surface.save(Path(folder) / f"contact_{name}.vtu")

    _on_root(model.comm, Path(folder) / "body.vtu", write)


def mean_stress(admissible: Admissible) -> np.ndarray:
    """Mean of sigma^ in each owned cell [force/area], with the stress out of plane, shape (owned, 3, 3); collective."""
    model = admissible.solution.model
    return _spatial(model, tensors(admissible.stress.mean(axis=(1, 2)), model.d))


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Von Mises stress ``sqrt(3/2) |dev sigma|`` of tensors of shape (n, 3, 3) [force/area], shape (n,)."""
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    return np.sqrt(1.5) * np.linalg.norm(deviator, axis=(1, 2))


def _spatial(model: Model, stress: np.ndarray) -> np.ndarray:
    """Stresses of owned cells as tensors of space: plane strain has a stress out of plane, shape (owned, 3, 3)."""
    d, material = model.d, model.scene.material
    full = np.zeros((len(stress), 3, 3))
    full[:, :d, :d] = stress
    if d == 2 and isinstance(material, Elastic) and material.hypothesis == "plane strain":
        cells = np.arange(len(stress), dtype=np.int32)
        nu = evaluate(model.parameters["nu"], model.domain, np.full((1, d), 1 / (d + 1)), cells)[:, 0]
        full[:, 2, 2] = nu * np.trace(stress, axis1=1, axis2=2)
    return full


# -- gathering -----------------------------------------------------------------------------------------------------


def _on_root(comm: MPI.Comm, path: str | Path, draw: Callable[[], None]) -> None:
    """Draw on rank 0, with the folder made, the fonts set and VTK's remarks on missing displays silenced."""
    error: Exception | None = None
    if comm.rank == 0:
        from matplotlib import rc_context  # noqa: PLC0415

        try:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            with rc_context(STYLE):
                draw()
        except Exception as reason:  # to be raised on all ranks
            error = reason
    raise_together(comm, error)


def _gathered(comm: MPI.Comm, **arrays: np.ndarray) -> dict[str, np.ndarray]:
    """Arrays of all ranks one after the other, on rank 0; nothing elsewhere; collective."""
    parts = comm.gather(arrays)
    return {name: np.concatenate([part[name] for part in parts]) for name in arrays} if parts else {}


def _body(domain: Domain) -> dict[str, np.ndarray]:
    """Owned points (n, 3) and owned cells (m, d+1) by global point numbers."""
    geometry = domain.mesh.geometry
    nodes, cells = geometry.index_map(), geometry.dofmaps[0][: domain.owned_cells]
    numbers = nodes.local_to_global(np.ascontiguousarray(cells).ravel()).reshape(cells.shape)
    return {"points": geometry.x[: nodes.size_local].copy(), "cells": numbers}


def _nodal(admissible: Admissible) -> np.ndarray:
    """u^ at the owned points, in the order of :func:`_body`, shape (n, 3)."""
    model = admissible.solution.model
    geometry = model.mesh.geometry
    u = np.zeros_like(geometry.x)
    u[geometry.dofmaps[0].ravel(), : model.d] = admissible.displacement.x.array.reshape(-1, model.d)[model.nodes.ravel()]
    return u[: geometry.index_map().size_local]


def _whole(admissible: Admissible, traction: ContactTraction) -> tuple[ContactTraction, np.ndarray]:
    """The traction on the facets of all ranks with their corners (n, d, 3), on rank 0; nothing elsewhere."""
    model, contact = admissible.solution.model, traction.contact
    own = contact.facets[:, 0] < model.domain.owned_cells
    x = model.V.tabulate_dof_coordinates()[traction.nodes[own]]
    parts = {name: getattr(traction, name)[own] for name in ("nodes", "area", "values", "friction")}
    parts = _gathered(model.comm, **parts, x=x)
    return replace(traction, **{k: v for k, v in parts.items() if k != "x"}), parts.get("x", x[:0])


# -- drawing, on rank 0 --------------------------------------------------------------------------------------------


def _figure(width: float, height: float) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure
