"""Find where a contact ends, inside a facet: the zero of its pressure.

With the distance xi from the end of a contact of smooth bodies,

    p ~ xi^(1/2) inside,        F = int p ~ xi^(3/2),        gap ~ xi^(3/2) outside,

so ``F^(2/3)``, of the force F between the end and a node, and ``gap^(2/3)`` are
straight lines near the end, with their zero there. In the half plane they are, up to a
factor, one analytic function on both sides. F is taken because the forces of facets
balance where their pressures alternate.

Four lines are laid through nodes by least squares: on both sides, on each side alone,
and on both sides through more nodes. The end is the mean of their zeros. Its margin is
the range of the zeros and three tenths of the distance of nodes. It is an estimate, no
bound; ``benchmarks/contact_areas.py`` tells how often it holds. Where the pressure does
not vanish, as under the edge of a punch, all zeros are far outside: the contact then
ends with its part.

In 3D distances become areas: the sizes are the areas of layers of facets along the
border of the contact, the forces act on these layers, and there is no gap outside.

Symbols: p pressure, F force, n facets, k degree.

Source: K. L. Johnson, "Contact Mechanics", sections 2.7 and 5.1, on the behaviour at
the end; the lines are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FACETS = {1: 3, 2: 2}
"""Number of facets on each side whose nodes give a line, by degree."""
BEFORE_LAST = 0.3
"""Distance of the likely end inwards from the end of the closed facets [facets].

Only weights of nodes need it.
"""
LIMITS = (-1.0, 0.75)
"""Where a contact may end, outwards from the end of the closed facets [facets]."""
MOST_BEYOND = 0.25
"""What zeros beyond these limits add to a margin at most [facets]."""
LEAST_MARGIN = 0.3
"""Margin of lines that all have the same zero [distance of nodes]."""


@dataclass(frozen=True)
class Estimate:
    """Hold a number with a margin, an estimate of what it is off.

    Attributes:
        value: The number.
        margin: How far it may be off, to either side.

    Example:
        >>> print(ec.results.Estimate(1.00963, 0.0042))
        1.0096 +- 0.0042
    """

    value: float
    margin: float

    def __str__(self) -> str:
        """Write the number with as many digits as its margin tells."""
        if not self.margin > 0:
            return f"{self.value:.6g}"
        # Over an area that may be zero a mean pressure has no limit.
        is_finite = np.isfinite(self.margin)
        decimals = 1 - int(np.floor(np.log10(self.margin))) if is_finite else 0
        if not is_finite or not 0 <= decimals <= 12:
            return f"{self.value:.6g} +- {self.margin:.2g}"
        return f"{self.value:.{decimals}f} +- {self.margin:.{decimals}f}"

    @property
    def low(self) -> float:
        """Return the least number within the margin."""
        return self.value - self.margin

    @property
    def high(self) -> float:
        """Return the greatest number within the margin."""
        return self.value + self.margin


def end_of(
    sizes: np.ndarray,
    forces: np.ndarray,
    distances: np.ndarray,
    gaps: np.ndarray,
    count: int,
    degree: int,
) -> Estimate:
    """Estimate where a contact ends, outwards from the end of its closed facets.

    Args:
        sizes: Lengths of closed facets from the end inwards, or areas of layers of them
            [length or area], shape (n,), at least one.
        forces: Forces on them, in the plane and of rings per thickness, shape (n,).
        distances: Distances of nodes outside from the end of the closed facets
            [length], shape (m,).
        gaps: Gap that is left at these nodes [length], shape (m,).
        count: Number of facets on each side of a line; the wider line has one more.
        degree: Degree of the displacement.

    Returns:
        The distance [length or area], < 0 where the contact ends inside them.
    """
    unit = sizes[0] / degree  # the distance of nodes
    inside = np.stack([-np.cumsum(sizes) / unit, np.cumsum(forces)])
    outside = np.stack([distances / unit, gaps])
    # On both sides the function of a line falls outwards.
    inside[1] = np.maximum(inside[1], 0.0) ** (2 / 3)
    outside[1] = np.maximum(outside[1], 0.0) ** (2 / 3)
    nothing = np.zeros((2, 0))
    near_inside, near_outside = inside[:, :count], outside[:, : count * degree]
    pieces = [
        (near_inside, near_outside),
        (near_inside, nothing),
        (nothing, near_outside),
        (inside[:, : count + 1], outside[:, : (count + 1) * degree]),
    ]
    zeros = np.array([_zero(*piece, degree) for piece in pieces])
    zeros = zeros[np.isfinite(zeros)]
    limits = degree * np.array(LIMITS)
    found = np.clip(zeros, *limits) if len(zeros) else limits
    # Lines with a zero out of reach are none of a smooth contact.
    beyond = float(abs(zeros - found).mean()) if len(zeros) else 0.0
    margin = float(np.ptp(found)) + LEAST_MARGIN + min(beyond, degree * MOST_BEYOND)
    return Estimate(unit * float(found.mean()), unit * margin)


def _zero(inside: np.ndarray, outside: np.ndarray, degree: int) -> float:
    """Return the zero of a line through nodes inside and outside, or nan.

    On both sides the line is ``F^(2/3)`` inside and ``- c gap^(2/3)`` outside, with an
    unknown factor c.

    Args:
        inside: Places and ``F^(2/3)`` of nodes inside, shape (2, n).
        outside: Places and ``gap^(2/3)`` of nodes outside, shape (2, m).
        degree: Degree of the displacement.
    """
    x = np.concatenate([inside[0], outside[0]])
    columns = [np.ones_like(x), x]
    values = np.concatenate([inside[1], -outside[1]])
    if inside.size and outside.size:
        columns.append(np.concatenate([np.zeros_like(inside[1]), outside[1]]))
        values = np.concatenate([inside[1], np.zeros_like(outside[1])])
    matrix = np.stack(columns, axis=1)
    if len(x) < len(columns):
        return np.nan
    # Near the end the nodes have the greatest errors, and far from it lines are curved.
    distance = abs(x + BEFORE_LAST * degree)
    weights = distance**2 / (1 + distance**2) / (1 + distance) ** 2
    scale = abs(matrix).max(axis=0)
    scale[scale == 0.0] = 1.0
    weighted = weights[:, None] * matrix / scale
    constant, slope, *_ = np.linalg.lstsq(weighted, weights * values)[0] / scale
    return float(-constant / slope) if slope < 0 else np.nan
