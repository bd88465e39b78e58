"""Convert tags of cells and facets to plain tables, one number for each, and back."""

from __future__ import annotations

import numpy as np
from dolfinx import la
from dolfinx import mesh as dmesh
from mpi4py import MPI

NO_TAG = -1
"""Stands in a table where a cell or facet has no tag."""


def tag_table(tags: dmesh.MeshTags) -> np.ndarray:
    """Return the tag of each cell or facet of this rank, ghosts included.

    It is :data:`NO_TAG` where there is none.
    """
    index_map = tags.topology.index_map(tags.dim)
    table = np.full(index_map.size_local + index_map.num_ghosts, NO_TAG, dtype=np.int32)
    table[tags.indices] = tags.values
    return table


def tags_of(mesh: dmesh.Mesh, dim: int, entities: np.ndarray, values: np.ndarray) -> dmesh.MeshTags:
    """Make mesh tags of entities in any order, which may be repeated.

    Those with :data:`NO_TAG` are left out.
    """
    tagged = values != NO_TAG
    numbers, first = np.unique(entities[tagged], return_index=True)
    tags = values[tagged][first].astype(np.int32)
    return dmesh.meshtags(mesh, dim, numbers.astype(np.int32), tags)


def share_tags(
    comm: MPI.Comm, mesh: dmesh.Mesh, tags: dmesh.MeshTags | None
) -> dmesh.MeshTags | None:
    """Share tags between all ranks that have the cell or facet; collective.

    Any of the ranks may have the tag. DOLFINx locates facets on the rank that owns
    them. The others have them, too, as ghosts.
    """
    if tags is None or comm.size == 1:
        return tags
    table = tag_table(tags)
    index_map = tags.topology.index_map(tags.dim)
    owned = index_map.size_local
    vector = la.vector(index_map, 2)
    # The columns are the tag plus 1, zero for none, and whether there is a tag.
    rows = vector.array.reshape(-1, 2)
    rows[:owned] = 0.0
    rows[owned:, 0] = table[owned:] + 1
    rows[owned:, 1] = table[owned:] != NO_TAG
    # The owner gets the sums over its ghosts, and takes the mean where it has no tag.
    vector.scatter_reverse(la.InsertMode.add)
    ghost_tags = rows[:owned, 0] / np.maximum(rows[:owned, 1], 1.0)
    rows[:owned, 0] = np.where(table[:owned] != NO_TAG, table[:owned] + 1, ghost_tags)
    vector.scatter_forward()
    shared_table = rows[:, 0].astype(np.int32) - 1
    if not comm.allreduce(not np.array_equal(shared_table, table), MPI.LOR):
        return tags
    return tags_of(mesh, tags.dim, np.arange(len(shared_table)), shared_table)
