"""Contact tractions that the law allows and that balance the loads.

The law allows them at every point, not only at nodes: if the Bernstein coefficients of a traction lie in a convex set,
its values lie in it, too. Where the friction bound varies along a facet, or is given by the user, it is lowered until
the traction is allowed at a fine sampling of the facet.

Symbols: n normal of the foundation, r^ contact traction on the body, p = -r^_n pressure, b(p) friction bound, m number
of coefficients of a facet, which belong to its nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.allowed import Allowed, samples
from erc_contact.admissible.balance import Part, balanced
from erc_contact.admissible.cells import moments
from erc_contact.admissible.cones import Cones
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.exceptions import NotHeldError
from erc_contact.mesh.simplex import averages, bernstein, lagrange, projection, rule
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import CONSTANT, BoundContact, pressures, split
from erc_contact.model.model import Model

PASSES = 10
"""Limit of the passes that lower the friction bound where it is sampled; one or two are usual."""
MARGIN = 0.2
"""Share of the sampled deviation that is added for deviations between two samples [-]."""
MOBILITY = 0.1
"""kappa of :class:`_Shift` where a traction must change for the balance [-]; 0.01 to 1 give the same e within 3%."""
ROUND_OFF = 1e-12
"""kappa where no balance is needed: the accuracy of the traction of a method, over ``E/h |w|`` [-]."""
FAR = 1e3
"""Slip over ``h/E |r|`` beyond which this kappa grows with the slip [-]."""
SLIDES = 10.0
"""Slip over ``h/E |r|`` beyond which the pressure of a facet may be levelled, see :func:`_level` [-]."""
HELD = 1e-8
"""Imbalance that counts as none, over the forces [-]; 1e-15 to 1e-11 remains where an allowed traction exists."""


@dataclass(frozen=True, eq=False)
class _Shift:
    """Shift ``-kappa E/h v`` of a traction by slip and opening, with ``v = w_t + (w_n - g - mu |w_t|) n``.

    Half of the contact part of e^2, ``int b |w_t| + r_t.w_t + r_n (w_n - g)``, is ``int r.v`` up to a constant where
    ``b = offset + mu p`` (de Saxce's bipotential). A change dr of the traction adds about ``h/(kappa E) |dr|^2`` to the
    bulk part. So the best r is the allowed traction nearest to ``r_0 - kappa E/h v``. A traction that slips stays on
    the surface of its cone, where it adds nothing, however long the slip is.

    The attributes are means on a facet against its Bernstein polynomials: their products with coefficients are
    integrals.

    Attributes:
        slip: E/h times the mean of w_t [force/area], shape (f, m, d).
        path: E/h times the mean of ``|w_t|`` [force/area], shape (f, m).
        opening: E/h times the mean of ``max(g - w_n, 0)`` [force/area], shape (f, m).
        n: Normals, shape (f, 1, d).

    Source: G. de Saxce, Z.-Q. Feng, "The bipotential method", Math. Comput. Modelling 28 (1998).
    """

    slip: np.ndarray
    path: np.ndarray
    opening: np.ndarray
    n: np.ndarray

    def __call__(self, slope: Any) -> np.ndarray:
        """``-kappa E/h v`` for slopes mu of the friction bound [force/area], shape (f, m, d)."""
        return MOBILITY * ((slope * self.path + self.opening)[..., None] * self.n - self.slip)

    def round_off(self, r: np.ndarray) -> np.ndarray:
        """The shift with the kappa of round-off, which is larger where the slip is far beyond ``h/E |r|``.

        The round-off of a traction that slips enters e multiplied by the slip.
        """
        far = FAR * np.linalg.norm(r, axis=-1)
        length = self.path + self.opening
        kappa = ROUND_OFF * (1 + np.divide(length, far, out=np.zeros_like(far), where=far > 0))
        return kappa[..., None] * (self.opening[..., None] * self.n - self.slip)


def admissible_tractions(model: Model, solution: Any, loads: np.ndarray, forces: float) -> list[ContactTraction]:
    """r^: the L2 projection of the method's traction on degree k of each facet, limited to what the law allows.

    The limiter of degree 2 uses the means ``int r B_m / int B_m``, which the law allows where it allows r. Round-off of
    the method's traction is shifted in the direction in which it does not increase e.

    Where no support holds a rigid motion, r^ must balance the work of the loads on this motion exactly. The least
    change within the allowed tractions gives the balance.

    Args:
        model: The scene on a mesh.
        solution: The solution of the contact problem.
        loads: Work on the free motions of the projected loads, which sigma^ will balance [force], shape (motions,).
        forces: Sum of the sizes of the nodal forces of these loads [force].

    Raises:
        NotHeldError: If no allowed traction balances the loads on a free motion.
    """
    points, weights = rule(model.d - 1, model.contact_degree)
    project = projection(model.d - 1, model.degree, points, weights)
    average = averages(model.d - 1, model.degree, points, weights)
    raw, means, shifts = [], [], []
    for contact in model.contacts:
        nodes = model.facet_nodes(contact.facets)
        area = model.facet_areas(contact.facets)
        shifts.append(_shift(model, contact, solution.u.x.array.reshape(-1, model.d)[nodes], area))
        sampled = evaluate(solution.traction(contact), model.mesh, points, contact.facets)
        means.append(np.matmul(average, sampled))
        raw.append(ContactTraction(contact, nodes, area, np.matmul(project, sampled), np.zeros(nodes.shape)))

    def limited(*, levels: bool) -> list[ContactTraction]:
        return _limited(model, raw, means, shifts, loads, forces, levels=levels)

    if not any(contact.sampled for contact in model.contacts):
        return limited(levels=False)
    try:
        return limited(levels=True)
    except NotHeldError:  # on a coarse mesh level pressures may leave too little to balance with
        return limited(levels=False)


def _limited(
    model: Model,
    raw: list[ContactTraction],
    means: list[np.ndarray],
    shifts: list[_Shift],
    loads: np.ndarray,
    forces: float,
    *,
    levels: bool,
) -> list[ContactTraction]:
    """Tractions limited to what the law allows, and balanced; ``levels`` tells whether pressures may be levelled."""
    allowed = [Allowed(model, t.contact, np.ones(len(t.nodes))) for t in raw]
    level = [np.zeros(len(t.nodes), dtype=bool) for t in raw]

    def projected() -> list[ContactTraction]:
        values = [
            a.project(t.values) if model.degree == 1 else a.limited(mean, t.values)
            for t, mean, a in zip(raw, means, allowed, strict=True)
        ]
        values = [
            _levelled(a.project(r + shift.round_off(r)), a, shift, on)
            for r, a, shift, on in zip(values, allowed, shifts, level, strict=True)
        ]
        if model.free_motions:
            values = _balanced(model, raw, values, allowed, shifts, level, loads, forces)
        new = []
        for t, v, a in zip(raw, values, allowed, strict=True):
            pressure = pressures(v, a.n)
            limit = replace(a, factor=np.ones(len(v)), sharp=True)
            new.append(replace(t, values=v, friction_bound=limit.bound(pressure)))
        return new

    for _ in range(PASSES):
        new = projected()
        factors = [_shrink(model, t) for t in new]
        found = [
            _becomes_level(model, t, a, shift) & levels & ~on
            for t, a, shift, on in zip(new, allowed, shifts, level, strict=True)
        ]
        changes = any(np.any(f < 1.0) for f in factors) or any(np.any(become) for become in found)
        if not model.comm.allreduce(changes, MPI.LOR):
            return new
        level = [on | become for on, become in zip(level, found, strict=True)]
        factors = [np.where(become, 1.0, f) for f, become in zip(factors, found, strict=True)]
        allowed = [
            replace(a, factor=np.where(become, 1.0, a.factor * f))
            for a, f, become in zip(allowed, factors, found, strict=True)
        ]
        raw = [replace(t, values=_shrunk(t.contact, t.values, f)) for t, f in zip(raw, factors, strict=True)]
        means = [_shrunk(t.contact, mean, f) for t, mean, f in zip(raw, means, factors, strict=True)]
    allowed = [replace(a, sharp=False) for a in allowed]
    return projected()


def _shift(model: Model, contact: BoundContact, u: np.ndarray, area: np.ndarray) -> _Shift:
    """The shift of the traction of a contact by displacements with nodal values u (f, m, d)."""
    n, d, k = contact.direction[:, None, :], model.d, model.degree
    points, weights = rule(d - 1, model.contact_degree)
    average, shape = averages(d - 1, k, points, weights), lagrange(d - 1, k, points)
    w_n, w_t, length = split(np.matmul(shape, u), n)
    opening = np.zeros_like(w_n)
    if not contact.bilateral:
        opening = np.maximum(model.gap_at_nodes(contact) @ shape.T - w_n, 0.0)
    stiffness = (model.at_middles(model.modulus, contact.facets[:, 0]) / area ** (1 / (d - 1)))[:, None]
    slip = stiffness[..., None] * np.matmul(average, w_t)
    return _Shift(slip, stiffness * length @ average.T, stiffness * opening @ average.T, n)


def _level(values: np.ndarray, allowed: Allowed, shift: _Shift) -> np.ndarray:
    """Tractions (f, m, d) of the mean pressure of each facet that oppose the slip with the friction that it allows.

    Where friction varies or is nonlinear in the pressure, the bound of a pressure that varies is no polynomial, and r^
    stays below it: the contact part charges the difference times the slip. With a level pressure it follows the bound,
    exactly where the parameters are polynomials on the facet.
    """
    pressure = np.maximum(-(values * shift.n).sum(axis=2).mean(axis=1), 0.0)
    bound = allowed.bound(np.broadcast_to(pressure[:, None], values.shape[:2]))
    length = np.linalg.norm(shift.slip, axis=2, keepdims=True)
    against = np.divide(shift.slip, length, out=np.zeros_like(shift.slip), where=length > 0)
    return -pressure[:, None, None] * shift.n - bound[..., None] * against


def _levelled(values: np.ndarray, allowed: Allowed, shift: _Shift, level: np.ndarray) -> np.ndarray:
    """Tractions (f, m, d), those of some facets (f,) with a level pressure; collective where friction is sampled."""
    if not allowed.contact.sampled:
        return values
    return np.where(level[:, None, None], _level(values, allowed, shift), values)


def _becomes_level(model: Model, traction: ContactTraction, allowed: Allowed, shift: _Shift) -> np.ndarray:
    """Facets whose error falls when their pressure is levelled, shape (f,).

    They slide far, and the contact part falls by more than the bulk part rises, as far as the changes tell.
    """
    friction = traction.contact.friction
    if friction is None or friction.convex or friction.dependence == CONSTANT:  # no product of friction and pressure
        return np.zeros(len(traction.nodes), dtype=bool)
    most, used = _friction(model, traction)
    saved = 2 * np.maximum(most - used, 0.0).mean(axis=1) * shift.path.mean(axis=1)
    added = ((traction.values - _level(traction.values, allowed, shift)) ** 2).sum(axis=2).mean(axis=1)
    far = shift.path.mean(axis=1) > SLIDES * np.linalg.norm(traction.values, axis=2).max(axis=1, initial=0.0)
    return far & (saved > added)


def _friction(model: Model, traction: ContactTraction) -> tuple[np.ndarray, np.ndarray]:
    """The friction bound and the length of the tangential traction at samples of the facets, shape (f, q)."""
    at = samples(model.d)
    shape = bernstein(model.d - 1, model.degree, at)
    parameters = model.friction_parameters(traction.contact, at)
    most = traction.contact.friction_bound(np.maximum(-traction.normal_component @ shape.T, 0.0), parameters)
    return most, np.linalg.norm(np.einsum("qm,fmi->fqi", shape, traction.tangential_part), axis=-1)


def _shrink(model: Model, traction: ContactTraction) -> np.ndarray:
    """Factor of the friction bound on each facet with which the law allows r^ between the nodes, shape (f,)."""
    if not traction.contact.sampled:
        return np.ones(len(traction.nodes))
    most, used = _friction(model, traction)
    peak = model.comm.allreduce(float(used.max(initial=0.0)), MPI.MAX)
    excess = used > most + 1e-14 * peak  # the ratio of two numbers that are round-off means nothing
    ratio = np.divide(most, used, out=np.ones_like(used), where=excess).min(axis=1)
    return np.where(ratio < 1.0, np.maximum(ratio - MARGIN * (1 - ratio), 0.0), 1.0)


def _shrunk(contact: BoundContact, values: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Tractions (f, m, d) with their tangential part times a factor of each facet."""
    n = contact.direction[:, None, :]
    normal = (values * n).sum(axis=-1, keepdims=True) * n
    return normal + factor[:, None, None] * (values - normal)


def _balanced(
    model: Model,
    raw: list[ContactTraction],
    start: list[np.ndarray],
    allowed: list[Allowed],
    shifts: list[_Shift],
    level: list[np.ndarray],
    loads: np.ndarray,
    forces: float,
) -> list[np.ndarray]:
    """The allowed tractions nearest to the shifted ones that balance the loads on the free motions.

    The tractions of facets with a level pressure are multiples of :func:`_level`: one unknown, all nodes as one.
    """
    comm, d = model.comm, model.d
    weights, motions = [], []
    for t in raw:
        of = [f.x.array.reshape(-1, d)[t.nodes] for f in model.free_motions]  # linear: values are the coefficients
        share = t.area / t.nodes.shape[1]
        moment = np.stack([moments(t.area, values, model.degree) for values in of], axis=-1)
        motions.append(moment / share[:, None, None, None])
        owned = model.owned(t.contact.facets)
        weights.append(np.where(owned, share, 0.0)[:, None])
    values = start
    for _ in range(PASSES):
        peak = comm.allreduce(max((float(abs(r).max(initial=0.0)) for r in values), default=0.0), MPI.MAX)
        cones = [a.near(r, peak) for a, r in zip(allowed, values, strict=True)]
        moves = [shift(c.slope) for shift, c in zip(shifts, cones, strict=True)]
        along = [_levelled(r, a, shift, on) for r, a, shift, on in zip(values, allowed, shifts, level, strict=True)]
        free = [Part(*part).of(~on) for *part, on in zip(cones, start, moves, weights, motions, level, strict=True)]
        rays = [
            _rays(*(array[on] for array in of)) for *of, on in zip(along, start, weights, motions, level, strict=True)
        ]
        found, rest, sizes = balanced(comm, free + rays, loads)
        values = [np.empty_like(r) for r in start]
        for r, of_nodes, of_rays, on in zip(values, found[: len(raw)], found[len(raw) :], level, strict=True):
            r[~on], r[on] = of_nodes, of_rays.reshape(-1, *r.shape[1:])
        if np.linalg.norm(rest) > HELD * max(forces, sizes):
            raise NotHeldError(
                "No contact traction that the law allows, a polynomial on each facet, balances the loads on a rigid "
                f"motion that no support holds (imbalance {np.linalg.norm(rest) / max(forces, sizes):.1e} of the "
                "forces). Look at the direction of the loads, add a Displacement or friction, or refine the mesh at "
                "the contact."
            )
        moved = 0.0
        for r, a, shift, on in zip(values, allowed, shifts, level, strict=True):
            kept = np.where(on[:, None, None], _levelled(r, a, shift, on), a.project(r))
            moved = max(moved, float(abs(kept - r).max(initial=0.0)))
        if comm.allreduce(moved, MPI.MAX) <= 1e-13 * peak:
            break
    return values


def _rays(along: np.ndarray, start: np.ndarray, weight: np.ndarray, motions: np.ndarray) -> Part:
    """Facets whose tractions are multiples >= 0 of given ones (f, m, d), all nodes of a facet as one long vector."""
    f, m, d = along.shape
    long = along.reshape(f, 1, m * d)
    size = np.linalg.norm(long, axis=2, keepdims=True)
    unit = np.divide(-long, size, out=np.zeros_like(long), where=size > 0)
    none = np.zeros((f, 1))
    cones = Cones(unit, none, none, none > 0)
    start = start.reshape(f, 1, m * d)
    return Part(cones, start, np.zeros_like(start), weight, motions.reshape(f, 1, m * d, motions.shape[-1]))
