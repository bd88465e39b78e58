"""Draw a picture of the meshes of a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.error.runs import AdaptiveRun, MeshErrors
from erc_contact.output.gathered import letters_of
from namedmesh import Domain
from namedmesh.base.percent import percent
from namedmesh.base.ranks import gather_rows
from namedmesh.pictures import (
    SPACE,
    WORDS,
    ShownPart,
    body_mesh,
    corners_seen,
    draw_figure,
    new_figure,
    only_in_2d,
    show,
    skin_of,
    views_of,
)

MOST_MESHES = {2: 6, 3: 3}
"""Greatest number of meshes in a new figure, for each dimension."""


def draw_meshes(
    meshes: AdaptiveRun | MeshErrors, path: str | Path | None = None, *, ax: Any = None
) -> Any:
    """Draw meshes of a sequence side by side; collective.

    They are the last, the first and some between. There are at most six of them in 2D,
    and three in 3D.

    Args:
        meshes: A ``History``, or pairs of a domain and eps_E of its owned cells, as in
            ``History.meshes``. A history knows whether its coordinates are r and z.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, in 2D: one for each mesh that is drawn. By
            default they belong to a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.

    Raises:
        InputError: If there is no mesh, or axes are given in 3D.
    """
    letters = "xyz"
    label = None
    if not isinstance(meshes, Sequence):
        letters = letters_of(meshes.error.model.space)
        label = meshes.error.model.scene.label
        meshes = meshes.meshes
    if not meshes:
        raise InputError("draw_meshes: no mesh is given; give a history, or pairs (domain, eps_E).")
    comm, dim = meshes[0][0].comm, meshes[0][0].dim
    greatest = MOST_MESHES[dim] if ax is None else np.size(ax)
    # Only rank 0 has the user's axes.
    chosen = _choose_meshes(meshes, comm.bcast(greatest))
    bodies = []
    titles = []
    for domain, eps in chosen:
        bodies.append(gather_rows(comm, **body_mesh(domain)))
        square = comm.allreduce(float(np.sum(eps**2)), MPI.SUM)
        titles.append((f"{domain.cells} cells", f"error {percent(float(np.sqrt(square)), 3)}"))

    def draw(ax: Any) -> np.ndarray:
        only_in_2d("draw_meshes", ax, dim)
        shown = []
        for body, (domain, _) in zip(bodies, chosen, strict=True):
            shown.append(_parts_of(body, domain.cells, dim))
        views = list(views_of(dim, np.eye(3)[2]).values())
        count = len(chosen)
        width, height = np.ptp(corners_seen(shown[0], views[0]), axis=0)[:2]
        ratio = width / height
        panels = np.ravel(_panels(ratio, count, dim) if ax is None else ax)
        # Each view has a row, with all meshes side by side.
        pictures = [(parts, view) for view in views for parts in shown]
        used = panels[: len(pictures)]
        show(used, pictures, letters)
        if ax is None:
            for panel in used:
                panel.label_outer(remove_inner_ticks=True)
        between = ", " if ratio > 0.8 else "\n"
        for panel, words in zip(panels, titles, strict=False):
            panel.set_title(between.join(words), fontsize=10)
        for panel in panels[len(pictures) :]:
            panel.set_axis_off()
        return panels

    return draw_figure(comm, path, ax, draw, label)


def _choose_meshes(meshes: MeshErrors, greatest: int) -> list[tuple[Domain, np.ndarray]]:
    """Choose the last mesh, the first and some between, at most so many of them."""
    places = np.linspace(len(meshes) - 1, 0, greatest).round().astype(int)
    return [meshes[place] for place in np.unique(places)]


def _parts_of(body: dict[str, np.ndarray], cells: int, dim: int) -> list[ShownPart]:
    """Draw the elements of a mesh and their edges."""
    skin = skin_of(**body, d=dim)
    # Lines are thin on fine meshes.
    width = float(np.clip(35 / np.sqrt(cells), 0.4, 1.2))
    faces = skin.faces(skin.points, color="#dce6f0")
    return [faces, skin.edges(skin.points, color="#1f2d3d", line_width=width)]


def _panels(ratio: float, count: int, dim: int) -> Any:
    """Make axes of a new figure for meshes with a width over height of ``ratio``."""
    rows, columns = 2, count
    if dim == 2:
        # The figure is about twice as wide as high, with few empty places.
        shapes = [(-(-count // columns), columns) for columns in range(1, count + 1)]
        rows, columns = min(shapes, key=lambda shape: _badness(ratio, count, *shape))
    widest = 9.0 if dim == 2 else SPACE
    height = min(5.5, widest / (ratio * columns), 9.0 / rows)
    wide = max(ratio * height, 1.2) + WORDS * (dim - 2)
    high = height + 0.5 * (dim - 1)
    figure = new_figure(wide * columns + 0.6, high * rows + 0.5, "compressed")
    figure.get_layout_engine().set(w_pad=0.12)
    is_flat = dim == 2
    return figure.subplots(rows, columns, squeeze=False, sharex=is_flat, sharey=is_flat)


def _badness(ratio: float, count: int, rows: int, columns: int) -> float:
    """Tell how far rows and columns are from a figure of 2 to 1 that is full [-]."""
    distance = abs(np.log(ratio * columns / rows / 2))
    return float(distance + rows * columns - count)
