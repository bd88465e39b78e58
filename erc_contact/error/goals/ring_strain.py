"""A given strain whose work with the stress of rings is a stress intensity factor.

It is G of :mod:`erc_contact.error.goals.singular_strain` for a ring of tips of radius R
and the stress of a body of revolution. By Betti's theorem on the half plane, on which
all volumes have the weight r, a displacement v and a stress T that is in equilibrium
with free faces, and that are u- and its stress in their first power at the tip, give

    K = 1/(2 pi R) int 2 pi r sigma(u) : E'/2 (eps(v) - C^-1 T).

Here ``v = eta (u- + what the ring adds)`` has the hoop strain ``v_r/r``. Were T the
stress of plane strain, it would leave a body force and a strain that is not square
integrable. Equilibrium of rings is ``div (r T) = T_tt e_r``: r T in the half plane
needs to be balanced in z alone, and T_tt follows. So, with the symbols of
:mod:`erc_contact.error.goals.tip_series` and the stress function A of u-,

    r T = R cof grad grad (eta A) + [eta m, - (eta chi)_z; - (eta chi)_z, (eta chi)_r],
    T_tt = (eta m)_r - (eta chi)_zz

is in equilibrium for any eta, and leaves the faces free. What v lacks to T is of the
power 1/2 near the tip, not zero as in the plane. The first term alone has no hoop
stress; A is cut by itself: with its parts in m and chi, T_tt would grow as R/radius.

With 2 mu as unit of stresses, M = r T and ``E'/(4 mu) = 2/(kappa + 1)``,

    2 mu r (eps - C^-1 T) = r sym grad (eta w) - M + nu/(1 + nu) (tr M + r T_tt) I,
    hoop: eta w_r - (r T_tt - nu tr M)/(1 + nu).

Source: Betti's theorem as in the plane; stress functions of rings with a cut-off, ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import ufl

from erc_contact.base.ufl_types import Ufl
from erc_contact.error.goals.singular_strain import (
    INNER_SHARE,
    SingularStrain,
    cut_fields,
    cut_off,
    cut_off_slopes,
    in_frame,
)
from erc_contact.error.goals.tip_series import POWERS, Series, ring_fields

AT_TIP = 1e-12
"""Least distance from the tip over the radius: powers below zero are finite [-]."""
POWERS_AND_ANGLES = [
    (n - 1 / 2, abs(n - 1 / 2 - 2 * j)) for n in range(POWERS + 1) for j in range(n + 3)
]
"""Powers p and factors m of the angle of ``rho^p cos(m theta)`` in the series."""


@dataclass(frozen=True)
class RingStrain(SingularStrain):
    """Declare the given strain ``t G`` of a ring of crack tips.

    Args:
        coefficients: Of the fields in :func:`ring_coefficients`.
    """

    coefficients: tuple[tuple[float, ...], ...] = ()

    parameters: ClassVar[tuple[str, ...]] = (*SingularStrain.parameters, "coefficients")

    def strain(self, x: Ufl, **parameters: Ufl) -> Ufl:
        """Return ``t G``, UFL, shape (3, 3)."""
        amount, R, tip_z, c, s, radius, kappa, of_fields = (
            parameters[name] for name in self.parameters
        )
        forward, aside = in_frame(x, R, tip_z, c, s)
        distance = ufl.sqrt(forward**2 + aside**2)
        rho = ufl.max_value(ufl.min_value(distance, radius), AT_TIP * radius)
        fields = of_fields * _basis(forward / rho, aside / rho, rho / R)
        w_r, w_z, chi, chi_z, m, *lack = (fields[i] for i in range(9))

        # Beyond both edges of the ring in which eta varies its derivatives are zero.
        cut = ufl.max_value(rho, INNER_SHARE * radius)
        local = ufl.atan2(aside, forward), cut, radius
        eta, _, _ = cut_off(cut, radius)
        slope, bend = cut_off_slopes(*local)
        _, plane_w, plane_T = cut_fields(self.mode, kappa, *local)
        turn = ufl.as_matrix([[c, -s], [s, c]])
        of_eta, second = turn * slope, turn * bend * turn.T
        root = ufl.sqrt(R)
        w = turn * plane_w + ufl.as_vector([w_r, w_z]) / root
        of_chi = ufl.as_matrix([[0, -of_eta[1]], [-of_eta[1], of_eta[0]]])
        M = R * (turn * plane_T * turn.T) + root * chi * of_chi
        tt = (m * of_eta[0] - 2 * chi_z * of_eta[1]) / root - root * chi * second[1, 1]
        nu = (3 - kappa) / 4
        pressed = nu / (1 + nu) * (ufl.tr(M) + x[0] * tt)
        plane = x[0] * ufl.sym(ufl.outer(of_eta, w)) - M + pressed * ufl.Identity(2)
        hoop = (nu * ufl.tr(M) - x[0] * tt) / (1 + nu)
        rr, rz, zz, of_hoop = (eta / root * part for part in lack)
        whole = ufl.as_matrix(
            [
                [plane[0, 0] + rr, plane[0, 1] + rz, 0],
                [plane[0, 1] + rz, plane[1, 1] + zz, 0],
                [0, 0, hoop + of_hoop],
            ]
        )
        return amount / (ufl.pi * (kappa + 1) * R * x[0]) * whole


def ring_coefficients(
    mode: str, nu: float, cosine: float, sine: float
) -> tuple[tuple[float, ...], ...]:
    """Return the coefficients of w_r, w_z, chi, chi_z, m and what the strain lacks.

    Each is a sum of ``rho^p cos(m theta)`` and ``rho^p sin(m theta)``, with the pairs
    of :data:`POWERS_AND_ANGLES` and rho over R; shape (9, 2 pairs).

    Args:
        mode: "I" or "II".
        nu: Poisson's ratio [-].
        cosine: Direction in which the crack points, a unit vector in (r, z).
        sine: Likewise.
    """
    fields = ring_fields(mode, nu, complex(cosine, -sine))
    rows = (*fields.w, fields.chi, fields.chi_z, fields.m, *fields.lack)
    return tuple(_row(series) for series in rows)


def _row(series: Series) -> tuple[float, ...]:
    """Return the coefficients of the cosines and sines of a real series."""
    row = dict.fromkeys(POWERS_AND_ANGLES, 0j)
    for (a, b), c in series.terms.items():
        row[a + b, abs(a - b)] += c if a > b else c.conjugate()
    numbers: list[float] = []
    for c in row.values():
        numbers += [c.real, -c.imag]
    return tuple(numbers)


def _basis(cosine: Ufl, sine: Ufl, rho: Ufl) -> Ufl:
    """Return the powers and angles of :func:`ring_coefficients`, UFL, a vector."""
    theta = ufl.atan2(sine, cosine)
    parts = []
    for p, m in POWERS_AND_ANGLES:
        power = rho**p
        parts += [power * ufl.cos(m * theta), power * ufl.sin(m * theta)]
    return ufl.as_vector(parts)
