"""The contact part of the error in the constitutive relation.

Symbols: r^ and w admissible traction and displacement on the contact, n normal, g gap,
b friction bound, s tangential displacement at the end of the last step of a history,
which is zero without history.

Source: Coorevits, Hild, Hjiaj, equation (16); the gap g, the general bound and s are
ours.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.traction import ContactTraction
from erc_contact.error.oscillation import COARSE, EXACT, UNKNOWN
from erc_contact.mesh.quadrature import facet_pieces, integrate, polynomials
from erc_contact.mesh.simplex import barycentric, rule
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import BoundContact, ContactData, pressures
from erc_contact.model.friction import CONCAVE
from erc_contact.model.model import Model
from erc_contact.model.symbolic import varies_in_cells
from erc_contact.model.trace import split

CONTACT_DEGREE = 21
"""Quadrature degree in space where the slip is far from zero, and its length smooth but no polynomial."""
AWAY = 0.5
"""Greatest distance of the slip from its mean on a facet, over that mean, where its length counts as smooth [-].

The length ``sqrt(slip . slip)`` of a linear slip is then analytic on a facet 1.4 times
as large, and the rule of degree CONTACT_DEGREE is exact to 1e-8.
"""


def contact_density(
    contact: BoundContact,
    n: np.ndarray,
    r: np.ndarray,
    w: np.ndarray,
    s: Any,
    gap: Any,
    bound: np.ndarray,
) -> np.ndarray:
    """Twice the contact term, ``2 (b(p^) |w_t - s| + r^_t.(w_t - s) + r^_n (w_n - g))``, at points, shape (n, q).

    Args:
        contact: The contact.
        n: Normal of the foundation, shape (n, 1, d).
        r: r^ at the points [force/area], shape (n, q, d).
        w: u^ there [length], shape (n, q, d).
        s: The tangential displacement of the last step there [length], shape (n, q, d),
            or 0 without history.
        gap: The gap there [length], shape (n, q), or a number.
        bound: The friction bound there [force/area], shape (n, q).
    """
    (r_n, r_t, _), (w_n, w_t, slip) = split(r, n), split(w - s, n)
    density = np.zeros(r_n.shape) if contact.bilateral else r_n * (w_n - gap)
    if contact.friction is not None:
        density += bound * slip + (r_t * w_t).sum(axis=-1)
    # a difference of two works that are equal up to round-off is no error; otherwise e
    # would stop at 1e-8 of the norm
    size = np.linalg.norm(w, axis=-1) + np.linalg.norm(np.broadcast_to(s, w.shape), axis=-1)
    resolution = 16 * np.finfo(float).eps * np.linalg.norm(r, axis=-1) * (size + abs(gap))
    return 2 * np.where(abs(density) <= resolution, 0.0, density)


def contact_parts(model: Model, hat: fem.Function, traction: ContactTraction) -> np.ndarray:
    """Twice the integral of the contact term over each facet [force length]; collective. Facets of ghosts get 0."""
    return contact_squares(model, hat, traction, 0.0)[0]


def contact_squares(
    model: Model, hat: fem.Function, traction: ContactTraction, floor: float
) -> tuple[np.ndarray, float, float]:
    """:func:`contact_parts`, and the squares of the oscillations of gap and friction bound on this rank.

    The integrals are exact where the integrand is a polynomial or, in the plane, one on
    each side of the points where the slip is zero. Else they are adapted: where the
    data of the contact vary, the friction bound is nonlinear in the pressure, or, in
    space, the slip may vanish. Adapted integrals may leave ``floor`` or the share
    UNKNOWN of their values unknown, and contain what they leave unknown.

    Args:
        model: The scene on a mesh.
        hat: The admissible displacement u^ [length].
        traction: r^ on the contact.
        floor: What the integrals may leave unknown [force length].
    """
    contact = traction.contact
    friction = contact.friction
    trace = contact.trace
    area = trace.here.owned_areas
    of_w = trace.coefficients(trace.of(hat.x.array))
    of_s = trace.coefficients(trace.slip_before)
    if contact.varies or (friction is not None and friction.dependence == CONCAVE):
        return _adapted_squares(model, traction, of_w, of_s, area, floor)
    if friction is None:
        points, weights = _same_rule(model.d, 2 * model.degree)
    elif model.d == 2:
        points, weights = _rule_between_zeros(contact, of_w - of_s)
    else:
        points, weights = _same_rule(model.d, CONTACT_DEGREE)
    parts = area * _means(model, traction, of_w, of_s, points, weights)
    if friction is None or model.d == 2:
        return parts, 0.0, 0.0
    # In space the length of a slip that may vanish has a kink at a point that is no
    # corner of a piece.
    kinked = _slip_may_vanish(contact, of_w - of_s)
    adapted, gaps, bounds = _adapted_squares(
        model, traction, of_w, of_s, np.where(kinked, area, 0.0), floor
    )
    return np.where(kinked, adapted, parts), gaps, bounds


def _means(
    model: Model,
    traction: ContactTraction,
    of_w: np.ndarray,
    of_s: np.ndarray,
    points: np.ndarray,
    weights: np.ndarray,
) -> np.ndarray:
    """Twice the mean of the contact term on each facet [force/length^(d-2)], shape (f,), by rules of the facets.

    The data of the contact must not vary inside the facets.

    Args:
        model: The scene on a mesh.
        traction: r^ on the contact.
        of_w: Coefficients of u^ [length], shape (f, m, d).
        of_s: Coefficients of s [length], shape (f, m, d).
        points: Points of each facet in barycentric coordinates, shape (f, q, d) or (1,
            q, d).
        weights: Their weights, of sum 1, shape (f, q) or (1, q).
    """
    contact = traction.contact
    middle = np.full((1, model.d - 1), 1 / model.d)
    shape = polynomials(model.degree, points)
    r = np.matmul(shape, traction.values)
    w = np.matmul(shape, of_w)
    s = np.matmul(shape, of_s)
    n = contact.direction[:, None, :]
    gap = 0.0 if contact.gap is None else evaluate(contact.gap, model.mesh, middle, contact.facets)
    parameters = model.friction_parameters(contact, middle)
    bound = contact.friction_bound(pressures(r, n), parameters)
    density = contact_density(contact, n, r, w, s, gap, bound)
    return (density * weights).sum(axis=1)


def _same_rule(d: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (1, q, d), barycentric, and weights (1, q) of a rule that is the same on all facets."""
    points, weights = rule(d - 1, degree)
    return barycentric(points)[None], weights[None]


def _rule_between_zeros(contact: BoundContact, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (f, q, 2), barycentric, and weights (f, q) of rules that are exact between the zeros of the slip.

    A facet in the plane is cut where the slip is zero. On each part the length of the
    slip is a polynomial of the degree of the slip, so that its product with a pressure
    of the same degree is integrated exactly.

    Args:
        contact: The contact.
        slip: Coefficients of ``w - s`` [length], shape (f, m, 2).
    """
    normal = contact.direction
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    along = np.einsum("fmi,fi->fm", slip, tangent)
    degree = along.shape[1] - 1
    if degree == 1:  # as a polynomial of degree 2
        along = np.column_stack([along, along.mean(axis=1)])
    zeros = _zeros(*along.T)
    ends = np.column_stack([np.zeros(len(zeros)), np.sort(zeros, axis=1), np.ones(len(zeros))])
    lengths = np.diff(ends, axis=1)
    points, weights = rule(1, 2 * degree)
    places = ends[:, :-1, None] + lengths[..., None] * points[:, 0]
    shape = len(zeros), lengths.shape[1] * len(points)
    places = places.reshape(shape)
    weights = (lengths[..., None] * weights).reshape(shape)
    return np.stack([1 - places, places], axis=-1), weights


def _zeros(start: np.ndarray, end: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """The zeros in (0, 1) of quadratic polynomials with these Bernstein coefficients (n,), shape (n, 2).

    A zero that does not exist is 0.
    """
    # a x^2 + b x + c, by the formula that does not cancel
    a = start - 2 * middle + end
    b = 2 * (middle - start)
    c = start
    root = np.sqrt(np.maximum(b**2 - 4 * a * c, 0.0))
    sum_of_signs = -0.5 * (b + np.where(b < 0, -root, root))
    with np.errstate(divide="ignore", invalid="ignore"):
        zeros = np.column_stack([sum_of_signs / a, c / sum_of_signs])
    inside = (zeros > 0) & (zeros < 1)
    return np.where(inside, zeros, 0.0)


def _slip_may_vanish(contact: BoundContact, slip: np.ndarray) -> np.ndarray:
    """Tell on which facets the slip may be zero, or so near to it that its length is not smooth, shape (f,).

    Args:
        contact: The contact.
        slip: Coefficients of ``w - s`` [length], shape (f, m, d).
    """
    _, tangential, size = split(slip, contact.direction[:, None, :])
    mean = tangential.mean(axis=1, keepdims=True)
    farthest = np.linalg.norm(tangential - mean, axis=2).max(axis=1)
    slides = size.max(axis=1) > 0
    return slides & (farthest > AWAY * np.linalg.norm(mean[:, 0], axis=1))


def _adapted_squares(
    model: Model,
    traction: ContactTraction,
    of_w: np.ndarray,
    of_s: np.ndarray,
    area: np.ndarray,
    floor: float,
) -> tuple[np.ndarray, float, float]:
    """The numbers of :func:`contact_squares` by adapted integrals; collective.

    Args:
        model: The scene on a mesh.
        traction: r^ on the contact.
        of_w: Coefficients of u^ [length], shape (f, m, d).
        of_s: Coefficients of s [length], shape (f, m, d).
        area: Areas of the facets, 0 for those that are left out, shape (f,).
        floor: What the integrals may leave unknown [force length].
    """
    contact = traction.contact
    given = ContactData(contact, model.mesh)
    least = [
        EXACT * model.comm.allreduce(float(abs(v).max(initial=0.0)), MPI.MAX)
        for v in (of_w, *[traction.values] * 2)
    ]

    def terms(of: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape, n = polynomials(model.degree, at), contact.direction[of][:, None, :]
        r, w = np.matmul(shape, traction.values[of]), np.matmul(shape, of_w[of])
        r_n, _, friction = split(r, n)
        gap, normal, bound = (
            given.gap(of, x),
            given.normal(of, x),
            given.bound(of, x, np.maximum(-r_n, 0.0)),
        )
        beyond = (w * normal).sum(axis=-1) - gap
        beyond = abs(beyond) if contact.bilateral else np.maximum(beyond, 0.0)
        turned = np.linalg.norm(r, axis=-1) * np.linalg.norm(normal - n, axis=-1)
        excess = friction - bound
        beyond, turned, excess = (
            np.where(v <= most, 0.0, v)
            for v, most in zip((beyond, turned, excess), least, strict=True)
        )
        soft = (1 / contact.trace.stiffness)[of][:, None]
        density = contact_density(contact, n, r, w, np.matmul(shape, of_s[of]), gap, bound)
        return np.stack([density, beyond**2 / soft + turned**2 * soft, excess**2 * soft], axis=-1)

    corners, share = contact.trace.here.corners, np.array([UNKNOWN, COARSE, COARSE])
    floors = np.array([floor, 0.0, 0.0])
    total = integrate(
        model.comm, terms, corners, area, facet_pieces(model.d - 1), share=share, floor=floors
    )
    parts, gaps, friction = total.value.T
    unknown = np.zeros(2)
    if not total.resolved[0]:
        unknown[0 if contact.gap is not None and varies_in_cells(contact.gap) else 1] = total.rest[
            :, 0
        ].sum()
    return (
        parts + total.rest[:, 0],
        float(gaps.sum() + unknown[0]),
        float(friction.sum() + unknown[1]),
    )
