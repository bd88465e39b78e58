"""Pack tables and plain data as one file, which is whole or known as damaged.

A file is HDF5, made in memory by h5py. In front of HDF5's part is a block of 512 bytes,
which HDF5 leaves to its users: format and SHA-256 of all the rest. So any byte that
changed is found. It is not compressed: that makes it a quarter smaller and takes twice
the time.

HDF5 through h5py and not adios4dolfinx or its successor io4dolfinx: these cannot be
installed beside the wheel of DOLFINx (they ask for a package fenics-dolfinx, which has
none), on several ranks they need an ADIOS2 or an h5py with MPI, which have no wheels
either, and they keep no names, rows or geometry.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.hdf5 import check_tables

FORMAT = 2
"""Number of the format of the files."""
BLOCK = 512
"""Length of the block in front [bytes]."""
TITLE = "erc_contact level, format "
"""Beginning of a file, by the name of the distribution; the format's number follows."""


class Damaged(ValueError):
    """Report that a file is not what was written."""


Check = Callable[[Any, Mapping[str, np.ndarray]], None]
"""A function of plain data and tables that raises an error if they make no sense."""


@dataclass(frozen=True, eq=False)
class Contents:
    """Hold the contents of a file.

    Attributes:
        about: Plain data, as JSON has them.
        tables: Arrays by their names in the file.
    """

    about: dict[str, Any]
    tables: dict[str, np.ndarray]


def pack(contents: Contents) -> tuple[bytes, memoryview]:
    """Return the bytes of a file: the block in front, and HDF5's part."""
    import h5py  # noqa: PLC0415 - only files that are kept need it

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=BLOCK) as file:
        for name, table in contents.tables.items():
            file.create_dataset(name, data=table)
        vtk = file.require_group("VTKHDF")
        vtk.attrs["Version"] = (2, 0)
        vtk.attrs["Type"] = np.bytes_("UnstructuredGrid")
        file["about"] = json.dumps(contents.about)
    content = buffer.getbuffer()[BLOCK:]
    return _block(FORMAT, content), content


def unpack(whole: bytes, check: Check, kind: str) -> Contents:
    """Read plain data and tables from the bytes of a file, and check them.

    Args:
        whole: All bytes of the file.
        check: Function that checks what was read.
        kind: Word for such a file, for the errors.

    Raises:
        Damaged: If they are not what was written.
        InputError: If the format is newer than this version of the package.
    """
    title = whole[: whole.find(b"\n")].decode(errors="replace")
    number = title.removeprefix(TITLE)
    titled = title.startswith(TITLE) and number.isdecimal()
    # the checksum comes before the format: a changed byte may be in the number
    if not titled or whole[:BLOCK] != _block(int(number), whole[BLOCK:]):
        raise Damaged(f"it is damaged, or no {kind}")
    if int(number) != FORMAT:
        raise InputError(
            f"it has format {number}, and this version of the package knows format {FORMAT}: "
            "take the version that wrote it"
        )
    # What has a checksum may still be of anybody.
    try:
        contents = _read_contents(whole)
        check(contents.about, contents.tables)
    except Exception as reason:
        words = str(reason).rstrip(".")
        raise Damaged(f"it is no {kind} ({words})") from reason
    return contents


def _read_contents(whole: bytes) -> Contents:
    """Read plain data and tables from the bytes of a file, unchecked."""
    import h5py  # noqa: PLC0415

    tables: dict[str, np.ndarray] = {}

    def read_table(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            tables[name] = item[()]

    with h5py.File(io.BytesIO(whole), "r") as file:
        check_tables(file, len(whole))
        about = json.loads(file["about"][()])
        file.visititems(read_table)
    del tables["about"]
    return Contents(about, tables)


def _block(number: int, content: bytes | memoryview) -> bytes:
    """Return the block in front of a content: title with the format, and SHA-256."""
    title = f"{TITLE}{number}\n".encode()
    digest = hashlib.sha256(title)
    digest.update(content)
    return (title + digest.hexdigest().encode() + b"\n").ljust(BLOCK, b"\0")
