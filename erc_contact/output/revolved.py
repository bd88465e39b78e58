"""Draw an axisymmetric body in 3D: revolved about its axis, and cut open.

The elements of the half plane are seen on both faces of the cut. The edges of their
boundary are swept around the axis in steps. Triangles of degree 2 are four straight
ones.

Symbols: u^ admissible displacement, f number of triangles, q number of angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.runs import Run, error_of
from erc_contact.model.meridian import ON_AXIS
from erc_contact.output.deformed import (
    gather_mises,
    greatest_magnification,
    mises_on_skin,
    mises_scale,
    shift_of,
)
from erc_contact.output.drawing import only_turned
from erc_contact.output.files import save_grid
from erc_contact.output.foundations import round_factor
from erc_contact.output.gathered import whole_body
from erc_contact.output.maps import draw_map
from namedmesh.pictures import Skin, draw_figure, grid_of, on_root, skin_of, views_of
from namedmesh.simplex import node_vertices

STEP = 4.0
"""Greatest angle of a step around the axis [degrees]."""
EYE = 36.0
"""Angle around the axis at which the eye of a view from above is [degrees]."""
SIDES = np.array([[0, 1], [1, 2], [2, 0]])
"""Corners of the sides of a triangle."""
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
"""Corners of the halves of a rectangle."""
QUARTERS = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]])
"""Nodes of the quarters of a triangle of degree 2."""
FILE = ".vtkhdf"
"""Suffix of a file for ParaView."""


def draw_revolved(
    error: ConstitutiveError | Run,
    path: str | Path | None = None,
    angle: float = 270.0,
    factor: float | None = None,
) -> Any:
    """Draw a deformed axisymmetric body in 3D, cut open; collective.

    The axis is z, and the cut is open towards the eye. Colours are the von Mises stress
    of sigma^ with its hoop part, and displacements are magnified, as in
    :func:`draw_deformed`.

    Args:
        error: The error whose admissible pair is drawn, or a history.
        path: Picture file, or None. With the suffix ``.vtkhdf`` it is a file for
            ParaView instead: the surface before the deformation, with ``displacement``
            [length] at the points and ``von_mises`` [force/area] on the triangles.
        angle: Angle by which the half plane is revolved [degrees].
        factor: Magnification of u^ [-], by default as in :func:`draw_deformed`.

    Returns:
        The axes on rank 0; None on the other ranks, or if a file for ParaView is
        written.

    Raises:
        InputError: If the body is not axisymmetric, or the angle is not in (0, 360].
    """
    error = error_of(error)
    space = error.model.space
    only_turned("draw_revolved", space)
    if not 0.0 < angle <= 360.0:
        raise InputError(f"draw_revolved: angle is {angle!r}; give degrees in (0, 360].")
    size = space.domain.extent
    body, contacts = whole_body(error.admissible)
    cells = gather_mises(error.admissible)
    count = int(np.ceil(angle / STEP)) + 1
    angles = np.radians(EYE - angle / 2 + 180 + np.linspace(0, angle, count))

    def write() -> None:
        skin, mises = _revolve(body["points"], body, cells, angles)
        grid = grid_of(skin.points, skin.triangles, 2)
        grid.point_data["displacement"] = _around(body["u"], angles)
        grid.cell_data["von_mises"] = mises.mean(axis=1)
        save_grid(grid, Path(str(path)))

    def draw(ax: Any) -> Any:
        times = factor
        if times is None:
            times = round_factor(greatest_magnification(body, contacts, size))
        x = body["points"] + shift_of(body, contacts, times) + times * body["u"]
        skin, mises = _revolve(x, body, cells, angles)
        scale = mises_scale(cells, "von Mises stress [force/area]")
        views = {"": views_of(3, np.eye(3)[2])["from above"]}
        title = f"displacement × {times:g}"
        return draw_map(ax, skin, skin.points, mises, scale, views, title=title)

    if path is not None and Path(path).suffix == FILE:
        return on_root(space.comm, path, write)
    return draw_figure(space.comm, path, None, draw, error.model.scene.label)


def _around(vectors: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Turn vectors of the half plane, (r, z, 0), to angles around the axis.

    Args:
        vectors: The vectors, shape (n, 3).
        angles: The angles [rad], shape (q,).

    Returns:
        Their parts along x, y and z, angle by angle, shape (q n, 3).
    """
    r, z, _ = vectors.T
    x = np.outer(np.cos(angles), r)
    y = np.outer(np.sin(angles), r)
    return np.stack([x, y, np.broadcast_to(z, x.shape)], axis=-1).reshape(-1, 3)


def _revolve(
    x: np.ndarray,
    body: Mapping[str, np.ndarray],
    cells: Mapping[str, np.ndarray],
    angles: np.ndarray,
) -> tuple[Skin, np.ndarray]:
    """Make the surface of a revolved body; the numbers of its nodes go angle by angle.

    Args:
        x: Nodes in the half plane as they are drawn [length], shape (n, 3).
        body: The mesh of the half plane.
        cells: The von Mises stress in its cells, of :func:`gather_mises`.
        angles: Angles around the axis [rad], shape (q,).

    Returns:
        The surface, and the stress at the corners of its triangles [force/area], shape
        (f, 3).
    """
    flat = skin_of(body["points"], body["cells"], 2)
    mises = mises_on_skin(flat, cells)
    if mises.ndim == 1:
        mises = np.repeat(mises[:, None], 3, axis=1)
    triangles, lines = flat.triangles, flat.lines
    if triangles.shape[1] > 3:
        corners = node_vertices(2, 2)[QUARTERS]
        triangles = triangles[:, QUARTERS].reshape(-1, 3)
        mises = mises[:, corners].mean(axis=-1).reshape(-1, 3)
        lines = lines[:, [[0, 2], [2, 1]]].reshape(-1, 2)
    edges = triangles[:, SIDES].reshape(-1, 2)
    _, first, counts = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
    )
    radius = body["points"][edges, 0].max(axis=1)
    swept = first[(counts == 1) & (radius[first] > ON_AXIS * radius.max())]
    # A step sweeps a rectangle with the corners a, b, b', a' from an edge.
    rows = len(x) * np.arange(len(angles))[:, None, None]
    rectangles = np.concatenate([rows[:-1] + edges[swept], rows[1:] + edges[swept, ::-1]], axis=2)
    of_edges = mises[:, SIDES].reshape(-1, 2)[swept]
    of_rectangles = of_edges[:, [0, 1, 1, 0]][:, HALVES]
    of_faces = [triangles + rows[0], triangles + rows[-1]]
    all_triangles = np.concatenate([*of_faces, rectangles[..., HALVES].reshape(-1, 3)])
    of_steps = np.tile(of_rectangles.reshape(-1, 3), (len(angles) - 1, 1))
    skin = Skin(
        _around(x, angles),
        all_triangles,
        np.zeros(len(all_triangles), dtype=int),
        np.concatenate([lines + rows[0], lines + rows[-1]]),
    )
    return skin, np.concatenate([mises, mises, of_steps])
