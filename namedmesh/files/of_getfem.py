"""Read files of GetFEM (.mesh), whose regions are the sets."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.file_mesh import Block, ElementSet, FacetSet, FileMesh, pad
from namedmesh.rows import in_space

FACTOR = re.compile(r"GT_(PK|QK)\((\d+),\s*(\d+)\)")
"""A simplex or a cube of a dimension and a degree, of which cells are products."""
ORDER = {
    "triangle": [0, 1, 2],
    "quadrilateral": [0, 1, 3, 2],
    "tetrahedron": [0, 1, 2, 3],
    "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6],
    "prism": [0, 1, 2, 3, 4, 5],
}
"""Order of the corners of products, whose first coordinate runs fastest."""
SHAPES_OF_PRODUCTS = {
    (2,): "triangle",
    (3,): "tetrahedron",
    (1, 1): "quadrilateral",
    (1, 1, 1): "hexahedron",
    (2, 1): "prism",
}
"""Shape by the dimensions of the simplices of which a cell is the product."""

HIGHEST = 9
"""Highest degree of cells that are read."""


def mesh_of_getfem(path: Path) -> FileMesh:
    """Read a file of GetFEM.

    Raises:
        InputError: If it has no points, or cells that are not read.
    """
    text = re.sub(r"%.*", "", path.read_text("latin-1"))
    points = re.findall(r"POINT[ \t]+(\d+)((?:[ \t]+[-+.\d][-+.\deE]*)+)", text)
    if not points:
        raise InputError("it has no list of points, as files of GetFEM have.")
    places = {int(number): row for row, (number, _) in enumerate(points)}
    x = np.array([[float(word) for word in words.split()] for _, words in points])
    kinds: dict[str, list[list[int]]] = {}
    cell_of: dict[int, tuple[str, int]] = {}
    for number, kind, words in re.findall(
        r"CONVEX\s+(\d+)\s+'?(GT_[^'\n]+?\))'?((?:[ \t]+\d+)+)", text
    ):
        rows = kinds.setdefault(kind, [])
        cell_of[int(number)] = (kind, len(rows))
        rows.append([places.get(int(word), -1) for word in words.split()])
    blocks: list[Block] = []
    left_out = {}
    block_of = {}
    for kind, rows in kinds.items():
        shape, corners = _corners(kind)
        if shape is None:
            left_out[kind] = len(rows)
            continue
        block_of[kind] = len(blocks)
        nodes = np.array(rows)
        others = np.setdiff1d(np.arange(nodes.shape[1]), corners)
        blocks.append(Block(shape, nodes[:, [*corners, *others]]))
    element_sets = []
    facet_sets = []
    for name, words in re.findall(r"BEGIN REGION\s+(\d+)(.*?)END REGION", text, re.DOTALL):
        members: dict[int, list[int]] = {}
        facets = []
        for cell, _, face in re.findall(r"(\d+)(/(\d+))?", words):
            kind, row = cell_of.get(int(cell), ("", 0))
            if kind not in block_of:
                continue
            block = blocks[block_of[kind]]
            if not face:
                members.setdefault(block_of[kind], []).append(row)
            elif block.shape in ("triangle", "tetrahedron"):
                facets.append(np.delete(block.corners[row], int(face)))
        if members:
            found = {number: np.array(rows) for number, rows in members.items()}
            element_sets.append(ElementSet(name, found, int(name)))
        if facets:
            facet_sets.append(FacetSet(name, pad(np.array(facets)), int(name)))
    return FileMesh(
        in_space(x),
        tuple(blocks),
        tuple(element_sets),
        tuple(facet_sets),
        left_out=left_out,
    )


def _corners(kind: str) -> tuple[str | None, list[int]]:
    """Return the shape of a kind of cells, None if it is not read, and its corners."""
    factors: list[tuple[int, int]] = []
    for family, d, degree in FACTOR.findall(kind):
        factors += [(int(d), int(degree))] if family == "PK" else [(1, int(degree))] * int(d)
    shape = SHAPES_OF_PRODUCTS.get(tuple(d for d, _ in factors))
    if shape is None or max(degree for _, degree in factors) > HIGHEST:
        return None, []
    # The nodes of a simplex count along its first direction, then along the second one.
    numbers = []
    strides = [1]
    for d, degree in factors:
        grid = [
            point[::-1] for point in product(range(degree + 1), repeat=d) if sum(point) <= degree
        ]
        ends = [i for i, point in enumerate(grid) if sum(point) == 0 or max(point) == degree]
        numbers.append(ends)
        strides.append(strides[-1] * len(grid))
    corners = []
    for place in product(*reversed(numbers)):
        steps = zip(reversed(place), strides, strict=False)
        corners.append(sum(end * stride for end, stride in steps))
    return shape, [corners[place] for place in ORDER[shape]]
