"""Fields near the tip of a crack of a body of revolution, as series.

Lengths are over the radius R of the ring of tips. Near the tip the body is nearly in
plane strain, and the factor 1 of a mode is nearly the field u- of
:mod:`erc_contact.error.goals.singular_strain`. What the ring adds are powers: with w =
2 mu u, the place z = x + i y in the frame of the crack, the radial direction e as a
complex number, and r = 1 + Re(conj(e) z),

    w = w_0 + w_1 + ...,    w_n ~ |z|^(n - 1/2),

each a sum of ``c z^a conj(z)^b``. Let D be the derivative by z, D* by conj(z), and

    Theta = s_xx + s_yy,    Phi = s_xx - s_yy + 2 i s_xy,    H = Re(conj(e) w)/r,

H the strain in hoop direction times 2 mu. Hooke's law, with ``l = 2 nu/(1 - 2 nu)``,
and equilibrium are

    Theta = 2 (1 + l) Re(D w) + l H,    Phi = 2 D* w,
    s_tt = l (Re(D w) + H/2) + H,
    r (D* Theta + D Phi) + (Theta e + Phi conj(e))/2 = e s_tt.

They are solved power by power: with the right side B of what is known,

    D* ((3 + l) D w + (1 + l) conj(D w)) = B - l D* H

is integrated by conj(z), then by z. The faces stay free by ``- conj(psi)`` with ``psi =
c z^(n - 1/2)``, a field in equilibrium: on both faces it asks for the same c, as a or b
is an integer. So no power meets a logarithm.

Source: Muskhelishvili, with the hoop terms; Leblond, Torlai (1992) for the powers of
curved fronts. The recursion is ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import pi, sqrt

import numpy as np

from erc_contact.error.goals.singular_strain import PSI_SHARES

HALF = 0.5
POWERS = 2
"""Number of powers beyond plane strain."""
PLANE_FACTORS = {"I": 1.0 + 0.0j, "II": -1.0j}
"""Factor of the potential phi of a mode [-]."""


class Series:
    """Hold ``sum c z^a conj(z)^b``.

    Args:
        terms: The coefficient c of each pair (a, b).
    """

    def __init__(self, terms: dict[tuple[float, float], complex]) -> None:
        self.terms = {powers: c for powers, c in terms.items() if c}

    def __add__(self, other: Series) -> Series:
        """Return the sum."""
        terms = dict(self.terms)
        for powers, c in other.terms.items():
            terms[powers] = terms.get(powers, 0.0) + c
        return Series(terms)

    def __sub__(self, other: Series) -> Series:
        """Return the difference."""
        return self + (-1.0) * other

    def __rmul__(self, factor: complex) -> Series:
        """Return a multiple."""
        return Series({powers: factor * c for powers, c in self.terms.items()})

    def conj(self) -> Series:
        """Return the complex conjugate."""
        return Series({(b, a): c.conjugate() for (a, b), c in self.terms.items()})

    def real(self) -> Series:
        """Return the real part."""
        return HALF * (self + self.conj())

    def along(self, e: complex) -> Series:
        """Return ``Re(conj(e) self)``, the component in a direction."""
        return (e.conjugate() * self).real()

    def times_x(self, e: complex) -> Series:
        """Return the product with ``Re(conj(e) z)``."""
        terms: dict[tuple[float, float], complex] = {}
        for (a, b), c in self.terms.items():
            for powers, factor in (((a + 1, b), e.conjugate()), ((a, b + 1), e)):
                terms[powers] = terms.get(powers, 0.0) + HALF * factor * c
        return Series(terms)

    def D(self) -> Series:
        """Return the derivative by z."""
        return Series({(a - 1, b): a * c for (a, b), c in self.terms.items()})

    def D_bar(self) -> Series:
        """Return the derivative by conj(z)."""
        return Series({(a, b - 1): b * c for (a, b), c in self.terms.items()})

    def integral(self) -> Series:
        """Return an integral by z; no power is -1, as none is below zero but halves."""
        return Series({(a + 1, b): c / (a + 1) for (a, b), c in self.terms.items()})

    def integral_bar(self) -> Series:
        """Return an integral by conj(z)."""
        return Series({(a, b + 1): c / (b + 1) for (a, b), c in self.terms.items()})

    def at(self, distance: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the real part at distances and angles, of their shape."""
        total = np.zeros_like(distance)
        for (a, b), c in self.terms.items():
            total += distance ** (a + b) * (c * np.exp(1j * (a - b) * theta)).real
        return total

    def on_face(self) -> dict[float, complex]:
        """Return the factor of each power of the distance on the face above."""
        factors: dict[float, complex] = {}
        for (a, b), c in self.terms.items():
            factors[a + b] = factors.get(a + b, 0.0) + c * 1j ** round(2 * (a - b))
        return factors


@dataclass(frozen=True, eq=False)
class RingFields:
    """Hold the fields of a mode of a ring, see the top of this module.

    All are real, and components are along r, z and the hoop. M is r times the stress of
    the powers up to :data:`POWERS`; its hoop component ``r s_tt`` follows from
    equilibrium. What M has more than in plane strain is ``(M_rz, M_zz) = (- chi_z,
    chi_r)`` and ``M_rr = m``; chi is zero on the faces.

    Attributes:
        w: Displacement without w_0, times 2 mu: r and z.
        chi: Stress function of what M has in z.
        chi_z: Its derivative by z.
        m: What M has in rr.
        lack: r times the strain of w, less the strain of M by Hooke's law, times 2 mu:
            rr, rz, zz, hoop. It is of the power ``POWERS - 3/2``, and vanishes at the
            tip.
    """

    w: tuple[Series, Series]
    chi: Series
    chi_z: Series
    m: Series
    lack: tuple[Series, Series, Series, Series]


def ring_fields(mode: str, nu: float, e: complex) -> RingFields:
    """Return the fields of a mode of a ring.

    Args:
        mode: "I" or "II".
        nu: Poisson's ratio [-].
        e: The radial direction in the frame of the crack, of size 1.
    """
    w, stresses = _powers(mode, nu, e)
    # M has r - 1 times the stress of the power before, too.
    Thetas, Phis = [], []
    for before, now in pairwise(stresses):
        Thetas.append(now.Theta + before.Theta.times_x(e))
        Phis.append(now.Phi + before.Phi.times_x(e))
    Theta, Phi = _sum(Thetas), _sum(Phis)
    chi, chi_z = _stress_function(Theta, Phi, e)
    m, _, _ = _in_half_plane(Theta, Phi, e)
    first = stresses[0]
    tt = _sum([stress.tt for stress in stresses[:-1]])
    M = _Stress(first.Theta + Theta, first.Phi + Phi, tt + tt.times_x(e))
    of_ring = _sum(w[1:])
    components = of_ring.along(e), of_ring.along(1j * e)
    return RingFields(components, chi, chi_z, m, _lack(w[0] + of_ring, M, nu, e))


@dataclass(frozen=True, eq=False)
class _Stress:
    """Hold Theta, Phi and the hoop component of a stress."""

    Theta: Series
    Phi: Series
    tt: Series


def _powers(mode: str, nu: float, e: complex) -> tuple[list[Series], list[_Stress]]:
    """Return w_n and its stress for each n up to :data:`POWERS`."""
    lame = 2 * nu / (1 - 2 * nu)
    H = Series({})
    w = [plane_field(mode, 3 - 4 * nu)]
    stresses = [_stress(w[0], H, lame)]
    for n in range(1, POWERS + 1):
        known = stresses[-1]
        divergence = known.Theta.D_bar() + known.Phi.D()
        of_ring = HALF * (e * known.Theta + e.conjugate() * known.Phi) - e * known.tt
        H = w[-1].along(e) - H.times_x(e)
        right = -1.0 * (divergence.times_x(e) + of_ring) - lame * H.D_bar()
        whole = right.integral_bar()
        real = whole.real()
        slope = (1 / (4 + 2 * lame)) * real + HALF * (whole - real)
        particular = slope.integral()
        stress = _stress(particular, H, lame)
        # On the faces the traction is Theta - Phi, times i/2.
        traction = (stress.Theta - stress.Phi).on_face().get(n - 1.5, 0.0)
        free = Series({(0.0, n - HALF): 1.0})
        of_free = _stress(free, Series({}), lame).Phi.on_face()[n - 1.5]
        w.append(particular + traction / of_free * free)
        stresses.append(_stress(w[n], H, lame))
    return w, stresses


def _stress(w: Series, H: Series, lame: float) -> _Stress:
    """Return the stress of a displacement and its hoop strain; lame is l."""
    half_volume = w.D().real()
    Theta = 2 * (1 + lame) * half_volume + lame * H
    tt = lame * half_volume + (1 + HALF * lame) * H
    return _Stress(Theta, 2.0 * w.D_bar(), tt)


def _lack(w: Series, M: _Stress, nu: float, e: complex) -> tuple[Series, Series, Series, Series]:
    """Return :attr:`RingFields.lack` of a displacement and r times a stress."""
    volume, change = 2.0 * w.D().real(), 2.0 * w.D_bar()
    pressed = nu / (1 + nu) * (M.Theta + M.tt)
    Theta = volume + volume.times_x(e) - M.Theta + 2.0 * pressed
    Phi = change + change.times_x(e) - M.Phi
    hoop = w.along(e) - (1 / (1 + nu)) * (M.tt - nu * M.Theta)
    rr, rz, zz = _in_half_plane(Theta, Phi, e)
    return _cleaned(rr), _cleaned(rz), _cleaned(zz), _cleaned(hoop)


def plane_field(mode: str, kappa: float) -> Series:
    """Return w_0 of a mode: ``kappa phi - z conj(phi') - conj(psi)`` of the plane.

    Args:
        mode: "I" or "II".
        kappa: Kolosov's constant [-].
    """
    a = PLANE_FACTORS[mode] / (2 * sqrt(2 * pi))
    b = (1 + PSI_SHARES[mode]) * a
    return Series(
        {
            (-HALF, 0.0): kappa * a,
            (1.0, -1.5): HALF * a.conjugate(),
            (0.0, -HALF): -b.conjugate(),
        }
    )


def _sum(parts: list[Series]) -> Series:
    """Return the sum of series."""
    return sum(parts, start=Series({}))


def _in_half_plane(Theta: Series, Phi: Series, e: complex) -> tuple[Series, Series, Series]:
    """Return the components rr, rz and zz of a tensor."""
    turned = e.conjugate() ** 2 * Phi
    rr = HALF * (Theta + turned.real())
    rz = HALF * (-1j * turned).real()
    zz = HALF * (Theta - turned.real())
    return rr, rz, zz


def _stress_function(Theta: Series, Phi: Series, e: complex) -> tuple[Series, Series]:
    """Return chi with ``(M_rz, M_zz) = (- chi_z, chi_r)``, and chi_z."""
    e_z = 1j * e
    force = HALF * (e_z * Theta + e_z.conjugate() * Phi)
    slope = -HALF * 1j * force
    chi = slope.integral_bar()
    # Powers of z alone have no derivative by conj(z), but mirrors, as chi is real.
    powers = {(b, a): c.conjugate() for (a, b), c in chi.terms.items() if a == 0}
    return chi + Series(powers), 2.0 * slope.along(e_z)


def _cleaned(lack: Series) -> Series:
    """Return what a strain lacks without the round-off of powers that cancel."""
    terms = {}
    for (a, b), c in lack.terms.items():
        if a + b > POWERS - 2:
            terms[a, b] = c
    return Series(terms)
