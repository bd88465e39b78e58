"""Read mesh files: give each to the reader of what it holds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from namedmesh.base.exceptions import InputError
from namedmesh.files.apart import read_apart
from namedmesh.files.file_mesh import FileMesh
from namedmesh.files.formats import DRAWINGS, format_of
from namedmesh.files.of_abaqus import mesh_of_abaqus, mesh_of_hecmw
from namedmesh.files.of_ansys import mesh_of_ansys
from namedmesh.files.of_aster import mesh_of_aster
from namedmesh.files.of_dyna import mesh_of_dyna
from namedmesh.files.of_frd import mesh_of_frd
from namedmesh.files.of_getfem import mesh_of_getfem
from namedmesh.files.of_gid import mesh_of_gid
from namedmesh.files.of_kratos import mesh_of_kratos
from namedmesh.files.of_med import mesh_of_med
from namedmesh.files.of_mfem import mesh_of_mfem
from namedmesh.files.of_xdmf import mesh_of_xdmf

OF_GMSH = {
    "gmsh": ".msh",
    "unv": ".unv",
    "cgns": ".cgns",
    "medit": ".mesh",
    "plot3d": ".p3d",
}
"""Formats that gmsh reads, and endings that it takes for no script."""
OF_MESHIO = {"ucd": "avsucd", "medit": "medit", "gmsh": "gmsh"}
"""meshio's names of formats."""
OF_VTK = ("vtk", "vtk xml", "vtkhdf")
"""Formats of VTK's."""
OWN: dict[str, Callable[[Path], FileMesh]] = {
    "abaqus": mesh_of_abaqus,
    "ansys": mesh_of_ansys,
    "aster": mesh_of_aster,
    "dyna": mesh_of_dyna,
    "hecmw": mesh_of_hecmw,
    "getfem": mesh_of_getfem,
    "mfem": mesh_of_mfem,
    "gid": mesh_of_gid,
    "med": mesh_of_med,
    "kratos": mesh_of_kratos,
    "frd": mesh_of_frd,
    "xdmf": mesh_of_xdmf,
}
"""Readers of this package."""
TOLD = (
    *(".vtk", ".vtu", ".pvtu", ".vti", ".vts", ".vtr", ".vtkhdf", ".xdmf", ".xmf"),
    *(".med", ".mmed", ".rmed", ".mdpa", ".frd", ".unv", ".cgns", ".mesh", ".bdf", ".nas"),
    *(".fem", ".inp", ".cdb", ".mail", ".k", ".key", ".dyn"),
)
"""Endings of formats that their contents tell."""
BY_ENDING = {
    ".p3d": "plot3d",
    **dict.fromkeys((".e", ".exo", ".ex2", ".exd", ".g", ".gen"), "exodus"),
}
"""Formats of which the contents do not tell them."""


def read(path: Path, kind: str, *, numbered: bool) -> FileMesh:
    """Read a mesh file, on this rank.

    Args:
        path: The file.
        kind: Its format, as :func:`kind_of` tells it.
        numbered: Whether surfaces and volumes of files of gmsh that are in no group are
            called by their numbers.

    Raises:
        InputError: If the file is unreadable or has no mesh of a known format.
    """
    if kind in DRAWINGS:
        raise InputError(f"it is a drawing ({kind}), and has no mesh; read_mesh makes one.")
    if kind in OWN:
        return OWN[kind](path)
    if kind == "exodus":
        return read_apart("of_vtk", "mesh_of_exodus", path)
    if kind in OF_VTK:
        return read_apart("of_vtk", "mesh_of_vtk", path, kind=kind)
    if kind == "nastran":
        return read_apart("of_nastran", "mesh_of_nastran", path, numbered=numbered)
    if kind in OF_GMSH:
        return _by_gmsh(path, kind, numbered=numbered)
    if not kind and path.suffix.lower() in TOLD:
        raise InputError(
            f"it does not begin as files that end with {path.suffix!r} do: it is damaged, or of a "
            "form that is not read. Write the mesh in another format: .msh, .vtu, .med, .inp."
        )
    return read_apart("of_meshio", "mesh_of_meshio", path, kind=OF_MESHIO.get(kind))


def _by_gmsh(path: Path, kind: str, *, numbered: bool) -> FileMesh:
    """Read a file by gmsh, else by meshio."""
    try:
        return read_apart("of_gmsh", "mesh_of_gmsh", path, numbered=numbered, ending=OF_GMSH[kind])
    except InputError:
        if kind in OF_MESHIO:
            with suppress(InputError):
                return read_apart("of_meshio", "mesh_of_meshio", path, kind=OF_MESHIO[kind])
        raise


def kind_of(path: Path) -> str:
    """Return the format of a file, "" if neither contents nor ending tell it.

    Raises:
        InputError: If it is missing, or of a format that is not read.
    """
    subject = f"The file {str(path)!r}"
    try:
        if path.is_file():
            return format_of(path) or BY_ENDING.get(path.suffix.lower(), "")
    except InputError as reason:
        raise InputError(f"{subject} cannot be used: {reason}") from reason
    except OSError as reason:
        raise InputError(f"{subject} cannot be opened: {reason.strerror}.") from reason
    raise InputError(f"{subject} does not exist; look at the path and the working folder.")
