"""Split a mesh of DOLFINx whose cells are no straight simplices, with its tags."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import mesh as dmesh

from namedmesh.base.communicators import lasting
from namedmesh.base.ranks import global_numbers
from namedmesh.base.releases import cell_nodes, coordinate_map
from namedmesh.files.building import Built, build_simplices, spread_from
from namedmesh.files.file_mesh import SHAPES, Block, ElementSet, FacetSet, FileMesh, pad
from namedmesh.sides import connect_facets
from namedmesh.tags import NO_TAG, tag_table

TENSOR_ORDER = {
    "quadrilateral": [0, 1, 3, 2],
    "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6],
    "pyramid": [0, 1, 3, 2, 4],
}
"""Order of the corners, which DOLFINx counts as corners of products."""
SPLIT = ("quadrilateral", "hexahedron", "prism", "pyramid")
"""Cells that become simplices."""


def has_other_cells(mesh: dmesh.Mesh) -> bool:
    """Tell whether the cells of a mesh fill its space and are no straight simplices."""
    shape = mesh.topology.cell_type.name
    fills_space = mesh.topology.dim == mesh.geometry.dim >= 2
    return fills_space and (shape in SPLIT or coordinate_map(mesh.geometry).degree > 1)


def simplicial(
    mesh: dmesh.Mesh, facet_tags: dmesh.MeshTags | None, cell_tags: dmesh.MeshTags | None
) -> tuple[dmesh.Mesh, dmesh.MeshTags | None, dmesh.MeshTags | None]:
    """Split the cells of a mesh into straight simplices; collective.

    Args:
        mesh: The mesh.
        facet_tags: Tags of its facets, or None.
        cell_tags: Tags of its cells, or None.

    Returns:
        The new mesh with the same tags.

    Raises:
        InputError: If a cell cannot be split.
    """
    comm = lasting(mesh.comm)
    parts = comm.gather(_tables(mesh, facet_tags, cell_tags))

    def make() -> Built:
        assert parts is not None
        return build_simplices(_file_mesh(mesh, parts), numbered=False)

    new = spread_from(comm, 0, make, "The mesh of DOLFINx")
    return (
        new["mesh"],
        None if facet_tags is None else new["facet_tags"],
        None if cell_tags is None else new["cell_tags"],
    )


def _tables(
    mesh: dmesh.Mesh, facet_tags: dmesh.MeshTags | None, cell_tags: dmesh.MeshTags | None
) -> list[np.ndarray]:
    """Return points, cells, their tags, facets, their tags and numbers of the points.

    They are what this rank owns. The numbers are the numbers that the user gave.
    """
    d = mesh.topology.dim
    nodes = mesh.geometry.index_map()
    owned = mesh.topology.index_map(d).size_local
    cells = cell_nodes(mesh.geometry)[:owned]
    numbers = global_numbers(nodes, cells)
    tags = np.full(owned, NO_TAG) if cell_tags is None else tag_table(cell_tags)[:owned]
    width = 2 if d == 2 else 4
    facets = np.empty((0, width), dtype=np.int64)
    values = np.empty(0, dtype=np.int64)
    if facet_tags is not None:
        connect_facets(mesh)
        mesh.topology.create_connectivity(d - 1, 0)
        here = facet_tags.indices < mesh.topology.index_map(d - 1).size_local
        found = facet_tags.indices[here]
        corners = dmesh.entities_to_geometry(mesh, d - 1, found, False)
        facets = pad(global_numbers(nodes, corners)[:, :width])
        values = facet_tags.values[here].astype(np.int64)
    count = nodes.size_local
    given = mesh.geometry.input_global_indices[:count]
    return [mesh.geometry.x[:count], numbers, tags, facets, values, given]


def _file_mesh(mesh: dmesh.Mesh, parts: Sequence[list[np.ndarray]]) -> FileMesh:
    """Return the mesh that the ranks have together."""
    points, cells, tags, facets, values, given = (
        np.concatenate(tables) for tables in zip(*parts, strict=True)
    )
    # The ranks number points and cells each in their way; the split must not see it.
    order = np.lexsort((given, *points.T))
    row = np.empty(len(order), dtype=np.int64)
    row[order] = np.arange(len(order))
    points, cells, facets = points[order], row[cells], row[facets]
    rows = np.lexsort(np.sort(cells, axis=1).T)
    cells, tags = cells[rows], tags[rows]
    shape = mesh.topology.cell_type.name
    count = SHAPES[shape].corners
    corners = TENSOR_ORDER.get(shape, list(range(count)))
    others = list(range(count, cells.shape[1]))
    block = Block(shape, cells[:, [*corners, *others]])
    tagged = []
    for tag in np.unique(tags[tags != NO_TAG]):
        tagged.append(ElementSet(str(tag), {0: np.flatnonzero(tags == tag)}, int(tag)))
    facet_sets = [FacetSet(str(tag), facets[values == tag], int(tag)) for tag in np.unique(values)]
    return FileMesh(points, (block,), tuple(tagged), tuple(facet_sets))
