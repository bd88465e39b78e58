"""Bodies and their foundations as triangles and lines for pyvista. On rank 0.

Bodies of degree 2 are cut into straight parts, so that their edges are seen to be curved.

Symbols: X place before the deformation, g gap, n normal of the foundation, d dimension, k degree, m nodes of a simplex.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from erc_contact.drawing import mean_normal, tangents
from erc_contact.fields import Surface
from erc_contact.files import degree_of, grid_of, subdivided
from erc_contact.simplex import edges, lagrange, node_between, node_vertices

DIVISIONS = 6
"""Straight parts of a curved edge at most."""
TRIANGLES = 200_000
"""Curved triangles are drawn by about so many straight ones in all, and fewer parts of an edge if need be."""
REACH = 0.15
"""The foundation is drawn where its magnified gap is below this share of the body's size."""
BAND, EXCESS = 0.03, 0.06
"""Width of the band of a foundation, and what a flat one is longer than its contact, as shares of the size."""


@dataclass(frozen=True, eq=False)
class Skin:
    """What is seen of a body: triangles of degree k, and the edges of elements.

    Attributes:
        points: Nodes of the body [length], shape (n, 3).
        triangles: Nodes of the triangles, shape (f, 3 or 6).
        cell: The element of each, shape (f,).
        lines: Nodes of the edges, shape (e, 2 or 3).
    """

    points: np.ndarray
    triangles: np.ndarray
    cell: np.ndarray
    lines: np.ndarray

    @property
    def divisions(self) -> int:
        """Parts of an edge that are drawn straight."""
        many = int(np.sqrt(TRIANGLES / len(self.triangles)))
        return 1 if degree_of(self.lines, 1) == 1 else min(max(many, 1), DIVISIONS)

    def faces(self, x: np.ndarray, **look: Any) -> tuple[Any, dict[str, Any]]:
        """The triangles with nodes at x, and how they look; colours of elements are those in ``scalars``."""
        points, parts = sampled(x[self.triangles], 2, self.divisions)
        if "scalars" in look:
            look["scalars"] = np.repeat(look["scalars"][self.cell], len(parts) // len(self.cell), axis=0)
        return straight(points, parts), look

    def edges(self, x: np.ndarray, **look: Any) -> tuple[Any, dict[str, Any]]:
        """The edges with nodes at x, and how they look."""
        return straight(*sampled(x[self.lines], 1, self.divisions)), look


def skin_of(points: np.ndarray, cells: np.ndarray, d: int) -> Skin:
    """The skin of a body of elements (m, N) of dimension d: these themselves in 2D."""
    k = degree_of(cells, d)
    surface = grid_of(points, cells[:, : d + 1], d).extract_surface(algorithm="dataset_surface")
    cell = surface.cell_data["vtkOriginalCellIds"]
    corners = surface.point_data["vtkOriginalPointIds"][surface.regular_faces]
    local = (cells[cell, None, : d + 1] == corners[:, :, None]).argmax(axis=2)

    def between(pairs: np.ndarray) -> np.ndarray:
        """Nodes between pairs of vertices of the triangles, shape (f, pairs)."""
        first, second = local[:, pairs.reshape(-1, 2).T].swapaxes(0, 1)
        return np.take_along_axis(cells[cell], node_between(d, k)[first, second], axis=1)

    lines = between(edges(2)[:, node_vertices(1, k)]).reshape(-1, k + 1)
    _, once = np.unique(np.sort(lines[:, :2], axis=1), axis=0, return_index=True)
    return Skin(points, between(node_vertices(2, k)), cell, lines[once])


def sampled(x: np.ndarray, d: int, divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Lines or triangles with nodes (n, m, 3) cut into straight ones: points (p, 3), and these by these points."""
    points, parts = subdivided(d, divisions)
    at = np.matmul(lagrange(d, degree_of(x, d), points), x)
    return at.reshape(-1, x.shape[-1]), (np.arange(len(x))[:, None, None] * len(points) + parts).reshape(-1, d + 1)


def straight(points: np.ndarray, parts: np.ndarray) -> Any:
    """Straight lines (n, 2) or triangles (n, 3) between points (p, 3) for pyvista."""
    import pyvista  # noqa: PLC0415

    if parts.shape[1] == 3:
        return pyvista.PolyData.from_regular_faces(points, parts)
    return pyvista.PolyData(points, lines=np.insert(parts, 0, 2, axis=1))


def foundation(surface: Surface, factor: float, size: float) -> Any:
    """A foundation at X + factor g n, in straight parts, as far as it is near the body.

    A plane with a constant gap is drawn somewhat larger than the contact, others opposite to the contact.

    Args:
        surface: The contact.
        factor: Magnification of the gap [-].
        size: Size of the body [length].

    Returns:
        Lines in 2D, triangles in 3D for pyvista; at their points ``normal``, the normal of the foundation.
    """
    d, contact = surface.d, surface.traction.contact
    direction = np.pad(contact.direction, ((0, 0), (0, 3 - d)))
    points, parts = sampled(surface.x + factor * surface.gap[..., None] * direction[:, None], d - 1, DIVISIONS)
    lift = sampled(factor * surface.gap[..., None], d - 1, DIVISIONS)[0][:, 0]
    normal, n = np.repeat(direction, len(points) // len(direction), axis=0), mean_normal(surface)
    if np.ptp(points[:, :d] @ n) + np.ptp(lift) + np.ptp(direction, axis=0).max() * size <= 1e-9 * size:
        plane = tangents(n)
        along, height = points[:, :d] @ plane.T, float((points[:, :d] @ n).mean())
        ends = along.min(axis=0) - EXCESS * size, along.max(axis=0) + EXCESS * size
        corners = np.stack(np.meshgrid(*np.transpose(ends), indexing="ij"), axis=-1).reshape(-1, d - 1)
        points = np.pad(corners @ plane + height * n, ((0, 0), (0, 3 - d)))
        parts = np.array([[0, 1]] if d == 2 else [[0, 1, 2], [1, 2, 3]])
        lift, normal = lift[: len(points)], normal[: len(points)]
    drawn = straight(points, parts)
    drawn.point_data.update({"lift": lift, "normal": normal})
    return drawn.clip_scalar(scalars="lift", value=REACH * size)


def ground(surface: Any, size: float) -> list[tuple[Any, dict[str, Any]]]:
    """How a :func:`foundation` looks in a picture of this size [length]: in 2D a line with a band beyond it."""
    import pyvista  # noqa: PLC0415

    if surface.n_lines == 0:
        return [(surface, {"color": "#b8b8b8"})] * (surface.n_cells > 0)
    parts = surface.lines.reshape(-1, 3)[:, 1:]
    beyond = surface.points + BAND * size * (surface.point_data["normal"] - [0.0, 0.0, 1.0])  # and behind the body
    quads = np.column_stack([parts, len(beyond) + parts[:, ::-1]])
    band = pyvista.PolyData.from_regular_faces(np.concatenate([surface.points, beyond]), quads)
    return [(band, {"color": "#c8c8c8"}), (surface, {"color": "#505050", "line_width": 3.0})]
