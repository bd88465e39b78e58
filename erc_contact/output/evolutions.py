"""Draw figures and an animation of a loading history."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.base.progress import at, stage
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.mesh.simplex import lagrange, rule
from erc_contact.output.contact_plots import COLOURS, STATUS
from erc_contact.output.deformed import draw_deformed, magnification
from erc_contact.output.drawing import COLOUR_CYCLE, draw_figure, new_figure, panels_of, tangents
from erc_contact.output.files import on_root
from erc_contact.output.foundations import rounded
from erc_contact.output.series import LoadingHistory

ALONG = 400
"""Number of points along a contact in the picture of its zones."""
FRAMES = 60
"""Greatest number of frames of an animation."""


def plot_energies(
    history: LoadingHistory, path: str | Path | None = None, *, ax: Any = None
) -> Any:
    """Draw work, strain energy and dissipation against time; collective.

    Beside them is what is left of their balance.

    Args:
        history: The history.
        path: Picture file, or None.
        ax: Two axes of matplotlib to draw on; by default those of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.
    """
    comm = history.errors[0].domain.mesh.comm

    def draw(ax: Any) -> np.ndarray:
        time = history.column("time")
        left, right = panels = panels_of(
            new_figure(8.6, 3.9).subplots(1, 2) if ax is None else ax, 2, "plot_energies"
        )
        for axes in panels:
            axes.set_prop_cycle(color=COLOUR_CYCLE)
        for name, words in (
            ("work", "work of loads and supports"),
            ("stored", "stored"),
            ("dissipated", "dissipated"),
        ):
            left.plot(time, history.column(name), "o-", ms=3, lw=1.2, label=words)
        right.plot(
            time,
            history.column("imbalance"),
            "o-",
            ms=3,
            lw=1.2,
            label="of the error on the meshes",
        )
        right.plot(
            time, history.column("in_time"), "s-", ms=3, lw=1.2, label="of the steps in time"
        )
        left.set(xlabel="t", ylabel="energy [force length]")
        right.set(xlabel="t", ylabel="what the balance leaves [force length]")
        for axes in panels:
            axes.legend(loc="best", frameon=False)
            axes.grid(color="0.9", lw=0.6)
        return panels

    return draw_figure(comm, path, ax, draw)


def plot_loop(
    history: LoadingHistory,
    contact: str,
    path: str | Path | None = None,
    part: str | None = None,
    *,
    ax: Any = None,
) -> Any:
    """Draw the shear force of a contact against a displacement; collective.

    The displacement is that of a boundary part. Both are taken in the tangential
    direction in which the force changes most.

    Args:
        history: The history.
        contact: Name of the contact.
        path: Picture file, or None.
        part: Name of the boundary part; by default the first one with a support or a
            load, or else the contact.
        ax: Axes of matplotlib to draw on; by default those of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.

    Raises:
        InputError: If no contact or no part has this name.
    """
    scene, model = history.errors[0].solution.scene, history.errors[0].model
    parts = [support.facets for support in scene.supports]
    parts += [load.facets for load in scene.loads if load.facets is not None]
    where = [*parts, contact][0] if part is None else part
    force = history.force(contact)
    trace = model.contact(contact).trace
    total = model.comm.allreduce(trace.direction[trace.here.owned].sum(axis=0))
    along = tangents(total / (np.linalg.norm(total) or 1.0))
    chosen = along[np.ptp(force @ along.T, axis=0).argmax()]
    moved = np.array([_mean_displacement(error, where) @ chosen for error in history.errors])

    def draw(ax: Any) -> Any:
        axes = new_figure(5.2, 4.2).subplots() if ax is None else ax
        axes.plot(moved, -(force @ chosen), "o-", ms=3, lw=1.2, color=COLOUR_CYCLE[0])
        axes.set(
            xlabel=f"mean displacement of {where} [length]",
            ylabel=f"shear on the foundation of {contact} [force]",
        )
        axes.grid(color="0.9", lw=0.6)
        return axes

    return draw_figure(model.comm, path, ax, draw)


def plot_zones(
    history: LoadingHistory, contact: str, path: str | Path | None = None, *, ax: Any = None
) -> Any:
    """Draw what of a contact in 2D is open, slips or sticks; collective.

    This is shown along the contact and in time.

    Args:
        history: The history.
        contact: Name of the contact.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on; by default those of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.

    Raises:
        InputError: If no contact has this name, or the body is in 3D.
    """
    if history.errors[0].domain.dim != 2:
        raise InputError(
            "plot_zones: the picture of zones along a contact and in time is for bodies in 2D."
        )
    comm = history.errors[0].domain.mesh.comm
    profiles = [error.profile(contact) for error in history.errors]

    def draw(ax: Any) -> Any:
        from matplotlib.colors import ListedColormap  # noqa: PLC0415
        from matplotlib.patches import Patch  # noqa: PLC0415

        time, longest = history.column("time"), max(profile["s"].max() for profile in profiles)
        at = (np.arange(ALONG) + 0.5) / ALONG
        status = np.array([_status_at(profile, at) for profile in profiles])
        first = np.diff(time).min(
            initial=np.ptp(time) or 1.0
        )  # the first state has no length of its own
        edges = np.append(time[0] - first, time)
        axes = new_figure(6.4, 4.0).subplots() if ax is None else ax
        colours = ListedColormap(COLOURS)
        axes.pcolormesh(
            edges, np.linspace(0, longest, ALONG + 1), status.T, cmap=colours, vmin=-0.5, vmax=2.5
        )
        axes.set(xlabel="t", ylabel=f"s along {contact} [length]")
        patches = [
            Patch(fc=c, ec="0.6", label=name) for c, name in zip(COLOURS, STATUS, strict=True)
        ]
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
        axes.legend(handles=patches, ncols=3, frameon=False, **place)
        return axes

    return draw_figure(comm, path, ax, draw)


def animate(history: LoadingHistory, path: str | Path, seconds: float = 0.15) -> None:
    """Write a gif of the deformed body; collective.

    It has the same magnification at all times.

    Args:
        history: The history.
        path: The file.
        seconds: How long each frame is shown [s].
    """
    comm = history.errors[0].domain.mesh.comm
    places = np.unique(np.linspace(0, len(history.errors) - 1, FRAMES).round().astype(int))
    shown = [history.errors[i] for i in places]
    factor = rounded(min(magnification(error) for error in shown))
    folder = Path(comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None))
    frames = [folder / f"{number:04d}.png" for number in range(len(shown))]
    with stage(comm, "animation"):
        for error, frame in zip(shown, frames, strict=True):
            at(comm, f"frame {int(frame.stem) + 1} of {len(frames)}")
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
    """Compute the mean of u^ on a boundary part [length], shape (d,); collective."""
    model = error.model
    facets = model.domain.owned_facets(part)
    points, weights = rule(model.d - 1, model.degree)
    nodal = error.admissible.displacement.x.array.reshape(-1, model.d)[model.facet_nodes(facets)]
    means = weights @ np.matmul(lagrange(model.d - 1, model.degree, points), nodal)
    area = model.facet_areas(facets)
    total = model.comm.allreduce(np.append(area @ means, area.sum()))
    return total[:-1] / total[-1]


def _status_at(profile: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the status at places along a contact, as shares of its length."""
    share = profile["s"] / profile["s"].max()
    return profile["status"][np.minimum(np.searchsorted(share, at), len(share) - 1)]
