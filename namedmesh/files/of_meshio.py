"""Read files by meshio, for formats that no other reader here has."""

from __future__ import annotations

import io
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.file_mesh import SHAPES, Block, ElementSet, FileMesh, NodeSet
from namedmesh.files.of_vtk import vectors_of
from namedmesh.files.tag_fields import tagged_sets
from namedmesh.rows import in_space

SHAPE_NAMES = {
    "vertex": "vertex",
    "line": "line",
    "triangle": "triangle",
    "quad": "quadrilateral",
    "tetra": "tetrahedron",
    "hexahedron": "hexahedron",
    "wedge": "prism",
    "pyramid": "pyramid",
}
"""Shape of meshio's types of cells, whose names may end with the number of nodes."""


def mesh_of_meshio(path: Path, *, kind: str | None = None) -> FileMesh:
    """Read a file by meshio, whose sets are integers at its cells and cell sets.

    Args:
        path: The file.
        kind: meshio's name of the format, or None if the ending tells it.
    """
    mesh = _read(path, kind)
    blocks = []
    kept = []
    left_out: Counter[str] = Counter()
    for number, block in enumerate(mesh.cells):
        shape = SHAPE_NAMES.get(block.type.rstrip("0123456789"))
        nodes = np.asarray(block.data)
        if shape is None or nodes.ndim != 2 or nodes.shape[1] < SHAPES[shape].corners:
            left_out[block.type] += len(block)
            continue
        blocks.append(Block(shape, nodes.astype(np.int64)))
        kept.append(number)
    fields = {}
    for name, values in mesh.cell_data.items():
        if len(values) != len(mesh.cells):
            continue  # meshio's reader of Nastran loses some
        fields[name] = [np.asarray(values[number]) for number in kept]
    names = {}
    for name, value in mesh.field_data.items():
        if np.shape(value) == (2,):
            tag, dim = (int(number) for number in value)
            names[dim, tag] = str(name)
    sets = list(tagged_sets(blocks, fields, names))
    for name, members in mesh.cell_sets.items():
        found = {}
        for place, number in enumerate(kept):
            if members[number] is not None and len(members[number]):
                found[place] = np.asarray(members[number]).astype(np.int64)
        if found and not name.startswith("gmsh:"):
            sets.append(ElementSet(str(name), found))
    node_sets = []
    for name, nodes in mesh.point_sets.items():
        node_sets.append(NodeSet(str(name), np.asarray(nodes).astype(np.int64)))
    points = np.asarray(mesh.points, dtype=float)
    return FileMesh(
        in_space(points),
        tuple(blocks),
        tuple(sets),
        node_sets=tuple(node_sets),
        left_out=left_out,
        values=vectors_of(mesh.point_data),
    )


def _read(path: Path, kind: str | None) -> Any:
    """Read a file by meshio, silently.

    Raises:
        InputError: If meshio knows no format of its ending, or fails.
    """
    import meshio  # noqa: PLC0415 - paid for only by those who read such files

    others = "Write the mesh in another format: .msh, .vtu, .med, .inp."
    endings = meshio.extension_to_filetypes
    if kind is None and not any(path.name.lower().endswith(ending) for ending in endings):
        raise InputError(
            f"neither what it holds nor its ending {path.suffix!r} tells a format of meshes. "
            f"{others}"
        )
    messages = io.StringIO()
    try:
        with redirect_stdout(messages), redirect_stderr(messages):
            return meshio.read(path, kind)
    except (Exception, SystemExit) as reason:  # what its readers stumble over
        what = f"{kind!r} of meshio" if kind else f"{path.suffix!r}"
        raise InputError(
            f"it is damaged, or of a form that the reader of {what} does not know. {others}"
        ) from reason
