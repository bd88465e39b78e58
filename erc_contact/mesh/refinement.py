"""Refinement of meshes by bisection, with their tags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.mesh.tags import tag_table, tags_of


@dataclass(frozen=True, eq=False)
class Refinement:
    """A refined mesh, and the cells and facets of the old mesh in which its own lie.

    Attributes:
        old: The mesh before.
        mesh: The refined mesh.
        parent_cell: The old cell of each cell of this rank, shape (cells,).
        facets: The facets that lie in an old facet, shape (n,).
        parent_facet: This old facet, shape (n,).
    """

    old: dmesh.Mesh
    mesh: dmesh.Mesh
    parent_cell: np.ndarray
    facets: np.ndarray
    parent_facet: np.ndarray

    def inherited(self, tags: dmesh.MeshTags | None) -> dmesh.MeshTags | None:
        """Tags of the new mesh: each cell or facet gets the tag of the old cell or facet in which it lies."""
        if tags is None:
            return None
        of_cells = tags.dim == self.mesh.topology.dim
        parents = self.parent_cell if of_cells else self.parent_facet
        children = np.arange(len(parents)) if of_cells else self.facets
        return tags_of(self.mesh, tags.dim, children, tag_table(tags)[parents])


def refine(mesh: dmesh.Mesh, cells: np.ndarray) -> Refinement:
    """Refine cells of this rank by bisection of longest edges (DOLFINx), conforming; collective.

    Which edge of a triangle is the longest must not depend on the numbers of the vertices: the mesh would depend on the
    number of ranks. So lengths are compared after a slight shear, which leaves no two edges of a structured mesh equal.
    Coordinates do not pass through the shear and back. Old vertices stay as they are, and a new one is the exact mean
    of the ends of its edge: a side at y = 0 stays at y = 0.

    Args:
        mesh: The mesh; it stays as it is.
        cells: Cells of this rank, shape (n,).

    Returns:
        The refined mesh, not yet balanced over the ranks, with its parents.
    """
    tdim = mesh.topology.dim
    mesh.topology.create_entities(1)
    mesh.topology.create_connectivity(tdim, 1)
    mesh.topology.create_connectivity(1, tdim)
    edges = dmesh.compute_incident_entities(mesh.topology, cells, tdim, 1)
    shear = np.eye(3) + 1e-5 * np.array([[0, 0.83, 0.31], [-0.57, 0.44, 0.71], [0.13, -0.92, 0.22]])
    if tdim == 2:
        shear[:2, 2] = shear[2, :2] = 0
    x = mesh.geometry.x.copy()
    try:
        mesh.geometry.x[:] = x @ shear
        fine, parent_cell, parent_facet = dmesh.refine(mesh, edges, None, dmesh.RefinementOption.parent_cell_and_facet)
    finally:
        mesh.geometry.x[:] = x
    fine.topology.create_entities(tdim - 1)
    fine.topology.create_connectivity(tdim, tdim - 1)
    fine.topology.create_connectivity(tdim - 1, tdim)
    start = fine.topology.index_map(tdim).local_range[0]
    original = fine.topology.original_cell_index - start
    parent_cell = parent_cell[original]
    ends = _parent_ends(mesh, fine, parent_cell, x @ shear)
    fine.geometry.x[:] = 0.5 * (x[ends[:, 0]] + x[ends[:, 1]])
    parent_facet = parent_facet.reshape(-1, tdim + 1)[original]
    child, local = np.nonzero(parent_facet >= 0)
    old = mesh.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)
    new = fine.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)
    return Refinement(mesh, fine, parent_cell, new[child, local], old[parent_cell[child], parent_facet[child, local]])


def _parent_ends(mesh: dmesh.Mesh, fine: dmesh.Mesh, parent_cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The two old nodes whose middle each node of a refined mesh is; for an old node they are the same.

    Args:
        mesh: The old mesh.
        fine: The refined mesh, in the coordinates of ``x``.
        parent_cell: Old cell of each cell of ``fine``.
        x: Coordinates of the old nodes at the refinement [length], shape (old nodes, 3).

    Returns:
        Old nodes of this rank, shape (nodes of fine, 2).
    """
    nodes = fine.geometry.dofmaps[0]
    _, first = np.unique(nodes, return_index=True)
    old = mesh.geometry.dofmaps[0][parent_cell[first // nodes.shape[1]]]
    candidates = np.stack([old[:, i] for i in np.array(np.triu_indices(nodes.shape[1])).T], axis=1)
    middle = 0.5 * (x[candidates[..., 0]] + x[candidates[..., 1]])
    nearest = np.linalg.norm(middle - fine.geometry.x[:, None], axis=2).argmin(axis=1)
    return np.take_along_axis(candidates, nearest[:, None, None], axis=1)[:, 0]
