"""Declare materials with a potential, as a user would write them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import ufl

from erc_contact.base.ufl_types import Ufl


@dataclass(frozen=True)
class Quadratic:
    """Linear elasticity by its energy."""

    E: Any
    nu: Any
    hypothesis: str = "plane strain"

    parameters: ClassVar[tuple[str, ...]] = ("E", "nu")

    def check(self, name: str, low: float, high: float) -> None:
        """Allow all values."""

    def potential(self, strain: Ufl, E: Ufl, nu: Ufl) -> Ufl:
        """Return psi of a strain (3, 3) [force/area]."""
        shear, lam = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
        return shear * ufl.inner(strain, strain) + lam / 2 * ufl.tr(strain) ** 2

    def conjugate(self, stress: Ufl, E: Ufl, nu: Ufl) -> Ufl:
        """Return psi* of a stress (3, 3) [force/area]."""
        return (1 + nu) / (2 * E) * ufl.inner(stress, stress) - nu / (2 * E) * ufl.tr(stress) ** 2

    def modulus(self, E: Ufl, nu: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area]."""
        return E


@dataclass(frozen=True)
class TwoModuli:
    """A bulk modulus K in compression, and a share of it in tension."""

    K: float
    G: float
    share: float
    hypothesis: str = "plane strain"

    parameters: ClassVar[tuple[str, ...]] = ("K", "G", "share")

    def check(self, name: str, low: float, high: float) -> None:
        """Allow all values."""

    def potential(self, strain: Ufl, K: Ufl, G: Ufl, share: Ufl) -> Ufl:
        """Return psi of a strain (3, 3) [force/area]."""
        e, volume = ufl.dev(strain), ufl.tr(strain)
        return G * ufl.inner(e, e) + K / 2 * ufl.conditional(volume > 0, share, 1) * volume**2

    def conjugate(self, stress: Ufl, K: Ufl, G: Ufl, share: Ufl) -> Ufl:
        """Return psi* of a stress (3, 3) [force/area]."""
        s, trace = ufl.dev(stress), ufl.tr(stress)
        bulk = K * ufl.conditional(trace > 0, share, 1)
        return ufl.inner(s, s) / (4 * G) + trace**2 / (18 * bulk)

    def modulus(self, K: Ufl, G: Ufl, share: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area]."""
        return 9 * K * G / (3 * K + G)


@dataclass(frozen=True)
class Fibres:
    """A soft body with fibres along x that carry tension only."""

    E: float
    fibre: float
    hypothesis: str = "plane strain"

    parameters: ClassVar[tuple[str, ...]] = ("E", "fibre")

    def check(self, name: str, low: float, high: float) -> None:
        """Allow all values."""

    def potential(self, strain: Ufl, E: Ufl, fibre: Ufl) -> Ufl:
        """Return psi of a strain (3, 3) [force/area]."""
        stretch = strain[0, 0]
        of_fibres = ufl.conditional(stretch > 0, fibre, 0) * stretch**2
        return E / 2 * ufl.inner(strain, strain) + of_fibres / 2

    def conjugate(self, stress: Ufl, E: Ufl, fibre: Ufl) -> Ufl:
        """Return psi* of a stress (3, 3) [force/area]."""
        pull = stress[0, 0]
        of_fibres = ufl.conditional(pull > 0, fibre / (E * (E + fibre)), 0) * pull**2
        return ufl.inner(stress, stress) / (2 * E) - of_fibres / 2

    def modulus(self, E: Ufl, fibre: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area]."""
        return E


@dataclass(frozen=True)
class Hencky:
    """A shear modulus that falls with the strain to a share, without conjugate."""

    K: Any
    G: Any
    limit: Any
    rest: Any

    parameters: ClassVar[tuple[str, ...]] = ("K", "G", "limit", "rest")

    def check(self, name: str, low: float, high: float) -> None:
        """Allow all values."""

    @property
    def elastic(self) -> tuple[float, float]:
        """Return Young's modulus and Poisson's ratio without strain."""
        young = 9 * self.K * self.G / (3 * self.K + self.G)
        return young, young / (2 * self.G) - 1

    def potential(self, strain: Ufl, K: Ufl, G: Ufl, limit: Ufl, rest: Ufl) -> Ufl:
        """Return psi of a strain (3, 3) [force/area]."""
        e = ufl.dev(strain)
        square = ufl.inner(e, e)
        soft = 2 * limit * (ufl.sqrt(square + limit**2) - limit)
        return K / 2 * ufl.tr(strain) ** 2 + G * (rest * square + (1 - rest) * soft)

    def convexity(self, K: Ufl, G: Ufl, limit: Ufl, rest: Ufl) -> Ufl:
        """Return the share of the elasticity that is left [-]."""
        return rest

    def modulus(self, K: Ufl, G: Ufl, limit: Ufl, rest: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area]."""
        return 9 * K * G / (3 * K + G)
