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
    bound_cancellation,
    contact_density,
    law_sum,
    slider_of,
    spring_of,
)
from erc_contact.error.laws import LawError
from erc_contact.error.oscillation import DATA_ROUND_OFF, OSCILLATION_SHARE, UNKNOWN_SHARE
from erc_contact.error.slip_rules import rule_between_zeros, same_rule, slip_may_vanish
from erc_contact.model.contact.contact_values import ContactData, friction_parameters
from erc_contact.model.contact.foundation import ContactOnMesh, pressures
from erc_contact.model.contact.friction import CONCAVE
from erc_contact.model.contact.jumps import kinks_on_facets
from erc_contact.model.contact.trace import split
from erc_contact.model.data.expressions import evaluate
from erc_contact.model.data.over_ranks import sums_of_cells
from erc_contact.model.data.quadrature import Integral, facet_pieces, integrate, polynomials
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.model import Model

CONTACT_DEGREE = 21
"""Quadrature degree where the integrand is smooth, but no polynomial.

That is so in space where the slip is far from zero, and where normals turn.
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


def contact_parts(model: Model, u_hat: fem.Function, traction: ContactTraction) -> np.ndarray:
    """Integrate twice the contact term over each facet [force length]; collective.

    Facets of ghosts get 0.
    """
    return contact_squares(model, u_hat, traction, 0.0).parts


def contact_squares(
    model: Model, u_hat: fem.Function, traction: ContactTraction, floor: float
) -> ContactSquares:
    """Compute the contact part of each facet, and oscillations; collective.

    The integrals are exact where the integrand is a polynomial or, in the plane, one on
    each side of the points where the slip is zero. Else they are adapted: where the
    data of the contact vary, the friction bound is nonlinear in the pressure, the
    foundation is compliant, or, in space and where normals turn, the slip may vanish.
    Adapted integrals may leave ``floor`` or the share UNKNOWN_SHARE of their values
    unknown, and contain what they leave unknown.

    Args:
        model: The scene on a mesh.
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
        return _adapted_squares(model, traction, of_w, of_s, area, floor, cancelling)
    turns = trace.corner_normals is not None
    if friction is None and not turns:
        points, weights = same_rule(model.d, 2 * model.degree)
    elif model.d == 2 and not turns:
        points, weights = rule_between_zeros(contact, of_w - of_s)
    else:
        points, weights = same_rule(model.d, CONTACT_DEGREE)
    parts = area * _means(model, traction, of_w, of_s, points, weights, cancelling)
    no_sum = np.zeros(len(parts))
    if friction is None or (model.d == 2 and not turns):
        return ContactSquares(parts, no_sum)
    # The length of a slip that may vanish has a kink at a point that is no corner of a
    # piece.
    kinked = slip_may_vanish(contact, of_w - of_s)
    adapted = _adapted_squares(
        model, traction, of_w, of_s, np.where(kinked, area, 0.0), floor, cancelling
    )
    parts = np.where(kinked, adapted.parts, parts)
    return ContactSquares(parts, adapted.of_sum, adapted.gaps, adapted.friction)


def contact_law_error(
    model: Model, u_hat: fem.Function, tractions: Sequence[ContactTraction], floor: float
) -> LawError:
    """Measure how far a pair is from the laws of all contacts; collective.

    Args:
        model: The scene on a mesh.
        u_hat: The admissible displacement u^ [length].
        tractions: r^ on each contact.
        floor: What the integral over each contact may leave unknown [force length].
    """
    gap, of_sum = np.zeros((2, len(model.nodes)))
    gaps = 0.0
    friction = 0.0
    for traction in tractions:
        squares = contact_squares(model, u_hat, traction, floor)
        trace = traction.contact.trace
        # below 0 by round-off only
        gap += trace.share(np.maximum(squares.parts, 0.0))
        of_sum += trace.share(squares.of_sum)
        gaps += squares.gaps
        friction += squares.friction
    # The other body of a facet may be on another rank.
    of_owners = sums_of_cells(model, gap), sums_of_cells(model, of_sum)
    return LawError(*of_owners, gaps=gaps, friction=friction)


def _means(
    model: Model,
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
        model: The scene on a mesh.
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
    middle = np.full((1, model.d - 1), 1 / model.d)
    shape = polynomials(model.degree, points)
    r = np.matmul(shape, traction.values)
    w = np.matmul(shape, of_w)
    s = np.matmul(shape, of_s)
    n = contact.trace.normals_at_places(points)
    gap = 0.0 if contact.gap is None else evaluate(contact.gap, model.mesh, middle, contact.facets)
    parameters = friction_parameters(model, contact, middle)
    bound = contact.friction_bound(pressures(r, n), parameters)
    density = contact_density(contact, n, r, w, s, gap, bound, cancelling=cancelling)
    return (density * weights).sum(axis=1)


def _adapted_squares(
    model: Model,
    traction: ContactTraction,
    of_w: np.ndarray,
    of_s: np.ndarray,
    area: np.ndarray,
    floor: float,
    cancelling: np.ndarray,
) -> ContactSquares:
    """Compute the numbers of :func:`contact_squares` by adapted integrals; collective.

    Args:
        model: The scene on a mesh.
        traction: r^ on the contact.
        of_w: Coefficients of u^ [length], shape (f, m, d).
        of_s: Coefficients of w in the last step [length], shape (f, m, d).
        area: Areas of the facets, 0 for those that are left out, shape (f,).
        floor: What the integrals may leave unknown [force length].
        cancelling: What cancels between two bodies [length], shape (f, 1).
    """
    contact = traction.contact
    data = ContactData(contact, model.mesh)
    least_gap = _round_off(model, of_w)
    least_force = _round_off(model, traction.values)

    def terms(facet: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate the contact term, what data are exceeded by, and the law's sum."""
        n = contact.trace.normals_at_places(places, facet)
        shape = polynomials(model.degree, places)
        r = np.matmul(shape, traction.values[facet])
        w = np.matmul(shape, of_w[facet])
        s = np.matmul(shape, of_s[facet])
        r_n, r_t, _ = split(r, n)
        gap = data.gap(facet, x)
        normal = data.normal(facet, x, n)
        bound = data.bound(facet, x, np.maximum(-r_n, 0.0))
        stiffness = data.stiffness(facet, x)
        tangential = data.tangential_stiffness(facet, x)
        shared = cancelling[facet]
        density = contact_density(
            contact, n, r, w, s, gap, bound, stiffness, tangential, shared, facet
        )

        opening = (w * normal).sum(axis=-1) - gap
        beyond = abs(opening) if contact.bilateral else np.maximum(opening, 0.0)
        of_sum = np.zeros(opening.shape)
        if stiffness is not None:
            beyond = np.zeros(opening.shape)  # the foundation gives way
            entry = (w * n).sum(axis=-1) - gap
            of_sum += law_sum(*spring_of(entry, np.maximum(-r_n, 0.0), stiffness))
        if tangential is not None:
            _, slide, _ = split(w - s, n)
            of_sum += law_sum(*slider_of(slide, r_t, bound, tangential))
        beyond = np.where(beyond <= least_gap, 0.0, beyond)
        turned = np.linalg.norm(r, axis=-1) * np.linalg.norm(normal - n, axis=-1)
        turned = np.where(turned <= least_force, 0.0, turned)
        excess = contact.friction_set.gauge(r_t, n, facet) - bound
        excess = np.where(excess <= least_force, 0.0, excess)
        # A violation of the gap is measured like a wrong support, E/h |.|^2; a
        # violation of the normal or of the friction bound like a wrong load, h/E |.|^2.
        compliance = (1 / contact.trace.stiffness)[facet][:, None]
        gaps = beyond**2 / compliance + turned**2 * compliance
        return np.stack([density, gaps, excess**2 * compliance, of_sum], axis=-1)

    corners = contact.trace.here.corners
    total = integrate(
        model.comm,
        terms,
        corners,
        area,
        facet_pieces(model.d - 1),
        share=np.array([UNKNOWN_SHARE, OSCILLATION_SHARE, OSCILLATION_SHARE, UNKNOWN_SHARE]),
        floor=np.array([floor, 0.0, 0.0, 0.0]),
        cuts=kinks_on_facets(model, contact.data, contact.facets),
    )
    return _with_unknown(contact, total)


def _with_unknown(contact: ContactOnMesh, total: Integral) -> ContactSquares:
    """Add what adapted integrals leave unknown to the parts and to the oscillations.

    Args:
        contact: The contact.
        total: Integrals of the contact term, of the oscillations of the gap and of the
            friction bound, and of the sum of both tractions, on each facet.
    """
    parts, of_gap, of_friction, of_sum = total.value.T
    parts_unknown = total.bound[:, 0]
    gap_unknown = 0.0
    friction_unknown = 0.0
    if not total.resolved[0]:
        # A varying gap is the likely reason, otherwise the friction bound.
        of_normal = [value for value in (contact.gap, contact.stiffness) if value is not None]
        if any(varies_in_cells(value) for value in of_normal):
            gap_unknown = float(parts_unknown.sum())
        else:
            friction_unknown = float(parts_unknown.sum())
    gaps_2 = float(of_gap.sum()) + gap_unknown
    friction_2 = float(of_friction.sum()) + friction_unknown
    return ContactSquares(parts + parts_unknown, of_sum, gaps_2, friction_2)


def _round_off(model: Model, values: np.ndarray) -> float:
    """Return the round-off of data of the size of values; collective."""
    local = float(abs(values).max(initial=0.0))
    return DATA_ROUND_OFF * model.comm.allreduce(local, MPI.MAX)
