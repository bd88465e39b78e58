"""Gather a mesh as plain arrays on rank 0, and distribute them over the ranks.

A mesh that DOLFINx makes has its cells and their corners in an order of its own, so
tables of the given cells are fetched for it (:class:`GivenCells`).
"""

from __future__ import annotations

from dataclasses import replace
from math import prod
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.ranks import fetch, global_numbers
from namedmesh.base.releases import cell_nodes
from namedmesh.closing import close_bodies
from namedmesh.named import NamedMesh
from namedmesh.partition import distribute
from namedmesh.plain import PlainMesh
from namedmesh.sides import connect_facets, facets_of_cells
from namedmesh.tags import tag_table, tags_of


def gather_mesh(mesh: NamedMesh, *, drawn: bool = False) -> PlainMesh:
    """Return a mesh on rank 0, and a mesh without cells on other ranks; collective.

    The order of points and cells does not depend on the number of ranks. Bodies that
    keep their shapes in a glued mesh are at their own places.

    Args:
        mesh: The mesh.
        drawn: Whether vertices of curved sides are put on the true surface.
    """
    comm = mesh.comm
    geometry = mesh.mesh.geometry
    d = mesh.dim
    count = mesh.owned_cells
    nodes = cell_nodes(geometry)[:count]
    numbers = global_numbers(geometry.index_map(), nodes)
    regions = mesh.region_tags[:count]
    tags = tag_table(mesh.facet_tags)[facets_of_cells(mesh.mesh)[:count]]
    points, cells = mesh.drawn_points if drawn else mesh.points
    x = geometry.x if mesh.places is not None else points
    x = x[: geometry.index_map().size_local, :d]
    parts = comm.gather((x, numbers, regions, tags))
    places = None if mesh.places is None else comm.gather(points[cells[:count], :d])
    marks = mesh.marks_of_sides
    all_marks = None if marks is None else comm.gather(marks[:count])
    if parts is None:
        return PlainMesh(x[:0], numbers[:0], regions[:0], tags[:0])
    plain = PlainMesh(*[np.concatenate(tables) for tables in zip(*parts, strict=True)])
    if all_marks is not None:
        plain = replace(plain, marks=np.concatenate(all_marks))
    if places is None:
        return _sort(plain)[0]
    plain, cells, corners = _sort(plain)
    in_order = np.take_along_axis(np.concatenate(places)[cells], corners[..., None], axis=1)
    return _at_places(plain, in_order)


def _at_places(plain: PlainMesh, places: np.ndarray) -> PlainMesh:
    """Return a glued mesh with its bodies at their own places.

    Args:
        plain: The glued mesh.
        places: Places of the corners of its cells [length], shape (m, d+1, d).
    """
    # Cells that have a point in common have the same place for it, to the last digit.
    rows = np.column_stack([plain.cells.ravel(), places.reshape(-1, plain.dim)])
    points, cells = np.unique(rows, axis=0, return_inverse=True)
    glued = points[:, 0].astype(np.int64)
    return replace(plain, x=points[:, 1:], cells=cells.reshape(plain.cells.shape), glued=glued)


def _sort(plain: PlainMesh) -> tuple[PlainMesh, np.ndarray, np.ndarray]:
    """Sort points and cells by their places.

    Returns:
        The mesh; the old number of each cell, shape (m,), and the old place of each of
        its corners, shape (m, d+1).
    """
    x = plain.x
    # Points of two bodies may be in one place; their cells are not.
    beside = np.full(x.shape, -np.inf)
    middles = np.sort(x[plain.cells], axis=1).sum(axis=1)
    for corner in plain.cells.T:
        np.maximum.at(beside, corner, middles)
    order = np.lexsort((*beside.T, *x.T))
    place = np.empty(len(x), dtype=np.int64)
    place[order] = np.arange(len(x))
    cells = place[plain.cells]
    corners = np.argsort(cells, axis=1)
    cells = np.take_along_axis(cells, corners, axis=1)
    tags = np.take_along_axis(plain.tags, corners, axis=1)
    rows = np.lexsort(cells.T)
    result = PlainMesh(x[order], cells[rows], plain.regions[rows], tags[rows])
    if plain.marks is not None:
        marks = np.take_along_axis(plain.marks, corners, axis=1)
        result = replace(result, marks=marks[rows])
    return result, rows, corners[rows]


def spread(comm: MPI.Comm, plain: PlainMesh, root: int = 0) -> dict[str, Any]:
    """Distribute the mesh of one rank over all ranks; collective.

    Args:
        comm: Communicator.
        plain: The mesh on one rank, a mesh without cells on the other ranks.
        root: The rank that has it.

    Returns:
        The arguments of a domain: "mesh", "facet_tags", "cell_tags", "curved_facets",
        "places" and "marks".
    """
    places = None
    has_marks, is_glued = comm.bcast((plain.marks is not None, plain.glued is not None), root)
    if is_glued:
        places = plain.x[plain.cells]
        if plain.glued is not None:
            _, numbers = np.unique(plain.glued, return_inverse=True)
            x = close_bodies(plain.x, plain.cells, numbers)
            plain = replace(plain, x=x, cells=numbers[plain.cells])
    cells = plain.cells.astype(np.int64)
    mesh = distribute(comm, cells, np.ascontiguousarray(plain.x))
    connect_facets(mesh)
    given = GivenCells(mesh, cells)
    tables = {
        "mesh": mesh,
        "facet_tags": given.facet_tags(plain.tags),
        "cell_tags": given.cell_tags(plain.regions),
        "curved_facets": None,
        "places": None,
        "marks": None,
    }
    if places is not None:
        tables["places"] = given.of_corners(places)
        if has_marks:
            tables["marks"] = given.of_sides(plain.marks_of_sides)
    elif has_marks:
        tables["curved_facets"] = given.facet_tags(plain.marks_of_sides)
    return tables


class GivenCells:
    """Fetch rows of tables of the given cells for a mesh; all methods are collective.

    The cells of all ranks have the order in which they were given. Each given table has
    the rows of the cells that its rank gave.

    Args:
        mesh: The mesh, whose facets are connected to its cells.
        numbers: Numbers of the corners of the cells that this rank gave, shape (cells,
            d+1).
    """

    def __init__(self, mesh: dmesh.Mesh, numbers: np.ndarray) -> None:
        self.mesh = mesh
        self.source = mesh.topology.original_cell_index
        """Number of the given cell of each cell on this rank, with ghosts."""
        # Places in the table of corners, to which DOLFINx may give another order.
        geometry = mesh.geometry
        numbers_here = geometry.input_global_indices[cell_nodes(geometry)]
        in_table = self.of_cells(numbers)
        self.order = np.argmax(in_table[:, None, :] == numbers_here[:, :, None], axis=2)

    def of_cells(self, table: Any) -> np.ndarray:
        """Return the rows (cells, ...) of the cells on this rank, with ghosts."""
        width = prod(table.shape[1:])
        rows = fetch(lasting(self.mesh.comm), table.reshape(len(table), width), self.source)
        return rows.reshape(len(rows), *table.shape[1:])

    def of_sides(self, table: Any) -> np.ndarray:
        """Return the same for a table of sides or corners, shape (cells, d+1)."""
        return np.take_along_axis(self.of_cells(table), self.order, axis=1)

    def of_corners(self, places: Any) -> np.ndarray:
        """Return the same for vectors at corners, shape (cells, d+1, d)."""
        return np.take_along_axis(self.of_cells(places), self.order[..., None], axis=1)

    def cell_tags(self, tags: Any) -> dmesh.MeshTags:
        """Return tags of cells, given by the tag of each cell, shape (cells,)."""
        values = self.of_cells(tags)
        return tags_of(self.mesh, self.mesh.topology.dim, np.arange(len(values)), values)

    def facet_tags(self, tags: Any) -> dmesh.MeshTags:
        """Return tags of facets, given by the tags of the sides, shape (cells, d+1)."""
        dim = self.mesh.topology.dim - 1
        facets = facets_of_cells(self.mesh)
        return tags_of(self.mesh, dim, facets.ravel(), self.of_sides(tags).ravel())
