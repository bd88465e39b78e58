"""Proofs with Coulomb friction: a bound of all solutions, and uniqueness.

The bound has no term of unknown sign. The derivation is in docs/coulomb.md. Symbols:
u^, sigma^, r^ an admissible pair and its contact traction, w^ = u^ on the contact; v =
u - u^ and tau = sigma - sigma^ the errors of any solution, in energy norms a = |v| and
b = |tau|; e the error in the constitutive relation, beta = |sigma^ - C eps(u^)| its
bulk part. For every tangential field t on the contact with |t| <= mu let

    q = the norm of the map W from v to the displacement of least energy that equals
        (t.v) n on the contact,
    A = the energy norm of the displacement of least energy that equals
        (mu |w^_t| - t.w^_t) n there,
    B = the energy norm of the stress of least energy that balances the traction
        rho = r^_t + |r^_n| t,
    e_t^2 = e^2 - 2 int rho.w^_t  >=  beta^2.

W maps tangential displacements to normal ones, so W W = 0. With ``s = |C eps(v) +
tau|/2``, ``a^2 + b^2 = 2 s^2 + beta^2/2``, this gives, without absolute values in the
derivation,

    a^2 + b^2  <=  e_t^2 + q (s + beta/2)^2 + 2 sqrt(A^2 + B^2) sqrt(a^2 + b^2),   (1)

which bounds a and b if q < 2. Where the pair has slip and traction in the direction of
t, A = B = 0 and e_t = e = beta:

    sqrt(a^2 + b^2)  <=  e sqrt(4 + q^2)/(2 - q).                                  (2)

An exact solution of direction t has e = 0: if q < 2 it is the only solution.

q is computed with finite elements. It is an estimate: nothing here bounds what the mesh
does not see of it. What another mesh tells of its limit is added
(:mod:`erc_contact.error.coulomb.other_mesh`). A and B are estimates by finite elements,
too; mostly they are small.

Source: (1) and (2) are ours; Y. Renard, SIAM J. Math. Anal. 38 (2006), has a uniqueness
criterion of this kind.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from erc_contact.base.exceptions import raise_together
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.coulomb.coupling import coupling
from erc_contact.error.coulomb.other_mesh import change_of_norm, other_mesh
from erc_contact.error.coulomb.slip_direction import LENGTHS, slip_fields
from erc_contact.error.coulomb.surface import PairOnSurface, has_coulomb, pair_on_surface
from erc_contact.error.runs import Run, error_of
from erc_contact.model.contact.friction import depends_on_pressure
from erc_contact.newton.linear.solver import Traces
from erc_contact.scene.potential import refuse_potential

SMOOTH_FIELD = 1
"""Which of the fields of :func:`slip_fields` is taken where trying one is expensive.

A field costs a linear solve there.
"""
CLAIMED_COUPLING = 3**0.5
"""Greatest q + change of which anything is claimed [-].

There (2) is 10 e. Nearer to q = 2 it says nothing, and the next mesh may withdraw it.
"""
BALANCED_WORK = 1e-8
"""Work of a traction on a rigid motion that counts as none [-].

It is over the works of its parts.
"""


@dataclass(frozen=True)
class CoulombCertificate:
    """Hold the certificate of a scene with Coulomb friction, with the estimate of q.

    It is a bound of all solutions, and uniqueness.

    Attributes:
        friction: The greatest friction coefficient mu on the contacts [-].
        q: Norm of the map W from tangential to normal displacements of the contact,
            with mu in it [-].
        q_change: How far q may be from its limit on fine meshes, as a finer or a
            coarser mesh tells with the same field t; where there is none, a tenth of q.
            After multigrid the last step of the iteration for q is added.
        unique: Whether ``q + q_change`` is at most :data:`CLAIMED_COUPLING`, safely
            below 2: at most one solution slips in the direction t of this pair.
        bound: Every solution has ``sqrt(|u - u^|^2 + |sigma - sigma^|^2) <= bound``
            [sqrt(force length)]; infinite where none is claimed.
        absolute: The error e in the constitutive relation [sqrt(force length)].
        misaligned: A, the energy norm of what t misses of the slip [sqrt(force
            length)].
        unbalanced: B, the energy norm of what t misses of the traction [sqrt(force
            length)].
        smoothing: Length over which the field t is made smooth, over the size of the
            contact [-].
        q_largest: The largest ``q + q_change`` of all fields t that were tried [-]. q
        belongs to the field with the least bound; on another mesh a rougher field may
        have the least bound, with a q up to this.
        unit: Unit of e as it stands behind the number; "" if the scene has none.

    Example:
        >>> certificate = ec.coulomb_certificate(error)
        >>> f"q = {certificate.q:.2f}, factor = {certificate.factor:.2f}"
        'q = 0.48, factor = 1.54'
        >>> certificate.unique
        True
    """

    friction: float
    q: float
    q_change: float
    unique: bool
    bound: float
    absolute: float
    misaligned: float
    unbalanced: float
    smoothing: float = 0.0
    q_largest: float = 0.0
    unit: str = ""

    @property
    def M(self) -> float:
        """Return ``q/mu``, the norm of the map W without friction [-]."""
        return self.q / self.friction if self.friction > 0 else 0.0

    @property
    def M_change(self) -> float:
        """Return ``q_change/mu`` [-]."""
        return self.q_change / self.friction if self.friction > 0 else 0.0

    @property
    def factor(self) -> float:
        """Return the bound over e [-]."""
        if self.absolute > 0:
            return self.bound / self.absolute
        return 1.0 if self.bound == 0 else np.inf

    def __str__(self) -> str:
        if self.friction == 0 and self.q == 0:
            return (
                "No friction grows with the pressure: there is one solution, and "
                f"e = {self.absolute:.3g}{self.unit} bounds it."
            )
        if not np.isfinite(self.q):
            return (
                "Nothing is proved of other solutions: the body moves rigidly along a contact, "
                "or friction is no isotropic multiple of the pressure."
            )
        q = f"q = {self.q:.3g} (+- {self.q_change:.1g})"
        if self.bound < np.inf:
            return (
                f"With the estimate {q} < 2 every solution lies within {self.factor:.3g} e = "
                f"{self.bound:.3g}{self.unit} of the pair, and one at most has its direction "
                "of slip."
            )
        if self.unique:
            return (
                f"With the estimate {q} < 2 one solution at most has this direction of slip; "
                "a bound is not claimed."
            )
        return (
            f"Nothing is proved of other solutions: {q} is not safely below 2, "
            f"at most {CLAIMED_COUPLING:.3g}. e bounds up to a product of two errors."
        )


def coulomb_certificate(error: ConstitutiveError | Run) -> CoulombCertificate:
    """Compute the certificate of a scene with Coulomb friction; collective.

    Args:
        error: The error of an admissible pair, or a history, whose error is taken.

    Returns:
        q and the bound. Without friction that grows with the pressure q is 0 and the
        bound is e. If the friction bound of a contact is another function of the
        pressure than a multiple, q is infinite and nothing is claimed.

    Example:
        >>> print(ec.coulomb_certificate(error))
        With the estimate q = 0.484 (+- 0.01) < 2 every solution lies within 1.54 e ...
    """
    error = error_of(error)
    e_alone = "e bounds it up to a product of two errors."
    refuse_potential(error.solution.scene.material, "coulomb_certificate()", e_alone)
    pair = error.admissible
    model = pair.model
    raise_together(model.space.comm, None)
    contacts = []
    for contact in model.contacts:
        if depends_on_pressure(contact.friction):
            contacts.append(contact)
    e = error.absolute
    unit = model.scene.unit("sqrt(force length)")
    if not all(has_coulomb(contact) for contact in contacts):
        return CoulombCertificate(0.0, np.inf, np.inf, False, np.inf, e, np.inf, np.inf, unit=unit)
    if not contacts:
        return CoulombCertificate(0.0, 0.0, 0.0, True, e, e, 0.0, 0.0, unit=unit)
    on_surface = pair_on_surface(pair)
    elastic = pair.solution.stiffness
    with elastic.in_memory():
        traces = elastic.traces(on_surface.surface.numbers)
        certify = _best if traces.cheap else _single
        best = replace(certify(error, on_surface, traces), unit=unit)
    # A field with a smaller q and a larger bound might not outlive the next mesh.
    if best.q + best.q_change > CLAIMED_COUPLING:
        best = replace(best, unique=False, bound=np.inf)
    return best


def _best(error: ConstitutiveError, pair: PairOnSurface, traces: Traces) -> CoulombCertificate:
    """Return the certificate of the field with the least bound; collective.

    Where no field has a bound, it is the certificate of the roughest field.
    """
    surface = pair.surface
    normal, x = surface.normal, surface.positions()
    comparison = other_mesh(error.model)
    tried = []
    for smoothing, t in zip(LENGTHS, slip_fields(pair), strict=True):
        q = coupling(normal, traces, t, x).q
        other_q = q if comparison is None else comparison.norm(surface, t)[0]
        change = change_of_norm(q, surface, other_q, comparison)
        tried.append(replace(_try_field(error, pair, traces, t, q, change), smoothing=smoothing))
    largest = max(certificate.q + certificate.q_change for certificate in tried)
    best = min(tried, key=lambda certificate: certificate.bound)
    return replace(best, q_largest=largest)


def _single(error: ConstitutiveError, pair: PairOnSurface, traces: Traces) -> CoulombCertificate:
    """Return the certificate of one field; collective.

    The coupling of another mesh is what q starts from.
    """
    surface = pair.surface
    t = slip_fields(pair)[SMOOTH_FIELD]
    comparison = other_mesh(error.model)
    other_q, start = (0.0, None) if comparison is None else comparison.norm(surface, t)
    norm = coupling(surface.normal, traces, t, surface.positions(), start)
    change = change_of_norm(norm.q, surface, other_q, comparison) + norm.raised
    certificate = _try_field(error, pair, traces, t, norm.q, change)
    return replace(certificate, smoothing=LENGTHS[SMOOTH_FIELD], q_largest=norm.q + change)


def _try_field(
    error: ConstitutiveError,
    pair: PairOnSurface,
    traces: Traces,
    t: np.ndarray,
    q: float,
    change: float,
) -> CoulombCertificate:
    """Return the certificate with a field t (n, d) at the nodes; collective."""
    surface = pair.surface
    forces, work = pair.unbalanced(t)
    eta = pair.unaligned(t)[:, None] * surface.normal
    A = _energy(eta, traces.lift(eta, rough=True))
    B = _energy(forces, traces.move(forces))
    # No stress balances forces that work on a rigid motion. The scale is made of
    # lengths of vectors, not of components: a motion along the normal meets only
    # round-off of rho, which is tangential, and components have nothing else to compare
    # this with.
    without_field, _ = pair.unbalanced(np.zeros_like(t))
    sizes = np.linalg.norm(without_field, axis=1) + np.linalg.norm(forces, axis=1)
    for motion in traces.motions:
        work_on_motion = abs(np.sum(motion * forces))
        if work_on_motion > BALANCED_WORK * (np.linalg.norm(motion, axis=1) @ sizes):
            B = np.inf
    e_t = float(np.sqrt(max(error.absolute**2 - 2 * work, error.bulk_error**2)))
    bound = bound_of_both(q + change, e_t, error.bulk_error, float(np.hypot(A, B)))
    friction = float(pair.friction.max())
    return CoulombCertificate(friction, q, change, q + change < 2, bound, error.absolute, A, B)


def _energy(displacement: np.ndarray, forces: np.ndarray) -> float:
    """Return the energy norm of displacements and their forces [sqrt(force length)]."""
    return float(np.sqrt(max(np.sum(displacement * forces), 0.0)))


def bound_of_both(q: float, e_t: float, bulk: float, missed: float) -> float:
    """Compute the largest ``sqrt(a^2 + b^2)`` that satisfies (1) [sqrt(force length)].

    It is called x, and infinite if q >= 2. (1) is ``x^2 - e_t^2 - q (s + beta/2)^2 - 2
    missed x <= 0`` with ``2 s^2 = x^2 - beta^2/2``. The left side is convex in x.
    Newton's method falls to its largest root from a point above: the root with
    ``sqrt(2) (s + beta/2) >= x`` in the place of x in the last term.

    Args:
        q: Norm of W [-].
        e_t: e_t [sqrt(force length)].
        bulk: beta, not above e_t.
        missed: ``sqrt(A^2 + B^2)``.
    """
    if not (q < 2 and missed < np.inf):
        return np.inf
    half = bulk + np.sqrt(2.0) * missed
    p = (half + np.sqrt(half**2 + (2 - q) * (e_t**2 - bulk**2))) / (2 - q)
    x = np.sqrt(2 * p * p - 2 * p * bulk + bulk**2)
    while x > 0:
        s = np.sqrt(max(x * x / 2 - bulk**2 / 4, 0.0))
        value = x * x - e_t**2 - q * (s + bulk / 2) ** 2 - 2 * missed * x
        slope = 2 * (x - missed) - (q * (s + bulk / 2) * x / s if s > 0 else 0.0)
        below = x - value / slope
        if not below < x * (1 - 1e-14):
            break
        x = below
    return float(x)
