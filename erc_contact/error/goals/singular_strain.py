"""A given strain whose work with the stress is a stress intensity factor.

At the tip of a crack with faces along theta = +-pi, in the frame of its direction, let
u- be the derivative along the direction of the displacement that has the factor 1 of a
mode, and no other one. Its stress is in equilibrium and leaves the faces free. By
Betti's theorem on a ring around the tip,

    K = E'/2 oint (sigma(u-) n . u - sigma(u) n . u-),

which is the interaction integral. Let eta be 1 near the tip and 0 outside a radius, and
T the stress with eta times the stress function of u-. T is in equilibrium, too, and
leaves the faces free. So, without loads within the radius,

    K = int sigma(u) : G,    G = E'/2 (eps(eta u-) - C^-1 T).

G is zero where eta is constant. The energy of a body with the given strain t G falls by
t K at first: K is its derivative, as the other goals are.

With Kolosov's kappa, ``w = 2 mu u-`` and the stress function A of u-,

    G = 2/(kappa + 1) (sym(grad eta (x) w) - T' + (3 - kappa)/4 tr(T') I),

and T' is what A has in T where eta varies. Here w and A are made of ``phi' = P + i Q``:
``a/(2 sqrt(z))`` with ``a = 1/sqrt(2 pi)`` for mode I, ``-i/sqrt(2 pi)`` for mode II.

Source: Muskhelishvili's potentials; Stern, Becker, Dunham (1976) for the ring; the
stress function with a cut-off, which needs no body force, is ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import ufl

from erc_contact.base.ufl_types import Ufl

INNER_SHARE = 0.25
"""Share of the radius up to which eta is 1 [-]."""
SIZE = 2.9
"""About the norm of G over ``sqrt(E'/radius)`` [-].

It is 3.3 for mode I and 1.8 for mode II, and larger where kappa is near 1. It tells a
first t, and how much of an integral may stay unknown.
"""
PSI_SHARES = {"I": 0.5, "II": -1.5}
"""Ratio of the potentials psi and phi of a mode [-]."""


@dataclass(frozen=True)
class SingularStrain:
    """Declare the given strain ``t G`` of a crack tip.

    Args:
        mode: "I" or "II".
        amount: t.
        tip_x: Position of the tip [length].
        tip_y: Likewise.
        cosine: Direction in which the crack points, a unit vector.
        sine: Likewise.
        radius: Radius beyond which it is zero [length].
        kappa: Kolosov's constant, ``3 - 4 nu`` with plane strain [-].
    """

    mode: str
    amount: float
    tip_x: float
    tip_y: float
    cosine: float
    sine: float
    radius: float
    kappa: float

    region: ClassVar[None] = None
    parameters: ClassVar[tuple[str, ...]] = (
        "amount",
        "tip_x",
        "tip_y",
        "cosine",
        "sine",
        "radius",
        "kappa",
    )

    def strain(self, x: Ufl, **parameters: Ufl) -> Ufl:
        """Return ``t G``, UFL, shape (2, 2)."""
        amount, tip_x, tip_y, c, s, radius, kappa = (parameters[name] for name in self.parameters)
        forward, aside = in_frame(x, tip_x, tip_y, c, s)
        # At both edges of the ring G is zero, and so it is beyond them.
        distance = ufl.sqrt(forward**2 + aside**2)
        r = ufl.max_value(ufl.min_value(distance, radius), INNER_SHARE * radius)
        of_eta, w, T = cut_fields(self.mode, kappa, ufl.atan2(aside, forward), r, radius)
        local = ufl.sym(ufl.outer(of_eta, w)) - strain_of(kappa, T)
        turn = ufl.as_matrix([[c, -s], [s, c]])
        return 2 / (kappa + 1) * amount * (turn * local * turn.T)


def in_frame(x: Ufl, tip_x: Ufl, tip_y: Ufl, cosine: Ufl, sine: Ufl) -> tuple[Ufl, Ufl]:
    """Return the places along the direction of the crack and aside [length]."""
    to_x, to_y = x[0] - tip_x, x[1] - tip_y
    return cosine * to_x + sine * to_y, cosine * to_y - sine * to_x


def strain_of(kappa: Ufl, stress: Ufl) -> Ufl:
    """Return ``2 mu C^-1`` of a stress in the plane."""
    return stress - (3 - kappa) / 4 * ufl.tr(stress) * ufl.Identity(2)


def cut_fields(mode: str, kappa: Ufl, theta: Ufl, r: Ufl, radius: Ufl) -> tuple[Ufl, Ufl, Ufl]:
    """Return grad eta, w and T' in the frame of the crack, see above.

    Args:
        mode: "I" or "II".
        kappa: Kolosov's constant.
        theta: Angle from the direction of the crack.
        r: Distance from the tip [length].
        radius: Where eta is zero [length].
    """
    P, Q = potential(mode, theta, r)
    b = PSI_SHARES[mode]
    cosine_2, sine_2 = ufl.cos(2 * theta), ufl.sin(2 * theta)
    # kappa phi' - conj(phi') - z conj(phi'') - conj(psi')
    alpha, beta = 1 + b - cosine_2 / 2, sine_2 / 2
    w = ufl.as_vector([kappa * P - alpha * P + beta * Q, kappa * Q + beta * P + alpha * Q])
    A, of_A = stress_function(mode, theta, r)
    of_eta, second = cut_off_slopes(theta, r, radius)
    hessian = A * second + ufl.outer(of_eta, of_A) + ufl.outer(of_A, of_eta)
    return of_eta, w, cofactor(hessian)


def stress_function(mode: str, theta: Ufl, r: Ufl) -> tuple[Ufl, Ufl]:
    """Return the stress function A of u- and its gradient."""
    P, Q = potential(mode, theta, r)
    b = PSI_SHARES[mode]
    cosine_2, sine_2 = ufl.cos(2 * theta), ufl.sin(2 * theta)
    A = r * ((3 + 2 * b) * ufl.cos(theta) * P - (1 + 2 * b) * ufl.sin(theta) * Q)
    of_A = ufl.as_vector(
        [
            (2 + b) * P - (cosine_2 * P + sine_2 * Q) / 2,
            (cosine_2 * Q - sine_2 * P) / 2 - b * Q,
        ]
    )
    return A, of_A


def cofactor(hessian: Ufl) -> Ufl:
    """Return the stress of the second derivatives of a stress function."""
    return ufl.as_matrix([[hessian[1, 1], -hessian[0, 1]], [-hessian[0, 1], hessian[0, 0]]])


def cut_off_slopes(theta: Ufl, r: Ufl, radius: Ufl) -> tuple[Ufl, Ufl]:
    """Return the first and the second derivatives of eta, shapes (2,) and (2, 2)."""
    _, slope, curvature = cut_off(r, radius)
    outward = ufl.as_vector([ufl.cos(theta), ufl.sin(theta)])
    radial = ufl.outer(outward, outward)
    return slope * outward, curvature * radial + slope / r * (ufl.Identity(2) - radial)


def potential(mode: str, theta: Ufl, r: Ufl) -> tuple[Ufl, Ufl]:
    """Return the real and the imaginary part of phi' [1/sqrt(length)]."""
    size = 1 / (2 * ufl.sqrt(2 * ufl.pi * r))
    if mode == "I":
        return size * ufl.cos(theta / 2), -size * ufl.sin(theta / 2)
    return -size * ufl.sin(theta / 2), -size * ufl.cos(theta / 2)


def cut_off(r: Any, radius: Any) -> tuple[Any, Any, Any]:
    """Return eta and its first and second derivative in the ring and at its edges.

    ``eta = 1 - 35 s^4 + 84 s^5 - 70 s^6 + 20 s^7``, s from 0 to 1 across the ring:
    three derivatives vanish at its edges, so that G has no kinks there.
    """
    width = (1 - INNER_SHARE) * radius
    s = (r - INNER_SHARE * radius) / width
    eta = 1 - s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    slope = -140 * (s * (1 - s)) ** 3 / width
    curvature = -420 * (s * (1 - s)) ** 2 * (1 - 2 * s) / width**2
    return eta, slope, curvature
