"""Quadrature on the facets of a contact, where the length of the slip may have a kink.

The length is a polynomial in the plane between the zeros of the slip, and smooth in
3D where the slip is far from zero.

Symbols: w admissible displacement on the contact, s tangential displacement at the end
of the last step of a history, f facets, m coefficients of a facet, q points, d
dimension.
"""

from __future__ import annotations

import numpy as np

from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import split
from namedmesh.simplex import barycentric, rule

SLIP_DEVIATION = 0.5
"""Greatest distance of the slip from its mean where its length counts as smooth [-].

It is the distance on a facet, over that mean. The length ``sqrt(slip . slip)`` of a
linear slip is then analytic on a facet 1.4 times as large, and the rule of degree
CONTACT_DEGREE is exact to 1e-8.
"""


def same_rule(d: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points and weights of a rule that is the same on all facets.

    The points are barycentric, shape (1, q, d); the weights have shape (1, q).
    """
    points, weights = rule(d - 1, degree)
    return barycentric(points)[None], weights[None]


def rule_between_zeros(contact: ContactOnMesh, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Make rules that are exact between the zeros of the slip.

    A facet in the plane is cut where the slip is zero. On each part the length of the
    slip is a polynomial of the degree of the slip, so that its product with a pressure
    of the same degree is integrated exactly.

    Args:
        contact: The contact.
        slip: Coefficients of ``w - s`` [length], shape (f, m, 2).

    Returns:
        Points in barycentric coordinates, shape (f, q, 2), and weights, shape (f, q).
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
    """Find the zeros in (0, 1) of quadratic polynomials, shape (n, 2).

    A zero that does not exist is 0. The arguments are the Bernstein coefficients, shape
    (n,) each.
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


def slip_may_vanish(contact: ContactOnMesh, slip: np.ndarray) -> np.ndarray:
    """Tell on which facets the slip may be zero, shape (f,).

    It may also be so near to zero that its length is not smooth.

    Args:
        contact: The contact.
        slip: Coefficients of ``w - s`` [length], shape (f, m, d).
    """
    n = contact.trace.normals
    # The length that has the kink is taken where the set of friction is a disc.
    _, tangential, size = split(contact.friction_set.from_disc(slip, n), n)
    mean = tangential.mean(axis=1, keepdims=True)
    farthest = np.linalg.norm(tangential - mean, axis=2).max(axis=1)
    slides = size.max(axis=1) > 0
    return slides & (farthest > SLIP_DEVIATION * np.linalg.norm(mean[:, 0], axis=1))
