"""Read drawings on rank 0, by a process that meshes them."""

from __future__ import annotations

import json
import logging
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from namedmesh.base import checks
from namedmesh.base.exceptions import InputError
from namedmesh.drawings.kept import Kept
from namedmesh.drawings.opened import CAD
from namedmesh.files.apart import PACKAGE, WITHOUT_MPI
from namedmesh.files.for_gmsh import merge_script
from namedmesh.files.formats import DRAWINGS

LEVELS = {"info": logging.INFO, "warning": logging.WARNING}
"""Level of each kind of sentence."""
START = f"{WITHOUT_MPI}from namedmesh.drawings.worker import main\nmain()\n"
"""Program of the process."""


@dataclass(frozen=True)
class Wanted:
    """Say how a drawing is to be meshed.

    Args:
        size: Greatest edge of the cells [length]; None leaves it to a .geo file.
        heal: Tolerance up to which gaps are closed [length]; True takes 1e-6 of the
            extent, False none.
        defeature: Width up to which faces and edges are removed [length], or None.

    Raises:
        InputError: If a length is no number > 0.
    """

    size: float | None = None
    heal: float | bool = False
    defeature: float | None = None

    def __post_init__(self) -> None:
        """Check the lengths."""
        if self.size is not None:
            checks.positive("read_mesh: size", self.size, "the greatest edge of cells, > 0")
        if not isinstance(self.heal, bool):
            checks.positive("read_mesh: heal", self.heal, "True or a tolerance > 0 [length]")
        if self.defeature is not None:
            checks.positive("read_mesh: defeature", self.defeature, "a width > 0 [length]")

    @property
    def given(self) -> bool:
        """Tell whether something is asked for."""
        return self != Wanted()


def check_kind(path: Path, kind: str, wanted: Wanted, *, scripts: bool) -> None:
    """Check that a file can be what it is asked for.

    Args:
        path: The file.
        kind: Its format.
        wanted: How a drawing is to be meshed.
        scripts: Whether scripts may run.

    Raises:
        InputError: If it is a script and none may run, something is asked for that a
            mesh file does not have, or it ends as drawings do and is none.
    """
    if kind == "script" and not scripts:
        raise InputError(
            f"The drawing {str(path)!r} is a script of gmsh's, a program that can run any command "
            "and write any file. If you trust who wrote it: read_mesh(path, scripts=True)."
        )
    if kind in DRAWINGS:
        return
    if path.suffix.lower() in CAD:
        raise InputError(
            f"The drawing {str(path)!r} cannot be used: it ends as drawings do, and does not begin "
            "so. Export it anew."
        )
    if wanted.given:
        raise InputError(
            f"read_mesh: size=, heal= and defeature= mesh a drawing ({', '.join(CAD)}, .geo); "
            f"{str(path)!r} is none. Cells of a mesh file get other sizes by refined or remeshed."
        )


def open_geometry(gmsh: Any, path: Path, kind: str, wanted: Wanted) -> list[Kept | None]:
    """Open a file with the true shape of bodies in gmsh's current session.

    A drawing is meshed by a process of its own. A script of gmsh's that has physical
    groups is opened as it is, unless sizes or repairs are asked for: gmsh's session
    then has its geometry and its names.

    Returns:
        A list with the geometry of the drawing as text, None in it if that cannot be
        kept; an empty list for a script with groups.

    Raises:
        InputError: If the file cannot be meshed.
    """
    is_script = kind == "script"
    if not is_script or wanted.given or "Physical" not in path.read_text(encoding="latin-1"):
        return [_mesh(gmsh, path, kind, wanted)]
    merge_script(gmsh, path)
    return []


def _mesh(gmsh: Any, path: Path, kind: str, wanted: Wanted) -> Kept | None:
    """Mesh a drawing, and open the mesh in gmsh's current session."""
    with tempfile.TemporaryDirectory() as folder:
        job = asdict(wanted) | {"path": str(path.resolve()), "kind": kind, "folder": folder}
        _run(job, f"The drawing {str(path)!r}")
        gmsh.merge(str(Path(folder) / "mesh.msh"))
        kept = json.loads((Path(folder) / "result.json").read_text())
    if kept is None:
        return None
    suffix, text, curved = kept
    return suffix, text, frozenset(curved)


def _run(job: dict[str, Any], what: str) -> None:
    """Let a process mesh a drawing; log what it tells.

    Raises:
        InputError: If it fails or dies.
    """
    command = [sys.executable, "-c", START, str(PACKAGE), json.dumps(job)]
    log = logging.getLogger("namedmesh")
    stage = "starting"
    problem = None
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            kind, sentence = json.loads(line)
            if kind == "stage":
                stage = sentence
            elif kind in LEVELS:
                log.log(LEVELS[kind], "%s: %s.", what, sentence)
            elif kind == "refused":
                problem = f"{what} cannot be used: {sentence}."
            else:
                problem = _in_words(what, stage, sentence)
    if problem is None and stage != "done":
        how = f"signal {-process.returncode}" if process.returncode < 0 else "an error"
        problem = _in_words(what, stage, f"gmsh's process ended by {how}")
    if problem is not None:
        raise InputError(problem)


def _in_words(what: str, stage: str, reason: str) -> str:
    """Return what failed at which stage, and what to try."""
    advice = {
        "starting": "See that gmsh is installed: python -c 'import gmsh'",
        "reading": "Open it in a CAD program and export it as STEP again",
        "meshing": "Give another size=, or heal= and defeature= for tiny edges and faces",
    }
    advised = advice.get(stage, "Give heal=True, or another tolerance")
    return f"{what} cannot be used; {stage}: {reason.strip().rstrip('.')}. {advised}."
