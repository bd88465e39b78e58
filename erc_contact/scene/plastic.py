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
from erc_contact.base.ufl_types import Ufl
from erc_contact.scene.material import (
    AXISYMMETRIC,
    PLANE_STRAIN,
    PLANE_STRESS,
    Elastic,
    Value,
    check_numbers,
)


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
    On a mesh in the plane it is plane strain, or of a body of revolution.

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
        hypothesis: "plane strain" or "axisymmetric". A mesh in space does not ask.

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

    def potential(
        self,
        strain: Ufl,
        E: Ufl,
        nu: Ufl,
        yield_stress: Ufl,
        hardening: Ufl,
        kinematic: Ufl,
        plastic_strain: Ufl,
        accumulated: Ufl,
    ) -> Ufl:
        """Return psi of a strain (3, 3) [force/area]."""
        shear = E / (2 * (1 + nu))
        bulk = E / (3 * (1 - 2 * nu))
        deviator = ufl.dev(strain) - plastic_strain
        trial = 2 * shear * deviator - _back_stress(kinematic, plastic_strain)
        beyond = _excess(trial, _limit(yield_stress, hardening, accumulated))
        elastic = bulk / 2 * ufl.tr(strain) ** 2 + shear * ufl.inner(deviator, deviator)
        return elastic - beyond**2 / (2 * (3 * shear + hardening + kinematic))

    def conjugate(
        self,
        stress: Ufl,
        E: Ufl,
        nu: Ufl,
        yield_stress: Ufl,
        hardening: Ufl,
        kinematic: Ufl,
        plastic_strain: Ufl,
        accumulated: Ufl,
    ) -> Ufl:
        """Return psi* of a stress (3, 3) [force/area]."""
        deviator = ufl.dev(stress)
        of_shear = (1 + nu) / (2 * E) * ufl.inner(deviator, deviator)
        elastic = (1 - 2 * nu) / (6 * E) * ufl.tr(stress) ** 2 + of_shear
        relative = deviator - _back_stress(kinematic, plastic_strain)
        beyond = _excess(relative, _limit(yield_stress, hardening, accumulated))
        of_step = beyond**2 / (2 * (hardening + kinematic))
        return elastic + ufl.inner(deviator, plastic_strain) + of_step

    def new_state(
        self,
        strain: Ufl,
        E: Ufl,
        nu: Ufl,
        yield_stress: Ufl,
        hardening: Ufl,
        kinematic: Ufl,
        plastic_strain: Ufl,
        accumulated: Ufl,
    ) -> dict[str, Ufl]:
        """Return plastic strain and accumulated plastic strain after a step [-]."""
        shear = E / (2 * (1 + nu))
        deviator = ufl.dev(strain) - plastic_strain
        trial = 2 * shear * deviator - _back_stress(kinematic, plastic_strain)
        limit = _limit(yield_stress, hardening, accumulated)
        flow = _excess(trial, limit) / (3 * shear + hardening + kinematic)
        # Where nothing flows, the direction does not matter.
        direction = 1.5 * trial / (_excess(trial, limit) + limit)
        return {
            "plastic_strain": plastic_strain + flow * direction,
            "accumulated": _positive(accumulated) + flow,
        }

    def convexity(self, E: Ufl, nu: Ufl, yield_stress: Ufl, hardening: Ufl, kinematic: Ufl) -> Ufl:
        """Return the share of the elasticity that plastic flow leaves [-]."""
        slope = hardening + kinematic
        return slope / (slope + 3 * E / (2 * (1 + nu)))

    def modulus(self, E: Ufl, nu: Ufl, yield_stress: Ufl, hardening: Ufl, kinematic: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area]: Young's."""
        return E


def _back_stress(kinematic: Ufl, plastic_strain: Ufl) -> Ufl:
    """Return X, the middle of the yield surface [force/area], shape (3, 3)."""
    return 2 * kinematic / 3 * plastic_strain


def _limit(yield_stress: Ufl, hardening: Ufl, accumulated: Ufl) -> Ufl:
    """Return the yield stress of a body that has yielded before, ``y + H a``."""
    return yield_stress + hardening * _positive(accumulated)


def _positive(accumulated: Ufl) -> Ufl:
    """Return an accumulated plastic strain that is not below zero.

    The polynomial of a cell that has yielded in part is below zero beside its nodes,
    and ``y + H a`` < 0 would have no convex potential.
    """
    return ufl.max_value(accumulated, 0)


def _excess(deviator: Ufl, limit: Ufl) -> Ufl:
    """Return ``[q - limit]_+`` of a deviator, with derivatives at q = 0, too."""
    square = 1.5 * ufl.inner(deviator, deviator)
    return ufl.sqrt(ufl.max_value(square, limit**2)) - limit
