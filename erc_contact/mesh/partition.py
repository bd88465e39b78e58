"""Distribution of meshes over ranks: every rank holds all cells around the vertices of its own cells.

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

from erc_contact.base.exceptions import InputError, raise_together
from erc_contact.base.ranks import exchange

HUGE = 1e100
"""Coordinates beyond have volumes that are no numbers of double precision [length]."""
FOLDED = 1e-6
"""Difference of the volumes of the cells and that within the boundary that counts as round-off, relative [-]."""


def vertex_patch_partitioner(
    comm: MPI.Comm, parts: int, cell_types: Sequence[Any], cells: Sequence[np.ndarray]
) -> Any:
    """Partition cells with the stock graph partitioner and ghost every cell by shared vertices.

    A cell goes to its owner and to every rank that owns a cell with a common vertex. To
    find these, the pairs (vertex, owner) of all ranks are sent to the rank "vertex mod
    size".

    Args:
        comm: Communicator.
        parts: Number of parts, the size of ``comm``.
        cell_types: One simplex type.
        cells: One flat array of the cells' global vertices.

    Returns:
        Adjacency list cell -> ranks, the owner first (the C++ object that DOLFINx
        expects).
    """
    stock = dmesh.create_cell_partitioner(dmesh.GhostMode.none, 2)(comm, parts, cell_types, cells)
    owner = np.asarray(stock.array, dtype=np.int64)
    per_cell = {"triangle": 3, "tetrahedron": 4}[cell_types[0].name]
    vertex = np.asarray(cells[0], dtype=np.int64)
    cell = np.repeat(np.arange(len(owner)), per_cell)

    pairs = _unique(comm, vertex, owner[cell])
    met, source = exchange(comm, pairs[:, 0] % comm.size, pairs)
    known = _unique(comm, *met.T)
    vertices, counts = np.unique(known[:, 0], return_counts=True)
    starts = np.cumsum(counts) - counts
    asked = _unique(comm, met[:, 0], source)
    at = np.searchsorted(vertices, asked[:, 0])
    repeat = np.where(counts[at] > 1, counts[at], 0)  # a vertex on one rank only needs no answer
    row = np.repeat(starts[at] - np.cumsum(repeat) + repeat, repeat) + np.arange(repeat.sum())
    shared, _ = exchange(comm, np.repeat(asked[:, 1], repeat), known[row])

    shared = _unique(comm, *shared.T)
    first = np.searchsorted(shared[:, 0], vertex, side="left")
    times = np.searchsorted(shared[:, 0], vertex, side="right") - first
    row = np.repeat(first - np.cumsum(times) + times, times) + np.arange(times.sum())
    ghost, rank = np.repeat(cell, times), shared[row, 1]
    other = rank != owner[ghost]
    ghost = _unique(comm, ghost[other], rank[other])

    sizes = 1 + np.bincount(ghost[:, 0], minlength=len(owner))
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    data = np.empty(offsets[-1], dtype=np.int32)
    data[offsets[:-1]] = owner
    others = np.ones(len(data), dtype=bool)
    others[offsets[:-1]] = False
    data[others] = ghost[:, 1]
    return graph.adjacencylist(data, offsets.astype(np.int32))._cpp_object


def _unique(comm: MPI.Comm, numbers: np.ndarray, ranks: np.ndarray) -> np.ndarray:
    """The different pairs (number, rank) in order, shape (n, 2); as one number each they are sorted faster."""
    return np.column_stack(np.divmod(np.unique(numbers * comm.size + ranks), comm.size))


def partitioner(comm: MPI.Comm) -> Any:
    """The partitioner with which a mesh is created on ``comm``; None in serial, where nothing is distributed."""
    return vertex_patch_partitioner if comm.size > 1 else None


def distributed(comm: MPI.Comm, cells: np.ndarray, x: np.ndarray) -> dmesh.Mesh:
    """A mesh of simplices shared by the ranks with complete vertex patches; collective.

    Args:
        comm: Communicator.
        cells: Numbers of the vertices of cells of this rank, in the order of all ranks'
            points, shape (m, d+1).
        x: Points of this rank [length], shape (n, d).
    """
    d = x.shape[1]
    element = basix.ufl.element("Lagrange", ("triangle", "tetrahedron")[d - 2], 1, shape=(d,))
    return dmesh.create_mesh(comm, cells, ufl.Mesh(element), x, partitioner(comm))


def patches_complete(mesh: dmesh.Mesh) -> bool:
    """Whether every rank holds all cells around each vertex of its own cells; collective."""
    tdim = mesh.topology.dim
    mesh.topology.create_connectivity(tdim, 0)
    vertices = mesh.topology.connectivity(tdim, 0).array.reshape(-1, tdim + 1)
    owned = vertices[: mesh.topology.index_map(tdim).size_local]
    total = la.vector(mesh.topology.index_map(0), dtype=np.float64)
    total.array[:] = np.bincount(owned.ravel(), minlength=len(total.array))
    total.scatter_reverse(la.InsertMode.add)
    total.scatter_forward()
    here = np.bincount(vertices.ravel(), minlength=len(total.array))
    touched = np.unique(owned)
    complete = bool(np.all(here[touched] == total.array[touched]))
    return bool(mesh.comm.allreduce(complete, MPI.LAND))


def redistributed(mesh: dmesh.Mesh, *every: dmesh.MeshTags | None) -> tuple[dmesh.Mesh, list[Any]]:
    """The same mesh balanced anew over the ranks with complete vertex patches; collective.

    Args:
        mesh: The mesh.
        every: Tags of its cells or facets; None stays None.

    Returns:
        The new mesh, and the tags on it in the order in which they were given.
    """
    tdim = mesh.topology.dim
    nodes = mesh.geometry.index_map()
    x = mesh.geometry.x[: nodes.size_local, : mesh.geometry.dim]
    owned = mesh.topology.index_map(tdim).size_local
    cells = nodes.local_to_global(mesh.geometry.dofmaps[0][:owned].ravel()).reshape(owned, tdim + 1)
    new = distributed(mesh.comm, cells, x)

    def moved(tags: dmesh.MeshTags | None) -> Any:
        if tags is None:
            return None
        dim = tags.dim
        keep = tags.indices < mesh.topology.index_map(dim).size_local
        mesh.topology.create_connectivity(dim, tdim)
        entities = cpp.mesh.entities_to_geometry(mesh._cpp_object, dim, tags.indices[keep], False)
        entities = nodes.local_to_global(entities.ravel()).reshape(-1, dim + 1)
        new.topology.create_connectivity(dim, 0)
        new.topology.create_connectivity(dim, tdim)
        found, values = distribute_entity_data(new, dim, entities, tags.values[keep])
        return dmesh.meshtags_from_entities(new, dim, graph.adjacencylist(found), values)

    return new, [moved(tags) for tags in every]


def check_mesh(mesh: dmesh.Mesh) -> None:
    """Check that a mesh has cells that the package works with; collective.

    Raises:
        InputError: If cells are not straight-sided triangles in the plane or tetrahedra
            in space.
    """
    cell, gdim, degree = (
        mesh.topology.cell_type.name,
        mesh.geometry.dim,
        mesh.geometry.cmaps[0].degree,
    )
    error = None
    if (cell, gdim) not in (("triangle", 2), ("tetrahedron", 3)):
        error = InputError(
            f"The mesh has cells of type {cell} in {gdim}D; allowed are triangles in 2D and tetrahedra in 3D. "
            "Mesh with simplices (in gmsh: no recombination), or split the cells."
        )
    elif degree != 1:
        error = InputError(
            f"The mesh has curved cells of degree {degree}; only straight-sided cells (degree 1) are allowed. "
            "In gmsh: Mesh.ElementOrder = 1."
        )
    raise_together(mesh.comm, error)


def check_shape(mesh: dmesh.Mesh) -> None:
    """Check that coordinates are finite and that no cell is turned over its neighbours; collective.

    The volumes of the cells add up to the volume within the boundary, ``int x.n dS /
    d``, only if none is turned over.

    Args:
        mesh: A mesh whose facets are connected to its cells.

    Raises:
        InputError: If a coordinate is not finite, or a cell is turned over.
    """
    tdim, comm = mesh.topology.dim, mesh.comm
    x = mesh.geometry.x[:, :tdim]
    finite = bool((abs(x) < HUGE).all())
    if not comm.allreduce(finite, MPI.LAND):
        raise InputError(
            f"The mesh has coordinates that are not finite, or beyond {HUGE:g}; look where they come from."
        )
    owned = mesh.topology.index_map(tdim).size_local
    cells = x[mesh.geometry.dofmaps[0]]
    facets = dmesh.exterior_facet_indices(mesh.topology)
    to_cell = mesh.topology.connectivity(tdim - 1, tdim)
    cell = to_cell.array[to_cell.offsets[facets]]
    of_cell = mesh.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)[cell]
    opposite = np.argmax(of_cell == facets[:, None], axis=1)
    local = np.array([[j for j in range(tdim + 1) if j != i] for i in range(tdim + 1)])[opposite]
    corners = np.take_along_axis(cells[cell], local[:, :, None], axis=1)
    apex = cells[cell, opposite]
    centre = x.mean(axis=0) if len(x) else np.zeros(tdim)
    centre = np.mean(comm.allgather(centre), axis=0)
    volume = abs(np.linalg.det(np.diff(cells[:owned], axis=1))).sum()
    within = _towers(corners, centre) * np.sign(_towers(corners, apex))
    volume, within = comm.allreduce(np.array([volume, within.sum()]), MPI.SUM)
    if abs(volume - within) > FOLDED * volume:
        raise InputError(
            f"The cells of the mesh lie over each other: their volumes are {volume / within:.6g} times that within the "
            "boundary. Look at the coordinates; a mesh that was deformed too much must be made anew."
        )


def _towers(corners: np.ndarray, apex: np.ndarray) -> np.ndarray:
    """Signed volumes, times d!, of the simplices between an apex and facets with corners (n, d, d)."""
    return np.linalg.det(corners - apex.reshape(-1, 1, apex.shape[-1]))
