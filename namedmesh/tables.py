"""Convert a domain to tables that know no ranks, and back on any number of ranks.

The tables have one row for each cell. Nodes have the numbers of the mesh that was
written. A cell of a mesh that is made from them may have its vertices in another order,
so whatever belongs to a vertex or a facet of a cell is put in order by these numbers.
Facet i is opposite to vertex i. Of a split domain the glued one is written, in the
order of the split cells, and its interfaces.

Symbols: d dimension, n number of cells, N nodes of a cell.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import asdict, fields
from typing import Any, cast

import numpy as np
from mpi4py import MPI

from namedmesh.assembled import Assembled, Member
from namedmesh.base.exceptions import InputError
from namedmesh.base.ranks import global_numbers
from namedmesh.base.releases import cell_nodes
from namedmesh.bodies import Geometry
from namedmesh.domain import Domain
from namedmesh.drawings.kept import check_kept
from namedmesh.naming import NamedShape, Rules
from namedmesh.partition import distribute, vertex_patch_partitioner
from namedmesh.shape import SIDES, Brick, Drawing
from namedmesh.sides import connect_facets, facets_of_cells
from namedmesh.simplex import node_between, node_vertices
from namedmesh.size_field import Labels
from namedmesh.tags import tag_table
from namedmesh.transfer import GivenCells

MOST_TAGS = 2**30
"""Tags are less: sums of two are tags, too."""


def tag_tables(domain: Domain) -> dict[str, np.ndarray]:
    """Return the tags of the owned cells, and the tags of their facets.

    Returns:
        "facets" and, where there are any, "curved", shape (n, d+1), and "regions",
        shape (n,). For a split domain these are the tags of the glued one, and "glued"
        has the numbers of its nodes, shape (n, d+1).
    """
    if domain.glued is not None:
        return _glued_tables(domain)
    owned = domain.owned_cells
    facets = facets_of_cells(domain.mesh)[:owned]
    tables = {"facets": tag_table(domain.facet_tags)[facets]}
    marks = domain.marks_of_sides
    if marks is not None:
        tables["curved"] = marks[:owned]
    if domain.cell_tags is not None:
        tables["regions"] = tag_table(domain.cell_tags)[:owned]
    return tables


def _glued_tables(domain: Domain) -> dict[str, np.ndarray]:
    """Return the tables of a split domain, see :func:`tag_tables`."""
    assert domain.glued is not None
    assert domain.interface_map is not None
    # Both meshes have the same owners.
    cells = domain.interface_map.cells[: domain.owned_cells]
    corners = _glued_corners(domain)[: domain.owned_cells]
    geometry = domain.glued.mesh.geometry
    nodes = cell_nodes(geometry)[cells]
    numbers = global_numbers(geometry.index_map(), nodes)
    tables = {"glued": np.take_along_axis(numbers, corners, axis=1)}
    if domain.glued.places is not None:
        in_order = np.take_along_axis(nodes, corners, axis=1)
        tables["closed"] = geometry.x[in_order, : domain.dim].reshape(len(cells), -1)
    for name, table in tag_tables(domain.glued).items():
        rows = table[cells]
        if table.ndim == 2:
            rows = np.take_along_axis(rows, corners, axis=1)
        tables[name] = rows
    return tables


def _glued_corners(domain: Domain) -> np.ndarray:
    """Return the place of each corner of the split cells in the glued cells."""
    assert domain.glued is not None
    assert domain.interface_map is not None
    in_glued = cell_nodes(domain.glued.mesh.geometry)[domain.interface_map.cells]
    here = domain.interface_map.nodes[cell_nodes(domain.mesh.geometry)]
    return np.argmax(in_glued[:, None, :] == here[:, :, None], axis=2)


def corner_places(points: np.ndarray, cells: np.ndarray, d: int) -> np.ndarray:
    """Return the places of the corners of cells [length], shape (n, d+1, d).

    Args:
        points: Places of the nodes [length], shape (n, 3).
        cells: Nodes of the cells, vertices first, shape (n, N).
        d: Dimension.
    """
    return points[cells[:, : d + 1], :d]


def glued_mesh(places: np.ndarray, glued: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes and cells of a glued mesh.

    Args:
        places: Places of the corners of its cells, the same for all copies of a node
            [length], shape (n, d+1, d).
        glued: Nodes of these cells, shape (n, d+1).
    """
    x = np.zeros((glued.max() + 1, 3))
    x[glued, : places.shape[2]] = places
    return x, glued


def describe_shape(geometry: Geometry | None) -> dict[str, Any] | None:
    """Return the true shape in plain data; its text comes from rank 0.

    Of a shape whose parts are named by rules, these are left out: they may be
    functions, see :func:`rules_of`. A run that goes on has them from its first mesh.

    Raises:
        InputError: If the shape is an object of a class of the user's.
    """
    if geometry is None:
        return None
    if isinstance(geometry, NamedShape):
        measures = [[*key, value] for key, value in geometry.measures.items()]
        return {
            "kind": "NamedShape",
            "shape": describe_shape(geometry.shape),
            "labels": asdict(geometry.labels),
            "last_tag": geometry.last_tag,
            "measures": measures,
        }
    if isinstance(geometry, Assembled):
        members = []
        for member in geometry.members:
            shape = describe_shape(cast("Geometry", member.shape))
            members.append(_shallow(member) | {"shape": shape})
        return {"kind": "Assembled"} | _shallow(geometry) | {"members": members}
    if not isinstance(geometry, Brick | Drawing):
        raise InputError(
            "A file cannot keep the true geometry of this domain, an object of type "
            f"{type(geometry).__name__}. Take a domain of rectangle, box, from_gmsh or read_mesh, "
            "or run without checkpoint=."
        )
    plain = asdict(geometry)
    if isinstance(geometry, Drawing):
        plain["curved"] = sorted(geometry.curved)
    return {"kind": type(geometry).__name__} | plain


def _shallow(value: Any) -> dict[str, Any]:
    """Return the fields of a dataclass by their names, as plain data."""
    return {entry.name: getattr(value, entry.name) for entry in fields(value)}


def rules_of(geometry: Any) -> list[Rules]:
    """Return the rules by which parts of a true shape are named, outermost first."""
    if isinstance(geometry, NamedShape):
        return [geometry.rules, *rules_of(geometry.shape)]
    rules = []
    if isinstance(geometry, Assembled):
        for member in geometry.members:
            rules += rules_of(member.shape)
    return rules


def geometry_of(
    plain: Mapping[str, Any] | None, rules: Iterator[Rules] | None = None
) -> Geometry | None:
    """Return the true shape from what :func:`describe_shape` gave.

    Args:
        plain: The plain data.
        rules: The rules of :func:`rules_of`; a shape for which there are none left
            names no parts on new meshes.

    Raises:
        InputError: If it is no shape.
    """
    if plain is None:
        return None
    if plain["kind"] == "NamedShape":
        given = None if rules is None else next(rules, None)
        inner = geometry_of(plain["shape"], rules)
        if given is None:
            return inner
        measures = {(kind, name): value for kind, name, value in plain["measures"]}
        labels = Labels(**plain["labels"])
        return NamedShape(inner, labels, given, plain["last_tag"], measures)
    if plain["kind"] == "Brick":
        corners = np.array([plain["low"], plain["high"]], dtype=float)
        if corners.shape[1] not in SIDES or not np.all(corners[0] < corners[1]):
            raise InputError("it has a brick without a volume.")
        return Brick(tuple(plain["low"]), tuple(plain["high"]))
    if plain["kind"] == "Assembled":
        return _assembled_of(plain, rules)
    curved = plain["curved"]
    if plain["kind"] != "Drawing" or not all(type(mark) is int for mark in curved):
        raise InputError("it has a shape of an unknown kind.")
    if plain["text"] != "":  # as it is on all ranks but the first
        check_kept(plain["suffix"], plain["text"])
    return Drawing(plain["suffix"], plain["text"], frozenset(curved))


def _assembled_of(plain: Mapping[str, Any], rules: Iterator[Rules] | None) -> Assembled:
    """Return the shape of several bodies from plain data.

    Raises:
        InputError: If it is none.
    """
    members = []
    tags = [*plain["names"].values(), *plain["regions"].values()]
    for member in plain["members"]:
        shape: Any = geometry_of(member["shape"], rules)
        region_tags = tuple(tuple(pair) for pair in member["region_tags"])
        members.append(Member(**{**member, "shape": shape, "region_tags": region_tags}))
        tags += [*member["names"].values(), *member["regions"].values()]
        tags += [member["first_tag"], member["first_mark"]]
        tags += [tag for old, new in region_tags for tag in (old, new)]
    joints = tuple(tuple(joint) for joint in plain["joints"])
    known = bool(members)
    for here, there, tag, tied, apart in joints:
        known &= here in plain["names"] and there in plain["names"]
        known &= type(tied) is bool and apart >= 0
        tags.append(tag)
    if not known or not all(type(tag) is int and abs(tag) < MOST_TAGS for tag in tags):
        raise InputError("it has a shape of bodies that are not there.")
    return Assembled(tuple(members), plain["names"], plain["regions"], joints)


class CellRows(GivenCells):
    """Give the cells of a mesh their rows of the tables that it was made from.

    The tables are on rank 0, and None on the other ranks. All methods are collective.

    Args:
        comm: Communicator that shares the mesh.
        points: Places of all nodes [length], shape (n, 3), on rank 0.
        cells: Nodes of the cells, vertices first, shape (n, N), on rank 0.
        d: Dimension.
        ranks: Partitioner that gives the cells to ranks.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        points: np.ndarray | None,
        cells: np.ndarray | None,
        d: int,
        ranks: Any = vertex_patch_partitioner,
    ) -> None:
        self.comm = comm
        vertices = np.empty((0, d + 1), dtype=np.int64)
        x = np.empty((0, d))
        if points is not None and cells is not None:
            used, numbers = np.unique(cells[:, : d + 1], return_inverse=True)
            vertices = numbers.astype(np.int64)
            x = points[used, :d]
        mesh = distribute(comm, vertices, np.ascontiguousarray(x), ranks)
        connect_facets(mesh)
        self._rows_of_ranks = comm.gather(mesh.topology.original_cell_index)
        super().__init__(mesh, vertices)

    def of_split(self, domain: Domain) -> CellRows:
        """Return the rows of the cells of a domain that was split from this mesh.

        Its tables are in the order of the same cells.
        """
        assert domain.interface_map is not None
        rows = copy(self)
        rows.mesh = domain.mesh
        rows.source = self.source[domain.interface_map.cells]
        rows._rows_of_ranks = self.comm.gather(rows.source)
        order = self.order[domain.interface_map.cells]
        rows.order = np.take_along_axis(order, _glued_corners(domain), axis=1)
        return rows

    def of_cells(self, table: np.ndarray | None) -> np.ndarray:
        """Return the rows of the cells on this rank, with ghosts."""
        parts = None
        if self._rows_of_ranks is not None and table is not None:
            parts = [table[rows] for rows in self._rows_of_ranks]
        return self.comm.scatter(parts)

    def of_nodes(
        self, table: np.ndarray | None, cells: np.ndarray | None, degree: int
    ) -> np.ndarray:
        """Return values at the nodes of the cells of this rank, from a table of nodes.

        Returns:
            Shape (local cells, N, ...).
        """
        of_table = None if table is None or cells is None else table[cells]
        values = self.of_cells(of_table)
        d = self.mesh.topology.dim
        ends = self.order[:, node_vertices(d, degree)]
        place = node_between(d, degree)[ends[..., 0], ends[..., 1]]
        return np.take_along_axis(values, place[..., None], axis=1)
