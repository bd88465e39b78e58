"""The contact part of the error in the constitutive relation.

Symbols: r^ and w admissible traction and displacement on the contact, n normal, g gap,
b friction bound, s tangential displacement at the end of the last step of a history,
which is zero without history. On a compliant foundation the term is the error in its
law (:mod:`erc_contact.error.foundations`).

Source: Coorevits, Hild, Hjiaj, equation (16); the gap g, the general bound and s are
ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.traction import ContactTraction
from erc_contact.error.contact_term import (
    AtPoints,
    bound_cancellation,
    contact_density,
    foundation_sum,
)
from erc_contact.error.laws import LawError
from erc_contact.error.oscillation import DATA_ROUND_OFF, OSCILLATION_SHARE, UNKNOWN_SHARE
from erc_contact.error.slip_rules import rule_between_zeros, same_rule, slip_may_vanish
from erc_contact.model.contact.contact_values import ContactData, friction_parameters
from erc_contact.model.contact.foundation import ContactOnMesh, pressures
from erc_contact.model.contact.friction import CONCAVE
from erc_contact.model.contact.jumps import kinks_on_facets
from erc_contact.model.contact.trace import lengths, split
from erc_contact.model.data.over_ranks import sums_of_cells
from erc_contact.model.data.quadrature import Integral, facet_pieces, integrate, polynomials
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.space import Space

CONTACT_DEGREE = 21
"""Quadrature degree where the integrand is smooth, but no polynomial.

That is so in 3D where the slip is far from zero, and where normals turn.
"""


class ContactSquares(NamedTuple):
    """Hold what a contact adds to e^2 and to the oscillations [force length].

    Attributes:
        parts: Twice the contact term on each facet, 0 for ghosts, shape (f,).
        of_sum: Square of the sum of both tractions of a compliant foundation, likewise;
            0 on a rigid foundation.
        gaps: Square of the oscillation of the gap on this rank.
        friction: Square of the oscillation of the friction bound.
    """

    parts: np.ndarray
    of_sum: np.ndarray
    gaps: float = 0.0
    friction: float = 0.0


class Squares[T](NamedTuple):
    """Hold a number for each density that a contact integrates adaptively.

    Attributes:
        term: Twice the contact term.
        of_sum: Square of the sum of both tractions of a compliant foundation.
        of_gap: Square of the oscillation of the gap and of the normal.
        of_friction: Square of the oscillation of the friction bound.
    """

    term: T
    of_sum: T
    of_gap: T
    of_friction: T


def contact_squares(
    space: Space, u_hat: fem.Function, traction: ContactTraction, floor: float
) -> ContactSquares:
    """Compute the contact part of each facet, and oscillations; collective.

    The integrals are exact where the integrand is a polynomial or, in the plane, one on
    each side of the points where the slip is zero. Else they are adapted: where the
    data of the contact vary, the friction bound is nonlinear in the pressure, the
    foundation is compliant, or, in 3D and where normals turn, the slip may vanish.
    Adapted integrals may leave ``floor`` or the share UNKNOWN_SHARE of their values
    unknown, and contain what they leave unknown.

    Args:
        space: The mesh.
        u_hat: The admissible displacement u^ [length].
        traction: r^ on the contact.
        floor: What the integrals may leave unknown [force length].
    """
    contact = traction.contact
    friction = contact.friction
    trace = contact.trace
    area = trace.here.owned_areas
    of_w = trace.coefficients(trace.of(u_hat.x.array))
    of_s = trace.coefficients(trace.of_before)
    cancelling = bound_cancellation(trace, u_hat.x.array)
    concave = friction is not None and friction.dependence == CONCAVE
    if contact.varies or concave or contact.is_compliant:
        return _adapted_squares(space, traction, of_w, of_s, area, floor, cancelling)
    turns = trace.corner_normals is not None
    if friction is None and not turns:
        points, weights = same_rule(space.d, 2 * space.degree)
    elif space.d == 2 and not turns:
        points, weights = rule_between_zeros(contact, of_w - of_s)
    else:
        points, weights = same_rule(space.d, CONTACT_DEGREE)
    parts = area * _means(space, traction, of_w, of_s, points, weights, cancelling)
    no_sum = np.zeros(len(parts))
    if friction is None or (space.d == 2 and not turns):
        return ContactSquares(parts, no_sum)
    # The length of a slip that may vanish has a kink at a point that is no corner of a
    # piece.
    kinked = slip_may_vanish(contact, of_w - of_s)
    adapted = _adapted_squares(
        space, traction, of_w, of_s, np.where(kinked, area, 0.0), floor, cancelling
    )
    parts = np.where(kinked, adapted.parts, parts)
    return ContactSquares(parts, adapted.of_sum, adapted.gaps, adapted.friction)


def contact_law_error(
    space: Space, u_hat: fem.Function, tractions: Sequence[ContactTraction], floor: float
) -> LawError:
    """Measure how far a pair is from the laws of all contacts; collective.

    Args:
        space: The mesh.
        u_hat: The admissible displacement u^ [length].
        tractions: r^ on each contact.
        floor: What the integral over each contact may leave unknown [force length].
    """
    gap, of_sum = np.zeros((2, len(space.nodes)))
    gaps = 0.0
    friction = 0.0
    for traction in tractions:
        squares = contact_squares(space, u_hat, traction, floor)
        trace = traction.contact.trace
        # below 0 by round-off only
        gap += trace.share(np.maximum(squares.parts, 0.0))
        of_sum += trace.share(squares.of_sum)
        gaps += squares.gaps
        friction += squares.friction
    # The other body of a facet may be on another rank.
    of_owners = sums_of_cells(space, gap), sums_of_cells(space, of_sum)
    return LawError(*of_owners, gaps=gaps, friction=friction)


def _means(
    space: Space,
    traction: ContactTraction,
    of_w: np.ndarray,
    of_s: np.ndarray,
    points: np.ndarray,
    weights: np.ndarray,
    cancelling: np.ndarray,
) -> np.ndarray:
    """Compute twice the mean of the contact term on each facet [force/length^(d-2)].

    The data of the contact must not vary inside the facets.

    Args:
        space: The mesh.
        traction: r^ on the contact.
        of_w: Coefficients of u^ [length], shape (f, m, d).
        of_s: Coefficients of w in the last step [length], shape (f, m, d).
        points: Points of each facet in barycentric coordinates, shape (f, q, d) or (1,
            q, d).
        weights: Their weights, of sum 1, shape (f, q) or (1, q).
        cancelling: What cancels between two bodies [length], shape (f, 1).

    Returns:
        The means, shape (f,).
    """
    contact = traction.contact
    middle = np.full((1, space.d - 1), 1 / space.d)
    shape = polynomials(space.degree, points)
    r = np.matmul(shape, traction.values)
    w = np.matmul(shape, of_w)
    s = np.matmul(shape, of_s)
    n = contact.trace.normals_at_places(points)
    gap = 0.0 if contact.gap is None else space.evaluate(contact.gap, middle, contact.facets)
    parameters = friction_parameters(space, contact, middle)
    bound = contact.friction_bound(pressures(r, n), parameters)
    density = contact_density(contact, AtPoints(n, r, w, s, gap, bound), cancelling)
    return (density * weights).sum(axis=1)


def _adapted_squares(
    space: Space,
    traction: ContactTraction,
    of_w: np.ndarray,
    of_s: np.ndarray,
    area: np.ndarray,
    floor: float,
    cancelling: np.ndarray,
) -> ContactSquares:
    """Compute the numbers of :func:`contact_squares` by adapted integrals; collective.

    Args:
        space: The mesh.
        traction: r^ on the contact.
        of_w: Coefficients of u^ [length], shape (f, m, d).
        of_s: Coefficients of w in the last step [length], shape (f, m, d).
        area: Areas of the facets, 0 for those that are left out, shape (f,).
        floor: What the integrals may leave unknown [force length].
        cancelling: What cancels between two bodies [length], shape (f, 1).
    """
    contact = traction.contact
    data = ContactData(contact, space.mesh)
    least_gap = _round_off(space, of_w)
    least_force = _round_off(space, traction.values)

    def squares(facet: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate the densities of :class:`Squares`, in its order."""
        n = contact.trace.normals_at_places(places, facet)
        shape = polynomials(space.degree, places)
        r = np.matmul(shape, traction.values[facet])
        w = np.matmul(shape, of_w[facet])
        s = np.matmul(shape, of_s[facet])
        gap = data.gap(facet, x)
        bound = data.bound(facet, x, pressures(r, n))
        springs = data.stiffness(facet, x), data.tangential_stiffness(facet, x)
        at = AtPoints(n, r, w, s, gap, bound, *springs, facet)

        normal = data.normal(facet, x, n)
        beyond = _above(_beyond_gap(contact, at, normal), least_gap)
        turned = lengths(r) * lengths(normal - n)
        turned = _above(turned, least_force)
        friction = contact.friction_set.gauge(split(r, n).tangential, n, facet)
        excess = _above(friction - bound, least_force)
        # A violation of the gap is measured like a wrong support, E/h |.|^2; a
        # violation of the normal or of the friction bound like a wrong load, h/E |.|^2.
        compliance = (1 / contact.trace.stiffness)[facet][:, None]
        densities = Squares(
            term=contact_density(contact, at, cancelling[facet]),
            of_sum=foundation_sum(at),
            of_gap=beyond**2 / compliance + turned**2 * compliance,
            of_friction=excess**2 * compliance,
        )
        return np.stack(densities, axis=-1)

    share = Squares(
        term=UNKNOWN_SHARE,
        of_sum=UNKNOWN_SHARE,
        of_gap=OSCILLATION_SHARE,
        of_friction=OSCILLATION_SHARE,
    )
    total = integrate(
        space.comm,
        squares,
        contact.trace.here.corners,
        area,
        facet_pieces(space.d - 1),
        share=np.array(share),
        floor=np.array(Squares(term=floor, of_sum=0.0, of_gap=0.0, of_friction=0.0)),
        cuts=kinks_on_facets(space, contact.data, contact.facets),
        most=space.points_on_facets,
    )
    return _with_unknown(contact, total)


def _beyond_gap(contact: ContactOnMesh, at: AtPoints, normal: np.ndarray) -> np.ndarray:
    """Return how far w is beyond the gap along a normal [length], shape (n, q).

    It is zero on a compliant foundation, which may be entered.
    """
    opening = np.vecdot(at.w, normal) - at.gap
    if at.stiffness is not None:
        return np.zeros(opening.shape)
    return abs(opening) if contact.bilateral else np.maximum(opening, 0.0)


def _above(values: np.ndarray, round_off: float) -> np.ndarray:
    """Return values with zero for what is round-off or negative."""
    return np.where(values <= round_off, 0.0, values)


def _with_unknown(contact: ContactOnMesh, total: Integral) -> ContactSquares:
    """Add what adapted integrals leave unknown to the parts and to the oscillations.

    Args:
        contact: The contact.
        total: Integrals of the densities of :class:`Squares` over each facet.
    """
    value, unknown = Squares(*total.value.T), Squares(*total.bound.T)
    gaps = float(value.of_gap.sum())
    friction = float(value.of_friction.sum())
    if not Squares(*total.resolved).term:
        # A varying gap is the likely reason, otherwise the friction bound.
        of_normal = [value for value in (contact.gap, contact.stiffness) if value is not None]
        if any(varies_in_cells(value) for value in of_normal):
            gaps += float(unknown.term.sum())
        else:
            friction += float(unknown.term.sum())
    return ContactSquares(value.term + unknown.term, value.of_sum, gaps, friction)


def _round_off(space: Space, values: np.ndarray) -> float:
    """Return the round-off of data of the size of values; collective."""
    local = float(abs(values).max(initial=0.0))
    return DATA_ROUND_OFF * space.comm.allreduce(local, MPI.MAX)
