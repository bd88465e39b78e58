"""Read mesh files: find the reader by the ending and by how the text begins."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.files.abaqus_cards import is_abaqus
from erc_contact.mesh.files.file_mesh import FileMesh
from erc_contact.mesh.files.of_abaqus import mesh_of_abaqus
from erc_contact.mesh.files.of_getfem import is_getfem, mesh_of_getfem
from erc_contact.mesh.files.of_gmsh import grouped, in_two_groups, mesh_of_model
from erc_contact.mesh.files.of_kratos import mesh_of_kratos
from erc_contact.mesh.files.of_med import mesh_of_med
from erc_contact.mesh.files.of_meshio import mesh_of_meshio
from erc_contact.mesh.files.of_vtk import mesh_of_exodus, mesh_of_vtk
from erc_contact.mesh.files.of_xdmf import mesh_of_xdmf
from erc_contact.mesh.gmsh_session import new_model


def mesh_of_gmsh(path: Path, *, numbered: bool) -> FileMesh:
    """Read a file by gmsh, whose sets are its groups; see :func:`grouped`."""
    with new_model() as gmsh:
        gmsh.merge(str(path))
        with grouped(gmsh.model, numbered=numbered):
            # In version 2 each element has groups; gmsh gives them to whole entities.
            if in_two_groups(gmsh.model) and _is_of_second_version(path):
                return mesh_of_meshio(path, "gmsh")
            return mesh_of_model(gmsh.model)


def _is_of_second_version(path: Path) -> bool:
    """Tell whether a file of gmsh is of version 2."""
    with path.open("rb") as file:
        return file.read(40).split()[:2] in ([b"$MeshFormat", b"2.2"], [b"$MeshFormat", b"2"])


OF_GMSH = (".msh", ".unv", ".cgns", ".mesh", ".meshb", ".bdf", ".nas", ".p3d", ".ir3")
"""Endings of files that gmsh reads."""
READERS: dict[str, Callable[[Path], FileMesh]] = {
    **dict.fromkeys((".vtk", ".vtu", ".pvtu", ".vti", ".vts", ".vtr", ".vtkhdf"), mesh_of_vtk),
    ".med": mesh_of_med,
    ".mdpa": mesh_of_kratos,
    **dict.fromkeys((".xdmf", ".xmf"), mesh_of_xdmf),
    **dict.fromkeys((".e", ".exo", ".ex2", ".exd", ".g", ".gen"), mesh_of_exodus),
}
"""Reader of other files by their ending; meshio gets those that are not here."""


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
    if is_abaqus(path):
        return mesh_of_abaqus(path)
    if is_getfem(path):
        return mesh_of_getfem(path)
    suffix = path.suffix.lower()
    if suffix == ".inp":
        return mesh_of_meshio(path, "avsucd")
    if suffix in OF_GMSH:
        return mesh_of_gmsh(path, numbered=numbered)
    return READERS.get(suffix, mesh_of_meshio)(path)
