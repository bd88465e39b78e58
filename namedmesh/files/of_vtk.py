"""Read files of VTK: legacy and XML files, and Exodus, whose reader VTK has."""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.files.beside import beside
from namedmesh.files.file_mesh import (
    Block,
    ElementSet,
    FacetSet,
    FileMesh,
    NodeSet,
    pad,
)
from namedmesh.files.tag_fields import tagged_sets
from namedmesh.rows import in_space

SHAPE_OF_TYPE = {
    1: "vertex",
    3: "line",
    5: "triangle",
    8: "quadrilateral",
    9: "quadrilateral",
    10: "tetrahedron",
    11: "hexahedron",
    12: "hexahedron",
    13: "prism",
    14: "pyramid",
    21: "line",
    22: "triangle",
    23: "quadrilateral",
    24: "tetrahedron",
    25: "hexahedron",
    26: "prism",
    27: "pyramid",
    28: "quadrilateral",
    29: "hexahedron",
    30: "quadrilateral",
    31: "prism",
    32: "prism",
    33: "hexahedron",
    34: "triangle",
    35: "line",
    37: "pyramid",
    68: "line",
    69: "triangle",
    70: "quadrilateral",
    71: "tetrahedron",
    72: "hexahedron",
    73: "prism",
    74: "pyramid",
}
"""Shape of the cells of VTK's numbers of types."""
POLYGON = 7
"""VTK's number of a polygon."""
CORNER_ORDER = {8: [0, 1, 3, 2], 11: [0, 1, 3, 2, 4, 5, 7, 6]}
"""Order of the corners of pixels and voxels, which count them line by line."""
DEEPEST = 4
"""Greatest number of files of XML that name each other."""
PIECES_HEAD = 1_000_000
"""Number of bytes of a file of XML in which the names of its pieces stand."""
MOST_VOXELS = 500_000
"""Greatest number of voxels of an image that is taken for a mesh."""
FACE_SETS = ("Side Sets", "Face Sets")
"""Groups of Exodus whose members are sides of cells."""


def mesh_of_vtk(path: Path, *, kind: str) -> FileMesh:
    """Read a file of VTK, whose sets are the integers at its cells.

    Args:
        path: The file.
        kind: Its format, "vtk", "vtk xml" or "vtkhdf".

    Raises:
        InputError: If VTK finds no cells in it, or it names files elsewhere.
    """
    if kind == "vtk xml":
        _check_pieces(path)
    with _silent():
        reader = _reader(kind)
        reader.SetFileName(str(path))
        reader.Update()
        data = reader.GetOutputDataObject(0)
        if data is not None and data.IsA("vtkImageData") and data.GetNumberOfCells() > MOST_VOXELS:
            raise InputError(
                f"it is an image of {data.GetNumberOfCells()} voxels; mesh the body that it shows, "
                "by pyvista's threshold and a mesher, and read that mesh."
            )
        grid = _unstructured_grid(data)
    if grid is None or not grid.GetNumberOfCells():
        raise InputError("VTK found no cells in it; the file is damaged, or of another format.")
    blocks, cells_of, left_out = _blocks(grid)
    fields = {}
    for name, values in _arrays(grid.GetCellData()).items():
        fields[name] = [values[cells] for cells in cells_of]
    return FileMesh(
        _points(grid),
        blocks,
        tagged_sets(blocks, fields, {}),
        left_out=left_out,
        values=vectors_of(_arrays(grid.GetPointData())),
    )


def _check_pieces(path: Path, deep: int = 0) -> None:
    """Check that the files that a file of XML names lie beside it.

    Raises:
        InputError: If one does not, or they name each other.
    """
    if deep > DEEPEST:
        raise InputError(f"more than {DEEPEST} files name each other, last {path.name!r}.")
    with path.open("rb") as file:
        head = file.read(PIECES_HEAD)
    for found in re.findall(rb"<(?:Piece|DataSet)\b[^>]*\b(?:Source|file)=[\"']([^\"']*)", head):
        name = html.unescape(found.decode("utf-8", "replace"))
        piece = beside(path, name)
        if piece != (path.parent / name).resolve():
            # VTK itself takes no file beside in place of one elsewhere.
            raise InputError(f"it names the file {name!r}; write the name without its folder.")
        _check_pieces(piece, deep + 1)


def _reader(kind: str) -> Any:
    """Return VTK's reader of a format."""
    # Each is imported alone: VTK's libraries take longer to load than a mesh to read.
    if kind == "vtkhdf":
        from vtkmodules.vtkIOHDF import vtkHDFReader  # noqa: PLC0415 - in a process of its own

        return vtkHDFReader()
    if kind == "vtk":
        from vtkmodules.vtkIOLegacy import vtkGenericDataObjectReader  # noqa: PLC0415

        reader = vtkGenericDataObjectReader()
        for fields in ("Scalars", "Vectors", "Fields"):
            getattr(reader, f"ReadAll{fields}On")()
        return reader
    from vtkmodules.vtkIOXML import vtkXMLGenericDataObjectReader  # noqa: PLC0415

    return vtkXMLGenericDataObjectReader()


def _unstructured_grid(data: Any) -> Any:
    """Return data of VTK as one unstructured grid, None if there is no grid."""
    from vtkmodules.vtkFiltersCore import vtkAppendFilter  # noqa: PLC0415

    if data is None:
        return None
    if data.IsA("vtkUnstructuredGrid"):
        return data
    leaves = [data]
    if data.IsA("vtkCompositeDataSet"):
        iterator = data.NewIterator()
        leaves = []
        while not iterator.IsDoneWithTraversal():
            leaves.append(iterator.GetCurrentDataObject())
            iterator.GoToNextItem()
    append = vtkAppendFilter()
    for leaf in leaves:
        if leaf is not None and leaf.IsA("vtkDataSet"):
            append.AddInputData(leaf)
    if not append.GetNumberOfInputConnections(0):
        return None
    append.Update()
    return append.GetOutput()


def _points(grid: Any) -> np.ndarray:
    """Return the points of a grid of VTK [length], shape (n, 3)."""
    from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: PLC0415

    return vtk_to_numpy(grid.GetPoints().GetData()).astype(float)


def _arrays(data: Any) -> dict[str, np.ndarray]:
    """Return the arrays of numbers at cells or points of VTK by name."""
    from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: PLC0415

    found = {}
    for number in range(data.GetNumberOfArrays()):
        array = data.GetArray(number)
        if array is not None:
            found[array.GetName() or str(number)] = vtk_to_numpy(array)
    return found


def vectors_of(point_data: Any) -> dict[str, np.ndarray]:
    """Return the vectors among the data of points by name, shape (n, 3) each."""
    found = {}
    for name in point_data:
        values = np.asarray(point_data[name])
        if values.ndim == 2 and values.shape[1] in (2, 3) and values.dtype.kind == "f":
            found[name] = in_space(values.astype(float))
    return found


@contextmanager
def _silent() -> Iterator[None]:
    """Keep VTK from writing warnings of its own."""
    from vtkmodules.vtkCommonCore import vtkObject  # noqa: PLC0415

    before = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(before)


def _blocks(grid: Any) -> tuple[tuple[Block, ...], list[np.ndarray], Counter[str]]:
    """Return the cells of a grid of VTK.

    Returns:
        The blocks, the numbers of their cells in the grid, and how many cells of which
        kind are left out.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: PLC0415

    types = vtk_to_numpy(grid.GetCellTypes()).astype(np.int64).ravel()
    cells_of_vtk = grid.GetCells()
    offsets = vtk_to_numpy(cells_of_vtk.GetOffsetsArray()).astype(np.int64)
    connectivity = vtk_to_numpy(cells_of_vtk.GetConnectivityArray()).astype(np.int64)
    sizes = np.diff(offsets)
    kinds = np.column_stack([types, sizes])
    blocks = []
    cells_of = []
    left_out: Counter[str] = Counter()
    for kind, size in np.unique(kinds, axis=0):
        cells = np.flatnonzero((types == kind) & (sizes == size))
        shape = SHAPE_OF_TYPE.get(int(kind))
        if kind == POLYGON:
            shape = {3: "triangle", 4: "quadrilateral"}.get(int(size))
        if shape is None:
            left_out[f"VTK {kind}"] += len(cells)
            continue
        nodes = connectivity[offsets[cells][:, None] + np.arange(size)]
        blocks.append(Block(shape, nodes[:, CORNER_ORDER.get(int(kind), slice(None))]))
        cells_of.append(cells)
    return tuple(blocks), cells_of, left_out


def mesh_of_exodus(path: Path) -> FileMesh:
    """Read a file of Exodus, with its blocks, side sets and node sets."""
    from vtkmodules.vtkIOExodus import vtkExodusIIReader  # noqa: PLC0415

    reader = vtkExodusIIReader()
    with _silent():
        if not reader.CanReadFile(str(path)):
            raise InputError("VTK finds that it is no file of Exodus.")
        reader.SetFileName(str(path))
        reader.SetApplyDisplacements(False)
        reader.SetGenerateGlobalNodeIdArray(True)
        reader.UpdateInformation()
        for kind in range(14):
            for number in range(reader.GetNumberOfObjects(kind)):
                reader.SetObjectStatus(kind, number, 1)
        for number in range(reader.GetNumberOfPointResultArrays()):
            reader.SetPointResultArrayStatus(reader.GetPointResultArrayName(number), 1)
        steps = reader.GetNumberOfTimeSteps()
        if steps:
            # The last one is the result.
            reader.SetTimeStep(steps - 1)
        reader.Update()
    mesh = _of_exodus_groups(reader.GetOutput())
    is_empty = mesh.values and not any(values.any() for values in mesh.values.values())
    if is_empty and b"file_size" not in path.read_bytes():
        raise InputError(
            "its values at points are stored in a way that the library of Exodus reads as zero, as"
            " meshio stores them; write .vtu."
        )
    return mesh


def _of_exodus_groups(output: Any) -> FileMesh:
    """Return the mesh of what VTK's reader of Exodus gives."""
    leaves = list(_leaves(output))
    ids = np.unique(np.concatenate([leaf.global_ids for leaf in leaves]))
    points = np.zeros((len(ids), 3))
    blocks: list[Block] = []
    sets: list[ElementSet] = []
    facet_sets: list[FacetSet] = []
    node_sets: list[NodeSet] = []
    left_out: Counter[str] = Counter()
    values: dict[str, np.ndarray] = {}
    for leaf in leaves:
        rows = np.searchsorted(ids, leaf.global_ids)
        if leaf.group == "Element Blocks":
            points[rows] = _points(leaf.grid)
            for name, vectors in vectors_of(_arrays(leaf.grid.GetPointData())).items():
                values.setdefault(name, np.zeros((len(ids), 3)))[rows] = vectors
        if leaf.group == "Node Sets":
            node_sets.append(NodeSet(leaf.name, rows, leaf.tag))
            continue
        found, _, out = _blocks(leaf.grid)
        found = tuple(Block(block.shape, rows[block.nodes]) for block in found)
        if leaf.group == "Element Blocks":
            first = len(blocks)
            blocks += found
            members = {first + i: np.arange(len(block.nodes)) for i, block in enumerate(found)}
            sets.append(ElementSet(leaf.name, members, leaf.tag))
            left_out += out
        elif leaf.group in FACE_SETS:
            for block in found:
                if block.dim in (1, 2):
                    facet_sets.append(FacetSet(leaf.name, pad(block.corners), leaf.tag))
    dim = max((block.dim for block in blocks), default=0)
    width = 2 * (dim - 1)
    fitting = tuple(found for found in facet_sets if found.corners.shape[1] == width)
    return FileMesh(points, tuple(blocks), tuple(sets), fitting, tuple(node_sets), left_out, values)


class _Leaf:
    """Hold a block or set of Exodus: group, name, tag, grid, numbers of nodes."""

    def __init__(self, group: str, words: str, grid: Any) -> None:
        self.group = group
        self.grid = _unstructured_grid(grid)
        self.global_ids = _arrays(self.grid.GetPointData())["GlobalNodeId"]
        head, separator, number = words.rpartition("ID: ")
        digits = number.strip().split()[0] if separator else ""
        self.tag = int(digits) if digits.isdigit() else None
        unnamed = not separator or head.startswith("Unnamed") or not head.strip()
        self.name = digits if separator and unnamed else (head.strip() or words)


def _leaves(output: Any) -> Iterator[_Leaf]:
    """Iterate over the blocks and sets of Exodus that are not empty."""
    for number in range(output.GetNumberOfBlocks()):
        group = output.GetBlock(number)
        if group is None:
            continue
        group_name = output.GetMetaData(number).Get(output.NAME())
        for member in range(group.GetNumberOfBlocks()):
            grid = group.GetBlock(member)
            if grid is not None and grid.GetNumberOfPoints():
                yield _Leaf(group_name, group.GetMetaData(member).Get(output.NAME()), grid)
