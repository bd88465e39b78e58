"""Make the folder of a run's files, and write grids as VTKHDF files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError, on_rank
from namedmesh.base.names import printable

PARTS = 24
"""Number of straight parts of a facet in 2D with quadratic fields, drawn or written."""
CHUNK_ROWS = 1000
"""Number of rows in a block of a file.

A reader unpacks a whole block for one row of it.
"""
COMPRESSION = 4
"""Level of compression of a block."""


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
