"""Declare how the yield stress grows with the plastic strain: curves, Voce, Swift.

A curve goes through points of plastic strain and yield stress, as a line or a parabola
between each two of them. The load step of a plastic law with it has a closed potential
(:mod:`erc_contact.scene.flow`), so that the bound of the error is proved as for linear
hardening.

Symbols: a accumulated plastic strain [-], k yield stress at a [force/area].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from erc_contact.base.exceptions import InputError

LEAST_SLOPE = 0.1
"""Least slope of a curve over its first yield stress [-].

Where k does not grow, psi* is infinite beyond it, and no stress near it has an error.
"""
MOST_POINTS = 60
"""Greatest number of points of a curve: UFL follows no more of them."""
MOST_PIECES = 24
"""Greatest number of pieces in the place of a function."""
NEAR_ENOUGH = 2e-3
"""Share of k by which so few pieces may miss a function [-]."""
SAMPLES = 4000
"""Number of plastic strains at which a function is sampled."""
ROUND_OFF = 1e-12
"""Share of a quarter of a rise by which a bulge may be beyond it [-]."""
MOST_BENT = 0.999
"""Greatest bulge of a law, over the bulge with the least slope at an end [-].

So the slope at an end is at least 1/2000 of the slope at the other end, and the square
of a slope whose root the flow takes (:mod:`erc_contact.scene.flow`) keeps nine digits.
"""
FIRST_SAMPLE = 1e-7
"""Least plastic strain of these above zero, over the greatest [-]."""


class Hardening:
    """Let the yield stress be a function of the accumulated plastic strain."""

    def of_law(self) -> HardeningCurve:
        """Return the curve that a plastic law takes."""
        raise NotImplementedError


@dataclass(frozen=True)
class HardeningCurve(Hardening):
    """Declare isotropic hardening by points of a measured curve.

    The first stress is the yield stress. Beyond the last point the stress stays, as in
    CalculiX and Abaqus. But psi* is infinite beyond a stress that does not grow: from
    each point the curve rises by at least a tenth of its first stress per unit of
    plastic strain, by 0.1% of it along a plastic strain of 1% (:meth:`of_law`).

    A table of the place, ``ec.table(x, values)``, in the place of a curve is a slope
    that varies in the body.

    Args:
        plastic_strain: True plastic strains in tension [-], from 0 on, increasing,
            shape (n,), with 2 <= n <= 60.
        stress: Yield stresses there [force/area], > 0, never decreasing, shape (n,).
        bulge: What the curve is above the line between two points, in the middle
            between them [force/area], shape (n-1,): it is a parabola there, which must
            not decrease. By default it is straight.

    Raises:
        InputError: If the points are no such curve.

    Example:
        >>> curve = ec.HardeningCurve([0.0, 0.02, 0.1], [235.0, 280.0, 340.0])
        >>> law = ec.Plastic(E=210e3, nu=0.3, hardening=curve)
        >>> law.yield_stress
        235.0
    """

    plastic_strain: Sequence[float]
    stress: Sequence[float]
    bulge: Sequence[float] = ()

    def __post_init__(self) -> None:
        """Check the points."""
        for name in ("plastic_strain", "stress", "bulge"):
            object.__setattr__(self, name, _numbers(name, getattr(self, name)))
        strain = np.array(self.plastic_strain)
        stress = np.array(self.stress)
        _check_sizes(len(strain), len(stress))
        if strain[0] != 0.0 or (np.diff(strain) <= 0.0).any():
            raise InputError(
                f"HardeningCurve: plastic_strain is {self.plastic_strain}; it must begin with 0, "
                "where the stress is the yield stress, and increase. Take the elastic strain "
                "stress/E from total strains."
            )
        _check_stress(strain, stress)
        if not self.bulge:
            object.__setattr__(self, "bulge", (0.0,) * (len(stress) - 1))
        _check_bulge(stress, np.array(self.bulge))

    @classmethod
    def through(
        cls, stress: Callable[[np.ndarray], np.ndarray], up_to: float = 1.0
    ) -> HardeningCurve:
        """Make the curve of a function k(a), of parabolas between points of it.

        They are as many as bring the curve to 0.2% of k, or 24. The law of the body is
        this curve, and the error is certified for it.

        Args:
            stress: Yield stresses [force/area] of accumulated plastic strains [-], both
                numpy arrays of shape (m,).
            up_to: Plastic strain at which the curve ends [-], > 0.

        Raises:
            InputError: If the function is no curve, see :class:`HardeningCurve`.

        Example:
            >>> curve = ec.HardeningCurve.through(lambda a: 200.0 + 300.0 * a**0.5)
            >>> len(curve.stress), round(curve.stress[-1], 9)
            (16, 500.0)
        """
        if not 0.0 < up_to < np.inf:
            raise InputError(f"HardeningCurve: up_to is {up_to!r}; it must be > 0 and finite [-].")
        strain = np.append(0.0, np.geomspace(FIRST_SAMPLE, 1.0, SAMPLES)) * up_to
        value = np.asarray(stress(strain), dtype=float)
        if value.shape != strain.shape or not np.isfinite(value).all():
            raise InputError(
                "HardeningCurve: the function k(a) must return a finite stress for each plastic "
                f"strain from 0 to {up_to:g}; write it with numpy, for arrays."
            )
        _check_stress(strain, value)
        return _through_samples(strain, value)

    def __call__(self, strain: Any) -> np.ndarray:
        """Return the yield stress at accumulated plastic strains [force/area].

        Beyond the last point it stays.
        """
        points = np.array(self.plastic_strain)
        inside = np.clip(strain, 0.0, points[-1])
        piece = np.clip(np.searchsorted(points, inside) - 1, 0, len(points) - 2)
        part = (inside - points[piece]) / np.diff(points)[piece]
        above = 4 * np.array(self.bulge)[piece] * part * (1 - part)
        return np.asarray(np.interp(inside, points, self.stress) + above)

    def of_law(self) -> HardeningCurve:
        """Return the curve with the least slope that a law needs.

        A stress that grows less is raised, until the curve has grown beyond it.

        Example:
            >>> flat = ec.HardeningCurve([0.0, 0.1, 0.2], [50.0, 50.0, 90.0])
            >>> flat.of_law().stress
            (50.0, 50.5, 90.0)
        """
        least = self.stress[0] * LEAST_SLOPE * np.array(self.plastic_strain)
        given = np.array(self.stress)
        above = np.maximum.accumulate(given - least)
        raised = np.where(above > given - least, above + least, given)
        most = MOST_BENT * np.maximum(np.diff(raised - least), 0.0) / 4
        bulge = np.clip(self.bulge, -most, most)
        return HardeningCurve(self.plastic_strain, raised.tolist(), bulge.tolist())

    @property
    def last_slope(self) -> float:
        """Return the slope of :meth:`of_law` beyond its last point [force/area]."""
        return self.stress[0] * LEAST_SLOPE

    def derivatives(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the slopes beyond the points, and the second derivatives there.

        Returns:
            Both [force/area], shape (n,); beyond the last point the curve is straight.
        """
        widths = np.diff(self.plastic_strain)
        bulge = np.array(self.bulge)
        slopes = (np.diff(self.stress) + 4 * bulge) / widths
        return np.append(slopes, self.last_slope), np.append(-8 * bulge / widths**2, 0.0)


@dataclass(frozen=True)
class Voce(Hardening):
    """Declare hardening that saturates: ``k = y + q (1 - exp(-b a)) + h a``.

    The body takes it as parabolas (:meth:`HardeningCurve.through`), which miss it by
    0.2% of k at most.

    Args:
        yield_stress: The yield stress y [force/area], > 0.
        saturation: What it grows by in the end, q [force/area], >= 0.
        rate: How fast it grows, b [-], > 0.
        slope: Slope h of the linear part [force/area], >= 0.

    Raises:
        InputError: If a number is outside its range.

    Reference:
        Voce (1948), The relationship between stress and strain for homogeneous
        deformation, Journal of the Institute of Metals 74, 537-562.

    Example:
        >>> ec.Voce(yield_stress=200.0, saturation=150.0, rate=20.0)(0.1).round(6)
        np.float64(329.699708)
    """

    yield_stress: float
    saturation: float
    rate: float
    slope: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check_positive("Voce", yield_stress=self.yield_stress, rate=self.rate)
        for name in ("saturation", "slope"):
            _check_not_negative("Voce", name, getattr(self, name))

    def __call__(self, strain: Any) -> Any:
        """Return the yield stress at accumulated plastic strains [force/area]."""
        saturated = 1.0 - np.exp(-self.rate * np.asarray(strain))
        return self.yield_stress + self.saturation * saturated + self.slope * np.asarray(strain)

    def of_law(self) -> HardeningCurve:
        """Return the curve that a plastic law takes."""
        return HardeningCurve.through(self).of_law()


@dataclass(frozen=True)
class Swift(Hardening):
    """Declare hardening by a power of the strain: ``k = K (a_0 + a)^n``.

    The body takes it as parabolas (:meth:`HardeningCurve.through`), which miss it by
    0.2% of k at most where ``a_0 >= 1e-3``.

    Args:
        strength: K [force/area], > 0.
        offset: a_0 [-], > 0; the yield stress is ``K a_0^n``.
        exponent: n [-], in (0, 1].

    Raises:
        InputError: If a number is outside its range.

    Reference:
        Swift (1952), Plastic instability under plane stress, Journal of the Mechanics
        and Physics of Solids 1, 1-18, equation (5).

    Example:
        >>> ec.Swift(strength=500.0, offset=0.01, exponent=0.2)(0.09).round(6)
        np.float64(315.478672)
    """

    strength: float
    offset: float
    exponent: float

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check_positive("Swift", strength=self.strength, offset=self.offset, exponent=self.exponent)
        if self.exponent > 1.0:
            raise InputError(f"Swift: exponent is {self.exponent:g}; it must be <= 1.")

    def __call__(self, strain: Any) -> Any:
        """Return the yield stress at accumulated plastic strains [force/area]."""
        return self.strength * (self.offset + np.asarray(strain)) ** self.exponent

    def of_law(self) -> HardeningCurve:
        """Return the curve that a plastic law takes."""
        return HardeningCurve.through(self).of_law()


def _numbers(name: str, values: Any) -> tuple[float, ...]:
    """Return a row of finite numbers as a tuple."""
    try:
        row = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        row = np.array(np.nan)
    if row.ndim != 1 or not np.isfinite(row).all():
        raise InputError(
            f"HardeningCurve: {name} is {values!r}; give a row of finite numbers. A function k(a) "
            "becomes a curve by ec.HardeningCurve.through(k)."
        )
    return tuple(row.tolist())


def _check_sizes(points: int, values: int) -> None:
    """Check the number of points."""
    if points != values:
        raise InputError(
            f"HardeningCurve: there are {points} plastic strains and {values} stresses; give "
            "one stress for each strain."
        )
    if not 2 <= points <= MOST_POINTS:
        raise InputError(
            f"HardeningCurve: there are {points} points; give 2 to {MOST_POINTS}. For a single "
            "slope give numbers, yield_stress= and hardening=."
        )


def _check_stress(strain: np.ndarray, stress: np.ndarray) -> None:
    """Check that a stress begins above zero and never falls."""
    if stress[0] <= 0.0:
        raise InputError(
            f"HardeningCurve: the first stress is {stress[0]:g}; it is the yield stress, which "
            "must be > 0 [force/area]."
        )
    falls = np.flatnonzero(np.diff(stress) < 0.0)
    if len(falls):
        at = falls[0]
        raise InputError(
            f"HardeningCurve: the stress falls from {stress[at]:g} to {stress[at + 1]:g} at a "
            f"plastic strain of {strain[at + 1]:g}. Where it falls, the potential is not "
            "convex, no error can be certified, and the strain localises with the mesh. End "
            "the curve at its greatest stress."
        )


def _check_bulge(stress: np.ndarray, bulge: np.ndarray) -> None:
    """Check that parabolas between points do not fall."""
    if bulge.shape != (len(stress) - 1,):
        raise InputError(
            f"HardeningCurve: bulge has {len(bulge)} values; give one for each of the "
            f"{len(stress) - 1} pieces between points."
        )
    rises = np.diff(stress)
    falls = np.flatnonzero(abs(bulge) > rises / 4 * (1 + ROUND_OFF))
    if len(falls):
        piece = falls[0]
        raise InputError(
            f"HardeningCurve: bulge[{piece}] is {bulge[piece]:g}; between points whose stress "
            f"grows by {rises[piece]:g} a parabola falls where it is beyond a quarter of this."
        )


def _check_positive(law: str, **numbers: float) -> None:
    """Check that numbers are > 0 and finite."""
    for name, value in numbers.items():
        if not 0.0 < value < np.inf:
            raise InputError(
                f"{law}: {name.replace('_', ' ')} is {value!r}; it must be > 0 and finite."
            )


def _check_not_negative(law: str, name: str, value: float) -> None:
    """Check that a number is >= 0 and finite."""
    if not 0.0 <= value < np.inf:
        raise InputError(f"{law}: {name} is {value!r}; it must be >= 0 and finite.")


def _through_samples(strain: np.ndarray, stress: np.ndarray) -> HardeningCurve:
    """Return a curve of few pieces near samples of a function, shapes (m,).

    A new point is set where the curve misses the function most.
    """
    ends = np.array([0, len(strain) - 1])
    while True:
        curve = _through(strain, stress, ends)
        missed = abs(curve(strain) / stress - 1.0)
        if missed.max() <= NEAR_ENOUGH or len(ends) > MOST_PIECES:
            return curve
        ends = np.sort(np.append(ends, missed.argmax()))


def _through(strain: np.ndarray, stress: np.ndarray, ends: np.ndarray) -> HardeningCurve:
    """Return the curve through some samples of a function.

    A parabola between two of them has half the difference of its end slopes from the
    function. Where it would fall, it has the greatest difference with which it grows.

    Args:
        strain: Plastic strains of the samples [-], shape (m,).
        stress: Yield stresses of the samples [force/area], shape (m,).
        ends: The samples, shape (n,).
    """
    slopes = np.diff(stress) / np.diff(strain)
    widths = np.diff(strain[ends])
    rises = np.diff(stress[ends])
    # A function may have kinks at the ends: each piece takes the slope on its side.
    first = slopes[ends[:-1]]
    last = slopes[ends[1:] - 1]
    bulge = np.clip((first - last) * widths / 8, -rises / 4, rises / 4)
    return HardeningCurve(strain[ends].tolist(), stress[ends].tolist(), bulge.tolist())
