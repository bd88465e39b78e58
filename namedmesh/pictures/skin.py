"""Turn bodies into triangles and lines for their pictures; on rank 0.

Triangles and lines of degree 2 are cut into straight parts, so that curved edges look
curved.

Symbols: d dimension, k degree, m number of nodes of a simplex.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from namedmesh.pictures.grids import degree_of, grid_of, subdivide
from namedmesh.simplex import bernstein, edges, lagrange, node_between, node_vertices

DIVISIONS = 6
"""Greatest number of straight parts of a curved edge."""
TRIANGLES = 12_000
"""Greatest number of straight triangles, about, in which curved ones are cut.

Edges have fewer parts if need be.
"""


@dataclass(frozen=True, eq=False)
class Skin:
    """Hold the visible part of a body: triangles of degree k, and their edges.

    In 2D the triangles are the elements.

    Attributes:
        points: Nodes of the body [length], shape (n, 3).
        triangles: Numbers of the nodes of each triangle, shape (f, 3 or 6).
        cell: Number of the element that each triangle belongs to, shape (f,).
        lines: Numbers of the nodes of each edge, shape (e, 2 or 3).
    """

    points: np.ndarray
    triangles: np.ndarray
    cell: np.ndarray
    lines: np.ndarray

    @property
    def divisions(self) -> int:
        """Return the number of straight parts in which an edge is drawn."""
        if degree_of(self.lines, 1) == 1:
            return 1
        affordable = int(np.sqrt(TRIANGLES / len(self.triangles)))
        return min(max(affordable, 1), DIVISIONS)

    def faces(self, x: np.ndarray, **look: Any) -> tuple[Any, dict[str, Any]]:
        """Return the triangles for pyvista, and the options with which they are drawn.

        The nodes are at x [length], shape (n, 3). The option ``scalars`` has one colour
        for each of their parts, in the order of :meth:`of_parts`.
        """
        points, parts = sample(x[self.triangles], 2, self.divisions)
        return straight(points, parts), look

    def of_parts(self, values: np.ndarray) -> np.ndarray:
        """Return values in the straight parts of the triangles, triangle by triangle.

        Args:
            values: One value for each element, shape (m,), or three at the corners of
                each triangle, shape (f, 3).
        """
        points, parts = subdivide(2, self.divisions)
        if values.ndim == 1:
            return np.repeat(values[self.cell], len(parts))
        centres = points[parts].mean(axis=1)
        return (values @ bernstein(2, 1, centres).T).ravel()

    def edges(self, x: np.ndarray, **look: Any) -> tuple[Any, dict[str, Any]]:
        """Return the edges for pyvista, and the options with which they are drawn.

        The nodes are at x [length], shape (n, 3).
        """
        points, parts = sample(x[self.lines], 1, self.divisions)
        return straight(points, parts), look


def skin_of(points: np.ndarray, cells: np.ndarray, d: int) -> Skin:
    """Find the skin of a body.

    Args:
        points: Nodes [length], shape (n, 3).
        cells: Numbers of the nodes of each element, shape (e, N).
        d: Dimension.
    """
    k = degree_of(cells, d)
    # VTK finds the surface of straight cells; their other nodes follow from the edges.
    surface = _surface(grid_of(points, cells[:, : d + 1], d))
    cell = surface.cell_data["vtkOriginalCellIds"]
    corners = surface.point_data["vtkOriginalPointIds"][surface.regular_faces]
    local = (cells[cell, None, : d + 1] == corners[:, :, None]).argmax(axis=2)

    def between(pairs: np.ndarray) -> np.ndarray:
        """Return nodes between pairs of vertices of each triangle, shape (f, pairs)."""
        first, second = local[:, pairs.reshape(-1, 2).T].swapaxes(0, 1)
        return np.take_along_axis(cells[cell], node_between(d, k)[first, second], axis=1)

    triangles = between(node_vertices(2, k))
    lines = between(edges(2)[:, node_vertices(1, k)]).reshape(-1, k + 1)
    # Two triangles share an edge, which is drawn once.
    first, second = np.sort(lines[:, :2], axis=1).T
    _, once = np.unique(first * len(points) + second, return_index=True)
    return Skin(points, triangles, cell, lines[once])


def _surface(grid: Any) -> Any:
    """Return the triangles of the surface of a grid, with numbers of cells and points.

    pyvista's own function has other arguments and other defaults in each release.
    """
    import pyvista  # noqa: PLC0415
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter  # noqa: PLC0415

    surface = vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.PassThroughPointIdsOn()
    surface.PassThroughCellIdsOn()
    surface.Update()
    return pyvista.wrap(surface.GetOutput())


def outline(body: Mapping[str, np.ndarray], d: int) -> list[tuple[Any, dict[str, Any]]]:
    """Draw the outline of a body before the deformation; a ball has none."""
    grid = grid_of(body["points"], body["cells"][:, : d + 1], d)
    lines = grid.extract_feature_edges(feature_angle=30.0, manifold_edges=False)
    return [(lines, {"color": "black", "line_width": 3.0})] if lines.n_points else []


def sample(x: np.ndarray, d: int, divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate values at nodes of lines or triangles on smaller straight pieces.

    Args:
        x: Values at the nodes, shape (n, m, c), for instance their positions with c =
            3.
        d: Dimension of the lines or triangles, 1 or 2.
        divisions: Number of parts of an edge.

    Returns:
        Values at the points, shape (p, c), and the numbers of the points of each
        straight one, shape (s, d+1).
    """
    points, parts = subdivide(d, divisions)
    values = np.matmul(lagrange(d, degree_of(x, d), points), x)
    # Each line or triangle has points of its own, which are numbered one after another.
    offset = np.arange(len(x))[:, None, None] * len(points)
    return values.reshape(-1, x.shape[-1]), (offset + parts).reshape(-1, d + 1)


def straight(points: np.ndarray, parts: np.ndarray) -> Any:
    """Make straight lines or triangles for pyvista.

    They are given by points (p, 3) and numbers of points (n, 2) or (n, 3).
    """
    import pyvista  # noqa: PLC0415

    if parts.shape[1] == 3:
        return pyvista.PolyData.from_regular_faces(points, parts)
    return pyvista.PolyData(points, lines=np.insert(parts, 0, 2, axis=1))
