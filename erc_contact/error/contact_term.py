"""Evaluate the contact term of e^2 at points of the contact.

Symbols: r^ admissible contact traction, w u^ on the contact (between two bodies the
jump), s displacement at the end of the last step of a history, g gap, p pressure, b
friction bound, k stiffness of a compliant foundation.
"""

from __future__ import annotations

import numpy as np

from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.trace import Trace, split


def contact_density(
    contact: ContactOnMesh,
    n: np.ndarray,
    r: np.ndarray,
    w: np.ndarray,
    s: np.ndarray | float,
    gap: np.ndarray | float,
    bound: np.ndarray,
    stiffness: np.ndarray | None = None,
    both: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Evaluate twice the contact term at points [force/length^(d-2)].

    It is ``2 (b(p^) |w_t - s| + r^_t.(w_t - s) + r^_n (w_n - g))``.

    Args:
        contact: The contact.
        n: Normals of the foundation, shape (n, q or 1, d).
        r: r^ at the points [force/area], shape (n, q, d).
        w: u^ there [length], shape (n, q, d).
        s: The displacement of the last step there, of which the tangential part counts
            [length], shape (n, q, d), or 0 without history.
        gap: The gap there [length], shape (n, q), or a number.
        bound: The friction bound there [force/area], shape (n, q).
        stiffness: k of a compliant foundation there [force/length^3], shape (n, q);
            None for a rigid one.
        both: What :func:`cancelled` returns [length], shape (n, 1), or 0.

    Returns:
        The term, shape (n, q).
    """
    r_n, r_t, _ = split(r, n)
    w_n = (w * n).sum(axis=-1)
    _, w_t, slip = split(w - s, n)
    if contact.bilateral:
        # A gap that is closed everywhere, with a traction of any sign, does no work.
        density = np.zeros(r_n.shape)
    elif stiffness is None:
        density = r_n * (w_n - gap)
    else:
        density = law_error(w_n - gap, np.maximum(-r_n, 0.0), stiffness)
    if contact.friction is not None:
        density += bound * slip + (r_t * w_t).sum(axis=-1)
    # A difference of two works that are equal up to round-off is no error. Otherwise e
    # would stop at 1e-8 of the norm.
    size = np.linalg.norm(w, axis=-1) + np.linalg.norm(np.broadcast_to(s, w.shape), axis=-1)
    size = size + abs(gap) + both
    resolution = 16 * np.finfo(float).eps * np.linalg.norm(r, axis=-1) * size
    return 2 * np.where(abs(density) <= resolution, 0.0, density)


def law_error(entry: np.ndarray, pressure: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Evaluate the error in the law of a compliant foundation [force/length^(d-2)].

    It is the left side of (F) in :mod:`erc_contact.error.foundations`, written without
    cancellation.

    Args:
        entry: ``w_n - g``, how far the body enters the foundation [length].
        pressure: p >= 0 [force/area].
        stiffness: k [force/length^3].
    """
    touching = (stiffness * entry - pressure) ** 2 / (2 * stiffness)
    lifted = pressure**2 / (2 * stiffness) - pressure * entry
    return np.where(entry > 0, touching, lifted)


def law_sum(entry: np.ndarray, pressure: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Evaluate the square of the sum of both pressures [force/length^(d-2)].

    It is ``(p^ + k <w_n - g>_+)^2/k``, as ``|sigma^ + C eps(u^)|^2`` of a body. See
    :func:`law_error` for the arguments.
    """
    return (pressure + stiffness * np.maximum(entry, 0.0)) ** 2 / stiffness


def cancelled(trace: Trace, u: np.ndarray) -> np.ndarray:
    """Bound the displacements that cancel in w, whose round-off w has [length], (f, 1).

    They are zero on a rigid foundation.

    Args:
        trace: The trace of a contact.
        u: Displacement at all nodes of this rank [length], shape (nodes d,).
    """
    if trace.there is None:
        return np.zeros((len(trace.here.nodes), 1))
    nodal = u.reshape(-1, trace.here.d)[trace.partners]
    # Both sides together are no larger than w and twice the other side.
    return 2 * np.linalg.norm(nodal, axis=2).max(axis=1, keepdims=True, initial=0.0)
