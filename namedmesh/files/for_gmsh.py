"""Hand files to gmsh so that it runs nothing: by names of our own, and checked.

gmsh chooses its reader by the ending and by the first line, runs what it does not know
as a script, and reads options that lie beside a file.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from namedmesh.base.exceptions import InputError

XAO_BEGINNING = re.compile(
    r"\s*(<\?xml[^>]*>\s*)?<XAO\b[^>]*>\s*<geometry\b[^>]*>\s*"
    r"<shape\s+format=\"BREP\"\s*>\s*<!\[CDATA\["
)
"""How a file of XAO begins that has its shape in itself."""
ERROR = "Error: "
"""How gmsh's sentences about errors begin."""


@contextmanager
def called(path: Path, ending: str) -> Iterator[Path]:
    """Give a file a name for gmsh inside the `with`, in a folder without other files.

    Args:
        path: The file.
        ending: The ending.
    """
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / f"file{ending}"
        text = path.read_bytes() if ending == ".msh" else b"$"
        if text.startswith(b"$"):
            link.symlink_to(path.resolve())
        else:  # blank lines or a mark of bytes before the first section
            link.write_bytes(text[text.index(b"$") :])
        yield link


def merge_script(gmsh: Any, path: Path) -> None:
    """Run a script in gmsh's current model, without options that lie beside it.

    The script may include others by names relative to its folder. It is read to its
    end: a parser that stops at an error keeps the text behind it, and reads that text
    in front of the next script of this process.

    Raises:
        InputError: If its path has quotes or line ends.
        ValueError: If gmsh finds an error in it, with the first of gmsh's sentences.
    """
    real = str(path.resolve())
    if not real.isprintable() or '"' in real:
        raise InputError(f"the path {real!r} has characters that gmsh does not bear; rename it.")
    with tempfile.TemporaryDirectory() as folder:
        first = Path(folder) / "script.geo"
        first.write_text(f'Include "{real}";\n')
        aborts = gmsh.option.getNumber("General.AbortOnError")
        gmsh.option.setNumber("General.AbortOnError", 0)
        try:
            said = _said_by(gmsh, lambda: gmsh.merge(str(first)))
        finally:
            gmsh.option.setNumber("General.AbortOnError", aborts)
    for sentence in said:
        if sentence.startswith(ERROR):
            raise ValueError(sentence.removeprefix(ERROR))


def _said_by(gmsh: Any, run: Callable[[], None]) -> list[str]:
    """Return what gmsh says while something runs; a user's logger goes on."""
    gmsh.logger.start()
    # A logger that was on warns of the second start. A new one has said nothing.
    before = len(gmsh.logger.get())
    try:
        run()
        return list(gmsh.logger.get())[before:]
    finally:
        if not before:
            gmsh.logger.stop()


def check_xao(text: str) -> None:
    """Check that a file of XAO has its shape in itself, as BREP.

    gmsh writes names into it as they are, so that it need not be good XML.

    Raises:
        InputError: If not.
    """
    begins = XAO_BEGINNING.match(text)
    if not begins or text.count("<shape") > 1 or "<!DOCTYPE" in text:
        raise InputError(
            "it has no shape of format BREP in itself, or is damaged; write the shape as BREP."
        )
