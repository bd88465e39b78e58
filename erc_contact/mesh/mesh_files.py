"""Open mesh files in gmsh; formats that gmsh does not read go through meshio."""

from __future__ import annotations

import io
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError

CAD = (".step", ".stp", ".iges", ".igs", ".brep", ".stl")
"""Endings of files of drawings, which have no names of parts."""
TAG_KEYS = ("gmsh:physical", "medit:ref", "cell_tags")
"""Names of the cell data of meshio that hold tags, the preferred one first."""


def open_mesh_file(gmsh: Any, path: Path, *, has_rules: bool) -> None:
    """Open a mesh file in gmsh's current session.

    Args:
        gmsh: The module gmsh.
        path: The file.
        has_rules: Whether rules name its parts, which then need no tags.

    Raises:
        InputError: If the file is missing, unreadable, a drawing, or without tags.
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
    if path.suffix in (".msh", ".geo"):
        gmsh.open(str(path))
        return
    with tempfile.TemporaryDirectory() as folder:
        converted = Path(folder) / "mesh.msh"
        _convert(path, converted, has_rules=has_rules)
        gmsh.open(str(converted))


def _convert(path: Path, target: Path, *, has_rules: bool) -> None:
    """Convert what meshio reads to a .msh file with physical groups."""
    import meshio  # noqa: PLC0415 - paid for only by those who read other formats

    mesh = _read(path)
    tags, names = _tags_of_cells(mesh)
    if tags is None and not has_rules:
        raise InputError(
            f"The mesh file {str(path)!r} has no groups of facets; write integer cell data for "
            "the boundary cells, convert to .msh with physical groups, or name parts by rules: "
            'parts={"bottom": ec.where(y=0.0)}.'
        )
    if tags is None:
        tags = [np.zeros(len(block.data), dtype=int) for block in mesh.cells]
    body_dim = max(block.dim for block in mesh.cells)
    blocks = []
    groups = []
    for block, block_tags in zip(mesh.cells, tags, strict=True):
        # Points, and edges of a body in space, are neither cells nor facets.
        if block.dim < body_dim - 1:
            continue
        # The sign of a tag tells an orientation, which plays no role here.
        group = np.abs(block_tags).astype(np.int32)
        if block.dim == body_dim:
            # Tag 0 means none, and each cell of the body must be in a group.
            group[group == 0] = group.max() + 1
        blocks.append((block.type, block.data))
        groups.append(group)
    converted = meshio.Mesh(
        mesh.points,
        blocks,
        cell_data={"gmsh:physical": groups, "gmsh:geometrical": groups},
        field_data=names,
    )
    converted.write(target, file_format="gmsh22", binary=False)


def _read(path: Path) -> Any:
    """Read a file by meshio, silently."""
    import meshio  # noqa: PLC0415

    messages = io.StringIO()
    try:
        with redirect_stdout(messages), redirect_stderr(messages):
            return meshio.read(path)
    except SystemExit as end:  # meshio's way to say that a file is broken
        words = " ".join(messages.getvalue().split())
        raise InputError(f"The mesh file {str(path)!r} cannot be read: {words}") from end


def _tags_of_cells(mesh: Any) -> tuple[list[np.ndarray] | None, dict[str, Any]]:
    """Find the tags of the cells in a mesh of meshio, and the names of the tags.

    Returns:
        The tags of each block of cells, or None if there are none; and pairs (tag,
        dimension) by name.
    """
    names = dict(mesh.field_data)
    tags = {}
    for key, blocks in mesh.cell_data.items():
        if all(np.issubdtype(block.dtype, np.integer) for block in blocks):
            tags[key] = blocks
    for key in TAG_KEYS:
        if key in tags:
            return tags[key], names
    if tags:
        return next(iter(tags.values())), names
    if not mesh.cell_sets:
        return None, names
    # Without integer data each cell set becomes a tag.
    set_tags = [np.zeros(len(block), dtype=int) for block in mesh.cells]
    for number, (name, members) in enumerate(mesh.cell_sets.items(), start=1):
        for block, cells in enumerate(members):
            if cells is not None and len(cells):
                set_tags[block][cells] = number
                names[name] = np.array([number, mesh.cells[block].dim])
    return set_tags, names
