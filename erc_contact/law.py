"""Unilateral contact with Coulomb friction: cone and bipotential (UFL, no mesh).

Symbols, with n the unit normal of the foundation that points into it (outward from the body):
w = u on the contact boundary, w_n = w.n, w_t = w - w_n n [length]; r the contact traction on the body,
r_n = r.n, r_t = r - r_n n [force/area]; g the initial gap [length]; mu the friction coefficient [-].

The conditions (12)-(15) with a gap: w_n <= g, r_n <= 0, r_n (w_n - g) = 0, |r_t| <= mu |r_n|, and
r_t = -mu |r_n| w_t/|w_t| where w_t is not zero.

Source: Coorevits, Hild, Hjiaj, equations (5)-(8), (12)-(16); the gap is ours.
"""

from __future__ import annotations

from typing import Any

import ufl


def project_on_cone(z: Any, n: Any, mu: Any | None) -> Any:
    """Project a traction on the Coulomb cone, first its normal part, then its tangential part.

    ``r_n = min(z_n, 0)``; ``r_t = z_t`` if ``|z_t| <= mu |r_n|`` (stick), else
    ``mu |r_n| z_t/|z_t|`` (slip); an open contact has r = 0.

    Args:
        z: Trial traction [force/area], shape (d,).
        n: Unit normal of the foundation, shape (d,).
        mu: Friction coefficient, or None for no friction at all (no friction term is formed).

    Returns:
        The contact traction r [force/area], shape (d,).
    """
    z_n = ufl.dot(z, n)
    r_n = ufl.conditional(ufl.lt(z_n, 0), z_n, 0)
    if mu is None:
        return r_n * n
    z_t = z - z_n * n
    size = ufl.sqrt(ufl.dot(z_t, z_t))
    bound = -mu * r_n
    slip = ufl.conditional(ufl.le(size, bound), 1, bound / size)
    return ufl.conditional(ufl.lt(z_n, 0), 1, 0) * (r_n * n + slip * z_t)
