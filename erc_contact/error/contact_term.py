"""Evaluate the contact term of e^2 at points of the contact.

Symbols: r^ admissible contact traction, w u^ on the contact (between two bodies the
jump), s displacement at the end of the last step of a history, g gap, p pressure, b
friction bound, k stiffness of a compliant foundation, k_n along its normal and k_t
tangentially.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from erc_contact.admissible.cones import clip
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import ALL, Facets, Trace, split


def contact_density(
    contact: ContactOnMesh,
    n: np.ndarray,
    r: np.ndarray,
    w: np.ndarray,
    s: np.ndarray | float,
    gap: np.ndarray | float,
    bound: np.ndarray,
    stiffness: np.ndarray | None = None,
    tangential: np.ndarray | None = None,
    cancelling: np.ndarray | float = 0.0,
    facet: Facets = ALL,
) -> np.ndarray:
    """Evaluate twice the contact term at points [force/length^(d-2)].

    It is ``2 (b(p^) |w_t - s| + r^_t.(w_t - s) + r^_n (w_n - g))``, and on a compliant
    foundation twice the left side of (F) in :mod:`erc_contact.error.foundations`. Where
    friction is orthotropic ``support(w_t - s)`` takes the place of the length
    (:mod:`erc_contact.model.contact.friction_set`).

    Args:
        contact: The contact.
        n: Normals of the foundation, shape (n, q or 1, d).
        r: r^ at the points [force/area], shape (n, q, d).
        w: u^ there [length], shape (n, q, d).
        s: The displacement of the last step there, of which the tangential part counts
            [length], shape (n, q, d), or 0 without history.
        gap: The gap there [length], shape (n, q), or a number.
        bound: The friction bound there [force/area], shape (n, q).
        stiffness: k_n of a compliant foundation there [force/length^3], shape (n, q);
            None where it is rigid.
        tangential: k_t there, likewise.
        cancelling: Bound of :func:`bound_cancellation` [length], shape (n, 1), or 0.
        facet: Numbers of the n facets in the contact, all of them by default.

    Returns:
        The term, shape (n, q).
    """
    r_n, r_t, _ = split(r, n)
    w_n = (w * n).sum(axis=-1)
    _, w_t, _ = split(w - s, n)
    if contact.bilateral:
        # A gap that is closed everywhere, with a traction of any sign, does no work.
        density = np.zeros(r_n.shape)
    elif stiffness is None:
        density = r_n * (w_n - gap)
    else:
        density = law_error(*spring_of(w_n - gap, np.maximum(-r_n, 0.0), stiffness))
    if tangential is not None:
        density += law_error(*slider_of(w_t, r_t, bound, tangential))
    elif contact.friction is not None:
        slip = contact.friction_set.support(w_t, n, facet)
        density += bound * slip + (r_t * w_t).sum(axis=-1)
    # A difference of two works that are equal up to round-off is no error. Otherwise e
    # would stop at 1e-8 of the norm.
    size = np.linalg.norm(w, axis=-1) + np.linalg.norm(np.broadcast_to(s, w.shape), axis=-1)
    size = size + abs(gap) + cancelling
    resolution = 16 * np.finfo(float).eps * np.linalg.norm(r, axis=-1) * size
    return 2 * np.where(abs(density) <= resolution, 0.0, density)


class SpringLaw(NamedTuple):
    """Hold a spring that carries what a convex set K allows, at points.

    Attributes:
        pull: ``k d``, what the spring would carry alone at the displacement d
            [force/area], shape (n, q, c).
        allowed: P, the traction of K that is nearest to it, likewise: the law.
        traction: t of K, likewise.
        stiffness: k [force/length^3], shape (n, q).
    """

    pull: np.ndarray
    allowed: np.ndarray
    traction: np.ndarray
    stiffness: np.ndarray


def spring_of(entry: np.ndarray, pressure: np.ndarray, stiffness: np.ndarray) -> SpringLaw:
    """Return the spring of a foundation along its normal, which does not pull.

    Args:
        entry: ``w_n - g``, how far the body enters the foundation [length], (n, q).
        pressure: p >= 0 [force/area], (n, q).
        stiffness: k_n [force/length^3], (n, q).
    """
    pull = (stiffness * entry)[..., None]
    return SpringLaw(pull, np.maximum(pull, 0.0), pressure[..., None], stiffness)


def slider_of(
    slide: np.ndarray, r_t: np.ndarray, bound: np.ndarray, stiffness: np.ndarray
) -> SpringLaw:
    """Return the tangential spring of a foundation, which friction limits.

    Args:
        slide: ``w_t - s`` [length], shape (n, q, d).
        r_t: Tangential traction on the body, at most the bound [force/area], likewise.
        bound: Friction bound b [force/area], shape (n, q).
        stiffness: k_t [force/length^3], shape (n, q).
    """
    pull = stiffness[..., None] * slide
    allowed = clip(pull, np.linalg.norm(pull, axis=-1), bound)
    return SpringLaw(pull, allowed, -r_t, stiffness)


def law_error(
    pull: np.ndarray, allowed: np.ndarray, traction: np.ndarray, stiffness: np.ndarray
) -> np.ndarray:
    """Evaluate the error in the law of a spring with a limit [force/length^(d-2)].

    It is ``(|t - P|^2/2 + (P - t).(k d - P))/k``, the left side of (F) in
    :mod:`erc_contact.error.foundations` without cancellation. Both terms are >= 0: P is
    the nearest point of a convex set that t is in. The arguments are in
    :class:`SpringLaw`.
    """
    square = 0.5 * ((traction - allowed) ** 2).sum(axis=-1)
    beyond = ((allowed - traction) * (pull - allowed)).sum(axis=-1)
    return (square + beyond) / stiffness


def law_sum(
    pull: np.ndarray, allowed: np.ndarray, traction: np.ndarray, stiffness: np.ndarray
) -> np.ndarray:
    """Evaluate the square of the sum of both tractions [force/length^(d-2)].

    It is ``|t + P|^2/k``, as ``|sigma^ + C eps(u^)|^2`` of a body. The arguments are in
    :class:`SpringLaw`.
    """
    return ((traction + allowed) ** 2).sum(axis=-1) / stiffness


def bound_cancellation(trace: Trace, u: np.ndarray) -> np.ndarray:
    """Bound the displacements that cancel in w, whose round-off w has [length], (f, 1).

    They are zero on a rigid foundation.

    Args:
        trace: The trace of a contact.
        u: Displacement at all nodes of this rank [length], shape (nodes d,).
    """
    nodal = u.reshape(-1, trace.here.d)[trace.partners]
    # Both sides together are no larger than w and twice the other side.
    cancelling = np.zeros((len(trace.here.nodes), 1))
    cancelling[trace.facing, 0] = 2 * np.linalg.norm(nodal, axis=2).max(axis=1, initial=0.0)
    return cancelling
