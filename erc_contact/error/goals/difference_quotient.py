"""Difference-quotient bound: certified intervals of higher order for single numbers.

Three admissible pairs give the interval, in which difference quotients take the place
of derivatives. Let the data of a scene move by t: loads by ``t psi``, supports by ``t
U'``. The energy J of its solution then has the derivative

    -J'(0) = psi(u) - (sigma n, U')  =: Q,

a mean displacement or, with the opposite sign, the force on a support. Take admissible
pairs of the scene and of those moved by t and -t, all on one mesh: (u^, sigma^), (u+,
sigma+), (u-, sigma-). For the lower end of the interval put

    phi = (u+ - u^)/t,    tau = (sigma^ - sigma-)/t,

for the upper end ``phi = (u^ - u-)/t, tau = (sigma+ - sigma^)/t``. In both cases phi is
U' on supports, tau balances psi. With ``delta = eps(u) - (eps(u^) + C^-1 sigma^)/2``

    Q = V + (tau - C eps(phi), delta) + int r.phi - int tau n.(w - g n),
    V = psi(u^) + f(phi) - a(u^, phi) + int tau n.(w^ - g n)
        + (tau - C eps(phi), C^-1 sigma^ - eps(u^))/2.

V is computed. What the contact adds is bounded by admissibility alone: none of the
displacements penetrates, and no traction pulls. Without friction, and with

    A = int |r_n| (g - w^_n),    B = int |r^_n| (g - w_n),    m = |delta|,

    m^2 + A + B = e^2/2 - |sigma^ - C eps(u^)|^2/4 =: M^2,

it is at least ``-(A + B)/t`` at the lower end, and at most that at the upper one. With
``d = |tau - C eps(phi)|`` the lower end is so

    V - max_m ( d m + (M^2 - m^2)/t ),    0 <= m <= M.

With Tresca friction b, A and B also contain what friction does, and V the difference
``int b (|w^_t| - |w+_t|)/t``, at the upper end ``int b (|w-_t| - |w^_t|)/t``. If the
friction bound depends on the pressure, the interval is an estimate.

The gap of a frictionless contact may move, too, by ``t n . a``, with a vector field a.
The derivative then has the work of r on a beside the work of the supports, and phi - a
takes the place of phi in the work of r: as u+ may be beyond g by ``t n . a``, its bound
is the same. V stays as it is.

The law may move, too, by a given strain t G. Then ``Q = psi(u) + int sigma : G``. In
C eps(phi) the place of eps(phi) is taken by ``eps(phi) - G``, and V has a term beside
psi(u^), ``int C G : (eps(u^) - eps_0)``.

The shifts of preloads may move, too: u^ has jumps q d at their cuts, and phi has the
jumps p d with the differences p of the shifts over t. So eps(phi) is the change of the
elastic strain, loads work on the jumps, and so do the forces of bolts that are given
(:mod:`erc_contact.error.goals.moved_law`).

Any t is allowed, and the intervals of several t may be intersected. While the contact
set stays as it is, d does not depend on t. Then ``t = 2 M/d`` is best, and the width d
M is of second order if d falls like M. A t that changes the set makes d larger, and
moves both V apart. If the edge of a contact moves by about t, the pressure there is
like the root of the distance, and the gap like its third power: V is apart by about
``t^2``, and ``d^2`` is larger by about t. Against ``M^2/t`` the best t is then like
``M^(2/3)``, and the width like ``M^(4/3)``: that is the order in the limit.

A friction bound that depends on the pressure is given the values that it has for the
pair (:mod:`erc_contact.error.goals.given_bounds`): the interval holds for the problem
with this Tresca friction, and is an estimate for the scene itself.

Source: ours, from the theorem of :mod:`erc_contact.error.constitutive`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.pair import Admissible
from erc_contact.error.bulk import adapted_gaps, body_error, is_adapted, spring_error
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.goals.constants import CHANGED
from erc_contact.error.goals.moved_law import MovedLaw
from erc_contact.error.load_work import load_work
from erc_contact.error.numbers import ROUND_OFF, BoundedNumber
from erc_contact.error.oscillation import UNKNOWN_SHARE
from erc_contact.error.works import contact_work, elastic_work, friction_work, strain_work

D_SHARE = 0.01
"""Share of d^2 that adapted integrals may leave unknown [-]; the interval has it."""
UNKNOWN = 1e-4
"""What integrals may leave unknown, over the square of M [-]."""


@dataclass(frozen=True, eq=False)
class Ends:
    """Hold an interval of Q.

    Attributes:
        low: Its lower end.
        high: Its upper end.
        t: The t that it is of.
        better_t: The t that would be best if d were the same for all t, ``2 M/d``.
        spread: V of the upper end less V of the lower end.
        d_squares: ``d^2`` on each owned cell, the mean of both ends, shape (owned,).
        resolved: Whether its integrals are resolved, and moved loads are represented
            exactly by the mesh.
    """

    low: float
    high: float
    t: float
    better_t: float
    spread: float
    d_squares: np.ndarray
    resolved: bool = True

    @property
    def width(self) -> float:
        """Return the width of the interval."""
        return self.high - self.low

    @property
    def changes_contact_set(self) -> bool:
        """Tell whether t changed the contact set so much that it is far too large."""
        return self.spread > CHANGED * self.width


@dataclass(frozen=True, eq=False)
class Unmoved:
    """Hold what the intervals of all t need of the scene that is not moved.

    Attributes:
        error: The error of its pair.
        psi: ``psi(u^)``.
        frictions: Work of friction on u^ on each contact [force length].
        M: M, see above [sqrt(force length)].
    """

    error: ConstitutiveError
    psi: BoundedNumber
    frictions: list[BoundedNumber]
    M: float

    @property
    def floor(self) -> float:
        """Return what integrals may leave unknown [force length].

        It widens the interval, by little beside ``M^2/t``.
        """
        return max(ROUND_OFF * self.error.scale**2, UNKNOWN * self.M**2)

    def beyond(self, d: float, t: float) -> float:
        """Return how far an end is beyond V, ``max_m (d m + (M^2 - m^2)/t)``."""
        # Concave in m: the maximum is at d t/2, or at the end M of the range.
        m = min(self.M, d * t / 2)
        return d * m + (self.M**2 - m**2) / t


def measure_unmoved(
    error: ConstitutiveError,
    psi: BoundedNumber,
) -> Unmoved:
    """Compute what the intervals of all t share; collective.

    Args:
        error: The error of the pair of the scene.
        psi: ``psi(u^)``.
    """
    # What flat facets of a curved body change is estimated beside e, and joins it here.
    square = error.absolute**2 + error.geometry_error**2
    M = float(np.sqrt(max(square / 2 - error.bulk_error**2 / 4, 0.0)))
    base = Unmoved(error, psi, [], M)
    pair = error.admissible
    for traction in pair.tractions:
        work = friction_work(pair.model.space, traction, pair.displacement, base.floor)
        base.frictions.append(work)
    return base


def ends_of(base: Unmoved, plus: Admissible, minus: Admissible, t: float) -> Ends:
    """Compute the interval of Q from three pairs; collective.

    Args:
        base: The scene, not moved.
        plus: The pair of the scene moved by t.
        minus: The pair of the scene moved by -t.
        t: t.
    """
    pair = base.error.admissible
    # phi and tau are quotients to opposite sides: so works of the moved pairs at the
    # contact have the sign that the end needs, and only A and B are left to bound.
    lower = _end(base, (plus, pair, plus), (pair, minus), t)
    upper = _end(base, (pair, minus, minus), (plus, pair), t)
    return _ends(base, lower, upper, t)


def rough_ends(base: Unmoved, plus: Admissible, t: float) -> Ends:
    """Estimate the interval of Q from the scene moved to one side; collective.

    With ``phi = (u+ - u^)/t`` and ``tau = (sigma+ - sigma^)/t`` both ends have the same
    V, which lies between the two V of the interval. It tells d, and about how wide the
    interval is, but nothing is proved.

    Args:
        base: The scene, not moved.
        plus: The pair of the scene moved by t.
        t: t.
    """
    pair = base.error.admissible
    V, d_squares = _end(base, (plus, pair, plus), (plus, pair), t)
    apart = BoundedNumber(_spread(base, plus, t) / 2)
    return _ends(base, (V - apart, d_squares), (V + apart, d_squares), t)


def _spread(base: Unmoved, plus: Admissible, t: float) -> float:
    """Estimate how far a motion moves V of both ends apart; collective.

    What the tractions of one scene do at the contact of the other is zero if the
    contact set stays as it is. With the other moved scene it moves V apart. That scene
    is taken to do nothing: it does as much at most, where a part opens one way and
    closes the other way.
    """
    pair = base.error.admissible
    space = pair.model.space
    total = -(base.error.contact_error**2)
    contacts = zip(pair.tractions, plus.tractions, base.frictions, strict=True)
    for here, there, slid in contacts:
        u = plus.displacement
        work = contact_work(space, there.contact, here.values, u, base.floor)
        work += friction_work(space, here, u, base.floor)
        work += contact_work(space, here.contact, there.values, pair.displacement, base.floor)
        total += (work + slid).value
    return max(total, 0.0) / t


def _ends(
    base: Unmoved,
    lower: tuple[BoundedNumber, np.ndarray],
    upper: tuple[BoundedNumber, np.ndarray],
    t: float,
) -> Ends:
    """Compute the interval from V and ``d^2`` of both ends; collective."""
    comm = base.error.model.space.comm
    ends = []
    sizes = []
    for sign, (V, d_squares) in ((-1.0, lower), (1.0, upper)):
        local = float(d_squares.sum())
        d = float(np.sqrt(max(comm.allreduce(local, MPI.SUM), 0.0)))
        sizes.append(d)
        ends.append(V.value + sign * (V.bound + base.beyond(d, t)))
    d_squares = np.maximum(0.5 * (lower[1] + upper[1]), 0.0)
    d = max(sizes)
    # At m = d t/2 an end is M^2/t + d^2 t/4 beyond V, least at t = 2 M/d.
    better_t = 2 * base.M / d if d > 0 else np.inf
    resolved = lower[0].resolved and upper[0].resolved
    spread = upper[0].value - lower[0].value
    return Ends(ends[0], ends[1], t, better_t, spread, d_squares, resolved)


def _end(
    base: Unmoved,
    displacements: tuple[Admissible, Admissible, Admissible],
    stresses: tuple[Admissible, Admissible],
    t: float,
) -> tuple[BoundedNumber, np.ndarray]:
    """Compute V of one end of the interval, and ``d^2`` of the owned cells; collective.

    Args:
        base: The scene, not moved.
        displacements: Pairs whose u^ have the difference ``t phi``, and the moved one
            of them.
        stresses: Pairs whose sigma^ have the difference ``t tau``.
        t: t.
    """
    error = base.error
    pair = error.admissible
    model = pair.model
    space = model.space
    first, second, moved = displacements
    phi = space.function()
    phi.x.array[:] = (first.displacement.x.array - second.displacement.x.array) / t
    more, less = stresses
    u = pair.displacement
    floor = base.floor / t
    # Two digits of the size are enough.
    size_2 = elastic_work(pair, phi, phi, np.inf).value

    size = float(np.sqrt(max(size_2, 0.0)))
    law = MovedLaw.between(first.model, second.model, t)
    product, d_squares = _across(base, phi, law, more, less, t, size)
    d_2 = space.comm.allreduce(float(d_squares.sum()), MPI.SUM)
    if d_2 > size_2:
        # Forces that a contact bears have a tau, and no phi.
        product, d_squares = _across(base, phi, law, more, less, t, float(np.sqrt(d_2)))

    # The round-off of strains does work on the stress of phi.
    V = base.psi + product + BoundedNumber(0.0, error.round_off * size)
    V += load_work(model, phi)
    # What moves beside loads and supports, given strains and preloads, works on phi.
    V = V - elastic_work(pair, u, phi, floor) + strain_work(pair, phi, floor) + law.work(pair, t)
    tractions = zip(pair.tractions, more.tractions, less.tractions, strict=True)
    contacts = zip(tractions, base.frictions, strict=True)
    for (traction, of_more, of_less), slid in contacts:
        tau = (of_more.values - of_less.values) / t
        V += contact_work(space, traction.contact, tau, u, floor)
        # Friction adds int b (|w^_t| - |w+_t|)/t, at the upper end its mirror image.
        slides = friction_work(space, traction, moved.displacement, base.floor)
        sign = 1.0 if moved is first else -1.0
        V += (sign / t) * (slid - slides)
    return V, d_squares


def _across(
    base: Unmoved,
    phi: fem.Function,
    law: MovedLaw,
    more: Admissible,
    less: Admissible,
    t: float,
    size: float,
) -> tuple[BoundedNumber, np.ndarray]:
    """Compute what V has of ``tau - C eps(phi)``, and ``d^2`` of cells; collective.

    Args:
        base: The scene, not moved.
        phi: phi.
        law: How much the law has moved.
        more: One of two pairs whose sigma^ have the difference ``t tau``.
        less: The other one.
        t: t.
        size: About the energy norm of phi or tau, whichever is larger.
    """
    error = base.error
    # q(h) = |sigma^ + h tau - C eps(u^ + h phi)|^2 is quadratic, so differences are
    # exact. With h phi about as large as e the fewest digits cancel.
    h = max(error.absolute, ROUND_OFF * error.scale) / max(size, 1e-150)
    pairs = []
    for step in (0.0, h, -h):
        pairs.append(_moved(law.move(error.admissible, step), phi, more, less, step, t))
    of_quotients = partial(_quotients, h=h)
    of_springs = of_quotients(*(spring_error(pair).gap for pair in pairs))
    if any(is_adapted(pair.model) for pair in pairs):
        floor = UNKNOWN_SHARE * np.array([UNKNOWN_SHARE * size**2, error.absolute * size])
        of_body = adapted_gaps(pairs, of_quotients, D_SHARE, floor)
        d_squares, product = (of_body.value + of_springs).T
        unknown = of_body.bound
        resolved = bool(of_body.resolved.all())
    else:
        bodies = [body_error(pair, UNKNOWN_SHARE) for pair in pairs]
        gaps = [body.gap for body in bodies]
        d_squares, product = (of_quotients(*gaps) + of_springs).T
        # Adapted integrals are up to twice their share too large.
        varies = any(pair.model.constitution.varies_in_cells for pair in pairs)
        share = 2 * UNKNOWN_SHARE if varies else 0.0
        of_both = gaps[1] + gaps[2]
        of_squares = (of_both + 2 * gaps[0]) / (2 * h**2)
        unknown = share * np.column_stack([of_squares, of_both / (8 * h)])
        resolved = not any(body.moduli for body in bodies)
    local = np.array([product.sum(), unknown[:, 1].sum(), float(not resolved)])
    value, bound, left = error.model.space.comm.allreduce(local, MPI.SUM)
    return BoundedNumber(value, bound, bool(left == 0.0)), d_squares + unknown[:, 0]


def _quotients(middle: np.ndarray, more: np.ndarray, less: np.ndarray, h: float) -> np.ndarray:
    """Return d^2 and the product of q(0), q(h) and q(-h), beside each other.

    They are ``(q(h) + q(-h) - 2 q(0))/(2 h^2)`` and ``(q(h) - q(-h))/(8 h)``.
    """
    return np.stack([(more + less - 2 * middle) / (2 * h**2), (more - less) / (8 * h)], axis=-1)


def _moved(
    pair: Admissible, phi: fem.Function, more: Admissible, less: Admissible, h: float, t: float
) -> Admissible:
    """Return the pair of ``u^ + h phi`` and ``sigma^ + h tau``, with the springs."""
    u_hat = pair.model.space.function()
    u_hat.x.array[:] = pair.displacement.x.array + h * phi.x.array
    of_springs = []
    triples = zip(pair.spring_tractions, more.spring_tractions, less.spring_tractions, strict=True)
    for value, of_more, of_less in triples:
        of_springs.append(value + h / t * (of_more - of_less))
    return replace(
        pair,
        displacement=u_hat,
        stress=pair.stress + h / t * (more.stress - less.stress),
        spring_tractions=of_springs,
    )
