"""Pack the downloads of demos: script, notebook and the files that they read.

sphinx-gallery offers script and notebook alone, and an archive of both. Of a demo that
reads files only the archive is offered, which has these files in their places.
"""

import re
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

ROOT = Path(__file__).parents[1]
FILES = re.compile(r'parents\[1\]((?: / "[^"]+")+)')
"""Path of a file or a folder that a script reads, from the folder above its own."""
LINK = re.compile(
    r"    \.\. container:: sphx-glr-download sphx-glr-download-(?:python|jupyter)\n\n.*\n\n"
)
"""The link to a script or a notebook in the page of a demo."""


def files_of(script: Path) -> list[Path]:
    """Return the files that a demo reads from the folder above its own."""
    files: list[Path] = []
    for path in FILES.findall(script.read_text()):
        place = ROOT.joinpath(*re.findall(r'"([^"]+)"', path))
        files += sorted(place.iterdir()) if place.is_dir() else [place]
    return files


def pack(script: Path, archive: Path, notebook: Path | None = None) -> None:
    """Write the archive of a demo; unpacked anywhere, script and notebook run."""
    with ZipFile(archive, "w", ZIP_DEFLATED) as packed:
        for file in [script, *files_of(script)]:
            packed.write(file, file.relative_to(ROOT).as_posix())
        if notebook is not None:
            packed.write(notebook, f"demos/{notebook.name}")


def pack_all(app: Any) -> None:
    """Write the archives of all demos in the place of those of sphinx-gallery."""
    for script in (ROOT / "demos").glob("*.py"):
        made = Path(app.srcdir) / "gallery" / script.stem
        pack(script, made.with_suffix(".zip"), made.with_suffix(".ipynb"))


def leave_out_script(app: Any, page: str, source: list[str]) -> None:
    """Take links to script and notebook from the page of a demo that reads files."""
    script = ROOT / "demos" / f"{Path(page).name}.py"
    if page.startswith("gallery/") and script.is_file() and files_of(script):
        source[0] = LINK.sub("", source[0])


def setup(app: Any) -> None:
    """Pack after sphinx-gallery has made its pages."""
    app.connect("builder-inited", pack_all, priority=900)
    app.connect("source-read", leave_out_script)
