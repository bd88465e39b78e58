"""Certified intervals of order 1.5 for single numbers, from three admissible pairs.

Let the data of a scene move by t: loads by ``t psi``, supports by ``t U'``. The energy
J of its solution then has the derivative

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

With given friction b, A and B also contain what friction does, and V the difference
``int b (|w^_t| - |w+_t|)/t``, at the upper end ``int b (|w-_t| - |w^_t|)/t``. If the
friction bound depends on the pressure, the interval is an estimate.

Any t is allowed, and the intervals of several t may be intersected. While the contact
set stays as it is, d does not depend on t, and the interval is narrower for larger t:
d m is then of second order. A t that changes the set makes d larger. The best t is a
few times ``e/|phi|``, and many times that where the contact is settled.

Source: ours, from the theorem of :mod:`erc_contact.error.constitutive`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.pair import Admissible, equilibrate
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.exceptions import InputError, NotConverged, NotHeldError
from erc_contact.error.bounds import Bounds
from erc_contact.error.bulk import add_springs, bulk_squares, data_vary
from erc_contact.error.constitutive import ROUND_OFF, ConstitutiveError, Run, error_of
from erc_contact.error.questions import Question, question_of
from erc_contact.error.works import (
    BoundedNumber,
    elastic_work,
    friction_work,
    load_work,
    strain_work,
)
from erc_contact.mesh.quadrature import facet_pieces, integrate, polynomials
from erc_contact.model.foundation import ContactData
from erc_contact.model.model import Model
from erc_contact.model.trace import split
from erc_contact.newton.solve import solved
from erc_contact.scene.goal import Goal

FACTOR = 3.0
"""Ratio of one t to the next that is tried [-]."""
LARGEST_COUNT = 6
"""Number of values of t that are tried at most."""
NARROWER = 0.9
"""Width over that of the best t so far from which the next t is not tried [-]."""


@dataclass(frozen=True, eq=False)
class _End:
    """Hold the parts of one end of the interval, see the module.

    Attributes:
        V: V.
        d: d.
    """

    V: BoundedNumber
    d: float


def interval(error: ConstitutiveError | Run, goal: Goal) -> Bounds:
    """Bound a number of the solution by three admissible pairs; collective.

    For each of some values of t, two to six, the scene is solved twice more on the same
    mesh, from the known solution. The interval is of order 1.5 in e, and of order 2
    where the contact set is settled; that of :func:`erc_contact.resultant` is of order
    1.

    Args:
        error: The error of an admissible pair, or a history, whose error is taken.
        goal: :class:`erc_contact.Resultant` or :class:`erc_contact.MeanDisplacement`.

    Returns:
        The interval, around its middle [force], [length].

    Raises:
        InputError: If the scene has no such part, it cannot move alone, or the scene is
            a step of a history.

    Example:
        >>> bounds = ec.interval(error, ec.Resultant("top", (0.0, 1.0)))
        >>> bool(bounds.low <= bounds.value <= bounds.high)
        True
    """
    error = error_of(error)
    model = error.model
    if any(contact.trace.before is not None for contact in model.contacts):
        raise InputError("interval: a step of a history has none; solve its scene alone.")
    question = question_of(error, goal)
    low, high = _best_ends(error, question)
    low, high = sorted((question.sign * low, question.sign * high))
    low += question.constant.value - question.constant.bound
    high += question.constant.value + question.constant.bound
    proved = error.guaranteed and question.constant.resolved and not data_vary(model)
    return Bounds((low + high) / 2, low, high, proved)


def _best_ends(error: ConstitutiveError, question: Question) -> tuple[float, float]:
    """Return the ends of the interval of Q, of several t; collective."""
    low, high = -np.inf, np.inf
    count = 0
    narrowest = np.inf
    for factor in (FACTOR, 1 / FACTOR):
        t = question.step if factor > 1 else question.step * factor
        while count < LARGEST_COUNT:
            ends = _ends(error, question, t)
            count += 1
            if ends is None:
                break
            # Each interval holds, so their intersection does.
            low, high = max(low, ends[0]), min(high, ends[1])
            width = ends[1] - ends[0]
            if width > NARROWER * narrowest:
                break
            narrowest = width
            t *= factor
        if count > 2:
            break
    if not np.isfinite(low):
        raise NotConverged("interval: the moved scenes were not solved; refine the mesh.", ())
    return low, high


def _ends(error: ConstitutiveError, question: Question, t: float) -> tuple[float, float] | None:
    """Return the ends for a t, None if its scenes are not solved; collective."""
    pair = error.admissible
    try:
        plus, minus = (_moved(error, question, sign * t) for sign in (1.0, -1.0))
    except (NotConverged, NotHeldError):
        return None
    lower = _end(error, question, (plus, pair, plus), (pair, minus), t)
    upper = _end(error, question, (pair, minus, minus), (plus, pair), t)
    square = error.absolute**2 + error.geometry_error**2
    M = float(np.sqrt(max(square / 2 - error.bulk_error**2 / 4, 0.0)))
    ends = []
    for sign, end in ((-1.0, lower), (1.0, upper)):
        m = min(M, end.d * t / 2)
        ends.append(end.V.value + sign * (end.V.bound + end.d * m + (M**2 - m**2) / t))
    return ends[0], ends[1]


def _moved(error: ConstitutiveError, question: Question, t: float) -> Admissible:
    """Return an admissible pair of the scene moved by t; collective."""
    solution = error.solution
    moved = solved(
        question.moved(t),
        error.domain,
        solution.method,
        degree=error.degree,
        after=None,
        start=solution,
        tolerance=None,
        solver="auto",
    )
    return equilibrate(moved)


def _end(
    error: ConstitutiveError,
    question: Question,
    displacements: tuple[Admissible, Admissible, Admissible],
    stresses: tuple[Admissible, Admissible],
    t: float,
) -> _End:
    """Compute the parts of one end of the interval; collective.

    Args:
        error: The error of the pair of the scene.
        question: What the goal moves.
        displacements: Pairs whose u^ have the difference ``t phi``, and the moved one
            of them.
        stresses: Pairs whose sigma^ have the difference ``t tau``.
        t: t.
    """
    pair = error.admissible
    model = pair.model
    first, second, moved = displacements
    phi = model.function()
    phi.x.array[:] = (first.displacement.x.array - second.displacement.x.array) / t
    more, less = stresses
    u = pair.displacement
    size_2 = elastic_work(pair, phi, phi).value

    # |sigma^ + h tau - C eps(u^ + h phi)|^2 for h and -h tells d^2 and the product.
    h = max(error.absolute, ROUND_OFF * error.scale) / np.sqrt(max(size_2, 1e-300))
    squares = [_bulk(pair, phi, more, less, sign * h, t) for sign in (0.0, 1.0, -1.0)]
    product = (squares[1] - squares[2]) / (4 * h)
    d_2 = (squares[1] + squares[2] - 2 * squares[0]) / (2 * h**2)

    V = BoundedNumber(question.psi(u) + product / 2) + load_work(model, phi)
    V = V - elastic_work(pair, u, phi) + strain_work(pair, phi)
    contacts = zip(pair.tractions, more.tractions, less.tractions, strict=True)
    for traction, of_more, of_less in contacts:
        tau = (of_more.values - of_less.values) / t
        V += _contact_work(model, traction, tau, u)
        floor = ROUND_OFF * error.scale**2
        slid = friction_work(model, traction, u, floor)
        slides = friction_work(model, traction, moved.displacement, floor)
        sign = 1.0 if moved is first else -1.0
        V += (sign / t) * (slid - slides)
    return _End(V, float(np.sqrt(max(d_2, 0.0))))


def _bulk(
    pair: Admissible, phi: fem.Function, more: Admissible, less: Admissible, h: float, t: float
) -> float:
    """Compute ``|sigma^ + h tau - C eps(u^ + h phi)|^2`` [force length]; collective."""
    model = pair.model
    hat = model.function()
    hat.x.array[:] = pair.displacement.x.array + h * phi.x.array
    of_springs = []
    triples = zip(pair.spring_tractions, more.spring_tractions, less.spring_tractions, strict=True)
    for value, of_more, of_less in triples:
        of_springs.append(value + h / t * (of_more - of_less))
    moved = replace(
        pair,
        displacement=hat,
        stress=pair.stress + h / t * (more.stress - less.stress),
        spring_tractions=of_springs,
    )
    difference, both, _ = bulk_squares(moved)
    add_springs(moved, difference, both)
    return float(model.comm.allreduce(float(difference.sum()), MPI.SUM))


def _contact_work(
    model: Model, traction: ContactTraction, tau: np.ndarray, u: fem.Function
) -> BoundedNumber:
    """Compute ``int tau n.(w^ - g n)`` on a contact [force length]; collective.

    Args:
        model: The scene on a mesh.
        traction: r^ on the contact.
        tau: Coefficients of the traction tau n [force/area], shape (f, m, d).
        u: u^.
    """
    contact = traction.contact
    trace = contact.trace
    data = ContactData(contact, model.mesh)
    of_w = trace.coefficients(trace.since(u.x.array))

    def density(facet: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        n = contact.direction[facet][:, None, :]
        shape = polynomials(model.degree, places)
        tau_n, tau_t, _ = split(np.matmul(shape, tau[facet]), n)
        w_n, w_t, _ = split(np.matmul(shape, of_w[facet]), n)
        # A gap that is closed everywhere does no work, whatever the traction.
        opening = 0.0 if contact.bilateral else w_n - data.gap(facet, x)
        return (tau_n * opening + (tau_t * w_t).sum(axis=-1))[..., None]

    area = trace.here.owned_areas
    corners = trace.here.corners
    integral = integrate(model.comm, density, corners, area, facet_pieces(model.d - 1))
    return BoundedNumber.summed(model.comm, integral)
