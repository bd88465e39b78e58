"""Refine meshes by bisection, with their tags."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh

from namedmesh.base.communicators import lasting
from namedmesh.base.ranks import fetch
from namedmesh.base.releases import cell_nodes
from namedmesh.periodic import close_alike, twisted
from namedmesh.sides import connect_facets, facets_of_cells
from namedmesh.tags import NO_TAG, tag_table, tags_of

EDGE_SHEAR = np.eye(3) + 1e-5 * np.array(
    [[0, 0.83, 0.31], [-0.57, 0.44, 0.71], [0.13, -0.92, 0.22]]
)
"""Which edge of a cell is the longest is decided after this shear."""


@dataclass(frozen=True, eq=False)
class Refinement:
    """Hold a refined mesh, and the old cells and facets that its parts lie in.

    A rank makes the children of its cells; the partitioner then gives them to any rank.
    Tables of children are on the ranks that made them.

    Attributes:
        mesh: The refined mesh.
        parent_cell: The old cell of each child made here, shape (children,).
        parent_side: Local number in the old cell of the side in which each facet of
            these children lies, -1 inside, shape (children, d+1).
        facets: Facets of the old cells, shape (cells, d+1).
    """

    mesh: dmesh.Mesh
    parent_cell: np.ndarray
    parent_side: np.ndarray
    facets: np.ndarray

    def places(self, corners: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return places of the corners of the new cells [length]; collective.

        Each corner is a corner of the old cell, or the middle of two.

        Args:
            corners: Nodes of the corners of the old cells [length], shape (cells, d+1,
                3).
            places: The places of these corners [length], shape (cells, d+1, d).

        Returns:
            Shape (new cells, d+1, d).
        """
        vertices = places.shape[1]
        of_parents = np.concatenate([corners, places], axis=2)[self.parent_cell]
        rows = self.of_cells(of_parents.reshape(len(of_parents), -1), slice(None))
        middle = _middles(rows.reshape(len(rows), vertices, -1))
        x = self.mesh.geometry.x[cell_nodes(self.mesh.geometry)]
        distance = np.linalg.norm(middle[:, None, :, :3] - x[:, :, None], axis=3)
        nearest = distance.argmin(axis=2)
        return np.take_along_axis(middle[..., 3:], nearest[..., None], axis=1)

    def of_sides(self, table: np.ndarray) -> np.ndarray:
        """Return a table of sides (cells, d+1) for the new cells; collective."""
        of_parents = table[self.parent_cell]
        values = np.take_along_axis(of_parents, np.maximum(self.parent_side, 0), axis=1)
        return self.of_cells(np.where(self.parent_side >= 0, values, NO_TAG), slice(None))

    def inherit_tags(self, tags: dmesh.MeshTags | None) -> dmesh.MeshTags | None:
        """Return the tags of the new mesh; collective.

        Each cell or facet gets the tag of the old one in which it lies.
        """
        if tags is None:
            return None
        table = tag_table(tags)
        if tags.dim == self.mesh.topology.dim:
            values = self.of_cells(table[self.parent_cell][:, None], slice(None))
            entities = np.arange(len(values))
        else:
            values = self.of_sides(table[self.facets])
            entities = facets_of_cells(self.mesh).ravel()
        return tags_of(self.mesh, tags.dim, entities, values.ravel())

    def of_cells(self, rows: np.ndarray, cells: np.ndarray | slice) -> np.ndarray:
        """Return the rows of new cells from a table of children; collective.

        Args:
            rows: Rows of the children made here, shape (children, m).
            cells: Cells of the new mesh on this rank.
        """
        return fetch(lasting(self.mesh.comm), rows, self.mesh.topology.original_cell_index[cells])


def refine(
    mesh: dmesh.Mesh,
    cells: np.ndarray,
    partitioner: Any,
    links: Sequence[np.ndarray] = (),
    axis: tuple[tuple[float, ...], ...] | None = None,
) -> Refinement:
    """Refine cells by bisection of longest edges (DOLFINx), conforming; collective.

    Which edge of a triangle is the longest must not depend on the numbers of the
    vertices: the mesh would depend on the number of ranks. So lengths are compared
    after a slight shear, which leaves no two edges of a structured mesh equal.
    Coordinates do not pass through the shear and back. Old vertices stay as they are,
    and a new one is the exact mean of the ends of its edge. So a side at y = 0 stays
    there.

    Args:
        mesh: The mesh; it stays as it is.
        cells: Cells of this rank, shape (n,).
        partitioner: What gives the new cells to ranks; None leaves them where they are.
        links: Numbers of edges of this rank and of edges that are split where they are,
            shape (n, 2) each.
        axis: In 3D a point and the direction of the axis around which such edges lie.

    Returns:
        The refined mesh and its parents.
    """
    tdim = mesh.topology.dim
    mesh.topology.create_entities(1)
    mesh.topology.create_connectivity(tdim, 1)
    mesh.topology.create_connectivity(1, tdim)
    edges = dmesh.compute_incident_entities(mesh.topology, cells, tdim, 1)
    shear = EDGE_SHEAR.copy()
    if tdim == 2:
        # A mesh in the plane stays there.
        shear[:2, 2] = 0
        shear[2, :2] = 0

    def moved(x: np.ndarray) -> np.ndarray:
        """Return points, moved so that no two edges of a cell are equal."""
        return x @ shear if axis is None else twisted(x, axis)

    x = mesh.geometry.x.copy()
    if links:
        mesh.topology.create_connectivity(1, 0)
        count = mesh.topology.index_map(1)
        every = np.arange(count.size_local + count.num_ghosts, dtype=np.int32)
        ends = moved(x)[dmesh.entities_to_geometry(mesh, 1, every)]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        edges = close_alike(mesh, edges, lengths, links)
    kind = dmesh.RefinementOption.parent_cell_and_facet
    try:
        mesh.geometry.x[:] = moved(x)
        fine, parent_cell, parent_facet = dmesh.refine(mesh, edges, partitioner, kind)
    finally:
        mesh.geometry.x[:] = x
    connect_facets(fine)
    # DOLFINx gives the local number of the facet in the old cell, -1 inside of it.
    parent_side = parent_facet.reshape(-1, tdim + 1)
    refinement = Refinement(fine, parent_cell, parent_side, facets_of_cells(mesh))
    _set_coordinates(refinement, x[cell_nodes(mesh.geometry)[parent_cell]], moved)
    return refinement


def _set_coordinates(
    refinement: Refinement, corners: np.ndarray, moved: Callable[[np.ndarray], np.ndarray]
) -> None:
    """Set the nodes of a refined mesh; collective.

    Each is an old node, or the middle of two old ones.

    Args:
        refinement: The refined mesh, in the coordinates of moved points.
        corners: Corners of the old cell of each child made here [length], shape
            (children, d+1, 3).
        moved: Returns where points were moved.
    """
    geometry = refinement.mesh.geometry
    nodes = cell_nodes(geometry)
    vertices = nodes.shape[1]
    # One cell for each node, the first in which it is.
    _, first = np.unique(nodes, return_index=True)
    rows = corners.reshape(len(corners), vertices * 3)
    middle = _middles(refinement.of_cells(rows, first // vertices).reshape(-1, vertices, 3))
    nearest = np.linalg.norm(moved(middle) - geometry.x[:, None], axis=2).argmin(axis=1)
    geometry.x[:] = np.take_along_axis(middle, nearest[:, None, None], axis=1)[:, 0]


def _middles(corners: np.ndarray) -> np.ndarray:
    """Return corners of cells and middles of their edges, (n, d+1, k) -> (n, m, k)."""
    # The pairs (i, i) stand for the corners themselves.
    i, j = np.triu_indices(corners.shape[1])
    return 0.5 * (corners[:, i] + corners[:, j])
