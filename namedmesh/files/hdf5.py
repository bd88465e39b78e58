"""Check files of HDF5 of others before they are read.

A table may be declared greater than any memory in a file of a few bytes, and its
numbers may lie in another file that the first names. Both are refused.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from namedmesh.base.exceptions import InputError

MAGIC = b"\x89HDF\r\n\x1a\n"
"""Beginning of a file of HDF5."""
MOST = 300
"""Greatest size of all tables, over the size of the file [-].

The best compression of numbers makes a thousandth of a constant table, but a mesh also
has points, of which a third is left.
"""
FREE = 10_000_000
"""Size of tables that is never too great [bytes]."""


def groups_of(path: Path) -> list[str]:
    """Return the names at the root of a file of HDF5.

    Raises:
        InputError: If it is damaged, or has tables that are greater than the file can
            hold, or numbers in other files.
    """
    import h5py  # noqa: PLC0415 - paid for only by those who read such files

    try:
        with h5py.File(path, "r") as file:
            check_tables(file, path.stat().st_size)
            return list(file)
    except (OSError, RuntimeError, KeyError, UnicodeError) as reason:
        raise InputError(f"its HDF5 is damaged ({reason}).") from reason


def check_tables(file: Any, size: int) -> None:
    """Check the tables of an open file of HDF5.

    Args:
        file: The file.
        size: Its size [bytes].

    Raises:
        InputError: If they are greater than the file can hold, or lie in other files.
    """
    import h5py  # noqa: PLC0415

    declared = 0
    seen = set()
    left = [file]
    while left:
        group = left.pop()
        for name in group:
            link = group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                raise InputError(
                    f"{name!r} in it is in another file, {link.filename!r}; put the numbers into "
                    "this file: h5repack or h5copy do it."
                )
            if isinstance(link, h5py.SoftLink) and link.path not in file:
                continue
            item = group[name]
            address = h5py.h5o.get_info(item.id).addr
            if address in seen:
                continue
            seen.add(address)
            if isinstance(item, h5py.Group):
                left.append(item)
            elif isinstance(item, h5py.Dataset):
                _check_place(item)
                declared += item.nbytes
    if declared > MOST * size + FREE:
        raise InputError(
            f"its tables are declared with {declared:.3g} bytes, and the file has {size}: it is "
            "damaged, or made to fill the memory."
        )


def _check_place(table: Any) -> None:
    """Check that the numbers of a table lie in its file.

    Raises:
        InputError: If not.
    """
    if table.external or table.is_virtual:
        raise InputError(
            f"the numbers of {table.name!r} lie in other files; put them into this file: h5repack "
            "does it."
        )
