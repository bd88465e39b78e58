"""Read meshes of MFEM, whose attributes and named sets of attributes are the sets."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.file_mesh import SHAPES, Block, ElementSet, FileMesh, by_tags
from namedmesh.rows import in_space

SHAPE_OF_TYPE = (
    *("vertex", "line", "triangle", "quadrilateral"),
    *("tetrahedron", "hexahedron", "prism", "pyramid"),
)
"""Shapes in the order of MFEM's numbers of types."""
SECTIONS = (
    *("dimension", "elements", "boundary", "vertices", "nodes"),
    *("attribute_sets", "bdr_attribute_sets"),
)
"""Words that begin what is read."""
OTHERS = ("edges", "vertex_parents", "coordinates", "knotvectors", "weights", "mfem_mesh_end")
"""Words that begin what is not read."""


def mesh_of_mfem(path: Path) -> FileMesh:
    """Read a mesh of MFEM, and a curved mesh at its corners.

    Raises:
        InputError: If it is a mesh of splines, with hanging nodes, or without vertices.
    """
    first, *lines = path.read_text("latin-1").splitlines()
    if not first.startswith("MFEM mesh"):
        raise InputError(
            f"it is {first.split(' v')[0]!r}, which has splines, hanging nodes or a rule in place "
            "of cells; let MFEM write plain cells, by Mesh::PrintVTU or after SetCurvature(1)."
        )
    sections = _sections(lines)
    dim = int(sections["dimension"][0])
    blocks, tags = _blocks(sections.get("elements", []) + sections.get("boundary", []))
    vertices = sections.get("vertices", [])
    curved = len(vertices) < 2
    x = _first_nodes(int(vertices[0]), sections["nodes"]) if curved else _table(vertices)
    sets: list[ElementSet] = []
    for name, d in (("attribute_sets", dim), ("bdr_attribute_sets", dim - 1)):
        named = _named_sets(sections.get(name, []), blocks, tags, d)
        by_number = [found for found in by_tags(blocks, tags, {}) if _dim(found, blocks) == d]
        sets += named or by_number
    notes = ("the cells are curved, and their corners are taken",) if curved else ()
    return FileMesh(in_space(x), blocks, tuple(sets), notes=notes)


def _sections(lines: list[str]) -> dict[str, list[str]]:
    """Return the lines of each section, without comments."""
    sections: dict[str, list[str]] = {}
    into: list[str] = []
    for line in lines:
        text = line.partition("#")[0].strip()
        if text in SECTIONS:
            into = sections.setdefault(text, [])
        elif text in OTHERS:
            into = []
        elif text:
            into.append(text)
    return sections


def _blocks(rows: list[str]) -> tuple[tuple[Block, ...], list[np.ndarray]]:
    """Return the cells by shape, and their attributes."""
    table = [words for words in map(str.split, rows) if len(words) > 1]
    kinds = np.array([int(words[1]) for words in table])
    blocks = []
    tags = []
    for kind in np.unique(kinds):
        shape = SHAPE_OF_TYPE[kind]
        width = 2 + SHAPES[shape].corners
        chosen = [table[row][:width] for row in np.flatnonzero(kinds == kind)]
        cells = np.array(chosen, dtype=np.int64)
        blocks.append(Block(shape, cells[:, 2:]))
        tags.append(cells[:, 0])
    return tuple(blocks), tags


def _table(rows: list[str]) -> np.ndarray:
    """Return the vertices [length], shape (n, d), of lines that begin with n and d."""
    return np.array(" ".join(rows[2:]).split(), dtype=float).reshape(-1, int(rows[1]))


def _first_nodes(count: int, field: list[str]) -> np.ndarray:
    """Return the vertices of a curved mesh [length], shape (count, d).

    Args:
        count: Their number.
        field: Lines of the field of places, which begins with the vertices.

    Raises:
        InputError: If cells do not share the nodes of the field.
    """
    heads = dict(re.findall(r"(\w+): (\S+)", "\n".join(field[:4])))
    if not re.match(r"H1_|Linear|Quadratic|Cubic", heads["FiniteElementCollection"]):
        raise InputError(
            "its cells do not share their corners, as periodic meshes have it; let MFEM write a "
            "mesh with vertices, after SetCurvature(1)."
        )
    values = np.array(" ".join(field[4:]).split(), dtype=float)
    d = int(heads["VDim"])
    by_node = heads["Ordering"] == "1"
    return values.reshape(-1, d)[:count] if by_node else values.reshape(d, -1).T[:count]


def _dim(found: ElementSet, blocks: tuple[Block, ...]) -> int:
    """Return the dimension of the elements of a set."""
    return max(blocks[number].dim for number in found.members)


def _named_sets(
    rows: list[str], blocks: tuple[Block, ...], tags: list[np.ndarray], d: int
) -> list[ElementSet]:
    """Return the sets of attributes of elements of a dimension."""
    sets = []
    for line in rows[1:]:
        _, name, numbers = line.split('"')
        wanted = [int(word) for word in numbers.split()[1:]]
        members = {}
        for number, (block, block_tags) in enumerate(zip(blocks, tags, strict=True)):
            if block.dim == d:
                members[number] = np.flatnonzero(np.isin(block_tags, wanted))
        sets.append(ElementSet(name, members))
    return sets
