"""Polynomials below the gap on the facets of a contact.

The gap's interpolating polynomial is lowered by its greatest excess over the gap on the
facet, also at its kinks, cusps and jumps (:mod:`erc_contact.model.data.peaks`). An
asperity is found if it changes the gap at one of the first samples, 72 on a facet in 2D
and 352 in 3D. The distance of two bodies alone needs no search: it is bounded by
polynomials.

Where the gap jumps on a facet, this excess is about the height of the jump. Such
facets have further polynomials: the line through the gap at the vertices, lowered in
the same way, and the least gap. Which of them is best depends on the displacement.

Symbols: g gap, w_n normal displacement (between two bodies of the jump), f facets, c
polynomials of a facet, m coefficients of a polynomial.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from erc_contact.model.contact.contact_values import gap_at_nodes
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.jumps import jumps, kinks_on_facets
from erc_contact.model.contact.trace import Trace, split
from erc_contact.model.data.peaks import pieces_of_each, upper_bounds
from erc_contact.model.data.quadrature import facet_pieces, polynomials
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.simplex import barycentric, coefficients, node_vertices, nodes, times_linear

POLYNOMIAL = 1e-14
"""Distance of a polynomial from the gap that is round-off, over its values [-].

Or over the coordinates of which the gap is made.
"""
GAP_POINTS = 2
"""Number of points of a gap that take as long as a point of another search."""
POOR = 0.4
"""Distance from the gap beyond which a facet may have a jump [-].

It is measured in differences of the gap at nodes, and costs nothing. A jump has at
least 0.5, a parabola at most 0.25, but for the facet of its apex.
"""


def gap_limits(model: Model, contact: ContactOnMesh, values: np.ndarray) -> np.ndarray:
    """Return coefficients of a polynomial below the gap on each facet; collective.

    It is the one that lowers u least of those that were found. In a bilateral contact
    it equals the gap at the nodes.

    Args:
        model: The scene on a mesh.
        contact: The contact.
        values: Coefficients of u [length], shape (nodes, d).

    Returns:
        The coefficients [length], shape (f, m).
    """
    if contact not in model.gap_limits:
        model.gap_limits[contact] = _minorants(model.space, contact)
    below = model.gap_limits[contact]
    if below.shape[1] == 1:
        return below[:, 0]
    w_n = split(contact.trace.of(values), contact.trace.normals).normal
    change = (np.maximum(w_n[:, None] - below, 0.0) ** 2).sum(axis=2)
    return below[np.arange(len(below)), change.argmin(axis=1)]


def excess_over_gap(space: Space, contact: ContactOnMesh, of_w: np.ndarray) -> np.ndarray:
    """Bound the excess of ``w.n`` over the gap on each facet [length]; collective.

    Where normals turn along a facet, ``w.n`` is no polynomial, and may exceed the gap
    between nodes at which it does not. But ``w.N`` is one, of the normals N that are
    linear on the facet, and so is the gap between two bodies times |N|. The greatest
    Bernstein coefficient of their difference bounds the excess. A gap that the scene
    gives is searched for peaks.

    Args:
        space: The mesh.
        contact: The contact.
        of_w: Coefficients of w [length], shape (f, m, d).

    Returns:
        The bounds, shape (f,), not below zero.
    """
    trace = contact.trace
    if contact.given_gap is None:
        round_off = POLYNOMIAL * abs(of_w).max(axis=(1, 2), initial=0.0)
        beyond = of_w
        if contact.between is not None:
            # The vectors between the bodies are linear, their coefficients are values.
            ends = node_vertices(space.d - 1, space.degree)
            beyond = of_w - contact.between[:, ends].mean(axis=2)
        corners = trace.normals_at_vertices
        weights = times_linear(space.d - 1, space.degree)
        products = np.einsum("mnv,fni,fvi->fm", weights, beyond, corners, optimize=True)
        highest = products.max(axis=1) / _least_length(corners)
        return np.where(highest > 2 * round_off, highest, 0.0)
    gap = space.everywhere(contact.gap)

    def above(facet: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        w = np.matmul(polynomials(space.degree, places), of_w[facet])
        w_n = (w * trace.normals_at_places(places, facet)).sum(axis=-1)
        return w_n - gap(x, contact.facets[facet])

    corners = trace.here.corners
    round_off = _round_off(of_w, corners)
    kinks = kinks_on_facets(space, [contact.gap], contact.facets)
    pieces = facet_pieces(space.d - 1)
    most = _most_pieces(space, contact)
    highest = upper_bounds(above, corners, pieces, round_off, kinks, most)
    return np.where(highest > 2 * round_off, highest, 0.0)


def _most_pieces(space: Space, contact: ContactOnMesh) -> int:
    """Return the limit of a search on each facet of a contact; collective."""
    facets = space.comm.allreduce(int(contact.trace.here.owned.sum()), MPI.SUM)
    points = GAP_POINTS * space.points_on_facets
    return pieces_of_each(points, facets, facet_pieces(space.d - 1))


def _round_off(coefficients: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the round-off of gaps on facets [length], shape (f,).

    A gap such as ``|x| - R`` is no more exact than the coordinates that it is made of.
    A search for the peaks of this noise would hardly end.

    Args:
        coefficients: What is compared with the gaps [length], shape (f, ...).
        corners: Vertices of the facets [length], shape (f, d, d).
    """
    axes = tuple(range(1, coefficients.ndim))
    of_values = abs(coefficients).max(axis=axes, initial=0.0)
    return POLYNOMIAL * np.maximum(of_values, abs(corners).max(axis=(1, 2), initial=0.0))


def _least_length(normals: np.ndarray) -> np.ndarray:
    """Bound the length of N on each facet from below [-], shape (f,).

    ``|sum l_i N_i|^2 >= c + (s - c) sum l_i^2`` with the least product c and the least
    square s of two normals, and ``sum l_i^2 >= 1/d``.

    Args:
        normals: Normals at the vertices, of at most the length 1, shape (f, d, d).
    """
    products = np.einsum("fid,fjd->fij", normals, normals)
    least = np.maximum(products.min(axis=(1, 2), initial=1.0), 0.0)
    squares = np.einsum("fii->fi", products).min(axis=1, initial=1.0)
    lengths: np.ndarray = np.sqrt(least + (squares - least) / normals.shape[1])
    return lengths


def _minorants(space: Space, contact: ContactOnMesh) -> np.ndarray:
    """Return coefficients of polynomials below the gap [length]; collective.

    Their shape is (f, c, m), with c = 1 where no facet may have a jump.
    """
    if contact.between is not None and contact.given_gap is None and not contact.bilateral:
        return _below_distance(contact.trace, contact.between)[:, None]
    at_nodes = gap_at_nodes(space, contact)
    lengths = contact.gap_lengths
    first = lengths * contact.trace.coefficients(at_nodes / lengths)
    if not contact.gap_varies or not varies_in_cells(contact.gap) or contact.bilateral:
        return first[:, None]
    excess, distance = _excess(space, contact, first, np.arange(len(first)))
    below = (first - excess[:, None])[:, None]
    poor = np.flatnonzero((excess > 0) & (distance > POOR * np.ptp(at_nodes, axis=1)))
    if not space.comm.allreduce(len(poor) > 0, MPI.LOR):
        return below
    poor = poor[jumps(space, contact, at_nodes, poor)]
    further = [np.zeros((len(poor), first.shape[1]))]
    if space.degree > 1:
        # Coefficients of a line are its values at the nodes.
        ends = node_vertices(space.d - 1, space.degree)
        further.append(at_nodes[poor][:, ends].mean(axis=2))
    below = np.repeat(below, 1 + len(further), axis=1)
    for number, polynomial in enumerate(further, start=1):
        excess, _ = _excess(space, contact, polynomial, poor)
        below[poor, number] = polynomial - excess[:, None]
    return below


def _below_distance(trace: Trace, between: np.ndarray) -> np.ndarray:
    """Return coefficients of polynomials below the distance of two bodies, (f, m).

    The distance is ``V.N/|N|`` with vectors V and normals N that are linear on a facet,
    |N| is between a least length l and 1. So it is at least ``V.N`` where that is
    positive, and ``V.N/l`` where it is negative; both are of degree 2 and equal to it
    at the vertices. On a facet with both signs ``V.N`` is lowered by what they differ
    at most, where it is least.

    Args:
        trace: The displacement of the contact.
        between: V at the vertices of the facets [length], shape (f, d, d).
    """
    d, degree = trace.here.d, trace.here.degree
    shares = barycentric(nodes(d - 1, 2))
    vectors = np.matmul(shares, between)
    normals = np.matmul(shares, trace.normals_at_vertices)
    products = (vectors * normals).sum(axis=-1) @ coefficients(d - 1, 2).T
    more = 1 / _least_length(trace.normals_at_vertices) - 1
    low = products.min(axis=1, initial=np.inf)
    high = products.max(axis=1, initial=-np.inf)
    factor = np.where(high <= 0, 1 + more, 1.0)
    has_both = (low < 0) & (high > 0)
    lowered = np.where(has_both, -more * low, 0.0)
    below = factor[:, None] * products - lowered[:, None]
    if degree == 2:
        return below
    # The line through the values at the vertices, lowered by its excess on the edges.
    at_vertices = below[:, :d]
    on_edges = at_vertices[:, node_vertices(d - 1, 2)[d:]].mean(axis=2)
    excess = (on_edges - below[:, d:]).max(axis=1, initial=0.0)
    return at_vertices - excess[:, None]


def _excess(
    space: Space, contact: ContactOnMesh, coefficients: np.ndarray, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bound the excess of polynomials over the gap on facets [length]; collective.

    Args:
        space: The mesh.
        contact: The contact.
        coefficients: Bernstein coefficients of the polynomials [length], shape (s, m).
        chosen: Numbers of the facets, shape (s,).

    Returns:
        The bounds, and the greatest distance from the gap at samples, shape (s,) each.
    """
    facets = contact.facets[chosen]
    gap = space.everywhere(contact.gap)
    distance = np.zeros(len(facets))

    def above(facet: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape = polynomials(space.degree, places)
        polynomial = np.matmul(shape, coefficients[facet][..., None])[..., 0]
        excess = polynomial - gap(x, facets[facet])
        np.maximum.at(distance, facet, abs(excess).max(axis=1))
        return excess

    # A polynomial gap is met to round-off, which is no excess.
    corners = contact.trace.here.corners[chosen]
    round_off = _round_off(coefficients, corners)
    kinks = kinks_on_facets(space, [contact.gap], facets)
    pieces = facet_pieces(space.d - 1)
    most = _most_pieces(space, contact)
    highest = upper_bounds(above, corners, pieces, round_off, kinks, most)
    return np.where(distance > round_off, highest, 0.0), distance
