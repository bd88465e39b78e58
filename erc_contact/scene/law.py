"""Declare contact and friction laws: the admissible tractions of a foundation.

Symbols, with n the unit normal of the foundation that points into it (outward from the
body): w = u on the contact boundary, w_n = w.n, w_t = w - w_n n [length]; r the contact
traction on the body, r_n = r.n, r_t = r - r_n n, pressure p = -r_n [force/area]; g the
initial gap [length]; b(p) the friction bound [force/area].

The conditions with a gap: w_n <= g, r_n <= 0, r_n (w_n - g) = 0, |r_t| <= b(p), and r_t
= -b(p) w_t/|w_t| where w_t is not zero. A law is its friction bound: Coulomb b = mu p
(12)-(15), Tresca b = s; a frictionless contact has none. A law of the user's own is a
class with the same members, ``parameters`` and ``friction_bound``. Its b must be
finite, not negative, never decrease and be concave in p: the tractions that it allows
are then a convex set, and the error in the constitutive relation is what it is for
Coulomb. A bilateral contact can pull: its b must not know the pressure. This is checked
at samples when the scene meets its mesh (:mod:`erc_contact.model.promises`). In 3D the
set of a law may be an ellipse: :mod:`erc_contact.model.contact.friction_set` says what
then takes the place of ``|r_t|`` and of the direction of w_t.

Source: Coorevits, Hild, Hjiaj, equations (5)-(8), (12)-(16); the gap and the general
bound are ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl, Value
from erc_contact.scene.checks import Vector, check_value, check_vector
from namedmesh.base.checks import is_number


class Law(Protocol):
    """Describe a friction law.

    In 3D a law with attributes ``axes`` and ``ratio`` allows an ellipse: it is b(p)
    along the tangential part of ``axes`` (a vector, or a callable of x), and ``ratio
    b(p)``, a number > 0, across it.

    Example: ``demos/extend/law.py``.

    Attributes:
        parameters: Names of the attributes that are values in space (numbers or
            callables of x, each >= 0), a tuple.

    Example:
        >>> law: ec.Law = ec.Coulomb(0.3)
        >>> law.parameters, round(law.friction_bound(2.0, friction=0.3), 12)
        (('friction',), 0.6)
    """

    @property
    def parameters(self) -> tuple[str, ...]: ...  # noqa: D102

    def friction_bound(self, pressure: Ufl, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return the friction bound b(p) [force/area], UFL, a scalar.

        It is >= 0, never decreases and is concave in p. Of a bilateral contact it does
        not depend on p.

        Args:
            pressure: The pressure p >= 0 [force/area], UFL.
            values: Not used; type checkers ask for it, so that a class may name its
                parameters.
            parameters: The parameters by their names, UFL. A bound that is plain
                arithmetic gets numpy arrays, too.
        """


@dataclass(frozen=True)
class Coulomb:
    """Declare Coulomb friction, ``b = mu p``.

    Args:
        friction: Friction coefficient mu >= 0 [-], number or callable of x.

    Raises:
        InputError: If the number is negative.

    Example:
        >>> ec.Contact("bottom", friction=ec.Coulomb(0.3))  # the same as friction=0.3
        Contact(facets='bottom', against=None, friction=Coulomb(friction=0.3), ...)
    """

    friction: Value
    parameters: ClassVar[tuple[str, ...]] = ("friction",)

    def __post_init__(self) -> None:
        """Check the friction coefficient."""
        check_value("Coulomb: friction", self.friction, 0.0)

    def friction_bound(self, pressure: Ufl, friction: Ufl) -> Ufl:
        """Return ``b(p) = mu p`` [force/area]."""
        return friction * pressure


@dataclass(frozen=True)
class Tresca:
    """Declare Tresca friction, ``b = s`` whatever the pressure.

    Args:
        limit: Friction bound s >= 0 [force/area], number or callable of x.

    Raises:
        InputError: If the number is negative.

    Example:
        >>> ec.Contact("bottom", friction=ec.Tresca(1.5))  # a bound in [force/area]
        Contact(facets='bottom', against=None, friction=Tresca(limit=1.5), ...)
    """

    limit: Value
    parameters: ClassVar[tuple[str, ...]] = ("limit",)

    def __post_init__(self) -> None:
        """Check the friction bound."""
        check_value("Tresca: limit", self.limit, 0.0)

    def friction_bound(self, pressure: Ufl, limit: Ufl) -> Ufl:
        """Return ``b(p) = s`` [force/area]."""
        return limit


@dataclass(frozen=True)
class Orthotropic:
    """Declare Coulomb friction with two coefficients in 3D, along and across an axis.

    The tractions that it allows lie in an ellipse, ``(r_1/mu_1)^2 + (r_2/mu_2)^2 <=
    p^2``, as of a surface that is ground, brushed or woven. The slip is not parallel to
    the traction: it is normal to the ellipse, so that the law dissipates the most
    (Mroz, Stupkiewicz, Int. J. Mech. Sci. 36 (1994)).

    Args:
        friction: Friction coefficients mu_1 and mu_2, numbers > 0 [-].
        axes: Direction of mu_1, a vector of any length, or a callable of x that returns
            one, which is taken in the middle of each facet. Its tangential part counts.

    Raises:
        InputError: If there are no two numbers > 0, or no direction.

    Example:
        >>> brushed = ec.Orthotropic((0.1, 0.4), axes=(1.0, 0.0, 0.0))
        >>> ec.Contact("bottom", friction=brushed)
        Contact(facets='bottom', against=None,
                friction=Orthotropic(friction=(0.1, 0.4), axes=(1.0, 0.0, 0.0)), ...)
    """

    friction: tuple[float, float]
    axes: Vector
    parameters: ClassVar[tuple[str, ...]] = ("along",)

    def __post_init__(self) -> None:
        """Check the coefficients and the direction."""
        friction: Any = self.friction
        is_pair = isinstance(friction, Sequence | np.ndarray) and len(friction) == 2
        if not (is_pair and all(is_number(mu) and mu > 0 for mu in friction)):
            raise InputError(
                f"Orthotropic: friction is {friction!r}; give two numbers > 0, the coefficients"
                " along the axis and across it, e.g. (0.1, 0.4)."
            )
        object.__setattr__(self, "friction", tuple(float(mu) for mu in friction))
        check_vector("Orthotropic: axes", self.axes)

    @property
    def along(self) -> float:
        """Return mu_1 [-]."""
        return self.friction[0]

    @property
    def ratio(self) -> float:
        """Return ``mu_2/mu_1`` [-]."""
        return self.friction[1] / self.friction[0]

    def friction_bound(self, pressure: Ufl, along: Ufl) -> Ufl:
        """Return the bound along the axis, ``b(p) = mu_1 p`` [force/area]."""
        return along * pressure


def project(
    z: Ufl,
    n: Ufl,
    bound: Callable[[Ufl], Ufl] | None,
    gauge: Callable[[Ufl, Ufl], Ufl],
    *,
    bilateral: bool = False,
) -> Ufl:
    """Project a traction on the tractions that a law allows [force/area], UFL.

    First its normal part is projected, then its tangential part with the bound there:
    ``r_n = min(z_n, 0)``, or z_n where the contact is bilateral; ``r_t = z_t`` if
    ``gauge(z_t) < b(p)`` (stick), else ``b(p) z_t/gauge(z_t)`` (slip).

    Args:
        z: Trial traction [force/area], shape (d,).
        n: Unit normal of the foundation, shape (d,).
        bound: Friction bound b of the pressure, or None for no friction at all (no
            friction term is formed).
        gauge: Gauge of the set of allowed tractions, of a tangential traction and n:
            its length, for isotropic friction.
        bilateral: Whether the contact cannot open.

    Returns:
        The contact traction r [force/area], shape (d,).
    """
    z_n = ufl.dot(z, n)
    r_n = z_n if bilateral else ufl.conditional(ufl.lt(z_n, 0), z_n, 0)
    if bound is None:
        return r_n * n
    z_t = z - z_n * n
    size = gauge(z_t, n)
    limit = bound(-r_n)
    # An open contact has b = 0 and may have z_t = 0: no division by zero.
    divisor = ufl.conditional(ufl.gt(size, 0), size, 1)
    share = ufl.conditional(ufl.lt(size, limit), 1, limit / divisor)
    return r_n * n + share * z_t
