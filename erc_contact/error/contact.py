"""The contact part of the error in the constitutive relation.

Symbols: r^ and w admissible traction and displacement on the contact, n normal, g gap, b friction bound, s tangential
displacement at the end of the last step of a history, which is zero without history.

Source: Coorevits, Hild, Hjiaj, equation (16); the gap g, the general bound and s are ours.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.traction import ContactTraction
from erc_contact.error.oscillation import COARSE, EXACT, UNKNOWN, facet_sizes
from erc_contact.mesh.quadrature import facet_pieces, integrate, polynomials
from erc_contact.mesh.simplex import bernstein, coefficients, lagrange, rule
from erc_contact.model.expressions import evaluate, varies_in_cells
from erc_contact.model.foundation import CONSTANT, BoundContact, ContactData, pressures, split
from erc_contact.model.model import Model

CONTACT_DEGREE = 21
"""Quadrature degree for the contact part; its integrand has kinks where the slip changes its direction."""


def contact_density(
    contact: BoundContact, n: np.ndarray, r: np.ndarray, w: np.ndarray, s: Any, gap: Any, bound: np.ndarray
) -> np.ndarray:
    """Twice the contact term, ``2 (b(p^) |w_t - s| + r^_t.(w_t - s) + r^_n (w_n - g))``, at points, shape (n, q).

    Args:
        contact: The contact.
        n: Normal of the foundation, shape (n, 1, d).
        r: r^ at the points [force/area], shape (n, q, d).
        w: u^ there [length], shape (n, q, d).
        s: The tangential displacement of the last step there [length], shape (n, q, d), or 0 without history.
        gap: The gap there [length], shape (n, q), or a number.
        bound: The friction bound there [force/area], shape (n, q).
    """
    (r_n, r_t, _), (w_n, w_t, slip) = split(r, n), split(w - s, n)
    density = np.zeros(r_n.shape) if contact.bilateral else r_n * (w_n - gap)
    if contact.friction is not None:
        density += bound * slip + (r_t * w_t).sum(axis=-1)
    # a difference of two works that are equal up to round-off is no error; otherwise e would stop at 1e-8 of the norm
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

    The integrals are adapted if the data of the contact vary, or if friction is given and the slip may change its
    direction. They may leave ``floor`` or the share UNKNOWN of their values unknown, and contain what they leave
    unknown.

    Args:
        model: The scene on a mesh.
        hat: The admissible displacement u^ [length].
        traction: r^ on the contact.
        floor: What the integrals may leave unknown [force length].
    """
    contact = traction.contact
    d, facets = model.d, contact.facets
    area = np.where(model.owned(facets), traction.area, 0.0)
    nodal = hat.x.array.reshape(-1, d)[traction.nodes]
    if not (contact.varies or (contact.friction is not None and contact.friction.dependence == CONSTANT)):
        points, weights = rule(d - 1, CONTACT_DEGREE)
        r = np.matmul(bernstein(d - 1, model.degree, points), traction.values)
        shape = lagrange(d - 1, model.degree, points)
        w, s = np.matmul(shape, nodal), np.matmul(shape, model.slip_before(contact))
        n = contact.direction[:, None, :]
        gap = 0.0 if contact.gap is None else evaluate(contact.gap, model.mesh, points, facets)
        bound = contact.friction_bound(pressures(r, n), model.friction_parameters(contact, points))
        return area * (contact_density(contact, n, r, w, s, gap, bound) @ weights), 0.0, 0.0
    return _adapted_squares(model, traction, np.matmul(coefficients(d - 1, model.degree), nodal), area, floor)


def _adapted_squares(
    model: Model, traction: ContactTraction, of_w: np.ndarray, area: np.ndarray, floor: float
) -> tuple[np.ndarray, float, float]:
    """The numbers of :func:`contact_squares` by adapted integrals; collective.

    Args:
        model: The scene on a mesh.
        traction: r^ on the contact.
        of_w: Coefficients of u^ [length], shape (f, m, d).
        area: Areas of the facets, 0 for those of other ranks, shape (f,).
        floor: What the integrals may leave unknown [force length].
    """
    contact = traction.contact
    facets, given = contact.facets, ContactData(contact, model.mesh)
    of_s = np.matmul(coefficients(model.d - 1, model.degree), model.slip_before(contact))
    size, stiffness = facet_sizes(model, facets), model.at_middles(model.modulus, facets[:, 0])
    least = [
        EXACT * model.comm.allreduce(float(abs(v).max(initial=0.0)), MPI.MAX) for v in (of_w, *[traction.values] * 2)
    ]

    def terms(of: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape, n = polynomials(model.degree, at), contact.direction[of][:, None, :]
        r, w = np.matmul(shape, traction.values[of]), np.matmul(shape, of_w[of])
        r_n, _, friction = split(r, n)
        gap, normal, bound = given.gap(of, x), given.normal(of, x), given.bound(of, x, np.maximum(-r_n, 0.0))
        beyond = (w * normal).sum(axis=-1) - gap
        beyond = abs(beyond) if contact.bilateral else np.maximum(beyond, 0.0)
        turned = np.linalg.norm(r, axis=-1) * np.linalg.norm(normal - n, axis=-1)
        excess = friction - bound
        beyond, turned, excess = (
            np.where(v <= most, 0.0, v) for v, most in zip((beyond, turned, excess), least, strict=True)
        )
        soft = (size / stiffness)[of][:, None]
        density = contact_density(contact, n, r, w, np.matmul(shape, of_s[of]), gap, bound)
        return np.stack([density, beyond**2 / soft + turned**2 * soft, excess**2 * soft], axis=-1)

    corners, share = model.facet_corners(facets), np.array([UNKNOWN, COARSE, COARSE])
    floors = np.array([floor, 0.0, 0.0])
    total = integrate(model.comm, terms, corners, area, facet_pieces(model.d - 1), share=share, floor=floors)
    parts, gaps, friction = total.value.T
    unknown = np.zeros(2)
    if not total.resolved[0]:
        unknown[0 if contact.gap is not None and varies_in_cells(contact.gap) else 1] = total.rest[:, 0].sum()
    return parts + total.rest[:, 0], float(gaps.sum() + unknown[0]), float(friction.sum() + unknown[1])
