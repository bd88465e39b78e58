"""Keep one file for each mesh of a run in a folder; each is whole, or known as damaged.

A file is HDF5, made in memory by h5py and written by rank 0. In front of HDF5's part is
a block of 512 bytes, which HDF5 leaves to its users: format and SHA-256 of all the
rest. It is written beside, flushed to the disk, and gets its name at the end. So a file
with its name is whole unless the disk has failed, and any byte that changed is found.
It is not compressed: that makes it a quarter smaller and takes twice the time.

HDF5 through h5py and not adios4dolfinx or its successor io4dolfinx: these cannot be
installed beside the wheel of DOLFINx (they ask for a package fenics-dolfinx, which has
none), on several ranks they need an ADIOS2 or an h5py with MPI, which have no wheels
either, and they keep no names, rows or geometry.
"""

from __future__ import annotations

import fcntl
import hashlib
import io
import json
import os
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.run.contents import check_contents
from namedmesh.for_solvers import check_tables

FORMAT = 2
"""Number of the format of the files."""
BLOCK = 512
"""Length of the block in front [bytes]."""
TITLE = "erc_contact level, format "
"""Beginning of a file; the number of the format follows."""
FILE_NAME = "level_{:04d}.vtkhdf"
"""Name of the file of a level by its number."""
FILE_PATTERN = re.compile(r"level_(\d{4,})\.vtkhdf")
"""The same as a pattern."""
UNFINISHED = ".part"
"""Added to the name of a file while it is written."""
ASIDE = ".damaged"
"""Added to the name of a damaged file when a better one takes its place."""


class Damaged(ValueError):
    """Report that a file is not what was written."""


Check = Callable[[Any, Mapping[str, np.ndarray]], None]
"""A function of plain data and tables that raises an error if they make no sense."""


@dataclass(frozen=True, eq=False)
class Level:
    """Hold the contents of a file.

    Attributes:
        about: Plain data, as JSON has them; "rows" are the rows of the run up to this
            mesh.
        tables: Arrays by their names in the file.
    """

    about: dict[str, Any]
    tables: dict[str, np.ndarray]


def pack(level: Level) -> tuple[bytes, memoryview]:
    """Return the contents of a file: the block in front, and HDF5's part."""
    import h5py  # noqa: PLC0415 - only runs that are kept need it

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=BLOCK) as file:
        for name, table in level.tables.items():
            file.create_dataset(name, data=table)
        vtk = file.require_group("VTKHDF")
        vtk.attrs["Version"] = (2, 0)
        vtk.attrs["Type"] = np.bytes_("UnstructuredGrid")
        file["about"] = json.dumps(level.about)
    content = buffer.getbuffer()[BLOCK:]
    return _block(FORMAT, content), content


def unpack(whole: bytes, check: Check = check_contents) -> Level:
    """Read a level from the contents of a file.

    Args:
        whole: The contents.
        check: Function that checks what was read.

    Raises:
        Damaged: If they are not what was written.
        InputError: If the format is newer than this version of the package.
    """
    title = whole[: whole.find(b"\n")].decode(errors="replace")
    number = title.removeprefix(TITLE)
    titled = title.startswith(TITLE) and number.isdecimal()
    # the checksum comes before the format: a changed byte may be in the number
    if not titled or whole[:BLOCK] != _block(int(number), whole[BLOCK:]):
        raise Damaged("it is damaged, or no level of a run")
    if int(number) != FORMAT:
        raise InputError(
            f"it has format {number}, and this version of erc_contact knows format {FORMAT}: "
            "take the version that wrote it, or another folder"
        )
    # What has a checksum may still be of anybody.
    try:
        level = _read_contents(whole)
        check(level.about, level.tables)
    except Exception as reason:
        words = str(reason).rstrip(".")
        raise Damaged(f"it is no level of a run ({words})") from reason
    return level


def _read_contents(whole: bytes) -> Level:
    """Read plain data and tables from the contents of a file, unchecked."""
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
    return Level(about, tables)


def _block(number: int, content: bytes | memoryview) -> bytes:
    """Return the block in front of a content: title with the format, and SHA-256."""
    title = f"{TITLE}{number}\n".encode()
    digest = hashlib.sha256(title)
    digest.update(content)
    return (title + digest.hexdigest().encode() + b"\n").ljust(BLOCK, b"\0")


class Folder:
    """Read and write the folder of a run on rank 0.

    Args:
        path: The folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock: int | None = None

    def numbers(self) -> list[int]:
        """Return the numbers of the files, in order."""
        numbers = []
        if self.path.is_dir():
            for path in self.path.iterdir():
                match = FILE_PATTERN.fullmatch(path.name)
                if match:
                    numbers.append(int(match[1]))
        return sorted(numbers)

    def file(self, number: int) -> Path:
        """Return the path of the file of a number."""
        return self.path / FILE_NAME.format(number)

    def read(self, number: int) -> Level:
        """Read the level of a number.

        Raises:
            Damaged: If it cannot be read, or is not what was written.
            InputError: If its format is newer.
        """
        try:
            level = unpack(self.file(number).read_bytes())
            if len(level.about["rows"]) != number:
                raise Damaged("it belongs to another mesh")
            return level
        except OSError as reason:
            raise Damaged(f"it cannot be read ({reason.strerror})") from reason
        except InputError as reason:
            raise InputError(f"{self.file(number)}: {reason}.") from reason

    def write(self, number: int, level: Level) -> None:
        """Write a file; one of the same number that is damaged gets another name.

        Raises:
            OSError: If it cannot be written; nothing of it is left.
        """
        path = self.file(number)
        unfinished = path.with_name(path.name + UNFINISHED)
        try:
            with unfinished.open("wb") as file:
                file.writelines(pack(level))
                file.flush()
                os.fsync(file.fileno())
            if path.exists():
                path.replace(path.with_name(path.name + ASIDE))
            # the name comes last: a file that has it is whole
            unfinished.replace(path)
            self._flush()
        except OSError:
            with suppress(OSError):
                unfinished.unlink()
            raise

    def open(self) -> None:
        """Make the folder and lock it for this run.

        The lock lasts until :meth:`close`, or until the process ends, however it ends.

        Raises:
            InputError: If another run holds it.
            OSError: If nothing can be written there.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        self._lock = os.open(self.path / "lock", os.O_CREAT | os.O_RDONLY, 0o666)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as reason:
            self.close()
            raise InputError(
                f"The folder {str(self.path)!r} belongs to a run that is going on; "
                "wait for it, or give another folder."
            ) from reason
        except OSError:  # a file system without locks
            pass
        # files that an earlier run, which was killed, did not finish
        for unfinished in self.path.glob(f"*{UNFINISHED}"):
            unfinished.unlink()

    def close(self) -> None:
        """Unlock the folder for other runs."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _flush(self) -> None:
        """Flush the names of the files to the disk."""
        descriptor = os.open(self.path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
