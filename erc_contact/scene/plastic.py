"""Declare von Mises plasticity with hardening by the convex potential of a load step.

Symbols: e deviator of the strain less the plastic strain p [-], q von Mises stress
``sqrt(3/2) |dev sigma|`` [force/area], G shear modulus, K bulk modulus, y yield stress,
H and H_k isotropic and kinematic hardening modulus, a accumulated plastic strain [-].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl, Value
from erc_contact.scene.material import (
    AXISYMMETRIC,
    PLANE_STRAIN,
    PLANE_STRESS,
    Elastic,
    check_numbers,
)

NO_YIELD = 1e100
"""Yield stress that no stress reaches, whatever the unit [force/area]."""


@dataclass(frozen=True)
class Plastic:
    """Declare von Mises plasticity with linear isotropic and kinematic hardening.

    The body remembers its plastic strain p and the accumulated plastic strain a. In a
    load step, one of implicit Euler, the energy of the step with the new plastic strain
    at its best is convex in the strain. With the trial stress ``s = 2 G e - X``, the
    back stress ``X = 2/3 H_k p`` and the yield stress ``y_a = y + H a`` it is, with its
    conjugate::

        psi = K (tr eps)^2/2 + G |e|^2 - [q(s) - y_a]_+^2 / (2 (3 G + H + H_k)),
        psi* = (tr sigma)^2/(18 K) + q(sigma)^2/(6 G) + sigma : p
               + [q(sigma - X) - y_a]_+^2 / (2 (H + H_k)).

    ``solve`` and ``adapt`` make one step from rest; ``evolve`` goes from step to step.
    On a mesh in the plane it is plane strain, or of a body of revolution. Beside it in
    a mapping of regions an :class:`Elastic` is a law that never yields.

    Args:
        E: Young's modulus [force/area], > 0: a number, a callable of x, or a mapping
            from the names of cell regions to either.
        nu: Poisson's ratio [-], in (-1, 1/2); likewise.
        yield_stress: Stress in tension at which yielding begins [force/area], > 0;
            likewise.
        hardening: Isotropic part of the slope of the stress in tension over the plastic
            strain [force/area], >= 0; likewise. The tangent in tension is ``E h/(E +
            h)`` with the whole slope h, which must be > 0.
        kinematic: Kinematic part of this slope, >= 0; likewise. It moves the yield
            surface in the place of widening it.
        hypothesis: "plane strain" or "axisymmetric". A mesh in 3D does not ask.

    Raises:
        InputError: If a number is outside its range.

    Example:
        >>> ec.Plastic(E=210e3, nu=0.3, yield_stress=235.0, hardening=2100.0).hardening
        2100.0
    """

    E: Value | Mapping[str, Value]
    nu: Value | Mapping[str, Value]
    yield_stress: Value | Mapping[str, Value]
    hardening: Value | Mapping[str, Value]
    kinematic: Value | Mapping[str, Value] = 0.0
    hypothesis: str = PLANE_STRAIN

    parameters: ClassVar[tuple[str, ...]] = ("E", "nu", "yield_stress", "hardening", "kinematic")
    state: ClassVar[Mapping[str, tuple[int, ...]]] = {"plastic_strain": (3, 3), "accumulated": ()}

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_numbers(self)
        if self.hypothesis == PLANE_STRESS:
            raise InputError(
                "Plastic: plane stress does not exist for it; take plane strain, or a thin body in "
                "space."
            )
        if self.hypothesis not in (PLANE_STRAIN, AXISYMMETRIC):
            raise InputError(
                f"Plastic: hypothesis is {self.hypothesis!r}; give {PLANE_STRAIN!r} or "
                f"{AXISYMMETRIC!r}."
            )

    @classmethod
    def of_elastic(cls, elastic: Elastic) -> Plastic:
        """Return an elastic material as a law that never yields."""
        return cls(elastic.E, elastic.nu, NO_YIELD, NO_YIELD, hypothesis=elastic.hypothesis)

    def check(self, name: str, low: float, high: float) -> None:
        """Check the range ``[low, high]`` that a parameter takes in the body.

        Raises:
            InputError: If it is not allowed.
        """
        what = name.replace("_", " ")
        if name in ("E", "nu"):
            Elastic.check(name, low, high)
        elif name == "yield_stress" and not 0.0 < low <= high < float("inf"):
            raise InputError(f"Plastic: {what} is {low:g}; it must be > 0 and finite [force/area].")
        elif not 0.0 <= low <= high < float("inf"):
            raise InputError(
                f"Plastic: {what} is {low:g}; it must be >= 0 and finite [force/area]."
            )
        elif name == "hardening" and low == 0.0 and self.kinematic == 0.0:
            raise InputError(
                "Plastic: hardening is 0. Without hardening psi* is infinite wherever a stress is "
                "beyond the yield stress, so an admissible stress would have to stay below it at "
                "every point, which the reconstruction does not do. Give hardening > 0, e.g. 1% "
                "of E."
            )
        elif name == "kinematic" and low == 0.0 and self.hardening == 0.0:
            raise InputError(
                "Plastic: hardening and kinematic are both 0, and their sum must be > 0. Give, "
                "e.g., 1% of E."
            )

    def potential(self, strain: Ufl, **values: Ufl) -> Ufl:
        """Return psi of a strain (3, 3) [force/area]."""
        here = _AtPoint(**values)
        elastic_strain = here.elastic_strain(strain)
        beyond = here.beyond(here.trial(strain))
        of_shear = here.shear * ufl.inner(elastic_strain, elastic_strain)
        elastic = here.bulk / 2 * ufl.tr(strain) ** 2 + of_shear
        return elastic - beyond**2 / (2 * (3 * here.shear + here.slope))

    def conjugate(self, stress: Ufl, **values: Ufl) -> Ufl:
        """Return psi* of a stress (3, 3) [force/area]."""
        here = _AtPoint(**values)
        deviator = ufl.dev(stress)
        of_shear = ufl.inner(deviator, deviator) / (4 * here.shear)
        elastic = (1 - 2 * here.nu) / (6 * here.E) * ufl.tr(stress) ** 2 + of_shear
        beyond = here.beyond(deviator - here.back_stress)
        return elastic + ufl.inner(deviator, here.plastic_strain) + beyond**2 / (2 * here.slope)

    def new_state(self, strain: Ufl, **values: Ufl) -> dict[str, Ufl]:
        """Return plastic strain and accumulated plastic strain after a step [-]."""
        here = _AtPoint(**values)
        trial = here.trial(strain)
        beyond = here.beyond(trial)
        flow = beyond / (3 * here.shear + here.slope)
        # Where nothing flows, the direction does not matter.
        direction = 1.5 * trial / (beyond + here.limit)
        return {
            "plastic_strain": here.plastic_strain + flow * direction,
            "accumulated": here.positive_accumulated + flow,
        }

    def convexity(self, E: Ufl, nu: Ufl, yield_stress: Ufl, hardening: Ufl, kinematic: Ufl) -> Ufl:
        """Return the share of the elasticity that plastic flow leaves [-]."""
        slope = hardening + kinematic
        return slope / (slope + 3 * E / (2 * (1 + nu)))

    def modulus(self, E: Ufl, nu: Ufl, yield_stress: Ufl, hardening: Ufl, kinematic: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area]: Young's."""
        return E


@dataclass(frozen=True, eq=False)
class _AtPoint:
    """Hold parameters and state of a point, UFL; see :class:`Plastic`."""

    E: Ufl
    nu: Ufl
    yield_stress: Ufl
    hardening: Ufl
    kinematic: Ufl
    plastic_strain: Ufl
    accumulated: Ufl

    @property
    def shear(self) -> Ufl:
        """Return G [force/area]."""
        return self.E / (2 * (1 + self.nu))

    @property
    def bulk(self) -> Ufl:
        """Return K [force/area]."""
        return self.E / (3 * (1 - 2 * self.nu))

    @property
    def slope(self) -> Ufl:
        """Return ``H + H_k`` [force/area]."""
        return self.hardening + self.kinematic

    @property
    def back_stress(self) -> Ufl:
        """Return X, the middle of the yield surface [force/area], shape (3, 3)."""
        return 2 * self.kinematic / 3 * self.plastic_strain

    @property
    def positive_accumulated(self) -> Ufl:
        """Return a, not below zero [-].

        The polynomial of a cell that has yielded in part is below zero beside its
        nodes, and ``y + H a`` < 0 would have no convex potential.
        """
        return ufl.max_value(self.accumulated, 0)

    @property
    def limit(self) -> Ufl:
        """Return ``y + H a``, the yield stress of a body that has yielded before."""
        return self.yield_stress + self.hardening * self.positive_accumulated

    def elastic_strain(self, strain: Ufl) -> Ufl:
        """Return e, the deviator of a strain less the plastic strain [-], (3, 3)."""
        return ufl.dev(strain) - self.plastic_strain

    def trial(self, strain: Ufl) -> Ufl:
        """Return s, the stress without flow less the back stress, shape (3, 3)."""
        return 2 * self.shear * self.elastic_strain(strain) - self.back_stress

    def beyond(self, deviator: Ufl) -> Ufl:
        """Return ``[q - y_a]_+`` of a deviator, with derivatives at q = 0, too."""
        square = 1.5 * ufl.inner(deviator, deviator)
        return ufl.sqrt(ufl.max_value(square, self.limit**2)) - self.limit
