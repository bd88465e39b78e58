"""Read mesh files: find the reader by the ending and by how the text begins."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.files.abaqus_cards import is_abaqus
from erc_contact.mesh.files.apart import read_apart
from erc_contact.mesh.files.file_mesh import FileMesh
from erc_contact.mesh.files.of_abaqus import mesh_of_abaqus
from erc_contact.mesh.files.of_frd import mesh_of_frd
from erc_contact.mesh.files.of_getfem import is_getfem, mesh_of_getfem
from erc_contact.mesh.files.of_gid import is_gid, mesh_of_gid
from erc_contact.mesh.files.of_kratos import mesh_of_kratos
from erc_contact.mesh.files.of_med import mesh_of_med
from erc_contact.mesh.files.of_meshio import mesh_of_meshio
from erc_contact.mesh.files.of_mfem import is_mfem, mesh_of_mfem
from erc_contact.mesh.files.of_xdmf import mesh_of_xdmf


def _by_gmsh(path: Path, *, numbered: bool) -> FileMesh:
    """Read a file of gmsh, else by meshio."""
    try:
        return read_apart("erc_contact.mesh.files.of_gmsh", "mesh_of_gmsh", path, numbered=numbered)
    except InputError as reason:
        try:
            return mesh_of_meshio(path)
        except InputError:
            raise reason from None


OF_GMSH = (".msh", ".unv", ".cgns", ".mesh", ".meshb", ".bdf", ".nas", ".p3d", ".ir3")
"""Endings of files that gmsh reads."""


def _by_vtk(path: Path) -> FileMesh:
    """Read a file of VTK, whose library ends where a file is damaged."""
    return read_apart("erc_contact.mesh.files.of_vtk", "mesh_of_vtk", path)


def _of_exodus(path: Path) -> FileMesh:
    """Read a file of Exodus by VTK."""
    return read_apart("erc_contact.mesh.files.of_vtk", "mesh_of_exodus", path)


BY_THEIR_BEGINNING: tuple[tuple[Callable[[Path], bool], Callable[[Path], FileMesh]], ...] = (
    (is_abaqus, mesh_of_abaqus),
    (is_getfem, mesh_of_getfem),
    (is_mfem, mesh_of_mfem),
    (is_gid, mesh_of_gid),
)
"""Readers of texts whose endings other programs use, too."""
READERS: dict[str, Callable[[Path], FileMesh]] = {
    **dict.fromkeys((".vtk", ".vtu", ".pvtu", ".vti", ".vts", ".vtr", ".vtkhdf"), _by_vtk),
    ".med": mesh_of_med,
    ".mdpa": mesh_of_kratos,
    ".frd": mesh_of_frd,
    **dict.fromkeys((".xdmf", ".xmf"), mesh_of_xdmf),
    **dict.fromkeys((".e", ".exo", ".ex2", ".exd", ".g", ".gen"), _of_exodus),
}
"""Reader of other files by their ending; meshio gets files with any other."""


def read(path: Path, *, numbered: bool) -> FileMesh:
    """Read a mesh file, on this rank.

    Args:
        path: The file.
        numbered: Whether surfaces and volumes of files of gmsh that are in no group are
            called by their numbers.

    Raises:
        InputError: If the file is missing, unreadable or has no mesh of a known format.
    """
    if not path.is_file():
        raise InputError(
            f"The mesh file {str(path)!r} does not exist; look at the path and the working folder."
        )
    for is_of_kind, mesh_of in BY_THEIR_BEGINNING:
        if is_of_kind(path):
            return mesh_of(path)
    suffix = path.suffix.lower()
    if suffix == ".inp":
        return mesh_of_meshio(path, "avsucd")
    if suffix in OF_GMSH:
        return _by_gmsh(path, numbered=numbered)
    return READERS.get(suffix, mesh_of_meshio)(path)
