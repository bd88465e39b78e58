"""Pack the downloads of demos: a script with the files that it reads, in their places.

sphinx-gallery offers the script alone, and an archive of it. Of a demo that reads files
the script alone is not offered.
"""

import re
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

ROOT = Path(__file__).parents[1]
FILES = re.compile(r'parents\[1\]((?: / "[^"]+")+)')
"""Path of a file or a folder that a script reads, from the folder above its own."""
LINK = re.compile(r"    \.\. container:: sphx-glr-download sphx-glr-download-python\n\n.*\n\n")
"""The link to a script in the page of a demo."""


def files_of(script: Path) -> list[Path]:
    """Return the files that a demo reads from the folder above its own."""
    files: list[Path] = []
    for path in FILES.findall(script.read_text()):
        place = ROOT.joinpath(*re.findall(r'"([^"]+)"', path))
        files += sorted(place.iterdir()) if place.is_dir() else [place]
    return files


def pack(script: Path, archive: Path) -> None:
    """Write the archive of a demo; unpacked anywhere, the demo runs."""
    with ZipFile(archive, "w", ZIP_DEFLATED) as packed:
        for file in [script, *files_of(script)]:
            packed.write(file, file.relative_to(ROOT).as_posix())


def pack_all(app: Any) -> None:
    """Write the archives of all demos in the place of those of sphinx-gallery."""
    for script in (ROOT / "demos").glob("*.py"):
        pack(script, Path(app.srcdir) / "gallery" / f"{script.stem}.zip")


def leave_out_script(app: Any, page: str, source: list[str]) -> None:
    """Take the link to the script alone from the page of a demo that reads files."""
    script = ROOT / "demos" / f"{Path(page).name}.py"
    if page.startswith("gallery/") and script.is_file() and files_of(script):
        source[0] = LINK.sub("", source[0])


def setup(app: Any) -> None:
    """Pack after sphinx-gallery has made its pages."""
    app.connect("builder-inited", pack_all, priority=900)
    app.connect("source-read", leave_out_script)
