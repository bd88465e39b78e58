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
from erc_contact.model.contact.trace import ALL, Facets, Trace, lengths, split


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


class AtPoints(NamedTuple):
    """Hold the tractions, displacements and data of a contact at points.

    They are at q points of each of n facets.

    Attributes:
        n: Normals of the foundation, shape (n, q or 1, d).
        r: r^ [force/area], shape (n, q, d).
        w: u^ [length], shape (n, q, d).
        s: The displacement of the last step, of which the tangential part counts
            [length], shape (n, q, d).
        gap: The gap [length], shape (n, q or 1), or a number.
        bound: The friction bound [force/area], shape (n, q).
        stiffness: k_n of a compliant foundation [force/length^3], shape (n, q); None
            where it is rigid.
        tangential: k_t, likewise.
        facet: Numbers of the n facets in the contact, all of them by default.
    """

    n: np.ndarray
    r: np.ndarray
    w: np.ndarray
    s: np.ndarray
    gap: np.ndarray | float
    bound: np.ndarray
    stiffness: np.ndarray | None = None
    tangential: np.ndarray | None = None
    facet: Facets = ALL

    @property
    def entry(self) -> np.ndarray:
        """Return ``w_n - g``, how far the body enters a foundation [length], (n, q)."""
        return np.asarray(np.vecdot(self.w, self.n) - self.gap)

    @property
    def spring(self) -> SpringLaw | None:
        """Return the spring of a compliant foundation along its normal."""
        if self.stiffness is None:
            return None
        r_n = split(self.r, self.n).normal
        return spring_of(self.entry, np.maximum(-r_n, 0.0), self.stiffness)

    @property
    def slider(self) -> SpringLaw | None:
        """Return the tangential spring of a compliant foundation."""
        if self.tangential is None:
            return None
        r_t = split(self.r, self.n).tangential
        slide = split(self.w - self.s, self.n).tangential
        return slider_of(slide, r_t, self.bound, self.tangential)


def contact_density(
    contact: ContactOnMesh, at: AtPoints, cancelling: np.ndarray | float
) -> np.ndarray:
    """Evaluate twice the contact term at points [force/length^(d-2)].

    It is ``2 (b(p^) |w_t - s| + r^_t.(w_t - s) + r^_n (w_n - g))``, and on a compliant
    foundation twice the left side of (F) in :mod:`erc_contact.error.foundations`. Where
    friction is orthotropic ``support(w_t - s)`` takes the place of the length
    (:mod:`erc_contact.model.contact.friction_set`).

    Args:
        contact: The contact.
        at: What it has at the points.
        cancelling: Bound of :func:`bound_cancellation` [length], shape (n, 1), or 0.

    Returns:
        The term, shape (n, q).
    """
    r_n, r_t, _ = split(at.r, at.n)
    w_t = split(at.w - at.s, at.n).tangential
    spring, slider = at.spring, at.slider
    if contact.bilateral:
        # A gap that is closed everywhere, with a traction of any sign, does no work.
        density = np.zeros(r_n.shape)
    elif spring is None:
        density = r_n * at.entry
    else:
        density = law_error(spring)
    if slider is not None:
        density += law_error(slider)
    elif contact.friction is not None:
        path = contact.friction_set.support(w_t, at.n, at.facet)
        density += at.bound * path + np.vecdot(r_t, w_t)
    # A difference of two works that are equal up to round-off is no error. Otherwise e
    # would stop at 1e-8 of the norm.
    size = lengths(at.w) + lengths(at.s) + abs(at.gap) + cancelling
    resolution = 16 * np.finfo(float).eps * lengths(at.r) * size
    return 2 * np.where(abs(density) <= resolution, 0.0, density)


def foundation_sum(at: AtPoints) -> np.ndarray:
    """Evaluate :func:`law_sum` of the springs of a foundation, shape (n, q).

    It is 0 on a rigid foundation.
    """
    total = np.zeros(at.bound.shape)
    for law in (at.spring, at.slider):
        if law is not None:
            total += law_sum(law)
    return total


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
    allowed = clip(pull, lengths(pull), bound)
    return SpringLaw(pull, allowed, -r_t, stiffness)


def law_error(law: SpringLaw) -> np.ndarray:
    """Evaluate the error in the law of a spring with a limit [force/length^(d-2)].

    It is ``(|t - P|^2/2 + (P - t).(k d - P))/k``, the left side of (F) in
    :mod:`erc_contact.error.foundations` without cancellation. Both terms are >= 0: P is
    the nearest point of a convex set that t is in.
    """
    misfit = law.traction - law.allowed
    square = 0.5 * np.vecdot(misfit, misfit)
    beyond = np.vecdot(-misfit, law.pull - law.allowed)
    return np.asarray((square + beyond) / law.stiffness)


def law_sum(law: SpringLaw) -> np.ndarray:
    """Evaluate the square of the sum of both tractions [force/length^(d-2)].

    It is ``|t + P|^2/k``, as ``|sigma^ + C eps(u^)|^2`` of a body.
    """
    total = law.traction + law.allowed
    return np.asarray(np.vecdot(total, total) / law.stiffness)


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
