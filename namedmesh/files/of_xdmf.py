"""Read files of XDMF, files of DOLFINx with mesh tags and functions, too.

DOLFINx writes each set of tags as a grid of its own, with the tagged cells or facets as
its topology.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.beside import beside
from namedmesh.files.file_mesh import Block, ElementSet, FileMesh, by_tags
from namedmesh.files.hdf5 import groups_of
from namedmesh.files.of_vtk import vectors_of
from namedmesh.files.tag_fields import tagged_sets
from namedmesh.rows import in_space, row_numbers

SHAPE_NAMES = {
    "polyvertex": "vertex",
    "polyline": "line",
    "edge": "line",
    "interval": "line",
    "tri": "triangle",
    "triangle": "triangle",
    "quad": "quadrilateral",
    "quadrilateral": "quadrilateral",
    "tet": "tetrahedron",
    "tetrahedron": "tetrahedron",
    "hex": "hexahedron",
    "hexahedron": "hexahedron",
    "wedge": "prism",
    "pyramid": "pyramid",
}
"""Shape by the first word of XDMF's types of topologies."""
MIXED = {
    1: ("vertex", 1),
    2: ("line", 2),
    4: ("triangle", 3),
    5: ("quadrilateral", 4),
    6: ("tetrahedron", 4),
    7: ("pyramid", 5),
    8: ("prism", 6),
    9: ("hexahedron", 8),
    34: ("line", 3),
    35: ("quadrilateral", 9),
    36: ("triangle", 6),
    37: ("quadrilateral", 8),
    38: ("tetrahedron", 10),
    39: ("pyramid", 13),
    40: ("prism", 15),
    41: ("prism", 18),
    48: ("hexahedron", 20),
    49: ("hexahedron", 24),
    50: ("hexahedron", 27),
}
"""Shape and number of nodes of XDMF's numbers of types in a mixed topology."""
WITH_COUNT = (1, 2)
"""Numbers of types after which the number of nodes stands."""


@dataclass(frozen=True, eq=False)
class _Grid:
    """Hold a topology with the fields at its elements.

    Attributes:
        name: Name of the grid.
        blocks: Its elements.
        fields: Values for each block by the name of the field.
    """

    name: str
    blocks: list[Block]
    fields: dict[str, list[np.ndarray]]


def mesh_of_xdmf(path: Path) -> FileMesh:
    """Read a file of XDMF, whose sets are the integers at its cells and facets.

    Raises:
        InputError: If it has no mesh.
    """
    root = ElementTree.parse(path).getroot()
    points: np.ndarray | None = None
    grids = []
    values: dict[str, np.ndarray] = {}
    for grid in root.iter("Grid"):
        geometry = grid.find("Geometry")
        if points is None and geometry is not None:
            points = _points(path, geometry)
        topology = grid.find("Topology")
        if topology is not None and topology.find("DataItem") is not None:
            grids.append(_grid(path, grid, topology))
        # The last step of a history stays.
        values.update(_node_values(path, grid, 0 if points is None else len(points)))
    if points is None or not grids:
        raise InputError("it has no grid with points and cells.")
    blocks, sets = _with_tags(grids)
    return FileMesh(points, tuple(blocks), tuple(sets), values=values)


def _data(path: Path, item: Any) -> np.ndarray:
    """Return the numbers of a data item.

    Raises:
        InputError: If it is of a format that is not read, or its file is missing.
    """
    rule = item.get("ItemType", "Uniform")
    if rule != "Uniform":
        raise InputError(f"its numbers are given by a rule, {rule!r}; write them as numbers.")
    kind = item.get("Format", "XML").upper()
    integer = item.get("NumberType", item.get("DataType", "Float")).lower() in (
        "int",
        "uint",
        "char",
        "uchar",
    )
    shape = [int(number) for number in item.get("Dimensions", "").split()]
    text = (item.text or "").strip()
    if kind == "XML":
        flat = np.array(text.split(), dtype=float)
        table = flat.astype(np.int64) if integer else flat
    elif kind == "HDF":
        import h5py  # noqa: PLC0415 - paid for only by those who read such files

        name, _, place = text.rpartition(":")
        file = beside(path, name)
        groups_of(file)
        with h5py.File(file, "r") as data:
            table = data[place][()]
    else:
        raise InputError(f"its numbers are in the format {kind!r}; write them as HDF or XML.")
    return table.reshape(shape) if shape and np.prod(shape) == table.size else table


def _points(path: Path, geometry: Any) -> np.ndarray:
    """Return the points of a geometry [length], shape (n, 3)."""
    items = geometry.findall("DataItem")
    kind = geometry.get("GeometryType", geometry.get("Type", "XYZ")).upper()
    if kind in ("X_Y_Z", "X_Y"):
        table = np.column_stack([_data(path, item).ravel() for item in items])
    elif kind in ("XY", "XYZ"):
        table = _data(path, items[0]).reshape(-1, len(kind))
    else:
        raise InputError(f"its points are given as {kind!r}; write them as XYZ.")
    return in_space(table.astype(float))


def _grid(path: Path, grid: Any, topology: Any) -> _Grid:
    """Return the elements of a grid, and the fields at them."""
    kind = topology.get("TopologyType", topology.get("Type", "")).lower()
    table = _data(path, topology.find("DataItem")).astype(np.int64)
    base = int(topology.get("BaseOffset", 0))
    if base and kind == "mixed":
        raise InputError("its mixed elements count their points from another number than 0.")
    table -= base
    if kind == "mixed":
        blocks, order = _split_mixed(table.ravel())
    else:
        shape = SHAPE_NAMES.get(kind.split("_")[0])
        if shape is None:
            raise InputError(f"it has elements of type {kind!r}, which are not read.")
        count = int(topology.get("NumberOfElements", len(table)).split()[-1])
        blocks = [Block(shape, table.reshape(count, -1))]
        order = [np.arange(count)]
    fields = {}
    for name, flat in _values(path, grid, "cell").items():
        fields[name] = [flat[rows] for rows in order]
    return _Grid(grid.get("Name", ""), blocks, fields)


def _split_mixed(stream: np.ndarray) -> tuple[list[Block], list[np.ndarray]]:
    """Take a mixed topology apart: blocks, and the numbers of their elements."""
    found: dict[tuple[str, int], tuple[list[int], list[int]]] = {}
    at = 0
    number = 0
    kinds = stream.tolist()
    while at < len(kinds):
        if kinds[at] not in MIXED:
            raise InputError(f"it has elements of XDMF's type {kinds[at]}, which are not read.")
        shape, width = MIXED[kinds[at]]
        begin = at + 1
        if kinds[at] in WITH_COUNT:
            width = kinds[begin]
            begin += 1
            if width < 1:
                raise InputError(f"it has an element of {width} points; it is damaged.")
        starts, numbers = found.setdefault((shape, width), ([], []))
        starts.append(begin)
        numbers.append(number)
        at = begin + width
        number += 1
    blocks = []
    order = []
    for (shape, width), (starts, numbers) in found.items():
        blocks.append(Block(shape, stream[np.array(starts)[:, None] + np.arange(width)]))
        order.append(np.array(numbers))
    return blocks, order


def _node_values(path: Path, grid: Any, count: int) -> dict[str, np.ndarray]:
    """Return the vectors at all points of a grid by name, shape (n, 3) each."""
    vectors = vectors_of(_values(path, grid, "node"))
    return {name: values for name, values in vectors.items() if len(values) == count}


def _values(path: Path, grid: Any, centre: str) -> dict[str, np.ndarray]:
    """Return the values of a grid at each "cell" or "node" by their names."""
    found = {}
    for attribute in grid.findall("Attribute"):
        item = attribute.find("DataItem")
        if attribute.get("Center", "Node").lower() == centre and item is not None:
            found[attribute.get("Name", "")] = _data(path, item)
    return found


def _with_tags(grids: list[_Grid]) -> tuple[list[Block], list[ElementSet]]:
    """Return the blocks of all grids, and the sets of their tags.

    A grid with cells of the body again tells tags of the cells of the first grid.
    """
    dim = max(block.dim for grid in grids for block in grid.blocks)
    blocks: list[Block] = []
    sets: list[ElementSet] = []
    called: dict[tuple[int, str], str] = {}
    for grid in grids:
        of_body = [block for block in grid.blocks if block.dim == dim]
        first_of_body = [number for number, block in enumerate(blocks) if block.dim == dim]
        if of_body and first_of_body:
            known = blocks[first_of_body[0]]
            found = [_on_cells(tagged, grid, known, first_of_body[0]) for tagged in _sets_of(grid)]
        else:
            begin = len(blocks)
            blocks += grid.blocks
            found = []
            for tagged in _sets_of(grid):
                members = {begin + number: rows for number, rows in tagged.members.items()}
                found.append(ElementSet(tagged.name, members, tagged.tag))
        for tagged in found:
            kind = dim if any(blocks[number].dim == dim for number in tagged.members) else dim - 1
            owner = called.setdefault((kind, tagged.name), grid.name)
            name = tagged.name if owner == grid.name else f"{grid.name} {tagged.name}"
            sets.append(ElementSet(name, tagged.members, tagged.tag))
    return blocks, sets


def _sets_of(grid: _Grid) -> tuple[ElementSet, ...]:
    """Return the sets of a grid; a grid with integers alone is a grid of tags."""
    if len(grid.fields) == 1 and len(grid.blocks) == 1:
        (values,) = grid.fields.values()
        flat = [np.asarray(part).reshape(len(part), -1)[:, 0] for part in values]
        if all(part.dtype.kind in "iu" for part in flat):
            return by_tags(tuple(grid.blocks), flat, {})
    return tagged_sets(grid.blocks, grid.fields, {})


def _on_cells(tagged: ElementSet, grid: _Grid, known: Block, number: int) -> ElementSet:
    """Return a set of the cells of a block, given by cells with the same corners."""
    rows = [grid.blocks[block].corners[members] for block, members in tagged.members.items()]
    if any(part.shape[1] != known.corners.shape[1] for part in rows):
        return ElementSet(tagged.name, {}, tagged.tag)
    there, here = row_numbers(known.corners, np.concatenate(rows))
    return ElementSet(tagged.name, {number: np.flatnonzero(np.isin(there, here))}, tagged.tag)
