"""Give the plastic flow of a load step, and its energy, for a polygon of hardening.

With the yield stress k(a) the energies of a load step contain the same function,

    F(t) = max over D >= 0 of  t D - c D^2/2 - int_a^{a+D} k(s) - k(a) ds,

of the stress t by which a trial is beyond the yield stress k(a): psi has -F with ``c =
3 G + H_k``, and psi* has +F with ``c = H_k``. The maximum is where ``t = c D + k(a+D) -
k(a)``. The right side grows with D as k never decreases, so that the flow ``D = F'(t)``
is unique, and F is convex. Of a polygon k with the points (a_i, k_i) it is linear
between

    D_i = [a_i - a]_+,   t_i = c D_i + [k_i - k(a)]_+,

and from the last t_i below t, with the slope H_i of k beyond a_i, exactly

    F(t) = F_i + D_i (t - t_i) + (t - t_i)^2 / (2 (c + H_i)),
    F_i = F_{i-1} + (D_{i-1} + D_i) (t_i - t_{i-1}) / 2.

Symbols: a accumulated plastic strain before the step [-], D what it grows by, k yield
stress, H slope of k [force/area], G shear modulus, H_k kinematic hardening modulus.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import ufl

from erc_contact.base.ufl_types import Ufl


class Point(NamedTuple):
    """Hold a point of a polygon: UFL strain [-], yield stress, slope beyond."""

    strain: Ufl
    stress: Ufl
    slope: Ufl


class Flow(NamedTuple):
    """Hold the flow of a load step [-] and its energy F [force/area], UFL."""

    amount: Ufl
    energy: Ufl


class Piece(NamedTuple):
    """Hold where a piece of F begins, UFL: t_i, D_i, F_i, and the slope H_i."""

    beyond: Ufl
    amount: Ufl
    energy: Ufl
    slope: Ufl


def polygon(
    yield_stress: Ufl, last_slope: Ufl, points: Sequence[tuple[Ufl, Ufl]] = ()
) -> list[Point]:
    """Return the points of a polygon with their slopes.

    Args:
        yield_stress: The stress without plastic strain [force/area].
        last_slope: The slope beyond the last point [force/area].
        points: Plastic strain and yield stress of further points.
    """
    every = [(ufl.as_ufl(0.0), yield_stress), *points]
    result = []
    for (strain, stress), (next_strain, next_stress) in pairwise(every):
        slope = (next_stress - stress) / (next_strain - strain)
        result.append(Point(strain, stress, slope))
    return [*result, Point(*every[-1], last_slope)]


def yield_stress_at(points: Sequence[Point], accumulated: Ufl) -> Ufl:
    """Return k of an accumulated plastic strain >= 0 [force/area]."""
    strain, stress, slope = _last_reached(points, lambda point: ufl.ge(accumulated, point.strain))
    return stress + slope * (accumulated - strain)


def flow(points: Sequence[Point], accumulated: Ufl, beyond: Ufl, c: Ufl) -> Flow:
    """Return the flow of a load step and its energy F.

    Args:
        points: The polygon.
        accumulated: Accumulated plastic strain before the step, >= 0 [-].
        beyond: The stress t beyond the yield stress, >= 0 [force/area].
        c: See the head of the module [force/area].
    """
    limit = yield_stress_at(points, accumulated)
    nothing = ufl.as_ufl(0.0)
    pieces = [Piece(nothing, nothing, nothing, points[0].slope)]
    for point in points[1:]:
        before = pieces[-1]
        amount = ufl.max_value(point.strain - accumulated, 0)
        start = c * amount + ufl.max_value(point.stress - limit, 0)
        area = (before.amount + amount) * (start - before.beyond) / 2
        pieces.append(Piece(start, amount, before.energy + area, point.slope))
    start, amount, energy, slope = _last_reached(pieces, lambda piece: ufl.ge(beyond, piece.beyond))
    over = beyond - start
    stiffness = c + slope
    return Flow(amount + over / stiffness, energy + amount * over + over**2 / (2 * stiffness))


def _last_reached(rows: Sequence[Any], is_reached: Callable[[Any], Ufl]) -> tuple[Ufl, ...]:
    """Return the last of some rows that is reached, UFL; the first one always is.

    The rows are halved, so that UFL is nested little.
    """
    if len(rows) == 1:
        return tuple(rows[0])
    middle = len(rows) // 2
    below = _last_reached(rows[:middle], is_reached)
    above = _last_reached(rows[middle:], is_reached)
    reached = is_reached(rows[middle])
    return tuple(ufl.conditional(reached, b, a) for a, b in zip(below, above, strict=True))
