"""Find components of graphs and the order along chains; tell DOLFINx ranks of cells."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import graph


def components(count: int, edges: np.ndarray) -> np.ndarray:
    """Return the least vertex of the connected component of each vertex of a graph.

    Args:
        count: Number of vertices.
        edges: Pairs of vertices, shape (n, 2).
    """
    # Most meshes are one body, and most scenes have no pair.
    if count <= 1 or not len(edges):
        return np.arange(count)
    from scipy import sparse  # type: ignore[import-untyped]  # noqa: PLC0415 - pairs only
    from scipy.sparse import csgraph  # type: ignore[import-untyped]  # noqa: PLC0415

    links = sparse.coo_array((np.ones(len(edges), dtype=bool), edges.T), (count, count))
    _, label = csgraph.connected_components(links, directed=False)
    _, first = np.unique(label, return_index=True)
    return np.asarray(first[label])


def successors(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Find the link of a chain that begins where each link ends.

    Args:
        start: Vertex at which each link begins, no vertex twice, shape (n,).
        end: Vertex at which it ends, shape (n,).

    Returns:
        Number of the next link, shape (n,); the last link of a chain is its own.
    """
    count = len(start)
    order = np.argsort(start)
    place = np.searchsorted(start, end, sorter=order)
    candidate = order[np.minimum(place, count - 1)]
    return np.where(start[candidate] == end, candidate, np.arange(count))


def to_chain_ends(successor: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Follow each link to the last link of its chain by pointer doubling.

    Each round doubles the distance that it sees.

    Args:
        successor: The next link, from :func:`successors`, shape (n,).
        lengths: Length of each link, shape (n,).

    Returns:
        The sum of the lengths from each link to the last one, whose own length does not
        count, and the number of the last link, shape (n,) each. A closed chain has no
        last link: there ``successor[last] != last``.
    """
    count = len(successor)
    is_last = successor == np.arange(count)
    distance = np.where(is_last, 0.0, lengths)
    last = successor
    for _ in range(count.bit_length()):
        distance = distance + distance[last]
        last = last[last]
    return distance, last


def order_along_curves(start: np.ndarray, end: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Order facets along the open and closed curves that they form, curve after curve.

    The curve with the lowest first point comes first. A closed curve begins at its
    lowest point.

    Args:
        start: Number of the first vertex of each facet, shape (f,).
        end: Number of its last vertex.
        x: Position of the first vertex, shape (f, 2).

    Returns:
        Numbers of the facets in order, shape (f,).
    """
    count = len(start)
    height = np.empty(count, dtype=int)
    height[np.lexsort(x.T[::-1])] = np.arange(count)
    successor = successors(start, end)
    to_end, last = to_chain_ends(successor, np.ones(count))
    closed = successor[last] != last
    if closed.any():
        # A closed curve gets a last facet: the one in front of its lowest point.
        lowest = components(count, np.column_stack([height, height[successor]]))
        cut = np.flatnonzero(closed & (height[successor] == lowest[height]))
        successor[cut] = cut
        to_end, last = to_chain_ends(successor, np.ones(count))
    # The place of a curve among all is the height of its first facet, which succeeds
    # no other one.
    has_successor = successor != np.arange(count)
    first = np.setdiff1d(np.arange(count), successor[has_successor])
    place = np.empty(count, dtype=int)
    place[last[first]] = height[first]
    return np.lexsort([-to_end, place[last]])


def destinations(owner: np.ndarray, cell: np.ndarray, rank: np.ndarray) -> Any:
    """Return the ranks of each cell as a partitioner of DOLFINx gives them.

    Args:
        owner: Rank that owns each cell, shape (n,).
        cell: Cells that are ghosts on other ranks, shape (g,).
        rank: The other rank of each of them, shape (g,).

    Returns:
        Adjacency list cell -> ranks, the owner first (the C++ object).
    """
    all_cells = np.concatenate([np.arange(len(owner)), cell])
    all_ranks = np.concatenate([owner, rank]).astype(np.int32)
    # The sort is stable, so that the owner comes first.
    order = np.argsort(all_cells, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(all_cells, minlength=len(owner)))])
    return graph.adjacencylist(all_ranks[order], offsets.astype(np.int32))._cpp_object
