"""Materials with a potential that several tests share, as a user would write them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import ufl


@dataclass(frozen=True)
class Quadratic:
    """Linear elasticity by its energy."""

    E: object
    nu: object

    parameters: ClassVar = ("E", "nu")

    def check(self, name, low, high):
        pass

    def potential(self, strain, E, nu):
        shear, lam = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
        return shear * ufl.inner(strain, strain) + lam / 2 * ufl.tr(strain) ** 2

    def conjugate(self, stress, E, nu):
        return (1 + nu) / (2 * E) * ufl.inner(stress, stress) - nu / (2 * E) * ufl.tr(stress) ** 2

    def modulus(self, E, nu):
        return E


@dataclass(frozen=True)
class TwoModuli:
    """A bulk modulus K in compression, and a share of it in tension."""

    K: float
    G: float
    share: float

    parameters: ClassVar = ("K", "G", "share")

    def check(self, name, low, high):
        pass

    def potential(self, strain, K, G, share):
        e, volume = ufl.dev(strain), ufl.tr(strain)
        return G * ufl.inner(e, e) + K / 2 * ufl.conditional(volume > 0, share, 1) * volume**2

    def conjugate(self, stress, K, G, share):
        s, trace = ufl.dev(stress), ufl.tr(stress)
        bulk = K * ufl.conditional(trace > 0, share, 1)
        return ufl.inner(s, s) / (4 * G) + trace**2 / (18 * bulk)

    def modulus(self, K, G, share):
        return 9 * K * G / (3 * K + G)


@dataclass(frozen=True)
class Fibres:
    """A soft body with fibres along x that carry tension only."""

    E: float
    fibre: float

    parameters: ClassVar = ("E", "fibre")

    def check(self, name, low, high):
        pass

    def potential(self, strain, E, fibre):
        stretch = strain[0, 0]
        of_fibres = ufl.conditional(stretch > 0, fibre, 0) * stretch**2
        return E / 2 * ufl.inner(strain, strain) + of_fibres / 2

    def conjugate(self, stress, E, fibre):
        pull = stress[0, 0]
        of_fibres = ufl.conditional(pull > 0, fibre / (E * (E + fibre)), 0) * pull**2
        return ufl.inner(stress, stress) / (2 * E) - of_fibres / 2

    def modulus(self, E, fibre):
        return E


@dataclass(frozen=True)
class Hencky:
    """A shear modulus that falls with the strain, to a share of it; no conjugate is known."""

    K: float
    G: float
    limit: float
    rest: float

    parameters: ClassVar = ("K", "G", "limit", "rest")

    def check(self, name, low, high):
        pass

    @property
    def elastic(self):
        """Young's modulus and Poisson's ratio without strain."""
        young = 9 * self.K * self.G / (3 * self.K + self.G)
        return young, young / (2 * self.G) - 1

    def potential(self, strain, K, G, limit, rest):
        e = ufl.dev(strain)
        square = ufl.inner(e, e)
        soft = 2 * limit * (ufl.sqrt(square + limit**2) - limit)
        return K / 2 * ufl.tr(strain) ** 2 + G * (rest * square + (1 - rest) * soft)

    def convexity(self, K, G, limit, rest):
        return rest

    def modulus(self, K, G, limit, rest):
        return 9 * K * G / (3 * K + G)
