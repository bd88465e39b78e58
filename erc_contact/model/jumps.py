"""Tell on which facets a gap jumps, and give its coefficients there.

Symbols: f facets, s chosen ones, q samples of a facet, m nodes of a facet, d dimension.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from mpi4py import MPI

from erc_contact.base.ufl_types import Ufl
from erc_contact.mesh.quadrature import facet_pieces, piece_points, polynomials
from erc_contact.mesh.simplex import barycentric, node_vertices, nodes
from erc_contact.model.expressions import Everywhere
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.of_nodes import values_of_nodes
from erc_contact.model.space import Space

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
    inside = Everywhere(contact.gap, space.mesh)(x, contact.facets[chosen])
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
    if space.degree == 1 or contact.bilateral:
        nodal[:, 0] = values_of_nodes(contact.trace.here, gaps)
        space.to_coefficients(nodal, [contact])
        return function[0]
    lengths = contact.gap_lengths
    gaps = gaps / lengths
    nodal[:, 0] = values_of_nodes(contact.trace.here, gaps)
    space.to_coefficients(nodal, [contact])
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
    samples, _, _ = piece_points(size)
    inside = np.matmul(samples, facet_pieces(size)).reshape(-1, size + 1)
    places = np.concatenate([barycentric(nodes(size, degree)), inside])
    quadratic = polynomials(2, places[None])[0]
    # Products of two polynomials of degree 2 span the polynomials of degree 4.
    products = (quadratic[:, :, None] * quadratic[:, None]).reshape(len(places), -1)
    return places, np.eye(len(places)) - products @ np.linalg.pinv(products)
