"""Refinement of meshes by bisection, with their tags."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.base.ranks import fetched
from erc_contact.mesh.tags import NO_TAG, tag_table, tags_of

SHEAR = np.eye(3) + 1e-5 * np.array([[0, 0.83, 0.31], [-0.57, 0.44, 0.71], [0.13, -0.92, 0.22]])
"""Which edge of a cell is the longest is decided after this shear."""


@dataclass(frozen=True, eq=False)
class Refinement:
    """A refined mesh, and the cells and facets of the old mesh in which its own lie.

    A rank makes the children of its cells; the partitioner then gives them to any rank.
    Tables of children are on the ranks that made them.

    Attributes:
        mesh: The refined mesh.
        parent_cell: The old cell of each child made here, shape (children,).
        parent_facet: The old facets in which the facets of these children lie, -1
            inside, shape (children, d+1).
    """

    mesh: dmesh.Mesh
    parent_cell: np.ndarray
    parent_facet: np.ndarray

    def inherited(self, tags: dmesh.MeshTags | None) -> dmesh.MeshTags | None:
        """Tags of the new mesh: each cell or facet gets the tag of the old one in which it lies; collective."""
        if tags is None:
            return None
        table, topology, dim = tag_table(tags), self.mesh.topology, tags.dim
        if dim == topology.dim:
            rows, entities = (
                table[self.parent_cell][:, None],
                np.arange(len(topology.original_cell_index)),
            )
        else:
            rows = np.where(self.parent_facet >= 0, table[self.parent_facet], NO_TAG)
            entities = topology.connectivity(topology.dim, dim).array
        return tags_of(self.mesh, dim, entities, self.of_cells(rows, slice(None)).ravel())

    def of_cells(self, rows: np.ndarray, cells: np.ndarray | slice) -> np.ndarray:
        """Rows of cells of the new mesh from a table of children, shape (children, m); collective."""
        return fetched(self.mesh.comm, rows, self.mesh.topology.original_cell_index[cells])


def refine(mesh: dmesh.Mesh, cells: np.ndarray, partitioner: Any) -> Refinement:
    """Refine cells of this rank by bisection of longest edges (DOLFINx), conforming; collective.

    Which edge of a triangle is the longest must not depend on the numbers of the
    vertices: the mesh would depend on the number of ranks. So lengths are compared
    after a slight shear, which leaves no two edges of a structured mesh equal.
    Coordinates do not pass through the shear and back. Old vertices stay as they are,
    and a new one is the exact mean of the ends of its edge: a side at y = 0 stays at y
    = 0.

    Args:
        mesh: The mesh; it stays as it is.
        cells: Cells of this rank, shape (n,).
        partitioner: What gives the new cells to ranks; None leaves them where they are.

    Returns:
        The refined mesh and its parents.
    """
    tdim = mesh.topology.dim
    mesh.topology.create_entities(1)
    mesh.topology.create_connectivity(tdim, 1)
    mesh.topology.create_connectivity(1, tdim)
    edges = dmesh.compute_incident_entities(mesh.topology, cells, tdim, 1)
    shear = SHEAR.copy()
    if tdim == 2:
        shear[:2, 2] = shear[2, :2] = 0
    x = mesh.geometry.x.copy()
    kind = dmesh.RefinementOption.parent_cell_and_facet
    try:
        mesh.geometry.x[:] = x @ shear
        fine, parent_cell, parent_facet = dmesh.refine(mesh, edges, partitioner, kind)
    finally:
        mesh.geometry.x[:] = x
    fine.topology.create_entities(tdim - 1)
    fine.topology.create_connectivity(tdim, tdim - 1)
    fine.topology.create_connectivity(tdim - 1, tdim)
    local = parent_facet.reshape(-1, tdim + 1)
    facets = mesh.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)[parent_cell]
    facets = np.where(local >= 0, np.take_along_axis(facets, np.maximum(local, 0), axis=1), -1)
    refinement = Refinement(fine, parent_cell, facets)
    _set_coordinates(refinement, x[mesh.geometry.dofmaps[0][parent_cell]], shear)
    return refinement


def _set_coordinates(refinement: Refinement, corners: np.ndarray, shear: np.ndarray) -> None:
    """Set the nodes of a refined mesh: each is an old one, or the middle of two old ones; collective.

    Args:
        refinement: The refined mesh, in sheared coordinates.
        corners: Corners of the old cell of each child made here [length], shape
            (children, d+1, 3).
        shear: The shear.
    """
    geometry = refinement.mesh.geometry
    nodes = geometry.dofmaps[0]
    _, first = np.unique(nodes, return_index=True)
    shape = corners.shape[1:]
    old = refinement.of_cells(
        corners.reshape(len(corners), shape[0] * shape[1]), first // nodes.shape[1]
    )
    old = old.reshape(len(old), *shape)
    i, j = np.triu_indices(nodes.shape[1])
    middle = 0.5 * (old[:, i] + old[:, j])
    nearest = np.linalg.norm(middle @ shear - geometry.x[:, None], axis=2).argmin(axis=1)
    geometry.x[:] = np.take_along_axis(middle, nearest[:, None, None], axis=1)[:, 0]
