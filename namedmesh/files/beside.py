"""Find a file that another file names, in the folder of the first or below it."""

from __future__ import annotations

from pathlib import Path

from namedmesh.base.exceptions import InputError


def beside(path: Path, name: str, top: Path | None = None) -> Path:
    """Return the path of a file that another file names.

    Args:
        path: The other file.
        name: The name in it. If it leads elsewhere, as on the computer of its author,
            the file of the same name beside the other file is meant.
        top: The folder that no name may leave; None is the folder of the other file.

    Raises:
        InputError: If there is none, or it is a link that leaves the folder.
    """
    folder = (top or path.parent).resolve()
    words = name.replace("\\", "/").strip()
    places = [] if not words or "\0" in words else [path.parent / words]
    places += [path.parent / place.name for place in places]
    left = None
    for place in places:
        try:
            if not place.is_file():
                continue
        except OSError:  # a name that is too long
            continue
        real = place.resolve()
        if real.is_relative_to(folder):
            return real
        left = real
    if left is not None:
        raise InputError(
            f"it names the file {name!r}, which is not in the folder {str(folder)!r}; copy the "
            "file into that folder."
        )
    raise InputError(f"it includes {name!r}, which is not beside it; put that file there.")
