"""Tell the format of a file by what it holds, not by how its name ends.

A library that chooses by the ending may run what it finds: gmsh takes a text that it
does not know for a script. So a file goes to the reader of what it holds, and a script
to none, unless it is asked for.
"""

from __future__ import annotations

import re
from pathlib import Path

from namedmesh.base.exceptions import InputError
from namedmesh.files.hdf5 import MAGIC, groups_of

HEAD = 65_536
"""Number of bytes of a file that are looked at."""
SCRIPTS = (".geo", ".geo_unrolled")
"""Endings of scripts of gmsh's, which nothing else tells."""
DRAWINGS = ("step", "iges", "brep", "xao", "script")
"""Formats that have the true shape of bodies."""
BEGINNINGS = {
    b"$MeshFormat": "gmsh",
    b"$NOD": "gmsh",
    b"$Comments": "gmsh",
    b"$PhysicalNames": "gmsh",
    b"# vtk DataFile": "vtk",
    b"MFEM ": "mfem",
    b"ISO-10303-21": "step",
    b"DBRep_DrawableShape": "brep",
    b"CASCADE Topology": "brep",
    b"@(#)ADF": "cgns",
    b"CDF\x01": "exodus",
    b"CDF\x02": "exodus",
    b"CDF\x05": "exodus",
}
"""Format by how a file begins, blank lines aside."""
PATTERNS = {
    "medit": rb"(?:#.*\n\s*)*MeshVersionFormatted\b",
    "unv": rb"-1[ \t]*\r?\n[ \t]*\d{2,6}\b",
    "frd": rb"1C[\w ]*\r?\n",
    "kratos": rb"(?:\s|//.*\n)*Begin (?:ModelPartData|Properties|Table|Nodes|Elements)",
    "dyna": rb"""(?xi)
        (?: \$.*\n\s* )+ \*
          | \* (?: KEYWORD | ELEMENT_(?:SOLID|SHELL|TSHELL) | SET_(?:NODE|SEGMENT|PART)
              | NODE.* \n (?: \$.*\n )* [ ]* \d+ [ ]+ [-+.\d] [^,\n]* \n )""",
    "aster": rb"(?i)(?:%.*\n\s*)*(?:TITRE|COOR_[23]D)\b",
    "hecmw": rb"(?i)(?:(?:!!|\#).*\n\s*)*!\s*(?:HEADER|NODE|INCLUDE)\b",
    "ansys": rb"(?is)(?:/COM,\s*ANSYS|/PREP7|(?:.{0,60000}?\n)?[ \t]*NBLOCK[ \t]*,[ \t]*\d)",
    "gid": rb"(?i)(?:#.*\n\s*)*mesh\s[^\n]*\belemtype\b",
    "nastran": rb"""(?x)
        (?: (?: \$.* | NASTRAN\ .* | ID[ ,].* | INIT\ .* | ASSIGN\ .* | )\r?\n )*
        (?: SOL\b | CEND | BEGIN\s*,?\s*BULK
          | (?:GRID|GRDSET|CTETRA|CHEXA|CPENTA|CTRIA3|CQUAD4|CORD2[RCS])[ ,*] )""",
    "iges": rb"[^\n]{72}S *0*1\r?\n",
    "getfem": rb"(?s).{0,3000}?(?:GETFEM|BEGIN POINTS LIST)",
    "ucd": rb"(?:#.*\n\s*)*(?:\d+[ \t]+){4}\d+[ \t]*\r?\n\s*\d+(?:[ \t]+[-+.\deE]+){3}",
}
"""Patterns of the beginnings of texts by format."""
ROOTS = {"VTKFile": "vtk xml", "Xdmf": "xdmf", "XAO": "xao"}
"""Format by the root of a file of XML."""
OF_HDF5 = {
    "ENS_MAA": "med",
    "VTKHDF": "vtkhdf",
    "CGNSLibraryVersion": "cgns",
    "coordx": "exodus",
    "coord": "exodus",
    "connect1": "exodus",
}
"""Format by a group at the root of a file of HDF5."""
POINTER = b"version https://git-lfs"
"""Beginning of what Git LFS leaves in the place of a file."""
CARD = re.compile(r"\s*\*\s*(\*|[A-Za-z])")
"""Line of a card of Abaqus or CalculiX, or of their comments."""


def format_of(path: Path) -> str:
    """Return the format of a file, "" if what it holds tells none.

    Raises:
        InputError: If it stands for a file that is not here, or has tables of HDF5 that
            do not belong to it.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head[:8] == MAGIC or head[512:520] == MAGIC:
        known = [OF_HDF5[name] for name in groups_of(path) if name in OF_HDF5]
        return known[0] if known else "hdf5"
    if path.suffix.lower() in SCRIPTS:
        return "script"
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if text.startswith(POINTER):
        raise InputError("it is a pointer of Git LFS; 'git lfs pull' brings the file itself.")
    for beginning, name in BEGINNINGS.items():
        if text.startswith(beginning):
            return name
    if text.startswith(b"<"):
        root = re.search(rb"<([A-Za-z]\w*)", text)
        return ROOTS.get(root[1].decode() if root else "", "")
    for name, pattern in PATTERNS.items():
        if re.match(pattern, text if name != "iges" else head):
            return name
    return "abaqus" if _has_cards(text, path) else ""


def _has_cards(text: bytes, path: Path) -> bool:
    """Tell whether a text begins as files of Abaqus and CalculiX do.

    A file that ends with .inp may have words before its first card.
    """
    lines = [line for line in text.decode("latin-1").splitlines() if line.strip()]
    if path.suffix.lower() != ".inp":
        lines = lines[:1]
    return any(CARD.match(line) for line in lines)
