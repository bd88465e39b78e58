"""Declare von Mises plasticity with hardening by the convex potential of a load step.

Symbols: e deviator of the strain less the plastic strain p [-], q von Mises stress
``sqrt(3/2) |dev sigma|`` [force/area], G shear modulus, K bulk modulus, y yield stress,
H and H_k isotropic and kinematic hardening modulus, a accumulated plastic strain [-], k
yield stress at a.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, ClassVar, NamedTuple

import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl, Value
from erc_contact.scene.flow import Flow, Point, flow, least_slope, yield_stress_at
from erc_contact.scene.hardening import Hardening, HardeningCurve, Swift, Voce
from erc_contact.scene.material import (
    AXISYMMETRIC,
    PLANE_STRAIN,
    PLANE_STRESS,
    Elastic,
    check_numbers,
)

NO_YIELD = 1e100
"""Yield stress that no stress reaches, whatever the unit [force/area]."""

Slope = Value | HardeningCurve | Voce | Swift
"""Isotropic hardening: a slope, or a curve of the yield stress."""


@dataclass(frozen=True)
class Plastic:
    """Declare von Mises plasticity with isotropic and linear kinematic hardening.

    The body remembers its plastic strain p and the accumulated plastic strain a. In a
    load step, one of implicit Euler, the energy of the step with the new plastic strain
    at its best is convex in the strain. With the trial stress ``s = 2 G e - X``, the
    back stress ``X = 2/3 H_k p`` and the yield stress k(a) it is, with its conjugate::

        psi = K (tr eps)^2/2 + G |e|^2 - F([q(s) - k(a)]_+, 3 G + H_k),
        psi* = (tr sigma)^2/(18 K) + q(sigma)^2/(6 G) + sigma : p
               + F([q(sigma - X) - k(a)]_+, H_k).

    A strain e_T of heat, the same in all directions, makes ``tr eps - 3 e_T`` of tr eps
    and adds ``e_T tr sigma`` to psi*: it causes no plastic flow by itself.

    For linear hardening ``k = y + H a`` it is ``F(t, c) = t^2 / (2 (c + H))``; for a
    curve see ``erc_contact.scene.flow``.

    ``solve`` and ``adapt`` make one step from rest; ``evolve`` goes from step to step.
    On a mesh in the plane it is plane strain, or of a body of revolution. Beside it in
    a mapping of regions an :class:`Elastic` is a law that never yields.

    Args:
        E: Young's modulus [force/area], > 0: a number, a callable of x, or a mapping
            from the names of cell regions to either.
        nu: Poisson's ratio [-], in (-1, 1/2); likewise.
        yield_stress: Stress in tension at which yielding begins [force/area], > 0;
            likewise. It is left out with a curve, whose first stress it is.
        hardening: Isotropic part of the slope of the stress in tension over the plastic
            strain [force/area], >= 0; likewise. The tangent in tension is ``E h/(E +
            h)`` with the whole slope h, which must be > 0. Or a curve of the yield
            stress: an :class:`HardeningCurve`, :class:`Voce` or :class:`Swift`, or a
            mapping from regions to curves and numbers.
        kinematic: Kinematic part of this slope, >= 0; likewise. It moves the yield
            surface in the place of widening it.
        hypothesis: "plane strain" or "axisymmetric". A mesh in 3D does not ask.

    Raises:
        InputError: If a number is outside its range.

    Example:
        >>> ec.Plastic(E=210e3, nu=0.3, yield_stress=235.0, hardening=2100.0).hardening
        2100.0
        >>> law = ec.Plastic(E=210e3, nu=0.3, hardening=ec.Voce(235.0, 150.0, 20.0))
        >>> law.yield_stress
        235.0
    """

    E: Value | Mapping[str, Value]
    nu: Value | Mapping[str, Value]
    yield_stress: Value | Mapping[str, Value | None] | None = None
    hardening: Slope | Mapping[str, Slope] = 0.0
    kinematic: Value | Mapping[str, Value] = 0.0
    hypothesis: str = PLANE_STRAIN

    parameters: ClassVar[tuple[str, ...]] = ("E", "nu", "yield_stress", "hardening", "kinematic")
    expands: ClassVar[bool] = True
    state: ClassVar[Mapping[str, tuple[int, ...]]] = {"plastic_strain": (3, 3), "accumulated": ()}

    def __post_init__(self) -> None:
        """Check the numbers, and take the yield stress of a curve."""
        self._take_yield_stress()
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

    def _take_yield_stress(self) -> None:
        """Take the yield stress of curves.

        Raises:
            InputError: If a region has no yield stress, or two.
        """
        if self._has_curve:
            columns = self.values_in_space()
            object.__setattr__(self, "yield_stress", columns["yield_stress"])
        elif self.yield_stress is None:
            raise InputError(
                "Plastic: yield_stress is left out, and hardening is no curve. Give the yield "
                "stress [force/area], or hardening=ec.HardeningCurve(plastic_strain, stress)."
            )

    @property
    def _has_curve(self) -> bool:
        """Tell whether a region hardens by a curve."""
        given = self.hardening
        slopes = given.values() if isinstance(given, Mapping) else [given]
        return any(isinstance(slope, Hardening) for slope in slopes)

    def values_in_space(self) -> dict[str, Any]:
        """Return the parameters; of a curve its points, as many of them in each region.

        Raises:
            InputError: If a region has no yield stress, or two.
        """
        result = {name: getattr(self, name) for name in self.parameters}
        if not self._has_curve:
            return result
        del result["hardening"]
        if not isinstance(self.hardening, Mapping):
            curve = _curve_of("", self.hardening, self.yield_stress)
            return result | _parameters(curve, len(curve), straight=_is_straight(curve))
        curves = {}
        for region, slope in self.hardening.items():
            given = self.yield_stress
            if isinstance(given, Mapping):
                given = given.get(region)
            curves[region] = _curve_of(region, slope, given)
        count = max(len(curve) for curve in curves.values())
        straight = all(_is_straight(curve) for curve in curves.values())
        rows = {
            region: _parameters(curve, count, straight=straight) for region, curve in curves.items()
        }
        for name in next(iter(rows.values())):
            result[name] = {region: row[name] for region, row in rows.items()}
        return result

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
        elif not name.startswith("bend_") and not 0.0 <= low <= high < float("inf"):
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
        here = _at_point(**values)
        elastic_strain = here.elastic_strain(strain)
        beyond = here.beyond(here.trial(strain))
        of_shear = here.shear * ufl.inner(elastic_strain, elastic_strain)
        elastic = here.bulk / 2 * (ufl.tr(strain) - 3 * here.free_strain) ** 2 + of_shear
        return elastic - here.flow(beyond, 3 * here.shear + here.kinematic).energy

    def conjugate(self, stress: Ufl, **values: Ufl) -> Ufl:
        """Return psi* of a stress (3, 3) [force/area]."""
        here = _at_point(**values)
        deviator = ufl.dev(stress)
        of_shear = ufl.inner(deviator, deviator) / (4 * here.shear)
        elastic = (1 - 2 * here.nu) / (6 * here.E) * ufl.tr(stress) ** 2 + of_shear
        beyond = here.beyond(deviator - here.back_stress)
        of_flow = here.flow(beyond, here.kinematic).energy
        of_given = ufl.inner(deviator, here.plastic_strain) + here.free_strain * ufl.tr(stress)
        return elastic + of_given + of_flow

    def new_state(self, strain: Ufl, **values: Ufl) -> dict[str, Ufl]:
        """Return plastic strain and accumulated plastic strain after a step [-]."""
        here = _at_point(**values)
        trial = here.trial(strain)
        beyond = here.beyond(trial)
        flow = here.flow(beyond, 3 * here.shear + here.kinematic).amount
        # Where nothing flows, the direction does not matter.
        direction = 1.5 * trial / (beyond + here.limit)
        return {
            "plastic_strain": here.plastic_strain + flow * direction,
            "accumulated": here.positive_accumulated + flow,
        }

    def convexity(
        self, E: Ufl, nu: Ufl, kinematic: Ufl, free_strain: Ufl = 0.0, **hardening: Ufl
    ) -> Ufl:
        """Return the share of the elasticity that plastic flow leaves [-].

        A free strain moves the potential, and leaves its curvature.
        """
        slope = kinematic + least_slope(_points(**hardening))
        return slope / (slope + 3 * E / (2 * (1 + nu)))

    def modulus(self, E: Ufl, **others: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area]: Young's."""
        return E


class _Corner(NamedTuple):
    """Hold a point of a curve, and the parabola beyond it, as :class:`flow.Point`."""

    strain: float
    stress: float
    slope: float
    bend: float = 0.0


def _parameters(corners: Sequence[_Corner], count: int, *, straight: bool) -> dict[str, float]:
    """Return the parameters of a law that hardens by a curve, with ``count`` points.

    Points that are added lie beyond the last one, on its line.

    Args:
        corners: The points of the curve.
        count: The number of points in all regions.
        straight: Whether all curves are polygons: the law has no bends then.
    """
    points = list(corners)
    while len(points) < count:
        strain, stress, slope, _ = points[-1]
        points.append(_Corner(strain + 1.0, stress + slope, slope))
    result = {"yield_stress": points[0].stress}
    for i, point in enumerate(points):
        result[f"slope_{i}"] = point.slope
        if i > 0:
            result |= {f"strain_{i}": point.strain, f"stress_{i}": point.stress}
        if not straight:
            result[f"bend_{i}"] = point.bend
    return result


def _is_straight(corners: Sequence[_Corner]) -> bool:
    """Tell whether a curve is a polygon."""
    return not any(point.bend for point in corners)


def _curve_of(region: str, hardening: Slope, yield_stress: Any) -> list[_Corner]:
    """Return the points of the curve of a region.

    Raises:
        InputError: If it has not exactly one yield stress, or its numbers vary in it.
    """
    where = f" in {region!r}" if region else ""
    if isinstance(hardening, Hardening):
        curve: HardeningCurve = hardening.of_law()
        first = curve.stress[0]
        if yield_stress not in (None, first):
            raise InputError(
                f"Plastic: yield_stress{where} is {yield_stress!r}, and the curve begins with "
                f"{first:g}. Leave yield_stress out: it is the first stress of the curve."
            )
        slopes, bends = (values.tolist() for values in curve.derivatives())
        columns = zip(curve.plastic_strain, curve.stress, slopes, bends, strict=True)
        return [_Corner(*column) for column in columns]
    if not isinstance(hardening, Real) or not isinstance(yield_stress, Real):
        raise InputError(
            f"Plastic: beside a curve, yield_stress{where} is {yield_stress!r} and hardening "
            f"{hardening!r}; give a number for each, or a curve for both."
        )
    if not hardening > 0.0:
        raise InputError(
            f"Plastic: beside a curve, hardening{where} is {hardening:g}; it must be > 0 "
            "[force/area], e.g. 1% of E."
        )
    return [_Corner(0.0, float(yield_stress), float(hardening))]


def _points(yield_stress: Ufl, hardening: Ufl = None, **of_curve: Ufl) -> list[Point]:
    """Return the points of hardening of parameters, UFL; see :class:`Plastic`.

    Linear hardening has a slope alone.
    """
    nothing = ufl.as_ufl(0.0)
    if hardening is not None:
        return [Point(nothing, yield_stress, hardening, nothing)]
    points = []
    for i in range(sum(name.startswith("slope_") for name in of_curve)):
        strain = of_curve[f"strain_{i}"] if i else nothing
        stress = of_curve[f"stress_{i}"] if i else yield_stress
        bend = of_curve.get(f"bend_{i}", nothing)
        points.append(Point(strain, stress, of_curve[f"slope_{i}"], bend))
    return points


def _at_point(
    E: Ufl,
    nu: Ufl,
    kinematic: Ufl,
    plastic_strain: Ufl,
    accumulated: Ufl,
    free_strain: Ufl = 0.0,
    **hardening: Ufl,
) -> _AtPoint:
    """Return parameters and state of a point."""
    points = _points(**hardening)
    return _AtPoint(E, nu, points, kinematic, plastic_strain, accumulated, free_strain)


@dataclass(frozen=True, eq=False)
class _AtPoint:
    """Hold parameters and state of a point, UFL; see :class:`Plastic`."""

    E: Ufl
    nu: Ufl
    points: list[Point]
    kinematic: Ufl
    plastic_strain: Ufl
    accumulated: Ufl
    free_strain: Ufl

    @property
    def shear(self) -> Ufl:
        """Return G [force/area]."""
        return self.E / (2 * (1 + self.nu))

    @property
    def bulk(self) -> Ufl:
        """Return K [force/area]."""
        return self.E / (3 * (1 - 2 * self.nu))

    @property
    def back_stress(self) -> Ufl:
        """Return X, the middle of the yield surface [force/area], shape (3, 3)."""
        return 2 * self.kinematic / 3 * self.plastic_strain

    @property
    def positive_accumulated(self) -> Ufl:
        """Return a, not below zero [-].

        The polynomial of a cell that has yielded in part is below zero beside its
        nodes, and a yield stress < 0 would have no convex potential.
        """
        return ufl.max_value(self.accumulated, 0)

    @property
    def limit(self) -> Ufl:
        """Return k(a), the yield stress of a body that has yielded before."""
        return yield_stress_at(self.points, self.positive_accumulated)

    def flow(self, beyond: Ufl, c: Ufl) -> Flow:
        """Return the flow at a stress beyond the limit; see :func:`.flow.flow`."""
        return flow(self.points, self.positive_accumulated, beyond, c)

    def elastic_strain(self, strain: Ufl) -> Ufl:
        """Return e, the deviator of a strain less the plastic strain [-], (3, 3)."""
        return ufl.dev(strain) - self.plastic_strain

    def trial(self, strain: Ufl) -> Ufl:
        """Return s, the stress without flow less the back stress, shape (3, 3)."""
        return 2 * self.shear * self.elastic_strain(strain) - self.back_stress

    def beyond(self, deviator: Ufl) -> Ufl:
        """Return ``[q - k(a)]_+`` of a deviator, with derivatives at q = 0, too."""
        square = 1.5 * ufl.inner(deviator, deviator)
        return ufl.sqrt(ufl.max_value(square, self.limit**2)) - self.limit
