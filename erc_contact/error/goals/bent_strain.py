"""A given strain whose work is the stress intensity factor of a crack that bends.

Behind a straight piece at its tip the crack bends, but stays in a horn

    |y| < W = xi (opening + widening xi),

with xi the distance behind the straight piece and y the distance from its line. The
proof of :mod:`erc_contact.error.goals.singular_strain` asks of T that it is in
equilibrium and leaves the faces free, and of v that it jumps across the crack alone,
not that one belongs to the other. So T gets the stress function ``c eta A``: c is zero
in the horn, and one where ``|y| > 3 W`` and beside the straight piece, so that T is
zero where the crack is. And v is ``eta u-`` with the angle theta continued from each
side to the crack. With ``B = eta A``, in G

    c T' - (1 - c) eta sigma(u-) + cof(2 sym(grad c (x) grad B) + B grad grad c)

takes the place of T'. A is of the second order in y, as the faces are free on the line,
so that G stays finite where the horn begins.

Source: the stress function with cut-offs, ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import ufl

from erc_contact.base.ufl_types import Ufl
from erc_contact.error.goals.singular_strain import (
    INNER_SHARE,
    PSI_SHARES,
    SingularStrain,
    cofactor,
    cut_fields,
    cut_off,
    in_frame,
    potential,
    strain_of,
    stress_function,
)

FULL = 3.0
"""Distance from the line over W from which on c is 1 [-]."""
AT_BEND = 1e-12
"""Least distance behind the straight piece over the radius: W is above zero [-]."""


@dataclass(frozen=True, kw_only=True)
class BentStrain(SingularStrain):
    """Declare the given strain ``t G`` of a tip of a crack that bends.

    Args:
        straight: Length of the straight piece [length].
        opening: Slope of W where the horn begins [-].
        widening: How it grows [1/length].
        side: Function of the mesh: 1 in cells above the crack, -1 in cells below it.
    """

    straight: float
    opening: float
    widening: float
    side: Callable[[Ufl], Ufl]

    parameters: ClassVar[tuple[str, ...]] = (
        *SingularStrain.parameters,
        "straight",
        "opening",
        "widening",
        "side",
    )

    def strain(self, x: Ufl, **parameters: Ufl) -> Ufl:
        """Return ``t G``, UFL, shape (2, 2)."""
        amount, tip_x, tip_y, c, s, radius, kappa, *of_line = (
            parameters[name] for name in self.parameters
        )
        straight, opening, widening, side = of_line
        forward, aside = in_frame(x, tip_x, tip_y, c, s)
        # The cut of the angle is beyond the other side.
        theta = side * (ufl.pi / 2 + ufl.atan2(-forward, side * aside))
        distance = ufl.sqrt(forward**2 + aside**2)
        r = ufl.max_value(ufl.min_value(distance, radius), INNER_SHARE * radius)
        eta, _, _ = cut_off(r, radius)
        of_eta, w, of_ring = cut_fields(self.mode, kappa, theta, r, radius)
        # The horn begins behind the straight piece.
        far = ufl.max_value(distance, straight)
        A, of_A = stress_function(self.mode, theta, far)
        of_both = eta * of_A + A * of_eta
        behind = -forward - straight
        c_horn, of_horn, second = horn(behind, aside, opening, widening, AT_BEND * radius)
        bent = ufl.outer(of_horn, of_both) + ufl.outer(of_both, of_horn) + eta * A * second
        # T less the stress of eta u- where eta does not vary.
        more = c_horn * of_ring + cofactor(bent)
        more -= (1 - c_horn) * eta * tip_stress(self.mode, theta, far)
        local = ufl.sym(ufl.outer(of_eta, w)) - strain_of(kappa, more)
        turn = ufl.as_matrix([[c, -s], [s, c]])
        return 2 / (kappa + 1) * amount * (turn * local * turn.T)


def tip_stress(mode: str, theta: Ufl, r: Ufl) -> Ufl:
    """Return the stress of u- in the frame of the crack, UFL, shape (2, 2)."""
    P, Q = potential(mode, theta, r)

    def turned(count: int) -> tuple[Ufl, Ufl]:
        """Return phi' times exp(- i count theta)."""
        cosine, sine = ufl.cos(count * theta), ufl.sin(count * theta)
        return P * cosine + Q * sine, Q * cosine - P * sine

    once, thrice = turned(1), turned(3)
    total = -2 / r * once[0]
    b = PSI_SHARES[mode]
    difference, twice_shear = (
        (3 / 2 * of_three - (1 + b) * of_one) / r
        for of_one, of_three in zip(once, thrice, strict=True)
    )
    shear = twice_shear / 2
    xx, yy = (total - difference) / 2, (total + difference) / 2
    return ufl.as_matrix([[xx, shear], [shear, yy]])


def horn(behind: Ufl, aside: Ufl, opening: Ufl, widening: Ufl, least: Ufl) -> tuple[Ufl, Ufl, Ufl]:
    """Return c with its first and second derivatives, shapes (), (2,) and (2, 2).

    It is ``10 s^3 - 15 s^4 + 6 s^5``, where s goes from 0 at W to 1 at 3 W.

    Args:
        behind: xi [length].
        aside: y [length].
        opening: Slope of W where the horn begins [-].
        widening: How it grows [1/length].
        least: Least value of xi [length].
    """
    xi = ufl.max_value(behind, least)
    W = xi * (opening + widening * xi)
    slope = (opening + 2 * widening * xi) / W
    ratio = ufl.conditional(ufl.gt(behind, 0), abs(aside) / W, FULL)
    s = ufl.max_value(ufl.min_value((ratio - 1) / (FULL - 1), 1), 0)
    c = s**3 * (10 - 15 * s + 6 * s**2)
    of_s = 30 * (s * (1 - s)) ** 2 / (FULL - 1)
    of_slope = 60 * s * (1 - s) * (1 - 2 * s) / (FULL - 1) ** 2
    # xi falls where the distance along the direction of the crack grows.
    up = ufl.sign(aside) / W
    of_ratio = ufl.as_vector([ratio * slope, up])
    along = ratio * (2 * slope**2 - 2 * widening / W)
    second = ufl.as_matrix([[along, up * slope], [up * slope, 0]])
    return c, of_s * of_ratio, of_slope * ufl.outer(of_ratio, of_ratio) + of_s * second
