"""Read mesh files: find the reader by the ending and by how the text begins."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.files.abaqus_cards import is_abaqus
from erc_contact.mesh.files.file_mesh import FileMesh
from erc_contact.mesh.files.of_abaqus import mesh_of_abaqus
from erc_contact.mesh.files.of_gmsh import grouped, mesh_of_model
from erc_contact.mesh.files.of_med import mesh_of_med
from erc_contact.mesh.files.of_meshio import mesh_of_meshio
from erc_contact.mesh.files.of_vtk import mesh_of_exodus, mesh_of_vtk
from erc_contact.mesh.gmsh_session import new_model


def mesh_of_gmsh(path: Path) -> FileMesh:
    """Read a file by gmsh, whose sets are its physical groups."""
    with new_model() as gmsh:
        gmsh.merge(str(path))
        with grouped(gmsh.model):
            return mesh_of_model(gmsh.model)


READERS: dict[str, Callable[[Path], FileMesh]] = {
    **dict.fromkeys((".msh", ".unv", ".cgns", ".mesh", ".meshb"), mesh_of_gmsh),
    **dict.fromkeys((".bdf", ".nas", ".p3d", ".ir3"), mesh_of_gmsh),
    **dict.fromkeys((".vtk", ".vtu", ".pvtu", ".vti", ".vts", ".vtr", ".vtkhdf"), mesh_of_vtk),
    ".med": mesh_of_med,
    **dict.fromkeys((".e", ".exo", ".ex2", ".exd", ".g", ".gen"), mesh_of_exodus),
}
"""Reader by the ending of the file; meshio gets the other files."""


def read(path: Path) -> FileMesh:
    """Read a mesh file, on this rank.

    Raises:
        InputError: If the file is missing, unreadable or has no mesh of a known format.
    """
    if not path.is_file():
        raise InputError(
            f"The mesh file {str(path)!r} does not exist; look at the path and the working folder."
        )
    if is_abaqus(path):
        return mesh_of_abaqus(path)
    reader = READERS.get(path.suffix.lower(), mesh_of_meshio)
    return reader(path)
