"""Draw figures and an animation of a loading history."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.base.progress import at, stage
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.runs import LoadingHistory
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.status import OPEN
from erc_contact.output.deformed import draw_deformed, magnification
from erc_contact.output.drawing import STATUS_COLOURS, STATUS_NAMES, tangents
from erc_contact.output.foundations import round_factor
from erc_contact.output.placing import panels
from namedmesh.base.names import in_picture
from namedmesh.pictures import COLOUR_CYCLE, draw_figure, on_root
from namedmesh.simplex import lagrange, rule

ZONE_POINTS = 400
"""Number of points along a contact in the picture of its zones."""
FRAMES = 60
"""Greatest number of frames of an animation."""
PANEL_SIZE = (3.6, 3.3)
"""Width and height of the axes of energies [inches]."""
LOOP_SIZE = (4.4, 3.6)
"""Width and height of the axes of a loop [inches]."""
STILL = 1e-3
"""Share of the way of the part that moves most, below which a part stands still [-]."""
HELD_ALONG = 0.5
"""Part of a unit vector that a support holds where it moves along it [-]."""
ZONES_SIZE = (5.7, 3.2)
"""Width and height of the axes of zones [inches]."""
STORES = {
    "work": "work of loads and supports",
    "stored": "stored",
    "dissipated": "dissipated",
    "plastic_work": "plastic work",
}
"""Columns of energies, and their names in the picture."""
LINE: dict[str, Any] = {"ms": 3, "lw": 1.2}
"""Size of the marks and width of the lines of curves."""


def plot_energies(
    history: LoadingHistory, path: str | Path | None = None, *, ax: Any = None
) -> Any:
    """Draw work, strain energy, dissipation and plastic work in time; collective.

    Beside them is the energy residual, what is left of their balance.

    Args:
        history: The history.
        path: Picture file, or None.
        ax: Two axes of matplotlib to draw on; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.
    """
    comm = history.errors[0].domain.comm

    def draw(ax: Any) -> np.ndarray:
        time = history.column("time")
        with panels("plot_energies", ax, [PANEL_SIZE, PANEL_SIZE]) as row:
            left, right = row
            for panel in row:
                panel.set_prop_cycle(color=COLOUR_CYCLE)
            for name, label in STORES.items():
                energy = history.column(name)
                # Plastic work is a curve where there is some.
                if name != "plastic_work" or energy.any():
                    left.plot(time, energy, "o-", label=label, **LINE)
            imbalance = history.column("imbalance")
            right.plot(time, imbalance, "o-", label="of the error on the meshes", **LINE)
            in_time = history.column("in_time")
            right.plot(time, in_time, "s-", label="of the steps in time", **LINE)
            left.set(xlabel="t", ylabel="energy [force length]")
            right.set(xlabel="t", ylabel="energy residual [force length]")
            for panel in row:
                # above the axes, where it hides no curve
                panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.04), frameon=False)
                panel.grid(color="0.9", lw=0.6)
        return row

    return draw_figure(comm, path, ax, draw, history.error.solution.scene.label)


def plot_loop(
    history: LoadingHistory,
    contact: str,
    path: str | Path | None = None,
    part: str | None = None,
    *,
    ax: Any = None,
) -> Any:
    """Draw the shear force of a contact against a displacement; collective.

    A boundary part has the displacement. Force and displacement are taken in the
    tangential direction in which the force changes most.

    Args:
        history: The history.
        contact: Name of the contact.
        path: Picture file, or None.
        part: Name of the boundary part; by default the first one that a support moves
            along the shear, or the loaded one whose load changes most along it, or else
            the contact.
        ax: Axes of matplotlib to draw on; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.

    Raises:
        InputError: If no contact or no part has this name.
    """
    model = history.errors[0].model
    force = history.force(contact)
    bound = model.contact(contact)
    trace = bound.trace
    facing = bound.name if contact == bound.against else bound.against
    facing_name = facing or f"the foundation of {contact}"
    total = model.space.comm.allreduce(trace.direction[trace.here.owned].sum(axis=0))
    # Around a closed contact the normals sum to zero.
    along = tangents(total / (np.linalg.norm(total) or 1.0))
    changes = np.ptp(force @ along.T, axis=0)
    direction = along[changes.argmax()]
    shear = force @ direction
    where = _driven_part(history, contact, direction) if part is None else part
    moved = _way(history, where, direction)

    def draw(ax: Any) -> Any:
        with panels("plot_loop", ax, [LOOP_SIZE]) as (axes,):
            # The force on what the body touches is the opposite of that on the body.
            axes.plot(moved, -shear, "o-", color=COLOUR_CYCLE[0], **LINE)
            axes.set(
                xlabel=f"mean displacement of {in_picture(where)} [length]",
                ylabel=f"shear on {in_picture(facing_name)} [force]",
            )
            if ax is None:
                axes.locator_params(axis="x", nbins=5)
            axes.grid(color="0.9", lw=0.6)
        return axes

    return draw_figure(model.space.comm, path, ax, draw, model.scene.label)


def plot_zones(
    history: LoadingHistory, contact: str, path: str | Path | None = None, *, ax: Any = None
) -> Any:
    """Draw what of a contact in 2D is open, slips or sticks; collective.

    This is shown along the contact and in time.

    Args:
        history: The history.
        contact: Name of the contact.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on; by default of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.

    Raises:
        InputError: If no contact has this name, or the body is in 3D.
    """
    if history.errors[0].domain.dim != 2:
        raise InputError(
            "plot_zones: the picture of zones along a contact and in time is for bodies in 2D."
        )
    comm = history.errors[0].domain.comm
    profiles = [error.profile(contact) for error in history.errors]

    def draw(ax: Any) -> Any:
        from matplotlib.colors import ListedColormap  # noqa: PLC0415
        from matplotlib.patches import Patch  # noqa: PLC0415

        time = history.column("time")
        length = max(profile["s"].max() for profile in profiles)
        shares = (np.arange(ZONE_POINTS) + 0.5) / ZONE_POINTS
        status = np.array([_status_at(profile, shares) for profile in profiles])
        # Each state is shown up to the middles between its time and the next ones.
        middles = 0.5 * (time[1:] + time[:-1])
        times = np.concatenate([time[:1], middles, time[-1:]])
        if len(time) == 1:
            times = time[0] + np.array([-0.5, 0.5])
        places = np.linspace(0, length, ZONE_POINTS + 1)
        colours = {"cmap": ListedColormap(STATUS_COLOURS), "vmin": -0.5, "vmax": 3.5}
        patches = []
        for code in np.unique(status):
            patches.append(Patch(fc=STATUS_COLOURS[code], ec="0.6", label=STATUS_NAMES[code]))
        where = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
        with panels("plot_zones", ax, [ZONES_SIZE]) as (axes,):
            axes.pcolormesh(times, places, status.T, **colours)
            axes.set(xlabel="t", ylabel=f"s along {in_picture(contact)} [length]")
            # What is ever closed is shown with as much beside it.
            closed = np.flatnonzero(np.any(status != OPEN, axis=0))
            if len(closed):
                low, high = places[closed[0]], places[closed[-1] + 1]
                beside = high - low
                axes.set_ylim(max(low - beside, 0.0), min(high + beside, length))
            axes.legend(handles=patches, ncols=len(patches), frameon=False, **where)
        return axes

    return draw_figure(comm, path, ax, draw, history.error.solution.scene.label)


def animate(history: LoadingHistory, path: str | Path, seconds: float = 0.15) -> None:
    """Write a gif of the deformed body; collective.

    It has the same magnification at all times.

    Args:
        history: The history.
        path: The file.
        seconds: Time for which each frame is shown [s].
    """
    comm = history.errors[0].domain.comm
    places = np.unique(np.linspace(0, len(history.errors) - 1, FRAMES).round().astype(int))
    shown = [history.errors[i] for i in places]
    factor = round_factor(min(magnification(error) for error in shown))
    folder = Path(comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None))
    # Rank 0 draws, but all ranks know the names.
    frames = [folder / f"{number:04d}.png" for number in range(len(shown))]
    with stage(comm, "animation"):
        for error, frame in zip(shown, frames, strict=True):
            at(comm, f"frame {int(frame.stem) + 1} of {len(frames)}")
            draw_deformed(error, frame, factor)

    def write() -> None:
        from PIL import Image  # noqa: PLC0415 - comes with matplotlib

        images = [Image.open(frame).convert("RGB") for frame in frames]
        # Frames differ by some pixels, as their words do; a gif has one size.
        width = min(image.size[0] for image in images) // 2
        height = min(image.size[1] for image in images) // 2
        first, *others = [image.resize((width, height)).quantize(128) for image in images]
        milliseconds = round(1000 * seconds)
        first.save(path, save_all=True, append_images=others, duration=milliseconds, loop=0)
        for frame in frames:
            frame.unlink()
        folder.rmdir()

    on_root(comm, path, write)


def moving_side(history: LoadingHistory, contact: ContactOnMesh) -> str:
    """Return the name of the side of a contact that moves more; collective.

    A contact with a foundation has one side.
    """
    ways = {}
    for side in contact.side_names:
        means = [_mean_displacement(error, side) for error in history.errors]
        ways[side] = np.linalg.norm(np.ptp(means, axis=0))
    # round-off must not choose between sides that move alike
    least = (1 - STILL) * max(ways.values())
    return next(side for side, way in ways.items() if way >= least)


def _driven_part(history: LoadingHistory, contact: str, direction: np.ndarray) -> str:
    """Return the part that a support or a load moves along a direction; collective.

    Of two bodies one may be clamped, and its support named first. A roller follows what
    is moved elsewhere.
    """
    model = history.errors[0].model
    scene = history.errors[0].solution.scene
    moved: list[str] = []
    rollers: list[str] = []
    for support, (_, components) in zip(scene.supports, model.fixed_facets, strict=True):
        holds = np.linalg.norm(direction[components]) > HELD_ALONG
        (moved if holds else rollers).append(support.facets)
    # A body force has no facets.
    loaded = [load.facets for load in scene.loads if load.facets is not None]
    changes = {}
    for part in loaded:
        forces = [error.force(part).force @ direction for error in history.errors]
        changes[part] = np.ptp(forces)
    loaded.sort(key=lambda part: -changes[part])
    parts = [*moved, *loaded, *rollers]
    # Sides of a tied joint are no parts of its mesh.
    if contact in model.domain.names or not parts:
        parts.append(contact)
    ways = {part: np.ptp(_way(history, part, direction)) for part in parts}
    least = STILL * max(ways.values())
    return next(part for part, way in ways.items() if way >= least)


def _way(history: LoadingHistory, part: str, direction: np.ndarray) -> np.ndarray:
    """Return the mean of u^ on a part along a direction at each time; collective."""
    return np.array([_mean_displacement(error, part) @ direction for error in history.errors])


def _mean_displacement(error: ConstitutiveError, part: str) -> np.ndarray:
    """Compute the mean of u^ on a boundary part [length], shape (d,); collective."""
    space = error.model.space
    facets = space.domain.owned_facets(part)
    points, weights = rule(space.d - 1, space.degree + 1)
    displacement = error.admissible.displacement.x.array.reshape(-1, space.d)
    nodal = displacement[space.facet_nodes(facets)]
    at_points = np.matmul(lagrange(space.d - 1, space.degree, points), nodal)
    of_points = space.facet_weights(facets, points, weights)
    moved = np.einsum("fq,fqi->i", of_points, at_points)
    total = space.comm.allreduce(np.append(moved, of_points.sum()))
    return total[:-1] / total[-1]


def _status_at(profile: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Return the status at places along a contact, as shares of its length."""
    ends = profile["s"] / profile["s"].max()
    facet = np.searchsorted(ends, shares)
    return profile["status"][np.minimum(facet, len(ends) - 1)]
