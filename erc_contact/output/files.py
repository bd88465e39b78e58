"""Arrays of all ranks on rank 0, and from there into files for ParaView.

Rank 0 of the mesh's communicator draws and writes; the other ranks do not import pyvista. What fails on rank 0 is
raised on all ranks. The folder of a path is made if it is missing.

Symbols: d dimension of simplices, N number of nodes of one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import raise_together
from erc_contact.mesh.simplex import lattice, node_between

FONTS = {"font.family": "STIXGeneral", "mathtext.fontset": "stix", "font.size": 11.0}
VTK_EDGES = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
"""Vertices of the edges of a tetrahedron, in the order of VTK's nodes; the first are those of a line, of a triangle."""
PARTS = 24
"""Straight parts of a facet in 2D where what it carries is quadratic."""
CHUNK, COMPRESSION = 1000, 4
"""Rows of a block of a file, and its level of compression: VTK's own blocks of 25 000 rows, which are full in the file
even if a mesh is small, take 5.7 MB for 133 triangles."""


def on_root(comm: MPI.Comm, path: str | Path, draw: Callable[[], None]) -> None:
    """Draw on rank 0 with the folder made; what fails is raised on all ranks; collective."""
    error: Exception | None = None
    if comm.rank == 0:
        try:
            from matplotlib import rc_context  # noqa: PLC0415

            Path(path).parent.mkdir(parents=True, exist_ok=True)
            with rc_context(FONTS):
                draw()
        except Exception as reason:
            error = reason
    raise_together(comm, error)


def gathered(comm: MPI.Comm, **arrays: np.ndarray) -> dict[str, np.ndarray]:
    """Arrays of all ranks one after the other, on rank 0; nothing elsewhere; collective."""
    parts = comm.gather(arrays)
    return {name: np.concatenate([part[name] for part in parts]) for name in arrays} if parts else {}


def degree_of(cells: np.ndarray, d: int) -> int:
    """Degree of simplices of dimension d that are given by their nodes (n, N)."""
    return 1 if cells.shape[1] == d + 1 else 2


@cache
def subdivided(d: int, divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """A line or a triangle cut into smaller ones: reference points (q, d), and these by their points (n, d+1)."""
    points = lattice(d, divisions)
    number = {tuple(p): i for i, p in enumerate((points * divisions).round().astype(int).tolist())}
    if d == 1:
        return points, np.array([[number[i,], number[i + 1,]] for i in range(divisions)])
    upward = [[(i, j), (i + 1, j), (i, j + 1)] for i, j in number if i + j < divisions]
    downward = [[(i + 1, j), (i + 1, j + 1), (i, j + 1)] for i, j in number if i + j < divisions - 1]
    return points, np.array([[number[corner] for corner in corners] for corners in upward + downward])


def grid_of(points: np.ndarray, cells: np.ndarray, d: int) -> Any:
    """Lines, triangles or tetrahedra of degree 1 or 2 for pyvista, from cells by their nodes (n, N); or polylines."""
    import pyvista  # noqa: PLC0415

    if d == 1 and cells.shape[1] > 3:
        return pyvista.UnstructuredGrid({pyvista.CellType.POLY_LINE: cells}, points)
    kinds = {1: ("LINE", "TRIANGLE", "TETRA"), 2: ("QUADRATIC_EDGE", "QUADRATIC_TRIANGLE", "QUADRATIC_TETRA")}
    k = degree_of(cells, d)
    order = node_between(d, k)[*VTK_EDGES[: d * (d + 1) // 2].T] if k == 2 else []
    kind = pyvista.CellType[kinds[k][d - 1]]
    return pyvista.UnstructuredGrid({kind: cells[:, [*range(d + 1), *order]]}, points)


def save_grid(grid: Any, path: Path) -> None:
    """Write a VTKHDF file; what stands in the way raises an OSError, where VTK would write nothing and be silent."""
    import pyvista  # noqa: PLC0415

    path.parent.mkdir(parents=True, exist_ok=True)
    path.open("wb").close()
    writer = pyvista.HDFWriter(path, grid).writer
    writer.SetChunkSize(CHUNK)
    writer.SetCompressionLevel(COMPRESSION)
    if not writer.Write():
        raise OSError(f"{path} could not be written.")
