"""Distribute meshes over ranks with complete vertex patches, and check their cells.

Every rank holds all cells around the vertices of its own cells.

The reconstruction of admissible stresses works on the cells around a vertex, its patch.
If all patches are complete on their ranks, it needs no communication. The ghosts that
DOLFINx offers, cells that share a facet, do not give that.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import cpp, graph, la
from dolfinx import mesh as dmesh
from dolfinx.io.utils import distribute_entity_data
from mpi4py import MPI

from namedmesh.base.communicators import lasting
from namedmesh.base.exceptions import InputError, raise_together
from namedmesh.base.ranks import exchange, global_numbers
from namedmesh.base.releases import cell_nodes, cell_partitioner, coordinate_map
from namedmesh.graphs import destinations
from namedmesh.sides import boundary_sides
from namedmesh.simplex import of_facets

HUGE = 1e100
"""Coordinates beyond have volumes that are no numbers of double precision [length]."""
FOLDED = 1e-6
"""Relative difference of two volumes that counts as round-off [-].

They are the volume of the cells, and that within the boundary.
"""


def vertex_patch_partitioner(
    comm: MPI.Comm,
    parts: int,
    cell_types: Sequence[Any],
    cells: Sequence[np.ndarray],
    *,
    same: tuple[np.ndarray, np.ndarray] | None = None,
) -> Any:
    """Partition cells by DOLFINx's graph partitioner, with ghosts by shared vertices.

    A cell goes to its owner and to every rank that owns a cell with a common vertex. To
    find these, the pairs (vertex, owner) of all ranks are sent to the rank "vertex mod
    size".

    Args:
        comm: Communicator.
        parts: Number of parts, the size of ``comm``.
        cell_types: One simplex type.
        cells: One flat array of the cells' global vertices.
        same: Global numbers of vertices, ascending, and of the vertices for which they
            stand, the same on all ranks, shape (n,) each; None without any.

    Returns:
        Adjacency list cell -> ranks, the owner first (the C++ object that DOLFINx
        expects).
    """
    stock = cell_partitioner()(comm, parts, cell_types, cells)
    owner = np.asarray(stock.array, dtype=np.int64)
    vertices_per_cell = {"triangle": 3, "tetrahedron": 4}[cell_types[0].name]
    vertex = np.array(cells[0], dtype=np.int64)
    if same is not None:
        numbers, stand_for = same
        places = np.flatnonzero(np.isin(vertex, numbers))
        vertex[places] = stand_for[np.searchsorted(numbers, vertex[places])]
    cell = np.repeat(np.arange(len(owner)), vertices_per_cell)
    vertex_owners = _vertex_owners(comm, vertex, owner[cell])

    # Each cell is a ghost on all ranks that own a cell at one of its vertices.
    first = np.searchsorted(vertex_owners[:, 0], vertex, side="left")
    counts = np.searchsorted(vertex_owners[:, 0], vertex, side="right") - first
    ghost = np.repeat(cell, counts)
    rank = vertex_owners[_ranges(first, counts), 1]
    is_elsewhere = rank != owner[ghost]
    ghosts = _unique(comm, ghost[is_elsewhere], rank[is_elsewhere])

    return destinations(owner, *ghosts.T)


def _vertex_owners(comm: MPI.Comm, vertex: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Find the owners of the cells at each vertex that has several; collective.

    Args:
        comm: Communicator.
        vertex: Global number of each vertex of each cell given here, shape (n,).
        owner: Rank that is to own the cell, shape (n,).

    Returns:
        Pairs (vertex, rank) in order, shape (m, 2).
    """
    pairs = _unique(comm, vertex, owner)
    # The rank "vertex mod size" learns all pairs of a vertex, and who sent them.
    received, source = exchange(comm, pairs[:, 0] % comm.size, pairs)
    known = _unique(comm, *received.T)
    vertices, counts = np.unique(known[:, 0], return_counts=True)
    starts = np.cumsum(counts) - counts
    requests = _unique(comm, received[:, 0], source)
    request_vertex = np.searchsorted(vertices, requests[:, 0])
    # A vertex on one rank only needs no answer.
    answers = np.where(counts[request_vertex] > 1, counts[request_vertex], 0)
    rows = _ranges(starts[request_vertex], answers)
    shared, _ = exchange(comm, np.repeat(requests[:, 1], answers), known[rows])
    return _unique(comm, *shared.T)


def _ranges(starts: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the numbers start, ..., start + count - 1 for each start, in one row."""
    return np.repeat(starts - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())


def _unique(comm: MPI.Comm, numbers: np.ndarray, ranks: np.ndarray) -> np.ndarray:
    """Return the different pairs (number, rank) in order, shape (n, 2)."""
    # One number for each pair is sorted faster than two columns.
    keys = np.unique(numbers * comm.size + ranks)
    return np.column_stack(np.divmod(keys, comm.size))


def partitioner(comm: MPI.Comm) -> Any:
    """Return the partitioner of meshes on ``comm``; None in serial."""
    return vertex_patch_partitioner if comm.size > 1 else None


def distribute(
    comm: MPI.Comm, cells: np.ndarray, x: np.ndarray, ranks: Any = vertex_patch_partitioner
) -> dmesh.Mesh:
    """Make a mesh of simplices, with complete vertex patches by default; collective.

    Args:
        comm: Communicator.
        cells: Numbers of the vertices of cells of this rank, in the order of all ranks'
            points, shape (m, d+1).
        x: Points of this rank [length], shape (n, d).
        ranks: Partitioner that gives the cells to ranks if there are several.
    """
    domain = ufl.Mesh(coordinate_element(x.shape[1]))
    return dmesh.create_mesh(comm, cells, domain, x, ranks if comm.size > 1 else None)


def coordinate_element(dim: int) -> Any:
    """Return the coordinate element of simplices that fill space."""
    cell = "triangle" if dim == 2 else "tetrahedron"
    return basix.ufl.element("Lagrange", cell, 1, shape=(dim,))


def patches_complete(mesh: dmesh.Mesh) -> bool:
    """Tell whether each rank has all cells at the vertices of its cells; collective."""
    tdim = mesh.topology.dim
    mesh.topology.create_connectivity(tdim, 0)
    vertices = mesh.topology.connectivity(tdim, 0).array.reshape(-1, tdim + 1)
    owned = vertices[: mesh.topology.index_map(tdim).size_local]
    # Each cell is owned once, so sums over owned cells count the cells of all ranks.
    total = la.vector(mesh.topology.index_map(0), dtype=np.float64)
    total.array[:] = np.bincount(owned.ravel(), minlength=len(total.array))
    total.scatter_reverse(la.InsertMode.add)
    total.scatter_forward()
    local = np.bincount(vertices.ravel(), minlength=len(total.array))
    touched = np.unique(owned)
    complete = bool(np.all(local[touched] == total.array[touched]))
    return bool(lasting(mesh.comm).allreduce(complete, MPI.LAND))


def redistribute(
    mesh: dmesh.Mesh,
    *tag_sets: dmesh.MeshTags | None,
    ranks: Any = vertex_patch_partitioner,
) -> tuple[dmesh.Mesh, list[dmesh.MeshTags | None]]:
    """Balance a mesh anew over the ranks, with complete vertex patches; collective.

    Args:
        mesh: The mesh.
        tag_sets: Tags of its cells or facets; None stays None.
        ranks: Partitioner that gives the cells to ranks.

    Returns:
        The new mesh, and the tags on it in the order in which they were given.
    """
    tdim = mesh.topology.dim
    nodes = mesh.geometry.index_map()
    x = mesh.geometry.x[: nodes.size_local, : mesh.geometry.dim]
    owned = mesh.topology.index_map(tdim).size_local
    cells = global_numbers(nodes, cell_nodes(mesh.geometry)[:owned])
    new = distribute(lasting(mesh.comm), cells, x, ranks)
    new_tags = [None if tags is None else _move_tags(tags, mesh, new) for tags in tag_sets]
    return new, new_tags


def _move_tags(tags: dmesh.MeshTags, mesh: dmesh.Mesh, new: dmesh.Mesh) -> dmesh.MeshTags:
    """Return tags of a mesh as tags of its redistributed copy; collective."""
    dim = tags.dim
    tdim = mesh.topology.dim
    owned = tags.indices < mesh.topology.index_map(dim).size_local
    mesh.topology.create_connectivity(dim, tdim)
    # The new mesh numbers its points as the old one does globally.
    entities = cpp.mesh.entities_to_geometry(mesh._cpp_object, dim, tags.indices[owned], False)
    nodes = global_numbers(mesh.geometry.index_map(), entities)
    new.topology.create_connectivity(dim, 0)
    new.topology.create_connectivity(dim, tdim)
    vertices, values = distribute_entity_data(new, dim, nodes, tags.values[owned])
    return dmesh.meshtags_from_entities(new, dim, graph.adjacencylist(vertices), values)


def check_mesh(mesh: dmesh.Mesh) -> None:
    """Check that a mesh has cells that the package works with; collective.

    Raises:
        InputError: If cells are not straight-sided triangles in the plane or tetrahedra
            in 3D.
    """
    cell = mesh.topology.cell_type.name
    gdim = mesh.geometry.dim
    degree = coordinate_map(mesh.geometry).degree
    error = None
    if (cell, gdim) not in (("triangle", 2), ("tetrahedron", 3)):
        error = InputError(
            f"The mesh has cells of type {cell} in {gdim}D; allowed are triangles in 2D and "
            "tetrahedra in 3D. Mesh with simplices (in gmsh: no recombination), or split the cells."
        )
    elif degree != 1:
        error = InputError(
            f"The mesh has curved cells of degree {degree}; only straight-sided cells (degree 1) "
            "are allowed. In gmsh: Mesh.ElementOrder = 1."
        )
    raise_together(lasting(mesh.comm), error)


def check_shape(mesh: dmesh.Mesh) -> None:
    """Check that coordinates are finite, and no cell is turned over; collective.

    The volumes of the cells add up to the volume within the boundary, ``int x.n dS /
    d``, only if none is turned over.

    Args:
        mesh: A mesh whose facets are connected to its cells.

    Raises:
        InputError: If a coordinate is not finite, or a cell is turned over.
    """
    tdim = mesh.topology.dim
    comm = lasting(mesh.comm)
    x = mesh.geometry.x[:, :tdim]
    finite = bool((abs(x) < HUGE).all())
    if not comm.allreduce(finite, MPI.LAND):
        raise InputError(
            f"The mesh has coordinates that are not finite, or beyond {HUGE:g}; look where they "
            "come from."
        )
    owned = mesh.topology.index_map(tdim).size_local
    cells = x[cell_nodes(mesh.geometry)]
    facets = dmesh.exterior_facet_indices(mesh.topology)
    # Facet i of a cell is opposite to its vertex i.
    cell, opposite = boundary_sides(mesh, facets)
    corners = of_facets(cells[cell], opposite)
    apex = cells[cell, opposite]
    # An apex amid the mesh keeps the round-off of the volumes small.
    centre = x.mean(axis=0) if len(x) else np.zeros(tdim)
    centre = np.mean(comm.allgather(centre), axis=0)
    volume = abs(np.linalg.det(np.diff(cells[:owned], axis=1))).sum()
    # The order of a facet's vertices has no meaning: the sign that its own cell has
    # makes the normal point outward.
    within = _towers(corners, centre) * np.sign(_towers(corners, apex))
    volume, within = comm.allreduce(np.array([volume, within.sum()]), MPI.SUM)
    if abs(volume - within) > FOLDED * volume:
        raise InputError(
            f"The cells of the mesh lie over each other: their volumes are {volume / within:.6g} "
            "times that within the boundary. Look at the coordinates; a mesh that was deformed "
            "too much must be made anew."
        )


def _towers(corners: np.ndarray, apex: np.ndarray) -> np.ndarray:
    """Compute d! times the signed volumes of simplices over facets [length^d].

    Args:
        corners: Corners of the facets [length], shape (n, d, d).
        apex: The opposite vertex of each simplex, shape (n, d), or one for all, (d,).
    """
    return np.linalg.det(corners - apex.reshape(-1, 1, apex.shape[-1]))
