"""Tags of cells and facets as plain tables, one number for each, and back."""

from __future__ import annotations

import numpy as np
from dolfinx import mesh as dmesh

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
    return dmesh.meshtags(mesh, dim, entities.astype(np.int32), values[tagged][first].astype(np.int32))
