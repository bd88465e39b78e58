"""Figures, files and an animation of a loading history."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.simplex import lagrange, rule
from erc_contact.output.curves import COLOURS, STATUS
from erc_contact.output.drawing import new_figure, save_figure, tangents
from erc_contact.output.files import gathered, on_root, vtk_cells
from erc_contact.output.gathered import body_nodes, nodal_displacement
from erc_contact.output.pictures import draw_deformed
from erc_contact.results.stresses import cell_stresses

ALONG = 400
"""Number of points along a contact in the picture of its zones."""
FRAMES = 60
"""Greatest number of frames of an animation."""


class History(Protocol):
    """A loading history, as far as it is drawn. An ``Evolution`` has these members."""

    @property
    def errors(self) -> tuple[ConstitutiveError, ...]:
        """The error at the end of each step."""

    def column(self, name: str) -> np.ndarray:
        """One number of each step: "time", "work", "dissipated", ..."""

    def force(self, contact: str) -> np.ndarray:
        """The resultant on a contact at the end of each step [force], shape (steps, d)."""


def plot_energies(history: History, path: str | Path) -> None:
    """Draw work, strain energy and dissipation against time, and what is left of their balance; collective."""
    comm = history.errors[0].domain.mesh.comm

    def draw() -> None:
        figure, time = new_figure(8.6, 3.9), history.column("time")
        left, right = figure.subplots(1, 2)
        for name, words in (("work", "work of loads and supports"), ("stored", "stored"), ("dissipated", "dissipated")):
            left.plot(time, history.column(name), "o-", ms=3, lw=1.2, label=words)
        right.plot(time, history.column("imbalance"), "o-", ms=3, lw=1.2, label="of the error on the meshes")
        right.plot(time, history.column("in_time"), "s-", ms=3, lw=1.2, label="of the steps in time")
        left.set(xlabel="t", ylabel="energy [force length]")
        right.set(xlabel="t", title="what the balance leaves [force length]")
        for axes in (left, right):
            axes.legend(loc="best", frameon=False)
            axes.grid(color="0.9", lw=0.6)
        save_figure(figure, path)

    on_root(comm, path, draw)


def plot_loop(history: History, contact: str, path: str | Path, part: str | None = None) -> None:
    """Draw the shear force of a contact against the displacement of a boundary part; collective.

    Both are taken in the tangential direction in which the force changes most.

    Args:
        history: The history.
        contact: Name of the contact.
        path: Picture file.
        part: Name of the boundary part; by default the first one with a support or a load.

    Raises:
        InputError: If no contact or no part has this name, or there is neither support nor load on the boundary.
    """
    scene, model = history.errors[0].solution.scene, history.errors[0].solution.model
    parts = [support.facets for support in scene.supports]
    parts += [load.facets for load in scene.loads if load.facets is not None]
    if part is None and not parts:
        raise InputError("plot_loop: the scene has neither support nor load on its boundary; name a part.")
    where = parts[0] if part is None else part
    force = history.force(contact)
    n = model.contact(contact).direction
    total = model.comm.allreduce(n[model.owned(model.contact(contact).facets)].sum(axis=0))
    along = tangents(total / (np.linalg.norm(total) or 1.0))
    chosen = along[np.ptp(force @ along.T, axis=0).argmax()]
    moved = np.array([_mean_displacement(error, where) @ chosen for error in history.errors])

    def draw() -> None:
        figure = new_figure(5.2, 4.2)
        axes = figure.subplots()
        axes.plot(moved, -(force @ chosen), "o-", ms=3, lw=1.2)
        axes.set(
            xlabel=f"mean displacement of {where} [length]", ylabel=f"shear on the foundation of {contact} [force]"
        )
        axes.grid(color="0.9", lw=0.6)
        save_figure(figure, path)

    on_root(model.comm, path, draw)


def plot_zones(history: History, contact: str, path: str | Path) -> None:
    """Draw which parts of a contact in 2D are open, slip or stick, along the contact and in time; collective.

    Raises:
        InputError: If no contact has this name, or the body is in 3D.
    """
    if history.errors[0].domain.dim != 2:
        raise InputError("plot_zones: the picture of zones along a contact and in time is for bodies in 2D.")
    comm = history.errors[0].domain.mesh.comm
    profiles = [error.profile(contact) for error in history.errors]

    def draw() -> None:
        from matplotlib.colors import ListedColormap  # noqa: PLC0415
        from matplotlib.patches import Patch  # noqa: PLC0415

        time, longest = history.column("time"), max(profile["s"].max() for profile in profiles)
        at = (np.arange(ALONG) + 0.5) / ALONG
        status = np.array([_status_at(profile, at) for profile in profiles])
        first = np.diff(time).min(initial=np.ptp(time) or 1.0)  # the first state has no length of its own
        edges = np.append(time[0] - first, time)
        figure = new_figure(6.4, 4.0)
        axes = figure.subplots()
        colours = ListedColormap(COLOURS)
        axes.pcolormesh(edges, np.linspace(0, longest, ALONG + 1), status.T, cmap=colours, vmin=-0.5, vmax=2.5)
        axes.set(xlabel="t", ylabel=f"s along {contact} [length]")
        patches = [Patch(color=c, label=name) for c, name in zip(COLOURS, STATUS, strict=True)]
        figure.legend(handles=patches, loc="outside upper center", ncols=3, frameon=False)
        save_figure(figure, path)

    on_root(comm, path, draw)


def write_series(history: History, path: str | Path) -> None:
    """Write the fields of all steps to one VTKHDF file with times, which opens in ParaView as it is; collective.

    It has the displacement u^ at the nodes; in the cells eps_E, the mean of sigma^, its von Mises stress, and that of
    the finite elements, with the names of :func:`erc_contact.output.write_fields`. A mesh of several steps is written
    once.

    Args:
        history: The history.
        path: The file.

    Raises:
        OSError: If the file cannot be written.
    """
    comm = history.errors[0].domain.mesh.comm
    meshes: list[dict[str, np.ndarray]] = []
    which, points, cells = [], [], []
    last: Any = None
    for error in history.errors:
        pair, model = error.admissible, error.solution.model
        if error.domain is not last:
            meshes.append(gathered(comm, **body_nodes(model)))
        last = error.domain
        which.append(len(meshes) - 1)
        points.append(gathered(comm, displacement=nodal_displacement(pair)))
        cells.append(gathered(comm, **cell_stresses(pair), eps_E=error.indicators))

    def write() -> None:
        _write_series(Path(path), history.column("time"), meshes, which, (points, cells), history.errors[0].domain.dim)

    on_root(comm, path, write)


def animate(history: History, path: str | Path, seconds: float = 0.15) -> None:
    """Write a gif of the deformed body, with the same magnification at all times; collective.

    Args:
        history: The history.
        path: The file.
        seconds: How long each frame is shown [s].
    """
    comm, size = history.errors[0].domain.mesh.comm, history.errors[0].domain.extent
    places = np.unique(np.linspace(0, len(history.errors) - 1, FRAMES).round().astype(int))
    shown = [history.errors[i] for i in places]
    largest = max(float(error.maximum("displacement").value) for error in shown)
    factor = float(f"{0.06 * size / largest:.2g}") if 0 < largest < 0.05 * size else 1.0
    folder = Path(comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None))
    frames = [folder / f"{number:04d}.png" for number in range(len(shown))]
    for error, frame in zip(shown, frames, strict=True):
        draw_deformed(error, frame, factor)

    def write() -> None:
        from PIL import Image  # noqa: PLC0415 - comes with matplotlib

        images = [Image.open(frame).convert("RGB") for frame in frames]
        wide, high = (min(image.size[axis] for image in images) // 2 for axis in (0, 1))
        first, *rest = [image.resize((wide, high)).quantize(128) for image in images]
        first.save(path, save_all=True, append_images=rest, duration=round(1000 * seconds), loop=0)
        for frame in frames:
            frame.unlink()
        folder.rmdir()

    on_root(comm, path, write)


def _mean_displacement(error: ConstitutiveError, part: str) -> np.ndarray:
    """The mean of u^ on a boundary part [length], shape (d,); collective."""
    model = error.solution.model
    facets = model.domain.facets(part)
    facets = facets[model.owned(facets)]
    points, weights = rule(model.d - 1, model.degree)
    nodal = error.admissible.displacement.x.array.reshape(-1, model.d)[model.facet_nodes(facets)]
    means = weights @ np.matmul(lagrange(model.d - 1, model.degree, points), nodal)
    area = model.facet_areas(facets)
    total = model.comm.allreduce(np.append(area @ means, area.sum()))
    return total[:-1] / total[-1]


def _status_at(profile: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The status at places along a contact, as shares of its length."""
    share = profile["s"] / profile["s"].max()
    return profile["status"][np.minimum(np.searchsorted(share, at), len(share) - 1)]


def _write_series(
    path: Path,
    times: np.ndarray,
    meshes: Sequence[dict[str, np.ndarray]],
    which: Sequence[int],
    data: tuple[Sequence[dict[str, np.ndarray]], Sequence[dict[str, np.ndarray]]],
    d: int,
) -> None:
    """Write a VTKHDF file with several times.

    Args:
        path: The file.
        times: Times of the steps.
        meshes: Points and cells of each mesh.
        which: Number of the mesh of each step.
        data: Values at the points and in the cells of each step.
        d: Dimension of the cells.
    """
    import h5py  # noqa: PLC0415

    kinds = [vtk_cells(mesh["cells"], d) for mesh in meshes]
    counts = {
        "NumberOfPoints": np.array([len(mesh["points"]) for mesh in meshes]),
        "NumberOfCells": np.array([len(cells) for _, cells in kinds]),
        "NumberOfConnectivityIds": np.array([cells.size for _, cells in kinds]),
    }
    starts = {name: np.concatenate([[0], np.cumsum(of)[:-1]])[list(which)] for name, of in counts.items()}
    with h5py.File(path, "w") as file:
        vtk = file.create_group("VTKHDF")
        vtk.attrs["Version"], vtk.attrs["Type"] = (2, 0), np.bytes_("UnstructuredGrid")
        for name, of in counts.items():
            vtk[name] = of
        vtk["Points"] = np.concatenate([mesh["points"] for mesh in meshes])
        vtk["Connectivity"] = np.concatenate([cells.ravel() for _, cells in kinds])
        vtk["Offsets"] = np.concatenate([np.arange(0, cells.size + 1, cells.shape[1]) for _, cells in kinds])
        vtk["Types"] = np.concatenate([np.full(len(cells), kind, dtype=np.uint8) for kind, cells in kinds])
        steps = vtk.create_group("Steps")
        steps.attrs["NSteps"] = len(times)
        steps["Values"] = times
        steps["PartOffsets"] = np.array(which)
        steps["NumberOfParts"] = np.ones(len(times), dtype=int)
        steps["PointOffsets"] = starts["NumberOfPoints"]
        steps["CellOffsets"] = starts["NumberOfCells"][:, None]
        steps["ConnectivityIdOffsets"] = starts["NumberOfConnectivityIds"][:, None]
        for kind, values in zip(("PointData", "CellData"), data, strict=True):
            lengths = np.array([len(next(iter(of.values()))) for of in values])
            for name in values[0]:
                vtk[f"{kind}/{name}"] = np.concatenate([of[name] for of in values])
                steps[f"{kind}Offsets/{name}"] = np.concatenate([[0], np.cumsum(lengths)[:-1]])
