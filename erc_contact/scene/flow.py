"""Give the plastic flow of a load step, and its energy, for a curve of hardening.

With the yield stress k(a) the energies of a load step contain the same function,

    F(t) = max over D >= 0 of  t D - c D^2/2 - int_a^{a+D} k(s) - k(a) ds,

of the stress t by which a trial is beyond the yield stress k(a): psi has -F with ``c =
3 G + H_k``, and psi* has +F with ``c = H_k``. The maximum is where ``t = c D + k(a+D) -
k(a)``. The right side grows with D as k never decreases, so that the flow ``D = F'(t)``
is unique, and F is convex. Let k be a parabola between each two points (a_i, k_i), with
the slope H_i at the first of them, or at a if a lies between them, and the second
derivative q_i. With ``m_i = c + H_i`` a piece begins where

    D_i = [a_i - a]_+,   t_i = c D_i + [k_i - k(a)]_+,

and a flow by d more is reached where ``t - t_i = m_i d + q_i d^2/2``: exactly

    F(t) = F_i + D_i (t - t_i) + m_i d^2/2 + q_i d^3/3,
    d = 2 (t - t_i) / (m_i + sqrt(m_i^2 + 2 q_i (t - t_i))).

This is also F_{i+1}, at the flow ``D_{i+1} - D_i``. The root is of ``(m_i + q_i d)^2``,
the slope of t where the flow ends, which is > 0. Of a polygon all q_i are zero.

Symbols: a accumulated plastic strain before the step [-], D what it grows by, k yield
stress, H slope of k, q second derivative of k [force/area], G shear modulus, H_k
kinematic hardening modulus.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import pairwise
from typing import Any, NamedTuple

import ufl

from erc_contact.base.ufl_types import Ufl


class Point(NamedTuple):
    """Hold a point of a curve, and the parabola beyond it, UFL.

    Attributes:
        strain: Plastic strain [-].
        stress: Yield stress [force/area].
        slope: Slope of the yield stress beyond the point [force/area].
        bend: Its second derivative there [force/area].
    """

    strain: Ufl
    stress: Ufl
    slope: Ufl
    bend: Ufl


class Flow(NamedTuple):
    """Hold the flow of a load step [-] and its energy F [force/area], UFL."""

    amount: Ufl
    energy: Ufl


class Piece(NamedTuple):
    """Hold where a piece of F begins, UFL: t_i, D_i, F_i, m_i and q_i."""

    beyond: Ufl
    amount: Ufl
    energy: Ufl
    stiffness: Ufl
    bend: Ufl

    def energy_of(self, more: Ufl, over: Ufl) -> Ufl:
        """Return F where the flow has grown by d, and t by ``over``, in the piece."""
        # A third power is a call of pow in C, slower than all of the law.
        of_flow = more * more * (self.stiffness / 2 + self.bend * more / 3)
        return self.energy + self.amount * over + of_flow


def least_slope(points: Sequence[Point]) -> Ufl:
    """Return the least slope of a curve [force/area]."""
    slopes = [points[-1].slope]
    for here, there in pairwise(points):
        at_end = here.slope + here.bend * (there.strain - here.strain)
        slopes += [here.slope, at_end]
    return reduce(ufl.min_value, slopes)


def yield_stress_at(points: Sequence[Point], accumulated: Ufl) -> Ufl:
    """Return k of an accumulated plastic strain >= 0 [force/area]."""
    here = Point(*_last_reached(points, lambda point: ufl.ge(accumulated, point.strain)))
    into = accumulated - here.strain
    return here.stress + here.slope * into + here.bend * into**2 / 2


def flow(points: Sequence[Point], accumulated: Ufl, beyond: Ufl, c: Ufl) -> Flow:
    """Return the flow of a load step and its energy F.

    Args:
        points: The curve.
        accumulated: Accumulated plastic strain before the step, >= 0 [-].
        beyond: The stress t beyond the yield stress, >= 0 [force/area].
        c: See the head of the module [force/area].
    """
    limit = yield_stress_at(points, accumulated)
    nothing = ufl.as_ufl(0.0)
    pieces: list[Piece] = []
    for point in points:
        start = amount = energy = nothing
        if pieces:
            before = pieces[-1]
            amount = _positive(point.strain - accumulated)
            start = c * amount + _positive(point.stress - limit)
            energy = before.energy_of(amount - before.amount, start - before.beyond)
        passed = _positive(accumulated - point.strain)
        stiffness = c + point.slope + point.bend * passed
        pieces.append(Piece(start, amount, energy, stiffness, point.bend))
    here = Piece(*_last_reached(pieces, lambda piece: ufl.ge(beyond, piece.beyond)))
    over = beyond - here.beyond
    more = _flow_by(over, here)
    return Flow(here.amount + more, here.energy_of(more, over))


def _positive(value: Ufl) -> Ufl:
    """Return a value, or zero if it is below zero, UFL."""
    # C calls a function for the greater of two numbers, and none for a condition.
    return ufl.conditional(ufl.gt(value, 0), value, 0)


def _flow_by(over: Ufl, piece: Piece) -> Ufl:
    """Return by how much the flow grows in a piece, d [-]."""
    # The root costs as much as the whole law of a polygon, which has none.
    if isinstance(piece.bend, ufl.classes.Zero):
        return over / piece.stiffness
    root = ufl.sqrt(piece.stiffness**2 + 2 * piece.bend * over)
    return 2 * over / (piece.stiffness + root)


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
    return tuple(_chosen(reached, b, a) for a, b in zip(below, above, strict=True))


def _chosen(condition: Ufl, yes: Ufl, no: Ufl) -> Ufl:
    """Return a value where a condition holds, else another value, UFL.

    What is zero in any case stays UFL's zero.
    """
    if isinstance(yes, ufl.classes.Zero) and isinstance(no, ufl.classes.Zero):
        return yes
    return ufl.conditional(condition, yes, no)
