"""Solve contacts of infinite layers by Fourier integrals of the unknown pressure.

A layer of thickness h lies without friction on a rigid base, or on a second layer that
is bonded to one. A pressure q = 1 acts on its top where |x| < a. In terms of the
wave number xi, with t = xi h/2, the pressures q and p on both sides move them by

    v_top = K (s S + d A),  v_foot = K (d A - s S),  K = 2 (1 - nu^2)/(E xi),
    s = (q + p)/2,  d = (q - p)/2,
    S = (cosh 2t - 1)/(sinh 2t + 2t),  A = (cosh 2t + 1)/(sinh 2t - 2t),

downwards, and the bonded layer by ``K' p L`` with k = 3 - 4 nu', t = xi h' and

    L = (2 k sinh 2t - 4t)/(2 k cosh 2t + 4 t^2 + k^2 + 1).

The pressure is ``sqrt(1 - z^2)`` times a sum of Chebyshev polynomials U_2n, z = x/b.
Where there is contact both sides have one slope. For large xi the equation tends to the
equation of half-planes, whose integrals are Chebyshev polynomials T; what is left
decays fast.

Source: L. M. Keer, J. Dundurs, K. C. Tsai, J. Appl. Mech. 39 (1972).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

TERMS = 14
"""Number of terms of the pressure."""
SECOND_GUESS = 1.1
"""Ratio of a second guess of the half-width to the first [-]."""
STEP = 1e-9
"""Relative change of the half-width that ends its iteration; round-off is below [-]."""


@dataclass(frozen=True)
class Layer:
    """Hold thickness [length], Young's modulus [force/area] and Poisson's ratio."""

    thickness: float
    E: float
    nu: float

    @property
    def compliance(self) -> float:
        """Return ``2 (1 - nu^2)/E`` [area/force]."""
        return 2 * (1 - self.nu**2) / self.E


@dataclass(frozen=True)
class Pressed:
    """Hold half-width, pressure in the middle, strain energy and force of a contact."""

    half_width: float
    peak: float
    energy: float
    force: float


def points_of(edges: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points and weights of Gauss on all intervals between edges."""
    x, w = np.polynomial.legendre.leggauss(count)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (x + 1)).ravel(), (half * w).ravel()


def free_layer(xi: np.ndarray, layer: Layer) -> tuple[np.ndarray, np.ndarray]:
    """Return S and A [-], both tending to 1."""
    t = np.minimum(xi * layer.thickness / 2, 300.0)
    decay = np.exp(-2 * t)
    even = (1 - decay) ** 2 / (1 - decay**2 + 4 * t * decay)
    # sinh 2t - 2t cancels for small t, where its series is exact to round-off.
    small = np.minimum(2 * t, 0.1)
    series = 2 * decay * (small**3 / 6 + small**5 / 120 + small**7 / 5040 + small**9 / 362880)
    below = np.where(2 * t < 0.1, series, 1 - decay**2 - 4 * t * decay)
    return even, (1 + decay) ** 2 / below


def bonded_layer(xi: np.ndarray, layer: Layer) -> np.ndarray:
    """Return L [-], which tends to 1."""
    t = np.minimum(xi * layer.thickness, 300.0)
    k = 3 - 4 * layer.nu
    decay = np.exp(-2 * t)
    above = k * (1 - decay**2) - 4 * t * decay
    return above / (k * (1 + decay**2) + (4 * t**2 + k**2 + 1) * decay)


def transforms(b: float, xi: np.ndarray) -> np.ndarray:
    """Return the cosine transforms of all terms of the pressure, (terms, points)."""
    # Enough points of the second kind of Chebyshev to resolve the fastest wave.
    count = 2 * int(200 + b * xi.max())
    angle = np.arange(1, count // 2 + 1) * np.pi / (count + 1)
    orders = 2 * np.arange(TERMS)[:, None] + 1
    terms = 2 * b * np.pi / (count + 1) * np.sin(angle) * np.sin(orders * angle)
    parts = []
    for chunk in np.array_split(xi, 1 + len(xi) // 1000):
        parts.append(terms @ np.cos(b * np.cos(angle)[:, None] * chunk))
    return np.concatenate(parts, axis=1)


def half_width(
    pressure: Callable[[float], tuple[np.ndarray, float]], guess: float
) -> tuple[float, np.ndarray]:
    """Return the half-width b and the terms of its pressure, by the secant method.

    Args:
        pressure: Returns the terms for a b, and a residual, zero at the true one.
        guess: A first b.
    """
    last = guess
    b = guess * SECOND_GUESS
    _, last_residual = pressure(last)
    for _ in range(30):
        terms, residual = pressure(b)
        if abs(b - last) < STEP * b:
            break
        step = residual * (b - last) / (residual - last_residual)
        last, last_residual = b, residual
        b -= step
    return b, terms


def receding(layer: Layer, bed: Layer | None, loaded: float) -> Pressed:
    """Solve the layer under a pressure of 1 on |x| < loaded."""
    ratio = bed.compliance / layer.compliance if bed else 0.0
    edges = np.concatenate([[0], np.geomspace(1e-4, 1, 30), np.linspace(1.2, 8, 40)])
    xi, weights = points_of(edges, 24)

    def responses(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return S, A and L."""
        below = bonded_layer(xi, bed) if bed else np.ones_like(xi)
        return (*free_layer(xi, layer), below)

    def load(xi: np.ndarray) -> np.ndarray:
        """Return the transform of the load."""
        return 2 * np.sin(loaded * xi) / xi

    even, odd, below = responses(xi)
    places = np.cos((np.arange(TERMS) + 0.5) * np.pi / (2 * TERMS))
    slopes = np.pi * np.cos((2 * np.arange(TERMS)[:, None] + 1) * np.arccos(places))

    def pressure(b: float) -> tuple[np.ndarray, float]:
        """Return the terms of the pressure, and a residual, zero at the true b."""
        hats = transforms(b, xi)
        waves = np.sin(b * xi[:, None] * places) * weights[:, None]
        rest = (odd + even) / 2 - 1 + ratio * (below - 1)
        # The first term balances the load; all others have no resultant.
        first = 4 * loaded / (np.pi * b)
        right_side = (load(xi) * (odd - even) / 2 - first * hats[0] * rest) @ waves
        right_side -= first * (1 + ratio) * slopes[0]
        matrix = (hats[1:] * rest) @ waves + (1 + ratio) * slopes[1:]
        solved = np.linalg.solve(np.vstack([matrix, np.sin(places)]).T, right_side)
        return np.concatenate([[first], solved[:-1]]), solved[-1]

    b, terms = half_width(pressure, 2.0 * loaded)

    # p and q decay like powers, so the energy needs far more waves than the slopes.
    end = 160.0
    xi, weights = points_of(np.concatenate([edges[:-1], np.arange(8.0, end + 0.1, 0.5)]), 14)
    even, odd, below = responses(xi)
    q, p = load(xi), terms @ transforms(b, xi)
    squares = (q + p) ** 2 / 2 * even + (q - p) ** 2 / 2 * odd + ratio * below * p**2
    # Beyond the last wave only q counts: its mean square is 2/xi^2.
    tail = 1 / end**2 + np.sin(2 * loaded * end) / (loaded * end**3)
    energy = layer.compliance / (2 * np.pi) * (float(np.sum(weights * squares / xi)) + tail)
    signs = (-1.0) ** np.arange(TERMS)
    return Pressed(float(b), float(terms @ signs), energy, 2 * loaded)


def approached(upper: Layer, lower: Layer, down: float, radius: float) -> Pressed:
    """Solve two layers, bonded outside, with the gap ``x^2/2 radius``.

    The upper one comes down by a distance. The pressure p moves both sides apart by
    ``p (K L + K' L')``, which is down - gap in the contact.
    """
    both = upper.compliance + lower.compliance
    edges = np.concatenate([[0], np.geomspace(1e-4, 1, 30), np.arange(1.5, 400.1, 0.5)])
    xi, weights = points_of(edges, 14)
    response = upper.compliance * bonded_layer(xi, upper)
    response += lower.compliance * bonded_layer(xi, lower)
    low = xi < 40.0
    places = np.cos((np.arange(TERMS) + 0.5) * np.pi / (2 * TERMS))
    slopes = np.pi * np.cos((2 * np.arange(TERMS)[:, None] + 1) * np.arccos(places))

    def pressure(b: float) -> tuple[np.ndarray, float]:
        """Return the terms of the pressure, and a residual, zero at the true b."""
        hats = transforms(b, xi)
        waves = np.sin(b * xi[low, None] * places) * weights[low, None]
        matrix = (hats[:, low] * (response[low] - both)) @ waves + both * slopes
        solved = np.linalg.solve(matrix.T, np.pi * b * places / radius)
        moved = float(np.sum(weights * (solved @ hats) * response / xi)) / np.pi
        return solved, moved - down

    b, terms = half_width(pressure, np.sqrt(radius * down))

    # The work of the pressure on the motion of both sides, by Chebyshev's rule.
    angle = np.arange(1, 200) * np.pi / 200
    x = b * np.cos(angle)
    odd = 2 * np.arange(TERMS)[:, None] + 1
    density = b * np.pi / 200 * np.sin(angle) * (terms @ np.sin(odd * angle))
    energy = float(density @ (down - x**2 / (2 * radius))) / 2
    peak = float(terms @ (-1.0) ** np.arange(TERMS))
    return Pressed(float(b), peak, energy, float(density.sum()))
