"""Make loops of the outlines of triangles, and bands of triangles between two loops.

A band is a strip of triangles between two closed loops of points.
"""

from __future__ import annotations

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.closest import closest
from namedmesh.graphs import order_along_curves
from namedmesh.joining.triangles import edge_lengths, edges_of
from namedmesh.rows import row_numbers

PLACES = 2**40
"""Number of places on a loop that are told apart."""


def outer_edges(triangles: np.ndarray) -> np.ndarray:
    """Return the edges that one triangle has alone, in its direction, shape (k, 2)."""
    edges = edges_of(triangles)
    (numbers,) = row_numbers(edges)
    return edges[np.bincount(numbers)[numbers] == 1]


def loops(x: np.ndarray, edges: np.ndarray) -> list[np.ndarray]:
    """Return the points of each closed loop that edges form.

    Args:
        x: Points [length], shape (n, 3).
        edges: First and last point of each edge, shape (k, 2).

    Raises:
        InputError: If a loop touches itself or another one.
    """
    if not len(edges):
        return []
    start, end = edges.T
    if len(np.unique(start)) < len(start):
        raise InputError(
            "joined: the outline of a curved part touches itself. Mesh the part with smaller "
            "facets, or name its pieces one by one."
        )
    order = order_along_curves(start, end, x[start])
    breaks = np.flatnonzero(end[order][:-1] != start[order][1:]) + 1
    return np.split(start[order], breaks)


def loop_edges(loop: np.ndarray) -> np.ndarray:
    """Return the edges of a loop of points, shape (k, 2)."""
    return np.column_stack([loop, np.roll(loop, -1)])


def band(x: np.ndarray, inner: np.ndarray, outer: np.ndarray) -> np.ndarray:
    """Return the triangles between two loops of points that run side by side.

    Points of the outer loop have places on the inner one. Going along both, the edge
    whose middle comes next makes a triangle with the point reached on the other loop.

    Args:
        x: Points [length], shape (n, 3).
        inner: Points of a loop, the band is on its left, shape (k,).
        outer: Points of the other loop in the same direction, shape (l,).

    Raises:
        InputError: If the outer loop does not go once around the inner one.
    """
    edges = loop_edges(inner)
    lengths = edge_lengths(x, edges)
    places = np.concatenate([[0.0], np.cumsum(lengths)])
    edge, shares, _ = closest(x[outer], x[edges])
    first = (places[edge] + shares[:, 1] * lengths[edge]) / places[-1]
    places /= places[-1]
    # Going once around, the place rises by one.
    step = np.roll(first, -1) - first
    step -= np.round(step)
    if abs(step.sum() - 1.0) > 0.5:
        raise InputError(
            "joined: the facets around the outline of a curved part do not go around it once. Mesh "
            "the parts with smaller facets there."
        )
    outer_places = first[0] + np.concatenate([[0.0], np.cumsum(step)])
    outer_places = np.minimum(np.maximum.accumulate(outer_places), outer_places[-1])
    # Whole numbers, so that both loops see one order of equal places.
    middles = np.rint(PLACES * (places[1:] + places[:-1]) / 2).astype(np.int64)
    outer_middles = np.rint(PLACES * (outer_places[1:] + outer_places[:-1]) / 2).astype(np.int64)
    around = PLACES * np.array([-1, 0, 1])[:, None]
    reached = np.searchsorted((around + outer_middles).ravel(), middles, side="left")
    outer_reached = np.searchsorted((around + middles).ravel(), outer_middles, side="right")
    from_inner = np.column_stack([edges, outer[reached % len(outer)]])
    from_outer = np.column_stack([loop_edges(outer)[:, ::-1], inner[outer_reached % len(inner)]])
    return np.concatenate([from_inner, from_outer])
