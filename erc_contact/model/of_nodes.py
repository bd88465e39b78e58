"""Give one value to each node of a contact from the values of its facets."""

from __future__ import annotations

import numpy as np

from erc_contact.model.trace import Side

CONTINUOUS = 1e-9
"""Difference of two facets at a node that counts as none, over the greatest value."""


def values_of_nodes(side: Side, values: np.ndarray) -> np.ndarray:
    """Return one value at each node from values of its facets, shape (nodes,).

    Where facets differ, as of data that jump between them, it is the mean weighted with
    their areas. So the sum of weights times values in the rule at the nodes is kept. A
    rank has all facets at the nodes of its own cells, so it needs no communication.

    Args:
        side: The facets.
        values: The values, shape (f, m).
    """
    nodes = side.nodes
    result = np.zeros(side.node_count)
    result[nodes] = values
    differs = abs(result[nodes] - values) > CONTINUOUS * abs(values).max(initial=0.0)
    if not differs.any():
        return result
    jumps = np.zeros(side.node_count, dtype=bool)
    jumps[nodes[differs]] = True
    areas = np.broadcast_to(side.areas[:, None], nodes.shape)
    area = np.bincount(nodes.ravel(), areas.ravel(), side.node_count)
    weighted = np.bincount(nodes.ravel(), (areas * values).ravel(), side.node_count)
    result[jumps] = weighted[jumps] / area[jumps]
    return result
