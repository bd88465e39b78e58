"""Tags of cells and facets as plain tables, one number for each, and back."""

from __future__ import annotations

import numpy as np
from dolfinx import la
from dolfinx import mesh as dmesh
from mpi4py import MPI

NO_TAG = -1
"""Stands in a table where a cell or facet has no tag."""


def tag_table(tags: dmesh.MeshTags) -> np.ndarray:
    """The tag of each cell or facet of this rank, ghosts included, :data:`NO_TAG` where there is none."""
    index_map = tags.topology.index_map(tags.dim)
    table = np.full(index_map.size_local + index_map.num_ghosts, NO_TAG, dtype=np.int32)
    table[tags.indices] = tags.values
    return table


def tags_of(mesh: dmesh.Mesh, dim: int, entities: np.ndarray, values: np.ndarray) -> dmesh.MeshTags:
    """Mesh tags of entities in any order, repeated ones included; those with :data:`NO_TAG` are left out."""
    tagged = values != NO_TAG
    entities, first = np.unique(entities[tagged], return_index=True)
    return dmesh.meshtags(
        mesh, dim, entities.astype(np.int32), values[tagged][first].astype(np.int32)
    )


def shared(mesh: dmesh.Mesh, tags: dmesh.MeshTags | None) -> dmesh.MeshTags | None:
    """The tags, known on all ranks that have the cell or facet, whichever of them had its tag; collective.

    DOLFINx locates facets on the rank that owns them. The others have them, too, as
    ghosts.
    """
    if tags is None or mesh.comm.size == 1:
        return tags
    table, index_map = tag_table(tags), tags.topology.index_map(tags.dim)
    known = np.column_stack([table + 1, table != NO_TAG])
    vector = la.vector(index_map, 2)
    rows, owned = vector.array.reshape(-1, 2), index_map.size_local
    rows[owned:] = known[owned:]  # of facets that their owner does not know
    rows[:owned] = 0.0
    vector.scatter_reverse(la.InsertMode.add)
    theirs = rows[:owned, 0] / np.maximum(rows[:owned, 1], 1.0)
    rows[:owned, 0] = np.where(table[:owned] != NO_TAG, table[:owned] + 1, theirs)
    vector.scatter_forward()
    every = rows[:, 0].astype(np.int32) - 1
    if not mesh.comm.allreduce(not np.array_equal(every, table), MPI.LOR):
        return tags
    return tags_of(mesh, tags.dim, np.arange(len(every)), every)
