"""Write a domain to a file of its own, and read it on any number of ranks.

The file has mesh, names and true shape, and ParaView opens it. Who keeps results on a
mesh puts them beside the same tables.

Symbols: d dimension, n number of nodes, c number of cells, N nodes of a cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from namedmesh.base.exceptions import InputError, on_rank
from namedmesh.base.ranks import gather_rows, global_numbers
from namedmesh.base.releases import cell_nodes
from namedmesh.bodies import Geometry
from namedmesh.domain import Domain
from namedmesh.interface_map import Interface
from namedmesh.keeping.checked import check_mesh
from namedmesh.keeping.packed import Contents, Damaged, pack, unpack
from namedmesh.naming import Rules
from namedmesh.periodic import PeriodicPair, across
from namedmesh.pictures.grids import body_mesh, vtk_cells
from namedmesh.tables import (
    CellRows,
    corner_places,
    describe_shape,
    geometry_of,
    glued_mesh,
    tag_tables,
)


def write_domain(domain: Domain, path: str | Path) -> None:
    """Write a domain to a file, which ParaView opens, too; collective.

    Args:
        domain: The domain.
        path: The file.

    Raises:
        InputError: If the true shape is an object of a class of the user's.
        OSError: If the file cannot be written.

    Example:
        >>> nm.write_domain(block, "block.vtkhdf")
        >>> nm.read_domain("block.vtkhdf")
        <Domain in 2D: 16 cells, boundary parts left, right, bottom, top>
    """
    tags = tag_tables(domain)
    about = about_mesh(domain, tags)
    geometry = domain.mesh.geometry
    cells = global_numbers(geometry.index_map(), cell_nodes(geometry)[: domain.owned_cells])
    drawn = body_mesh(domain)
    points = gather_rows(domain.comm, points=drawn["points"])
    rows = gather_rows(domain.comm, cells=cells, drawn=drawn["cells"], **tags)

    def write() -> None:
        tables = drawn_tables(points["points"], rows.pop("drawn"), domain.dim)
        with Path(path).open("wb") as file:
            file.writelines(pack(Contents(about, tables | rows)))

    on_rank(domain.comm, 0, write)


def read_domain(
    path: str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    rules: Sequence[tuple[Any, Any]] = (),
) -> Domain:
    """Read a domain that :func:`write_domain` or ``save`` wrote; collective.

    It has the mesh, the names, the pairs and the true shape of the domain.

    Args:
        path: The file.
        comm: Communicator that shares the mesh, of any number of ranks.
        rules: The rules by which :meth:`Domain.named` named parts and regions, a pair
            of mappings for each call, the last call first. The file has the names and
            not the rules, which are asked again where the true shape is meshed anew.

    Raises:
        InputError: If it is no such file, is damaged, or of a newer version.

    Example:
        >>> nm.write_domain(block, "block.vtkhdf")
        >>> nm.read_domain("block.vtkhdf").cells
        16
    """

    def read() -> Contents:
        try:
            return unpack(Path(path).read_bytes(), check_domain, "file of a domain")
        except OSError as reason:
            words = f"it cannot be read ({reason.strerror})"
            raise InputError(f"read_domain: {str(path)!r}: {words}.") from reason
        except (Damaged, InputError) as reason:
            raise InputError(f"read_domain: {str(path)!r}: {reason}.") from reason

    contents = on_rank(comm, 0, read)
    about = comm.bcast(contents.about if contents else None)
    given = (Rules.of(parts, regions) for parts, regions in rules)
    shape = geometry_of(about["geometry"], given)
    return mesh_of(comm, contents or Contents(about, {}), shape)[1]


def about_mesh(domain: Domain, tags: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return what is told of a mesh beside its tables; collective.

    Args:
        domain: The mesh.
        tags: Its tags, of :func:`namedmesh.tables.tag_tables`.

    Raises:
        InputError: If its true shape cannot be kept.
    """
    return {
        "dim": domain.dim,
        # the names of a split domain follow from its glued one and the interfaces
        "names": dict(domain.whole.names),
        "regions": dict(domain.regions),
        "geometry": domain.comm.bcast(describe_shape(domain.geometry)),  # its text is on rank 0
        "tags": sorted(tags),
        "interfaces": [asdict(interface) for interface in domain.interfaces],
        "periodic": [asdict(pair) for pair in domain.periodic],
    }


def drawn_tables(points: np.ndarray, cells: np.ndarray, d: int) -> dict[str, np.ndarray]:
    """Return points (n, 3) and cells (c, N) as the arrays of VTKHDF."""
    kind, cells = vtk_cells(cells, d)
    whole = {
        "Points": points,
        "Connectivity": cells.ravel(),
        "Offsets": np.arange(0, cells.size + 1, cells.shape[1]),
        "Types": np.full(len(cells), kind, dtype=np.uint8),
        "NumberOfPoints": np.array([len(points)]),
        "NumberOfCells": np.array([len(cells)]),
        "NumberOfConnectivityIds": np.array([cells.size]),
    }
    return {f"VTKHDF/{name}": array for name, array in whole.items()}


def mesh_of(
    comm: MPI.Comm, contents: Contents, shape: Geometry | None = None
) -> tuple[CellRows, Domain]:
    """Return the rows of the cells of a file, and its domain; collective.

    Args:
        comm: Communicator that shares the mesh.
        contents: What the file holds; tables are needed on rank 0 only.
        shape: The true shape; None takes what the file keeps of it.
    """
    about = contents.about
    points = contents.tables.get("VTKHDF/Points")
    cells = contents.tables.get("cells")
    is_split = "glued" in about["tags"]
    keep_shapes = "closed" in about["tags"]
    places = None
    if is_split and points is not None and cells is not None:
        places = corner_places(points, cells, about["dim"])
        of_glued = contents.tables["closed"].reshape(places.shape) if keep_shapes else places
        points, cells = glued_mesh(of_glued, contents.tables["glued"])
    rows = CellRows(comm, points, cells, about["dim"])
    kept_places = rows.of_corners(places) if keep_shapes else None
    domain = _domain(contents, rows, kept_places, shape)
    pairs = tuple(PeriodicPair.of(plain) for plain in about.get("periodic", ()))
    if pairs and comm.size > 1:
        # A side and its image are to be on one rank; the first mesh tells which are.
        ranks = across(domain, pairs, domain.mesh.geometry.input_global_indices)
        rows = CellRows(comm, points, cells, about["dim"], ranks)
        domain = _domain(contents, rows, None, shape)
    if pairs:
        domain = replace(domain, periodic=pairs)
    if not is_split:
        return rows, domain
    split = domain.cut(tuple(Interface.of(plain) for plain in about["interfaces"]))
    return rows.of_split(split), split


def _domain(
    contents: Contents, rows: CellRows, places: np.ndarray | None, shape: Geometry | None
) -> Domain:
    """Return the mesh with names, tags and true shape; collective.

    Args:
        contents: What the file holds.
        rows: The rows of its cells.
        places: Places of its corners if its bodies keep their shapes, else None.
        shape: The true shape; None takes what the file keeps of it.
    """
    about = contents.about
    facets = rows.facet_tags(contents.tables.get("facets"))
    # all ranks know from `about` which tags there are
    curved = None
    marks = None
    if "curved" in about["tags"]:
        if places is None:
            curved = rows.facet_tags(contents.tables.get("curved"))
        else:
            marks = rows.of_sides(contents.tables.get("curved"))
    cells = None
    if "regions" in about["tags"]:
        cells = rows.cell_tags(contents.tables.get("regions"))
    return Domain(
        rows.mesh,
        facets,
        about["names"],
        cells,
        about["regions"],
        shape or geometry_of(about["geometry"]),
        curved,
        places=places,
        marks=marks,
    )


def check_domain(about: Any, tables: Mapping[str, np.ndarray], degree: int = 1) -> None:
    """Check what a file tells of a mesh, its true shape included.

    Args:
        about: The plain data.
        tables: The tables; the cells have the nodes of a degree.
        degree: The degree, 1 or 2.

    Raises:
        InputError: If its true shape is none.
        ValueError: If something else is not as it was written, or another error of
            Python's if it is not there.
    """
    check_mesh(about, tables, degree)
    geometry_of(about["geometry"])
