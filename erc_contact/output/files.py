"""Gather arrays of all ranks on rank 0, and make grids and files of them.

Symbols: d dimension of simplices, N number of nodes of a simplex.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, on_rank
from namedmesh.base.names import printable
from namedmesh.simplex import lattice, node_between

STYLE = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 11.0,
    "pdf.fonttype": 42,
    "figure.autolayout": False,
    "figure.constrained_layout.use": False,
}
"""matplotlib's settings for our figures; journals want fonts of type 42 in pdf."""
VTK_EDGES = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
"""Vertices of the edges of a tetrahedron, in the order of VTK's nodes.

The first one is the edge of a line, and the first three are the edges of a triangle.
"""
VTK_KINDS = {1: (3, 5, 10), 2: (21, 22, 24)}
"""VTK's numbers of line, triangle and tetrahedron, by degree."""
POLYLINE = 4
"""VTK's number of a polyline."""
PARTS = 24
"""Number of straight parts of a facet in 2D with quadratic fields, drawn or written."""
CHUNK_ROWS = 1000
"""Number of rows in a block of a file.

A reader unpacks a whole block for one row of it.
"""
COMPRESSION = 4
"""Level of compression of a block."""


def on_root(comm: MPI.Comm, path: str | Path | None, draw: Callable[[], None]) -> None:
    """Draw or write on rank 0, and raise an exception there on all ranks; collective.

    Args:
        comm: Communicator.
        path: File whose folder is made if it is missing; None if there is no file.
        draw: Draws and writes the file.

    Raises:
        InputError: If a library for pictures is not installed.
    """

    def make() -> None:
        if path is not None:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
        try:
            draw()
        except ModuleNotFoundError as reason:
            raise InputError(
                f"Pictures and files for ParaView need {reason.name}, which is not installed: "
                "pip install 'erc-contact[pictures]' brings it. All else works without."
            ) from reason

    on_rank(comm, 0, make)


def make_folder(comm: MPI.Comm, folder: str | Path) -> Path:
    """Make the folder of a run's files before anything is drawn; collective.

    Raises:
        InputError: If it cannot be written.
    """
    path = Path(folder)

    def make() -> None:
        try:
            path.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=path):
                pass
        except OSError as reason:
            raise InputError(
                f"Nothing can be saved in {str(folder)!r}: {reason.strerror}. The results are as "
                "they were; call save() again with a folder that you may write to."
            ) from reason

    on_rank(comm, 0, make)
    return path


def gather(comm: MPI.Comm, **arrays: np.ndarray) -> dict[str, np.ndarray]:
    """Gather arrays of all ranks in a row on rank 0; collective.

    Other ranks get an empty dictionary.
    """
    parts = comm.gather(arrays) if comm.size > 1 else [arrays]
    if not parts:
        return {}
    return {name: np.concatenate([part[name] for part in parts]) for name in arrays}


def degree_of(cells: np.ndarray, d: int) -> int:
    """Return the degree, 1 or 2, of simplices of dimension d with nodes (n, N)."""
    return 1 if cells.shape[1] == d + 1 else 2


@cache
def subdivide(d: int, divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Cut the reference line or triangle into smaller pieces.

    Returns:
        Reference points, shape (q, d), and the numbers of the points of each smaller
        one, shape (n, d+1).
    """
    points = lattice(d, divisions)
    steps = (points * divisions).round().astype(int).tolist()
    number = {tuple(step): i for i, step in enumerate(steps)}
    if d == 1:
        return points, np.array([[number[i,], number[i + 1,]] for i in range(divisions)])
    upward = []
    downward = []
    for (i, j), corner in number.items():
        if i + j < divisions:
            upward.append([corner, number[i + 1, j], number[i, j + 1]])
        if i + j < divisions - 1:
            downward.append([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]])
    return points, np.array(upward + downward)


def vtk_cells(cells: np.ndarray, d: int) -> tuple[int, np.ndarray]:
    """Return VTK's number of a kind of simplices, and their nodes in its order.

    Args:
        cells: Nodes of the simplices, shape (n, N).
        d: Their dimension.
    """
    k = degree_of(cells, d)
    order = list(range(d + 1))
    if k == 2:
        first, second = VTK_EDGES[: d * (d + 1) // 2].T
        order += node_between(d, k)[first, second].tolist()
    return VTK_KINDS[k][d - 1], cells[:, order]


def grid_of(points: np.ndarray, cells: np.ndarray, d: int) -> Any:
    """Make a grid of pyvista.

    It is one of lines, triangles or tetrahedra of degree 1 or 2, or of polylines.

    Args:
        points: Nodes [length], shape (p, 3).
        cells: Numbers of the nodes of each cell, in DOLFINx's order, shape (n, N).
            Lines with more than 3 nodes are polylines.
        d: Dimension of the cells.
    """
    import pyvista  # noqa: PLC0415

    if d == 1 and cells.shape[1] > 3:
        kind, nodes = POLYLINE, cells
    else:
        kind, nodes = vtk_cells(cells, d)
    # Before the nodes of a cell VTK wants their number.
    counted = np.insert(nodes, 0, nodes.shape[1], axis=1)
    kinds = np.full(len(nodes), kind, dtype=np.uint8)
    return pyvista.UnstructuredGrid(counted.ravel(), kinds, points)


@contextmanager
def new_vtkhdf(path: str | Path) -> Iterator[Any]:
    """Write a VTKHDF file within a context, by h5py, which needs no HDF writer of VTK.

    Yields:
        Its group of the unstructured mesh.
    """
    import h5py  # noqa: PLC0415

    with h5py.File(path, "w") as file:
        vtk = file.create_group("VTKHDF")
        vtk.attrs["Version"] = (2, 0)
        vtk.attrs["Type"] = np.bytes_("UnstructuredGrid")
        yield vtk


def save_grid(grid: Any, path: Path, part: str = "") -> None:
    """Write a mesh with its data as a VTKHDF file.

    Args:
        grid: The mesh.
        path: The file.
        part: Name of the part that it shows, "" for none.

    Raises:
        OSError: If the file cannot be written.
    """
    nodes = grid.cell_connectivity
    # All cells are of one kind.
    corners = len(nodes) // grid.n_cells
    tables = {
        "Points": grid.points,
        "Connectivity": nodes,
        "Offsets": np.arange(0, len(nodes) + 1, corners),
        "Types": grid.celltypes,
        "NumberOfPoints": np.array([grid.n_points]),
        "NumberOfCells": np.array([grid.n_cells]),
        "NumberOfConnectivityIds": np.array([len(nodes)]),
    }
    for kind, data in (("PointData", grid.point_data), ("CellData", grid.cell_data)):
        for name, values in data.items():
            tables[f"{kind}/{name}"] = values
    path.parent.mkdir(parents=True, exist_ok=True)
    with new_vtkhdf(path) as vtk:
        if part:
            vtk.file["part"] = printable(part)
        for name, table in tables.items():
            array = np.asarray(table)
            chunks = (min(CHUNK_ROWS, len(array)), *array.shape[1:])
            vtk.create_dataset(
                name, data=array, chunks=chunks, compression="gzip", compression_opts=COMPRESSION
            )
