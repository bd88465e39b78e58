"""Keep one file for each mesh of a run in a folder; each is whole, or known as damaged.

A file is packed with a checksum by :mod:`namedmesh.keeping.packed`. It is written
beside by rank 0, flushed to the disk, and gets its name at the end. So a file with its
name is whole unless the disk has failed, and any byte that changed is found.
"""

from __future__ import annotations

import fcntl
import os
import re
from contextlib import suppress
from pathlib import Path

from erc_contact.base.exceptions import InputError
from erc_contact.run.contents import check_contents
from namedmesh.keeping import Contents, Damaged, pack, unpack

FILE_NAME = "level_{:04d}.vtkhdf"
"""Name of the file of a level by its number."""
FILE_PATTERN = re.compile(r"level_(\d{4,})\.vtkhdf")
"""The same as a pattern."""
UNFINISHED = ".part"
"""Added to the name of a file while it is written."""
ASIDE = ".damaged"
"""Added to the name of a damaged file when a better one takes its place."""


def unpack_level(whole: bytes) -> Contents:
    """Read a level from the contents of a file.

    Raises:
        Damaged: If they are not what was written.
        InputError: If the format is newer than this version of the package.
    """
    return unpack(whole, check_contents, "level of a run")


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

    def read(self, number: int) -> Contents:
        """Read the level of a number.

        Raises:
            Damaged: If it cannot be read, or is not what was written.
            InputError: If its format is newer.
        """
        try:
            level = unpack_level(self.file(number).read_bytes())
            if len(level.about["rows"]) != number:
                raise Damaged("it belongs to another mesh")
            return level
        except OSError as reason:
            raise Damaged(f"it cannot be read ({reason.strerror})") from reason
        except InputError as reason:
            raise InputError(f"{self.file(number)}: {reason}, or another folder.") from reason

    def write(self, number: int, level: Contents) -> None:
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
