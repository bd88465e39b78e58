"""Find where data are not smooth along facets: jumps of a gap, kinks of tables.

On a facet where a gap jumps its Bernstein coefficients stay between its values. At the
kinks of tables quadrature cuts the facets, in 2D.

Symbols: f facets, s chosen facets, q samples of a facet, m nodes of a facet, d
dimension.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np
from mpi4py import MPI
from ufl.corealg.traversal import traverse_unique_terminals

from erc_contact.base.ufl_tables import TableFunction
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.data.quadrature import Cuts, facet_pieces, piece_points, polynomials
from erc_contact.model.space import Space
from namedmesh.for_solvers import count_up
from namedmesh.simplex import barycentric, node_vertices, nodes

JUMP = 0.36
"""Distance of a gap that jumps from polynomials of degree 4, over its range [-].

At random places in segments and triangles a jump between two constants had at least
0.39, a cusp like a square root at most 0.35, a kink 0.13, half a wave 0.03.
"""
OUTSIDE = 0.1
"""Distance of a coefficient from values at nodes that may be due to a jump [-].

It is measured in differences of the gap at the nodes. A jump has at least 0.5.
"""
ROUND_OFF = 1e-12
"""Differences of gaps that are none, over their size [-]."""
COORDINATE_SAMPLES = 65
"""Number of points of a facet between which a coordinate of a table counts as linear.

It may be a radius. A kink whose place is not met is found by bisection, as others are.
"""


def jumps(
    space: Space, contact: ContactOnMesh, at_nodes: np.ndarray, chosen: np.ndarray
) -> np.ndarray:
    """Tell on which facets the gap jumps, also at their nodes; collective.

    Args:
        space: The mesh.
        contact: A contact with a gap.
        at_nodes: The gap at the nodes of all its facets [length], shape (f, m).
        chosen: Numbers of facets, shape (s,).

    Returns:
        Booleans, shape (s,).
    """
    places, residual = _samples(space.d - 1, space.degree)
    count = len(space.facet_points)
    x = np.matmul(places[count:], contact.trace.here.corners[chosen])
    inside = space.everywhere(contact.gap)(x, contact.facets[chosen])
    # At a node the gap may have the value of the other side of a jump.
    values = np.concatenate([at_nodes[chosen], inside], axis=1)
    distance = abs(values @ residual).max(axis=1, initial=0.0)
    height = np.ptp(values, axis=1)
    is_more = height > ROUND_OFF * abs(values).max(axis=1, initial=0.0)
    return is_more & (distance > JUMP * height)


def gap_by_coefficients(space: Space, contact: ContactOnMesh, gaps: np.ndarray) -> Ufl | None:
    """Return a gap whose nodal values are its Bernstein coefficients; collective.

    Beside a jump the polynomial through the gap at the nodes is far outside of it.
    There the coefficients stay between the values at the nodes of their edge.

    Args:
        space: The mesh.
        contact: The contact.
        gaps: Its gap at the nodes [length], shape (f, m).

    Returns:
        The gap [length], UFL; where normals turn along facets, g by its coefficients
        times ``|M|`` at the nodes; itself if it is a number, None without one.
    """
    if not contact.gap_varies:
        return contact.gap
    function = space.function()
    nodal = function.x.array.reshape(-1, space.d)
    of_facets = contact.trace.here.nodes
    is_plain = space.degree == 1 or contact.bilateral
    lengths = np.ones((1, 1)) if is_plain else contact.gap_lengths
    gaps = gaps / lengths
    nodal[:, 0] = contact.trace.here.values_of_nodes(gaps)
    space.to_coefficients(nodal, [contact])
    if is_plain:
        return function[0]
    ends = gaps[:, node_vertices(space.d - 1, space.degree)]
    low = np.minimum(ends.min(axis=2), gaps)
    high = np.maximum(ends.max(axis=2), gaps)
    coefficients = nodal[of_facets, 0]
    clipped = np.clip(coefficients, low, high)
    least = np.maximum(OUTSIDE * np.ptp(gaps, axis=1), ROUND_OFF * abs(gaps).max(axis=1))
    outside = (abs(coefficients - clipped) > least[:, None]).any(axis=1)
    if space.comm.allreduce(bool(outside.any()), MPI.LOR):
        chosen = np.flatnonzero(outside)
        chosen = chosen[jumps(space, contact, gaps, chosen)]
        # The coefficients of vertices are values.
        between = (chosen[:, None], np.arange(space.d, gaps.shape[1]))
        nodal[of_facets[between], 0] = clipped[between]
    nodal[of_facets, 0] = lengths * nodal[of_facets, 0]
    return function[0]


@cache
def _samples(size: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes and the first samples of a facet, and a residual there.

    Returns:
        Barycentric coordinates, shape (q, v), and the matrix (q, q) from values at the
        points to their differences from the nearest polynomial of degree 4.
    """
    samples = piece_points(size).points
    inside = np.matmul(samples, facet_pieces(size)).reshape(-1, size + 1)
    places = np.concatenate([barycentric(nodes(size, degree)), inside])
    quadratic = polynomials(2, places[None])[0]
    # Products of two polynomials of degree 2 span the polynomials of degree 4.
    products = (quadratic[:, :, None] * quadratic[:, None]).reshape(len(places), -1)
    return places, np.eye(len(places)) - products @ np.linalg.pinv(products)


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
        coordinates = space.everywhere(function.coordinates)(x, facets)
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
    rank = count_up(count)
    point = points[first[step] + rank]
    start = values[:, :-1].ravel()[step]
    end = values[:, 1:].ravel()[step]
    place = (step % steps + (point - start) / (end - start)) / steps
    return step // steps, np.clip(place, 0.0, 1.0)
