"""Relate facets to the cells beside them.

A side is a pair of a cell and one of its facets, by its local number. Facet i is
opposite to vertex i. The mesh must have connected its facets and cells, see
:func:`connect_facets`.
"""

from __future__ import annotations

import numpy as np
from dolfinx import mesh as dmesh


def connect_facets(mesh: dmesh.Mesh) -> None:
    """Let DOLFINx find the facets of the cells and the cells of the facets."""
    d = mesh.topology.dim
    mesh.topology.create_connectivity(d - 1, d)
    mesh.topology.create_connectivity(d, d - 1)


def facets_of_cells(mesh: dmesh.Mesh) -> np.ndarray:
    """Return the facets of the cells of this rank, shape (cells, d+1)."""
    d = mesh.topology.dim
    return mesh.topology.connectivity(d, d - 1).array.reshape(-1, d + 1)


def inner_facets(mesh: dmesh.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets of which both cells are on this rank, and these cells.

    Returns:
        Numbers of the facets, shape (n,), and of their cells, shape (n, 2).
    """
    d = mesh.topology.dim
    facet_to_cell = mesh.topology.connectivity(d - 1, d)
    first = facet_to_cell.offsets[:-1]
    inner = np.flatnonzero(np.diff(facet_to_cell.offsets) == 2)
    cells = np.column_stack([facet_to_cell.array[first[inner] + i] for i in range(2)])
    return inner, cells


def outer_facets(mesh: dmesh.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets of which one cell alone is on this rank, and this cell.

    On several ranks these are also the facets around its ghosts.

    Returns:
        Numbers of the facets and of their cells, shape (n,) each.
    """
    d = mesh.topology.dim
    facet_to_cell = mesh.topology.connectivity(d - 1, d)
    outer = np.flatnonzero(np.diff(facet_to_cell.offsets) == 1)
    return outer, facet_to_cell.array[facet_to_cell.offsets[outer]]


def local_facets(mesh: dmesh.Mesh, facets: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the local number of each facet (n,) in a cell that has it, shape (n,)."""
    return np.argmax(facets_of_cells(mesh)[cells] == facets[:, None], axis=1)


def boundary_sides(mesh: dmesh.Mesh, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the cell of each boundary facet, and the local number of the facet there.

    Args:
        mesh: A mesh whose facets are connected to its cells.
        facets: Numbers of the facets, shape (n,).
    """
    tdim = mesh.topology.dim
    facet_to_cell = mesh.topology.connectivity(tdim - 1, tdim)
    # A facet on the boundary has one cell, the first of its list.
    cell = facet_to_cell.array[facet_to_cell.offsets[facets]]
    return cell, local_facets(mesh, facets, cell)
