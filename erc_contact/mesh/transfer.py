"""Gather a mesh as plain arrays on rank 0, and distribute them over the ranks."""

from __future__ import annotations

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from erc_contact.base.releases import cell_nodes
from erc_contact.mesh.given import GivenCells
from erc_contact.mesh.named import NamedMesh
from erc_contact.mesh.partition import distributed
from erc_contact.mesh.plain import PlainMesh
from erc_contact.mesh.sides import facets_of_cells
from erc_contact.mesh.tags import NO_TAG, tag_table


def gathered_mesh(mesh: NamedMesh) -> PlainMesh:
    """Return a mesh on rank 0, and one without cells on other ranks; collective.

    The order of points and cells does not depend on the number of ranks.
    """
    comm = mesh.comm
    geometry = mesh.mesh.geometry
    d = mesh.dim
    count = mesh.owned_cells
    nodes = cell_nodes(geometry)[:count]
    numbers = geometry.index_map().local_to_global(nodes.ravel()).reshape(nodes.shape)
    regions = np.full(count, NO_TAG, dtype=np.int32)
    if mesh.cell_tags is not None:
        regions = tag_table(mesh.cell_tags)[:count]
    tags = tag_table(mesh.facet_tags)[facets_of_cells(mesh.mesh)[:count]]
    x = geometry.x[: geometry.index_map().size_local, :d]
    parts = comm.gather((x, numbers, regions, tags))
    if parts is None:
        return PlainMesh(x[:0], numbers[:0], regions[:0], tags[:0])
    plain = PlainMesh(*[np.concatenate(tables) for tables in zip(*parts, strict=True)])
    return _ordered(plain)


def _ordered(plain: PlainMesh) -> PlainMesh:
    """Sort points and cells by their places."""
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
    return PlainMesh(x[order], cells[rows], plain.regions[rows], tags[rows])


def given_cells(comm: MPI.Comm, plain: PlainMesh) -> GivenCells:
    """Distribute the mesh of one rank over all ranks; collective.

    Args:
        comm: Communicator.
        plain: The mesh on one rank, one without cells on the other ranks.

    Returns:
        What relates the cells of the mesh of all ranks to cells of ``plain``.
    """
    cells = plain.cells.astype(np.int64)
    mesh = distributed(comm, cells, np.ascontiguousarray(plain.x))
    d = plain.dim
    mesh.topology.create_connectivity(d - 1, d)
    mesh.topology.create_connectivity(d, d - 1)
    return GivenCells(mesh, cells)


def spread(comm: MPI.Comm, plain: PlainMesh) -> tuple[dmesh.Mesh, dmesh.MeshTags, dmesh.MeshTags]:
    """Distribute the mesh of rank 0 over all ranks; collective.

    Returns:
        The mesh, the tags of its facets and the tags of its cells.
    """
    given = given_cells(comm, plain)
    return given.mesh, given.facet_tags(plain.tags), given.cell_tags(plain.regions)
