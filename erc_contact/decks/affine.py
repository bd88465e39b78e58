"""Hold values that are linear in the position, and fit them to values at points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from erc_contact.scene.remote import moments_of, slopes_of

ROUND_OFF = 1e-6
"""Deviation from a linear function that numbers of a deck have, to their size [-]."""


@dataclass(frozen=True)
class Affine:
    """Hold a value that is linear in the position, a callable of x.

    Attributes:
        at_origin: Its value at the origin.
        slopes: Its derivatives along the coordinates, shape (d,).
    """

    at_origin: float
    slopes: tuple[float, ...]

    def __call__(self, x: Any) -> Any:
        """Return the value at a position."""
        value = self.at_origin
        for i, slope in enumerate(self.slopes):
            if slope:
                value = value + slope * x[i]
        return value

    def times(self, factor: float) -> Affine:
        """Return the value times a factor."""
        return Affine(factor * self.at_origin, tuple(factor * slope for slope in self.slopes))

    def plus(self, summand: Affine) -> Affine:
        """Return the sum of two values."""
        slopes = tuple(a + b for a, b in zip(self.slopes, summand.slopes, strict=True))
        return Affine(self.at_origin + summand.at_origin, slopes)

    @property
    def value(self) -> float | Affine:
        """Return a number where the value is constant, else the callable."""
        return self if any(self.slopes) else self.at_origin


def constant(value: float, d: int) -> Affine:
    """Return a value that does not vary, in d dimensions."""
    return Affine(float(value), (0.0,) * d)


def fitted(x: np.ndarray, values: np.ndarray) -> Affine | None:
    """Return the linear function that has values at points; None if there is none.

    Args:
        x: Points [length], shape (n, d).
        values: Values there, shape (n,).
    """
    d = x.shape[1]
    if np.ptp(values) == 0.0:
        return constant(float(values[0]), d)
    middle = x.mean(axis=0)
    matrix = np.column_stack([np.ones(len(x)), x - middle])
    # The least solution has no slope along which the points do not vary.
    solution = np.linalg.lstsq(matrix, values, rcond=1e-9)[0]
    if abs(matrix @ solution - values).max() > ROUND_OFF * abs(values).max():
        return None
    slopes = [float(slope) for slope in solution[1:]]
    small = ROUND_OFF * max(map(abs, slopes))
    slopes = [slope if abs(slope) > small else 0.0 for slope in slopes]
    return Affine(float(solution[0] - middle @ slopes), tuple(slopes))


def linear_traction(
    force: npt.ArrayLike, moment: npt.ArrayLike, points: np.ndarray, measures: np.ndarray
) -> list[Affine]:
    """Return the traction ``F/A + w x (x - c)`` with a resultant, by components.

    c is the centre of the area, and w is such that its moment is M about c.

    Args:
        force: Resultant F [force], d numbers.
        moment: Moment M about the origin [force length], one number in the plane, else
            three.
        points: Corners of edges or triangles [length], shape (m, d, d).
        measures: Their lengths or areas, shape (m,).
    """
    d = points.shape[2]
    area = measures.sum()
    centre = (measures[:, None] * points.mean(axis=1)).sum(axis=0) / area
    arms = points - centre
    sums = arms.sum(axis=1)
    squares = np.einsum("mki,mkj->mij", arms, arms) + np.einsum("mi,mj->mij", sums, sums)
    second = np.einsum("m,mij->ij", measures / (d * (d + 1)), squares)
    f = np.asarray(force, dtype=float)
    mean = f / area
    about = np.atleast_1d(moment) - moments_of(centre, f)
    spin = slopes_of(second, about)
    small = ROUND_OFF * abs(mean).max() / np.sqrt(area if d == 3 else area**2)
    spin = np.where(abs(spin) > small, spin, 0.0)
    result = []
    for i in range(d):
        slopes = tuple(float(value) for value in spin[i])
        result.append(Affine(float(mean[i] - spin[i] @ centre), slopes))
    return result
