"""Open drawings in gmsh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from erc_contact.base.exceptions import InputError

CAD = (".step", ".stp", ".iges", ".igs", ".brep", ".stl")
"""Endings of files of drawings, which have no names of parts."""
DRAWINGS = (*CAD, ".geo", ".geo_unrolled", ".xao")
"""Endings of files that have the true shape of a body."""


def open_drawing(gmsh: Any, path: Path) -> None:
    """Open a drawing in gmsh's current session.

    Raises:
        InputError: If the file is missing, or a drawing without names.
    """
    if not path.is_file():
        raise InputError(
            f"The mesh file {str(path)!r} does not exist; look at the path and the working folder."
        )
    if path.suffix.lower() in CAD:
        raise InputError(
            f"{str(path)!r} is a drawing, in which no part of the boundary has a name: open it "
            "in gmsh, name the parts and take from_gmsh: gmsh.initialize(); "
            f"gmsh.model.occ.importShapes({path.name!r}); gmsh.model.occ.synchronize(); "
            'gmsh.model.addPhysicalGroup(2, [1], name="bottom"), one for each part; '
            "body = ec.from_gmsh(gmsh.model). For a drawing in the plane the groups have "
            "dimension 1."
        )
    gmsh.open(str(path))
