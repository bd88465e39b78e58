"""Where domains come from: rectangles, boxes, gmsh models and mesh files.

gmsh runs on one rank, and every rank receives its part of the mesh. The names of gmsh's
physical groups become the names of boundary parts and cell regions.
"""

from __future__ import annotations

import io
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from dolfinx.io import gmsh as dgmsh
from mpi4py import MPI

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.gmsh_model import (
    as_input_error,
    marked_facets,
    name_groups,
    renumber,
    session,
)
from erc_contact.mesh.partition import partitioner
from erc_contact.mesh.shape import Brick, Drawing, drawing_of
from erc_contact.mesh.tags import tags_of

CAD = (".step", ".stp", ".iges", ".igs", ".brep", ".stl")
"""Endings of files of drawings, which have no names of parts."""


def rectangle(
    p0: Sequence[float],
    p1: Sequence[float],
    *,
    size: float | None = None,
    cells: Sequence[int] | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Domain:
    """A rectangle with the boundary parts left, right, bottom and top.

    Args:
        p0: Lower left corner (x, y) [length].
        p1: Upper right corner (x, y) [length].
        size: Size of triangles [length]: unstructured mesh by gmsh.
        cells: Numbers of squares (nx, ny), each cut in two by its rising diagonal:
            structured mesh.
        comm: Communicator that shares the mesh.

    Raises:
        InputError: If the corners do not span a rectangle, or not exactly one of size
            and cells is given.

    Example:
        >>> ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
        <Domain in 2D: 16 cells, boundary parts left, right, bottom, top>
    """
    return _brick(p0, p1, size, cells, comm, 2)


def box(
    p0: Sequence[float],
    p1: Sequence[float],
    *,
    size: float | None = None,
    cells: Sequence[int] | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Domain:
    """A box with the boundary parts left, right (x), front, back (y), bottom and top (z).

    Args:
        p0: Corner of least coordinates (x, y, z) [length].
        p1: Opposite corner [length].
        size: Size of tetrahedra [length]: unstructured mesh by gmsh.
        cells: Numbers of bricks (nx, ny, nz), each cut in six tetrahedra: structured
            mesh.
        comm: Communicator that shares the mesh.

    Raises:
        InputError: If the corners do not span a box, or not exactly one of size and
            cells is given.

    Example:
        >>> ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 2.0), cells=(1, 1, 2))
        <Domain in 3D: ... cells, boundary parts left, right, front, back, bottom, top>
    """
    return _brick(p0, p1, size, cells, comm, 3)


def _brick(
    p0: Sequence[float],
    p1: Sequence[float],
    size: float | None,
    cells: Sequence[int] | None,
    comm: MPI.Comm,
    dim: int,
) -> Domain:
    try:
        low, high = np.asarray(p0, dtype=float), np.asarray(p1, dtype=float)
    except (TypeError, ValueError):
        low = high = np.empty(0)
    if (
        low.shape != (dim,)
        or high.shape != (dim,)
        or not np.all(low < high)
        or not np.isfinite([low, high]).all()
    ):
        raise InputError(
            f"The corners are {p0} and {p1}; each must have {dim} numbers, the first below the second."
        )
    if (size is None) == (cells is None):
        raise InputError(
            "Give either size= (an unstructured mesh by gmsh) or cells= (a structured mesh)."
        )
    brick = Brick(tuple(map(float, low)), tuple(map(float, high)))
    if size is not None:
        checks.positive("The size of cells", size, "a length > 0")

        def model(gmsh: Any) -> None:
            brick.build(gmsh)
            gmsh.option.setNumber("Mesh.MeshSizeMin", size)
            gmsh.option.setNumber("Mesh.MeshSizeMax", size)

        with session(comm, model, "The geometry") as made:
            return brick.exact(_from_model(made, comm, 0, brick))
    assert cells is not None
    whole = isinstance(cells, Sequence | np.ndarray) and all(
        isinstance(n, Integral) and n >= 1 for n in cells
    )
    if not whole or len(cells) != dim:
        raise InputError(
            f"cells is {cells!r}; give {dim} whole numbers >= 1, e.g. cells={(4, 8, 4)[:dim]}."
        )
    if dim == 2:
        mesh = dmesh.create_rectangle(comm, [low, high], list(cells), partitioner=partitioner(comm))
    else:
        mesh = dmesh.create_box(comm, [low, high], list(cells), partitioner=partitioner(comm))
    mesh.topology.create_connectivity(dim - 1, dim)
    facets, values = [], []
    names: dict[str, int] = {}
    for number, (name, axis, at) in enumerate(brick.sides(), start=1):
        names[name] = number
        near = 1e-6 * (high[axis] - low[axis]) / cells[axis]
        found = dmesh.locate_entities(
            mesh, dim - 1, lambda x, a=axis, v=at, t=near: abs(x[a] - v) < t
        )
        facets.append(found)
        values.append(np.full(len(found), number, dtype=np.int32))
    tags = tags_of(mesh, dim - 1, np.concatenate(facets), np.concatenate(values))
    return brick.exact(Domain(mesh, tags, names, geometry=brick))


def from_gmsh(model: Any, comm: MPI.Comm = MPI.COMM_WORLD, rank: int = 0) -> Domain:
    """A domain from a gmsh model in memory; collective.

    The model is meshed if it has no mesh yet. A physical group on the boundary becomes
    a part with the same name, and a physical group of cells becomes a region. Without
    groups of cells the whole body is one region.

    Args:
        model: ``gmsh.model`` on ``rank``; elsewhere it may be None.
        comm: Communicator that shares the mesh.
        rank: Rank that holds the model.

    Raises:
        InputError: If the mesh has no physical group on its boundary, an entity is in
            two groups, a part of the body is in none, or the mesh is not of
            straight-sided simplices.

    Example:
        >>> ec.from_gmsh(gmsh.model)  # a square with the groups "body", "top" and "bottom"
        <Domain in 2D: ... cells, boundary parts bottom, top...>
    """
    return _from_model(model, comm, rank)


def read_mesh(
    path: str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    names: Mapping[int | tuple[int, int], str] | None = None,
) -> Domain:
    """Read a mesh file; collective.

    A ``.msh`` (or ``.geo``) file is read by gmsh. Any other format goes through meshio:
    boundary parts and regions are the cell data gmsh:physical, medit:ref or cell_tags,
    else the first integer cell data, else the cell sets. A vtu or xdmf file has tags
    without names; a part is then called by its tag, "3" for instance, or as ``names``
    says::

        block = ec.read_mesh("block.vtu", names={1: "bottom", 2: "top", 9: "steel"})

    Args:
        path: The file.
        comm: Communicator that shares the mesh.
        names: Names of boundary parts and regions by their tags. A tag that both a
            boundary part and a region have is told apart by its dimension:
            ``{(1, 3): "bottom", (2, 3): "steel"}`` in 2D.

    Raises:
        InputError: If the file is missing or unreadable, has no groups of facets, or is
            not of straight-sided simplices; or if the file does not have a tag of
            ``names``, or a name is given twice.

    Example:
        >>> ec.read_mesh("square.msh")  # a square with the groups "body", "top" and "bottom"
        <Domain in 2D: ... cells, boundary parts bottom, top...>
    """
    if not isinstance(path, str | Path):
        raise InputError(f"read_mesh: the path is {path!r}; give the name of a file.")
    path = Path(path)

    def build(gmsh: Any) -> None:
        _open(gmsh, path)
        if names is not None:
            name_groups(gmsh.model, names)

    with session(comm, build, f"The mesh file {str(path)!r}") as model:
        return from_gmsh(model, comm)


def _open(gmsh: Any, path: Path) -> None:
    if not path.is_file():
        raise InputError(
            f"The mesh file {str(path)!r} does not exist; look at the path and the working folder."
        )
    if path.suffix.lower() in CAD:
        raise InputError(
            f"{str(path)!r} is a drawing, in which no part of the boundary has a name: open it in gmsh, name the parts "
            f"and take from_gmsh: gmsh.initialize(); gmsh.model.occ.importShapes({path.name!r}); "
            'gmsh.model.occ.synchronize(); gmsh.model.addPhysicalGroup(2, [1], name="bottom"), one for each part; '
            "body = ec.from_gmsh(gmsh.model). For a drawing in the plane the groups have dimension 1."
        )
    if path.suffix in (".msh", ".geo"):
        gmsh.open(str(path))
        return
    with tempfile.TemporaryDirectory() as folder:
        converted = Path(folder) / "mesh.msh"
        _convert(path, converted)
        gmsh.open(str(converted))


def _convert(path: Path, target: Path) -> None:
    """Convert what meshio reads to a .msh file with physical groups."""
    import meshio  # noqa: PLC0415 - paid for only by those who read other formats

    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            mesh = meshio.read(path)
    except SystemExit as end:  # meshio's way to say that a file is broken
        raise InputError(
            f"The mesh file {str(path)!r} cannot be read: {' '.join(said.getvalue().split())}"
        ) from end
    tags = {
        key: data
        for key, data in mesh.cell_data.items()
        if all(np.issubdtype(d.dtype, np.integer) for d in data)
    }
    names = dict(mesh.field_data)
    if not tags and mesh.cell_sets:
        mark = [np.zeros(len(block), dtype=int) for block in mesh.cells]
        for number, (name, members) in enumerate(mesh.cell_sets.items(), start=1):
            for block, where in enumerate(members):
                if where is not None and len(where):
                    mark[block][where] = number
                    names[name] = np.array([number, mesh.cells[block].dim])
        tags = {"sets": mark}
    if not tags:
        raise InputError(
            f"The mesh file {str(path)!r} has no groups of facets; write integer cell data for the boundary cells, "
            "or convert to .msh with physical groups."
        )
    physical = next(
        (tags[key] for key in ("gmsh:physical", "medit:ref", "cell_tags") if key in tags), None
    )
    physical = [np.abs(t).astype(np.int32) for t in (physical or next(iter(tags.values())))]
    body = max(block.dim for block in mesh.cells)
    for block, mark in zip(mesh.cells, physical, strict=True):
        if block.dim == body:
            mark[mark == 0] = mark.max() + 1
    keep = [i for i, block in enumerate(mesh.cells) if block.dim >= body - 1]
    converted = meshio.Mesh(
        mesh.points,
        [(mesh.cells[i].type, mesh.cells[i].data) for i in keep],
        cell_data={
            key: [physical[i] for i in keep] for key in ("gmsh:physical", "gmsh:geometrical")
        },
        field_data=names,
    )
    converted.write(target, file_format="gmsh22", binary=False)


def _prepared(model: Any) -> tuple[int, dict[str, int], dict[str, int]]:
    """Mesh a model if needed; return its dimension, and the tags of boundary parts and of regions by name."""
    dim = int(model.getDimension())
    if dim < 2:
        raise InputError(
            f"The gmsh model has dimension {max(dim, 0)}; give a surface in the plane or a volume."
        )
    if not len(model.mesh.getElements(dim)[0]):
        model.mesh.generate(dim)
    kinds = {model.mesh.getElementProperties(kind)[0] for kind in model.mesh.getElements(dim)[0]}
    wrong = [kind for kind in sorted(kinds) if kind not in ("Triangle 3", "Tetrahedron 4")]
    if wrong:
        raise InputError(
            f"The mesh has cells of type {', '.join(wrong)}; allowed are straight-sided triangles and tetrahedra. "
            "In gmsh: no recombination, Mesh.ElementOrder = 1."
        )
    numbers, x, _ = model.mesh.getNodes()
    used = np.isin(
        numbers, np.concatenate(model.mesh.getElements(dim)[2])
    )  # an arc's centre may lie anywhere
    x = x.reshape(-1, 3)[used]
    if dim == 2 and np.ptp(x[:, 2]) > 1e-9 * np.ptp(x, axis=0).max():
        raise InputError(
            "The mesh is a surface in space; allowed are a surface in the plane (x, y) or a volume."
        )
    groups = {d: model.getPhysicalGroups(d) for d in (dim - 1, dim)}
    if not groups[dim - 1]:
        raise InputError(
            "The mesh has no groups of facets: name the parts of the boundary by physical groups of dimension "
            f'{dim - 1} in gmsh, e.g. Physical {("Curve", "Surface")[dim - 2]}("bottom") = {{1}};'
        )
    if not groups[dim]:
        model.addPhysicalGroup(dim, [tag for _, tag in model.getEntities(dim)], name="body")
        groups[dim] = model.getPhysicalGroups(dim)
    for d, what in ((dim - 1, "boundary part"), (dim, "region")):
        member = Counter(
            int(e) for _, tag in groups[d] for e in model.getEntitiesForPhysicalGroup(d, tag)
        )
        twice = [entity for entity, times in member.items() if times > 1]
        if twice:
            raise InputError(
                f"Entity {twice[0]} of dimension {d} is in two physical groups; each can be in one {what} only."
            )
    without = [tag for _, tag in model.getEntities(dim) if tag not in member]
    if without:
        raise InputError(
            f"Entity {without[0]} of dimension {dim} is in no physical group, others are; put all in one, or none."
        )
    renumber(model, dim)
    facets, cells = (
        {model.getPhysicalName(d, tag) or str(tag): int(tag) for _, tag in groups[d]}
        for d in groups
    )
    return dim, facets, cells


def _from_model(model: Any, comm: MPI.Comm, rank: int, geometry: Brick | None = None) -> Domain:
    """The domain of a gmsh model on a rank. It keeps the geometry that is given, else that of the model."""
    error: Exception | None = None
    prepared = None
    if comm.rank == rank:
        try:
            prepared = (*_prepared(model), None if geometry else drawing_of(model))
        except Exception as reason:  # every rank must learn of it
            error = as_input_error(reason, "The gmsh model")
    raise_together(comm, error)
    dim, names, regions, drawn = comm.bcast(prepared, root=rank)
    shape = Drawing(drawn[0], drawn[1] if comm.rank == 0 else "", drawn[2]) if drawn else geometry
    data = dgmsh.model_to_mesh(model, comm, rank, gdim=dim, partitioner=partitioner(comm))
    marks = marked_facets(model, comm, rank, data.mesh, None) if drawn and drawn[2] else None
    return Domain(data.mesh, data.facet_tags, names, data.cell_tags, regions, shape, marks)
