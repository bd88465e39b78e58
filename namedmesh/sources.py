"""Make domains from rectangles, boxes, gmsh models and mesh files.

gmsh runs on one rank, and every rank receives its part of the mesh. The names of gmsh's
physical groups become the names of boundary parts and cell regions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base import checks
from namedmesh.base.exceptions import InputError, on_rank
from namedmesh.bodies import Geometry
from namedmesh.domain import Domain
from namedmesh.drawings.kept import Kept, drawing_of
from namedmesh.drawings.reading import Wanted, check_kind, open_geometry
from namedmesh.files.building import Built, build_simplices, spread_from
from namedmesh.files.file_mesh import FacetSet
from namedmesh.files.formats import DRAWINGS
from namedmesh.files.of_gmsh import grouped, marked_entities, mesh_of_model
from namedmesh.files.reading import kind_of, read
from namedmesh.files.renaming import rename_sets
from namedmesh.gmsh_session import session
from namedmesh.partition import partitioner
from namedmesh.shape import Brick, Drawing
from namedmesh.sides import connect_facets
from namedmesh.tags import tags_of
from namedmesh.touching import tell_gaps
from namedmesh.where import Rule

NEAR_SIDE = 1e-6
"""Distance from a side that counts as none, as a share of the cell size [-]."""


def rectangle(
    p0: Sequence[float],
    p1: Sequence[float],
    *,
    size: float | None = None,
    cells: Sequence[int] | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Domain:
    """Make a rectangle with the boundary parts left, right, bottom and top.

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
    """Make a box with six boundary parts.

    They are left and right (x), front and back (y), bottom and top (z).

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
    """Make a rectangle or a box, see :func:`rectangle`; collective."""
    brick = _brick_between(p0, p1, dim)
    if (size is None) == (cells is None):
        raise InputError(
            "Give either size= (an unstructured mesh by gmsh) or cells= (a structured mesh)."
        )
    if size is not None:
        return _mesh_by_gmsh(brick, size, comm)
    assert cells is not None
    is_sequence = isinstance(cells, Sequence | np.ndarray)
    whole = is_sequence and all(isinstance(n, Integral) and n >= 1 for n in cells)
    if not whole or len(cells) != dim:
        raise InputError(
            f"cells is {cells!r}; give {dim} whole numbers >= 1, e.g. cells={(4, 8, 4)[:dim]}."
        )
    return _mesh_in_parts(brick, cells, comm)


def _brick_between(p0: Sequence[float], p1: Sequence[float], dim: int) -> Brick:
    """Return the brick between two corners.

    Raises:
        InputError: If the corners do not span a brick.
    """
    try:
        low = np.asarray(p0, dtype=float)
        high = np.asarray(p1, dtype=float)
    except (TypeError, ValueError):
        low = high = np.empty(0)
    right_shape = low.shape == (dim,) and high.shape == (dim,)
    if not right_shape or not np.all(low < high) or not np.isfinite([low, high]).all():
        raise InputError(
            f"The corners are {p0} and {p1}; each must have {dim} numbers, the first below the "
            "second."
        )
    return Brick(tuple(map(float, low)), tuple(map(float, high)))


def _mesh_by_gmsh(brick: Brick, size: float, comm: MPI.Comm) -> Domain:
    """Mesh a brick by gmsh with simplices of a size [length]; collective."""
    checks.positive("The size of cells", size, "a length > 0")

    def build(gmsh: Any) -> None:
        brick.build(gmsh)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)

    with session(comm, build, "The geometry") as model:
        return brick.exact(_from_model(model, comm, 0, brick))


def _mesh_in_parts(brick: Brick, cells: Sequence[int], comm: MPI.Comm) -> Domain:
    """Mesh a brick with equal parts along each axis, cut into simplices; collective."""
    dim = len(brick.low)
    corners = [np.array(brick.low), np.array(brick.high)]
    create = dmesh.create_rectangle if dim == 2 else dmesh.create_box
    mesh = create(comm, corners, list(cells), partitioner=partitioner(comm))
    connect_facets(mesh)
    facets = []
    tags = []
    names: dict[str, int] = {}
    for tag, (name, axis, coordinate) in enumerate(brick.sides(), start=1):
        names[name] = tag
        distance = NEAR_SIDE * (brick.high[axis] - brick.low[axis]) / cells[axis]
        on_side = _near_plane(axis, coordinate, distance)
        side_facets = dmesh.locate_entities(mesh, dim - 1, on_side)
        facets.append(side_facets)
        tags.append(np.full(len(side_facets), tag, dtype=np.int32))
    facet_tags = tags_of(mesh, dim - 1, np.concatenate(facets), np.concatenate(tags))
    return brick.exact(Domain(mesh, facet_tags, names, geometry=brick))


def _near_plane(
    axis: int, coordinate: float, distance: float
) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function that marks the points (3, n) near a plane normal to an axis."""

    def near(x: np.ndarray) -> np.ndarray:
        return abs(x[axis] - coordinate) < distance

    return near


def from_gmsh(
    model: Any,
    comm: MPI.Comm = MPI.COMM_WORLD,
    rank: int = 0,
    *,
    parts: Mapping[str, Rule] | None = None,
    regions: Mapping[str, Rule] | None = None,
) -> Domain:
    """Make a domain from a gmsh model in memory; collective.

    The model is meshed if it has no mesh yet. A physical group on the boundary becomes
    a part with the same name, and a physical group of cells becomes a region. Without
    groups of cells the whole body is one region. Rules name parts and regions without
    physical groups, see :meth:`Domain.named`.

    Args:
        model: ``gmsh.model`` on ``rank``; elsewhere it may be None.
        comm: Communicator that shares the mesh.
        rank: Rank that holds the model.
        parts: Name of each part -> a rule that says where it is.
        regions: Name of each region -> the same.

    Raises:
        InputError: If the mesh has no physical group on its boundary and there are no
            rules, an entity is in two groups, a part of the body is in none, or the
            mesh is not of straight-sided simplices.

    Example:
        >>> ec.from_gmsh(gmsh.model)  # a square with groups "body", "top" and "bottom"
        <Domain in 2D: ... cells, boundary parts bottom, top...>
        >>> ec.from_gmsh(gmsh.model, parts={"left": ec.where(x=0.0)})
        <Domain in 2D: ... cells, boundary parts bottom, top, left...>
    """
    has_rules = parts is not None or regions is not None
    domain = _from_model(model, comm, rank, has_rules=has_rules)
    return domain.named(parts, regions=regions) if has_rules else domain


def read_mesh(
    path: str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    names: Mapping[int | tuple[int, int], str] | None = None,
    size: float | None = None,
    heal: float | bool = False,
    defeature: float | None = None,
    parts: Mapping[str, Rule] | None = None,
    regions: Mapping[str, Rule] | None = None,
    scripts: bool = False,
) -> Domain:
    """Read a mesh file or mesh a drawing; collective.

    Files of gmsh (msh, unv, med, cgns, bdf), VTK and Exodus, Abaqus and CalculiX (inp),
    XDMF and what meshio reads come in with their sets as parts and regions. Cells of
    other shapes are split into simplices, cells of second order at their corners; what
    is left out or changed is told as a warning. A vtu or xdmf file may have tags
    without names; a part is then called by its tag, "3" for instance, or as ``names``
    says::

        block = ec.read_mesh("block.vtu", names={1: "bottom", 2: "top", 9: "steel"})

    What a file holds tells its format, and none is run as a program. Only with
    ``scripts=True`` are files of gmsh's language read (``.geo``), which may run any
    command and write any file.

    A drawing (STEP, IGES, BREP, or ``.geo`` without groups) is meshed by gmsh, in a
    process of its own. Its solids are regions with the names of the file, its faces
    parts with numbers. Solids that touch are a pair of parts, "nut on bolt" and "bolt
    on nut", see :meth:`Domain.touching`; what touches along a line or at a point only
    is kept apart. Lengths are in the unit of the file. Tiny edges and faces, and
    distances that look like gaps of the drawing, are told as warnings.

    Args:
        path: The file.
        comm: Communicator that shares the mesh.
        names: Names of boundary parts and regions by their tags. A tag that both a
            boundary part and a region have is told apart by its dimension:
            ``{(1, 3): "bottom", (2, 3): "steel"}`` in 2D.
        parts: Name of each part -> a rule that says where it is, see
            :meth:`Domain.named`. The file needs no groups of facets then.
        regions: Name of each region -> the same.
        size: Greatest edge of the cells of a drawing [length]; small circles have at
            least 8 edges. A ``.geo`` file may have sizes of its own.
        heal: Tolerance [length] up to which gaps of a drawing are closed; True takes
            1e-6 of its extent.
        defeature: Faces of a drawing that are narrower than this, and edges that are
            shorter, are removed [length]: fillets, chamfers, small holes.
        scripts: Whether scripts of gmsh's may run. Give True for those that you would
            run as a program.

    Raises:
        InputError: If the file is missing or unreadable, a script, has no groups of
            facets, or is not of straight-sided simplices; if the file does not have a
            tag of ``names``, or a name is given twice; or if a drawing has no solid,
            solids overlap, or gmsh cannot mesh it.

    Example:
        >>> ec.read_mesh("square.msh")  # a square with groups "body", "top", "bottom"
        <Domain in 2D: ... cells, boundary parts bottom, top...>
    """
    if not isinstance(path, str | Path):
        raise InputError(f"read_mesh: the path is {path!r}; give the name of a file.")
    path = Path(path)
    wanted = Wanted(size, heal, defeature)
    has_rules = parts is not None or regions is not None
    subject = f"The mesh file {str(path)!r}"
    is_drawing = False
    # Only rank 0 need have the file.
    kind = str(comm.bcast(on_rank(comm, 0, kind_of, path)))
    check_kind(path, kind, wanted, scripts=scripts)
    if kind in DRAWINGS:
        domain, is_drawing = _of_geometry(path, kind, comm, wanted, names, has_rules=has_rules)
    else:

        def make() -> Built:
            mesh = read(path, kind, numbered=not has_rules)
            return build_simplices(
                mesh if names is None else rename_sets(mesh, names), numbered=not has_rules
            )

        domain = Domain(**spread_from(comm, 0, make, subject))
    if has_rules:
        domain = domain.named(parts, regions=regions)
    if not is_drawing:
        return domain
    bodies = domain.split()
    if size is not None and len(bodies.regions) > 1:
        tell_gaps(bodies, size)
    return bodies


def _of_geometry(
    path: Path,
    kind: str,
    comm: MPI.Comm,
    wanted: Wanted,
    names: Mapping[int | tuple[int, int], str] | None,
    *,
    has_rules: bool,
) -> tuple[Domain, bool]:
    """Read a file that has the true shape of bodies; collective.

    Returns:
        The bodies in one piece, and whether they are a drawing, without groups.
    """
    kept: list[Kept | None] = []

    def build(gmsh: Any) -> None:
        kept.extend(open_geometry(gmsh, path, kind, wanted))

    with session(comm, build, f"The drawing {str(path)!r}") as model:
        is_drawing = comm.bcast(bool(kept))
        of_drawing = kept[0] if kept else None
        domain = _from_model(model, comm, 0, None, names, of_drawing, has_rules=has_rules)
    return domain, is_drawing


def _from_model(
    model: Any,
    comm: MPI.Comm,
    rank: int,
    geometry: Brick | None = None,
    names: Mapping[int | tuple[int, int], str] | None = None,
    kept: Kept | None = None,
    *,
    has_rules: bool = False,
) -> Domain:
    """Make the domain of a gmsh model on a rank; collective.

    It keeps the geometry that is given, else the drawing of the model. If rules name
    parts, what is in no group gets no name.
    """
    drawing: list[Kept] = []

    def make() -> Built:
        with grouped(model, numbered=not has_rules):
            marks: list[FacetSet] = []
            found = None if geometry else kept or drawing_of(model)
            if found is not None:
                drawing.append(found)
                *_, curved = found
                facets = model.getEntities(model.getDimension() - 1)
                marks = marked_entities(model, {int(tag): int(tag) for _, tag in facets if curved})
            mesh = mesh_of_model(model)
            mesh = mesh if names is None else rename_sets(mesh, names)
            return build_simplices(mesh, marks, numbered=not has_rules)

    tables = spread_from(comm, rank, make, "The gmsh model")
    shape: Geometry | None = geometry
    found = comm.bcast(drawing[0] if drawing else None, root=rank)
    if found is not None:
        suffix, text, curved = found
        # Rank 0 alone calls gmsh, so it alone keeps the text, which may be long.
        shape = Drawing(suffix, text if comm.rank == 0 else "", curved)
    return Domain(**tables, geometry=shape).snapped()
