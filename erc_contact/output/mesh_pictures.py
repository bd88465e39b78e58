"""Draw a picture of the meshes of a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.percent import percent
from erc_contact.mesh.domain import Domain
from erc_contact.output.bodies import skin_of
from erc_contact.output.drawing import draw_figure, new_figure, only_in_2d
from erc_contact.output.files import gathered
from erc_contact.output.gathered import body_mesh
from erc_contact.output.views import SPACE, WORDS, seen, show, views_of


def draw_meshes(
    meshes: Sequence[tuple[Domain, np.ndarray]], path: str | Path | None = None, *, ax: Any = None
) -> Any:
    """Draw meshes of a sequence side by side; collective.

    They are the last, the first and some between. There are at most six of them in 2D,
    and three in 3D.

    Args:
        meshes: Pairs of a domain and eps_E of its owned cells, as in
            ``History.meshes``.
        path: Picture file, or None.
        ax: Axes of matplotlib to draw on, in 2D: one for each mesh that is drawn. By
            default those of a new figure.

    Returns:
        The axes on rank 0, None on the other ranks.

    Raises:
        InputError: If there is no mesh, or axes are given in 3D.
    """
    if not meshes:
        raise InputError(
            "draw_meshes: no mesh is given; give pairs (domain, eps_E), as in history.meshes."
        )
    comm, dim = meshes[0][0].mesh.comm, meshes[0][0].dim
    most = comm.bcast((6 if dim == 2 else 3) if ax is None else np.size(ax))
    chosen = [
        meshes[i] for i in np.unique(np.linspace(len(meshes) - 1, 0, most).round().astype(int))
    ]
    bodies = [(gathered(comm, **body_mesh(domain)), domain.cells) for domain, _ in chosen]
    errors = [
        float(np.sqrt(comm.allreduce(float(np.sum(cells**2)), MPI.SUM))) for _, cells in chosen
    ]

    def draw(ax: Any) -> np.ndarray:
        only_in_2d("draw_meshes", ax, dim)
        widths = np.clip(
            [35 / np.sqrt(cells) for _, cells in bodies], 0.4, 1.2
        )  # thin lines on fine meshes
        skins = [skin_of(**body, d=dim) for body, _ in bodies]
        shown = [
            [
                skin.faces(skin.points, color="#dce6f0"),
                skin.edges(skin.points, color="#1f2d3d", line_width=width),
            ]
            for skin, width in zip(skins, widths, strict=True)
        ]
        views, many = list(views_of(dim, np.eye(3)[2]).values()), len(chosen)
        ratio = np.divide(*np.ptp(seen(shown[0], views[0]), axis=0)[:2])
        panels = np.ravel(_panels(ratio, many, dim) if ax is None else ax)
        for number, (panel, (view, parts)) in enumerate(
            zip(panels, ((view, parts) for view in views for parts in shown), strict=False)
        ):
            show(panel, parts, view)
            if ax is None:
                panel.label_outer(remove_inner_ticks=True)
            if number < many:
                between = ", " if ratio > 0.8 else "\n"
                words = f"{bodies[number][1]} cells{between}eps = {percent(errors[number], 3)}"
                panel.set_title(words, fontsize=10)
        for panel in panels[len(views) * many :]:
            panel.set_axis_off()
        return panels

    return draw_figure(comm, path, ax, draw)


def _panels(ratio: float, many: int, dim: int) -> Any:
    """Make axes of a new figure for meshes with a width over height of ``ratio``."""
    shapes = (
        [(-(-many // columns), columns) for columns in range(1, many + 1)]
        if dim == 2
        else [(2, many)]
    )
    rows, columns = min(
        shapes, key=lambda s: abs(np.log(ratio * s[1] / s[0] / 2)) + s[0] * s[1] - many
    )
    height = min(5.5, (9.0 if dim == 2 else SPACE) / (ratio * columns), 9.0 / rows)
    wide, high = max(ratio * height, 1.2) + WORDS * (dim - 2), height + 0.5 * (dim - 1)
    figure = new_figure(wide * columns + 0.6, high * rows + 0.5, "compressed")
    figure.get_layout_engine().set(w_pad=0.12)
    return figure.subplots(rows, columns, squeeze=False, sharex=dim == 2, sharey=dim == 2)
