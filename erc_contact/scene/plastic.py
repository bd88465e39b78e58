"""Declare von Mises plasticity with hardening by its convex potential.

Symbols: e deviator of the strain [-], q von Mises stress ``sqrt(3/2) |dev sigma|``
[force/area], G shear modulus, K bulk modulus, y yield stress, H hardening modulus.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.scene.material import Elastic, Value, check_numbers


@dataclass(frozen=True)
class Plastic:
    """Declare von Mises plasticity with linear isotropic hardening, in one load step.

    The body comes from rest without plastic strain, and is loaded once: ``solve`` and
    ``adapt`` make one step of implicit Euler, so an unloading is not followed. The
    energy of the step, with plastic strain, hardening and dissipation at their best, is
    convex in the strain. With the deviator e and the trial stress ``q_e = sqrt(6) G
    |e|`` it is, with its conjugate::

        psi = K (tr eps)^2/2 + G |e|^2 - [q_e - y]_+^2 / (2 (3 G + H)),
        psi* = (tr sigma)^2/(18 K) + q^2/(6 G) + [q - y]_+^2 / (2 H).

    On a mesh in the plane it is plane strain.

    Args:
        E: Young's modulus [force/area], > 0: a number, a callable of x, or a mapping
            from the names of cell regions to either.
        nu: Poisson's ratio [-], in (-1, 1/2); likewise.
        yield_stress: Stress in tension at which yielding begins [force/area], > 0;
            likewise.
        hardening: Slope of the stress in tension over the plastic strain [force/area],
            > 0; likewise. The tangent in tension is ``E H/(E + H)``.

    Raises:
        InputError: If a number is outside its range.

    Example:
        >>> ec.Plastic(E=210e3, nu=0.3, yield_stress=235.0, hardening=2100.0)
        Plastic(E=210000.0, nu=0.3, yield_stress=235.0, hardening=2100.0)
    """

    E: Value | Mapping[str, Value]
    nu: Value | Mapping[str, Value]
    yield_stress: Value | Mapping[str, Value]
    hardening: Value | Mapping[str, Value]

    parameters: ClassVar[tuple[str, ...]] = ("E", "nu", "yield_stress", "hardening")

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_numbers(self)

    @staticmethod
    def check(name: str, low: float, high: float) -> None:
        """Check the range ``[low, high]`` that a parameter takes in the body.

        Raises:
            InputError: If it is not allowed.
        """
        if name in ("E", "nu"):
            Elastic.check(name, low, high)
        elif name == "hardening" and low == 0.0:
            raise InputError(
                "Plastic: hardening is 0. Without hardening psi* is infinite wherever a stress is "
                "beyond the yield stress, so an admissible stress would have to stay below it at "
                "every point, which the reconstruction does not do. Give hardening > 0, e.g. 1% "
                "of E."
            )
        elif not 0.0 < low <= high < float("inf"):
            what = name.replace("_", " ")
            raise InputError(f"Plastic: {what} is {low:g}; it must be > 0 and finite [force/area].")

    def potential(self, strain: Ufl, E: Ufl, nu: Ufl, yield_stress: Ufl, hardening: Ufl) -> Ufl:
        """Return psi of a strain (3, 3) [force/area]."""
        shear = E / (2 * (1 + nu))
        bulk = E / (3 * (1 - 2 * nu))
        deviator = ufl.dev(strain)
        square = ufl.inner(deviator, deviator)
        beyond = _excess(6 * shear**2 * square, yield_stress)
        elastic = bulk / 2 * ufl.tr(strain) ** 2 + shear * square
        return elastic - beyond**2 / (2 * (3 * shear + hardening))

    def conjugate(self, stress: Ufl, E: Ufl, nu: Ufl, yield_stress: Ufl, hardening: Ufl) -> Ufl:
        """Return psi* of a stress (3, 3) [force/area]."""
        deviator = ufl.dev(stress)
        square = 1.5 * ufl.inner(deviator, deviator)
        beyond = _excess(square, yield_stress)
        elastic = (1 - 2 * nu) / (6 * E) * ufl.tr(stress) ** 2 + (1 + nu) / (3 * E) * square
        return elastic + beyond**2 / (2 * hardening)

    def modulus(self, E: Ufl, nu: Ufl, yield_stress: Ufl, hardening: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area]: Young's."""
        return E


def _excess(square: Ufl, yield_stress: Ufl) -> Ufl:
    """Return ``[q - y]_+`` from ``q^2``, with derivatives at q = 0, too."""
    return ufl.sqrt(ufl.max_value(square, yield_stress**2)) - yield_stress
