"""Find the kinks of tables on facets in 2D, where quadrature then cuts."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from ufl.corealg.traversal import traverse_unique_terminals

from erc_contact.base.ufl_tables import TableFunction
from erc_contact.base.ufl_types import Ufl
from erc_contact.mesh.quadrature import Cuts
from erc_contact.mesh.simplex import barycentric
from erc_contact.model.expressions import Everywhere
from erc_contact.model.space import Space

COORDINATE_SAMPLES = 65
"""Number of points of a facet between which a coordinate of a table counts as linear.

It may be a radius. A kink whose place is not met is found by bisection, as others are.
"""


def kinks_on_facets(
    space: Space, expressions: Iterable[Ufl | None], facets: np.ndarray
) -> Cuts | None:
    """Find the kinks of all tables in UFL expressions on facets; collective.

    Args:
        space: The mesh.
        expressions: The expressions; None among them is nothing.
        facets: Pairs (cell, local facet), shape (f, 2).

    Returns:
        The places of kinks; None in 3D, or without tables.
    """
    functions = _tables(expressions)
    if space.d != 2 or not functions:
        return None
    samples = np.linspace(0.0, 1.0, COORDINATE_SAMPLES)
    x = np.matmul(barycentric(samples[:, None]), space.facet_corners(facets))
    simplex = [np.empty(0, dtype=int)]
    place = [np.empty(0)]
    for function in functions:
        coordinates = Everywhere(function.coordinates, space.mesh)(x, facets)
        for number, points in enumerate(function.data.source.kinks):
            facet, at = _crossings(coordinates[:, :, number], points)
            simplex.append(facet)
            place.append(at)
    return Cuts(np.concatenate(simplex), np.concatenate(place))


def _tables(expressions: Iterable[Ufl | None]) -> list[TableFunction]:
    """Return the tables in expressions, also inside coordinates of other tables."""
    functions: list[TableFunction] = []
    for expression in expressions:
        if expression is None:
            continue
        for terminal in traverse_unique_terminals(expression):
            if isinstance(terminal, TableFunction):
                functions += [terminal, *_tables([terminal.coordinates])]
    return functions


def _crossings(values: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find where values along facets cross given points.

    Args:
        values: Values at samples of each facet, shape (f, q), linear between them.
        points: The points in increasing order, shape (n,).

    Returns:
        Facet and place along it [-] of each crossing.
    """
    steps = values.shape[1] - 1
    low = np.minimum(values[:, :-1], values[:, 1:]).ravel()
    high = np.maximum(values[:, :-1], values[:, 1:]).ravel()
    first = np.searchsorted(points, low, "left")
    count = np.searchsorted(points, high, "right") - first
    # A step along which the value does not change crosses nothing.
    count = np.where(high > low, count, 0)
    step = np.repeat(np.arange(len(low)), count)
    rank = np.arange(len(step)) - np.repeat(np.cumsum(count) - count, count)
    point = points[first[step] + rank]
    start = values[:, :-1].ravel()[step]
    end = values[:, 1:].ravel()[step]
    place = (step % steps + (point - start) / (end - start)) / steps
    return step // steps, np.clip(place, 0.0, 1.0)
