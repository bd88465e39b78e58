"""Declare how the yield stress grows with the plastic strain: curves, Voce, Swift.

A curve is a polygon through points of plastic strain and yield stress. The load step of
a plastic law with it has a closed potential (:mod:`erc_contact.scene.flow`), so that
the bound of the error is proved as for linear hardening.

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
PIECES = 24
"""Number of pieces of the polygon in the place of a function."""
SAMPLES = 4000
"""Number of plastic strains at which the bend of a function is sampled."""
FIRST_SAMPLE = 1e-7
"""Least plastic strain of these above zero, over the greatest [-]."""
EVEN_SHARE = 0.1
"""Share of the pieces that are spread evenly, whatever the bend [-]."""


class Hardening:
    """Let the yield stress be a function of the accumulated plastic strain."""

    def polygon(self) -> HardeningCurve:
        """Return the curve that a plastic law takes."""
        raise NotImplementedError


@dataclass(frozen=True)
class HardeningCurve(Hardening):
    """Declare isotropic hardening by points of a measured curve, linear between them.

    The first stress is the yield stress. Beyond the last point the stress stays, as in
    CalculiX and Abaqus. But psi* is infinite beyond a stress that does not grow: from
    each point the curve rises by at least a tenth of its first stress per unit of
    plastic strain, by 0.1% of it along a plastic strain of 1% (:meth:`polygon`).

    A table of the place, ``ec.table(x, values)``, in the place of a curve is a slope
    that varies in the body.

    Args:
        plastic_strain: True plastic strains in tension [-], from 0 on, increasing,
            shape (n,), with 2 <= n <= 60.
        stress: Yield stresses there [force/area], > 0, never decreasing, shape (n,).

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

    def __post_init__(self) -> None:
        """Check the points."""
        for name in ("plastic_strain", "stress"):
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

    @classmethod
    def through(
        cls, stress: Callable[[np.ndarray], np.ndarray], up_to: float = 1.0
    ) -> HardeningCurve:
        """Make the curve of a function k(a): 24 pieces between points of it.

        They are short where the function bends. The law of the body is this polygon,
        and the error is certified for it; of a concave function it lies below the
        function.

        Args:
            stress: Yield stresses [force/area] of accumulated plastic strains [-], both
                numpy arrays of shape (m,).
            up_to: Plastic strain at which the curve ends [-], > 0.

        Raises:
            InputError: If the function is no curve, see :class:`HardeningCurve`.

        Example:
            >>> curve = ec.HardeningCurve.through(lambda a: 200.0 + 300.0 * a**0.5)
            >>> len(curve.stress), round(curve.stress[-1], 9)
            (25, 500.0)
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
        ends = _ends_of_pieces(strain, value)
        return cls(strain[ends].tolist(), value[ends].tolist())

    def polygon(self) -> HardeningCurve:
        """Return the curve with the least slope that a law needs.

        A stress that grows less is raised, until the curve has grown beyond it.

        Example:
            >>> flat = ec.HardeningCurve([0.0, 0.1, 0.2], [50.0, 50.0, 90.0])
            >>> flat.polygon().stress
            (50.0, 50.5, 90.0)
        """
        least = self.stress[0] * LEAST_SLOPE * np.array(self.plastic_strain)
        given = np.array(self.stress)
        above = np.maximum.accumulate(given - least)
        raised = np.where(above > given - least, above + least, given)
        return HardeningCurve(self.plastic_strain, raised.tolist())

    @property
    def last_slope(self) -> float:
        """Return the slope of :meth:`polygon` beyond its last point [force/area]."""
        return self.stress[0] * LEAST_SLOPE


@dataclass(frozen=True)
class Voce(Hardening):
    """Declare hardening that saturates: ``k = y + q (1 - exp(-b a)) + h a``.

    The body takes it as a polygon (:meth:`HardeningCurve.through`), which is below it
    by 0.2% of k at most.

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

    def polygon(self) -> HardeningCurve:
        """Return the curve that a plastic law takes."""
        return HardeningCurve.through(self).polygon()


@dataclass(frozen=True)
class Swift(Hardening):
    """Declare hardening by a power of the strain: ``k = K (a_0 + a)^n``.

    The body takes it as a polygon (:meth:`HardeningCurve.through`), which is below it
    by 0.4% of k at most where ``a_0 >= 1e-3``.

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

    def polygon(self) -> HardeningCurve:
        """Return the curve that a plastic law takes."""
        return HardeningCurve.through(self).polygon()


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


def _ends_of_pieces(strain: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Return the samples between which the pieces of a function lie, (PIECES + 1,).

    The distance of a piece of length h from the function is ``h^2 |k''|/8`` at most. It
    is the same share of k in all pieces where h is like ``(|k''|/k)^-1/2``.
    """
    step = np.diff(strain)
    slope = np.diff(stress) / step
    bend = 2 * abs(np.diff(slope)) / (strain[2:] - strain[:-2])
    of_bend = np.sqrt(np.append(bend[0], bend) / abs(stress[1:])) * step
    of_length = step / strain[-1]
    parts = EVEN_SHARE * of_length
    parts += (1 - EVEN_SHARE) * of_bend / max(of_bend.sum(), np.finfo(float).tiny)
    reached = np.append(0.0, np.cumsum(parts))
    wanted = np.linspace(0.0, reached[-1], PIECES + 1)
    return np.unique(np.abs(reached[:, None] - wanted).argmin(axis=0))
