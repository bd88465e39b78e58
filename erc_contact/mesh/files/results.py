"""Read the displacement of a file of results on one rank, for all."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.base.ranks import from_first
from erc_contact.mesh.files.displacements import FileField, displacement_of
from erc_contact.mesh.files.reading import read


def from_file(comm: MPI.Comm, path: str | Path) -> FileField:
    """Read the displacement of a file of results; collective.

    Args:
        comm: Communicator.
        path: The file.

    Raises:
        InputError: On all ranks, if the file is missing, unreadable, or has no
            displacement at its points.
    """
    field: FileField | None = None
    error: InputError | None = None
    if comm.rank == 0:
        try:
            field = displacement_of(read(Path(path), numbered=False))
        except Exception as reason:  # every rank must learn of it
            error = InputError(f"certify: the file {str(path)!r} cannot be used: {reason}")
    raise_together(comm, error)
    found = from_first(comm, field)
    assert found is not None
    return found
