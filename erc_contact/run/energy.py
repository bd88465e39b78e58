"""The energies of a step of a history: strain energy, work of the loads and supports, work of the contacts.

Between two steps displacement and forces change along straight lines. So the work of a
traction t on a boundary part is

    int (t_n + t_(n-1))/2 . (u_n - u_(n-1)),

and that of a body force f is alike. In equilibrium the works of all parts are the
change of the strain energy, for any length of the step. Of an admissible pair, sigma^
gives t and u^ gives u, and what is left is of the order of its error.

What friction takes in a step is the dissipation function of its law for the slip of the
step, with the mean of the friction bounds at both ends of the step,

    ``int (b(r^_n) + b(r^_(n-1)))/2 |u^_t - s|``.

It is never below zero, and of second order in the length of the step. The bound at the
end alone is of first order: it is too small where a part opens while it slides. Minus
the work of friction, the tangential part of the work above, is of second order, too. It
is smaller, because a traction is never above its bound nor always against the slip; on
a facet with an open and a sticking node it may be below zero. Their difference
estimates what the length of the step costs where a point begins to slide, or turns. It
has the friction part of e^2/2 in it. It does not see how loads vary within a step in
which all slides.

Symbols: r^ and u^ admissible traction and displacement, b friction bound, s tangential
displacement of the last step, d dimension, f facets, m coefficients of a facet, q
points of a facet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cells import facet_order
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.traction import ContactTraction
from erc_contact.error.constitutive import ROUND_OFF, ConstitutiveError
from erc_contact.error.works import assembled, elastic_work, friction_work
from erc_contact.mesh.simplex import barycentric, bernstein, from_means, lagrange, projection, rule
from erc_contact.model.contacts import bind_contact
from erc_contact.model.foundation import BoundContact
from erc_contact.model.last_step import nearest
from erc_contact.model.model import Model
from erc_contact.model.trace import split
from erc_contact.results.profile import contact_of


@dataclass(frozen=True)
class Energies:
    """Energies of a step [force length].

    Attributes:
        work: Work of loads and supports on the body in the step.
        contact: Work of the contacts on the body in the step.
        friction: The part of the work of the contacts that friction does.
        dissipated: Energy that friction takes in the step.
        stored: Strain energy at its end.
    """

    work: float
    contact: float
    friction: float
    dissipated: float
    stored: float


def energies(error: ConstitutiveError, last: ConstitutiveError | None) -> Energies:
    """The energies of a step; collective.

    Args:
        error: The error at its end.
        last: The error at the end of the last step; None starts from rest, without
            forces.
    """
    before = None if last is None else last.admissible
    pair = error.admissible
    model = error.model
    contacts = {contact.name: contact for contact in model.contacts}
    work, contact_work, friction_work = _work_in_body(pair, before), 0.0, 0.0
    parts = _working(pair) | (set() if before is None else _working(before))
    for part in sorted(parts):  # the same order on all ranks
        contact = contacts.get(part)
        total, tangential = _works(pair, before, part, contact)
        if contact is None:
            work += total
        else:
            contact_work += total
            friction_work += tangential
    stored = 0.5 * elastic_work(pair, pair.displacement, pair.displacement).value
    floor = ROUND_OFF * stored
    dissipated = sum(_dissipated(pair, before, traction, floor) for traction in pair.tractions)
    return Energies(work, contact_work, friction_work, dissipated, stored)


def _dissipated(
    pair: Admissible, before: Admissible | None, traction: ContactTraction, floor: float
) -> float:
    """What friction takes on a contact in a step [force length]; collective."""
    if traction.contact.friction is None:
        return 0.0
    model, slip = pair.model, pair.displacement
    at_begin = friction_work(model, _traction_at_begin(model, before, traction), slip, floor)
    at_end = friction_work(model, traction, slip, floor)
    return 0.5 * (at_begin.value + at_end.value)


def _traction_at_begin(
    model: Model, before: Admissible | None, traction: ContactTraction
) -> ContactTraction:
    """The traction at the begin of a step, with the friction law of that time, on the mesh of its end; collective.

    On a mesh that refines the last one it is the same field, on another one a
    projection of it.
    """
    contact = traction.contact
    if before is None:  # from rest, without pressure
        return replace(traction, values=np.zeros_like(traction.values))
    old = before.model
    if old.domain is model.domain and old.degree == model.degree:
        last = contact_of(before, contact.name)
        friction, values = last.contact.friction, last.values
    else:
        declared = next(of for of in old.scene.contacts if of.facets == contact.name)
        friction = bind_contact(model, declared, model.modulus).friction
        points, weights = rule(model.d - 1, 2 * model.degree)
        x = np.matmul(barycentric(points), contact.trace.here.corners)
        carried, _ = _carried(before, contact.name, x)
        values = np.matmul(projection(model.d - 1, model.degree, points, weights), carried)
    return replace(traction, contact=replace(contact, friction=friction), values=values)


def _working(pair: Admissible) -> set[str]:
    """The names of the boundary parts whose tractions may do work."""
    scene = pair.model.scene
    loaded = {load.facets for load in scene.loads if load.facets is not None}
    return (
        loaded
        | {support.facets for support in scene.supports}
        | {contact.facets for contact in scene.contacts}
    )


def _works(
    pair: Admissible, before: Admissible | None, part: str, contact: BoundContact | None
) -> tuple[float, float]:
    """Work of the tractions on a boundary part in a step [force length]; collective.

    On a mesh that refines the last one the integral is exact, on another one it is not.

    Returns:
        The work, and the part of it that the tangential tractions of a contact do; 0
        without contact.
    """
    model = pair.model
    points, weights = rule(model.d - 1, 2 * model.degree)
    facets = model.domain.owned_facets(part)
    t, u = _at(pair, part, points)
    if before is not None:
        if before.domain is model.domain and before.model.degree == model.degree:
            old_t, old_u = _at(before, part, points)
        else:
            x = np.matmul(barycentric(points), model.facet_corners(facets))
            old_t, old_u = _carried(before, part, x)
        t, u = 0.5 * (t + old_t), u - old_u
    else:
        t = 0.5 * t
    areas = model.facet_areas(facets)
    total = float(areas @ ((t * u).sum(axis=-1) @ weights))
    tangential = 0.0
    if contact is not None:
        n = contact.direction[contact.trace.here.owned]
        _, t_t, _ = split(t, n[:, None, :])
        tangential = float(areas @ ((t_t * u).sum(axis=-1) @ weights))
    total, tangential = model.comm.allreduce(np.array([total, tangential]), MPI.SUM)
    return float(total), float(tangential)


def _at(pair: Admissible, part: str, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """sigma^ n [force/area] and u^ [length] at reference points of the owned facets of a part, shape (f, q, d) each."""
    model = pair.model
    _, t, u = _facets(pair, part)
    shape = (
        bernstein(model.d - 1, model.degree, points),
        lagrange(model.d - 1, model.degree, points),
    )
    return np.matmul(shape[0], t), np.matmul(shape[1], u)


def _facets(pair: Admissible, part: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners (f, d, d), coefficients of sigma^ n (f, m, d) and nodal values of u^ (f, m, d) of owned facets."""
    model, d, k = pair.model, pair.model.d, pair.model.degree
    facets = model.domain.owned_facets(part)
    nodes = model.facet_nodes(facets)
    moments = np.empty((*nodes.shape, d))
    order = facet_order(nodes[:, :d], k)[:, :, None]
    np.put_along_axis(moments, order, pair.facet_moments[model.facet_numbers(facets)], axis=1)
    t = from_means(d - 1, k, moments / model.facet_areas(facets)[:, None, None])
    return model.facet_corners(facets), t, pair.displacement.x.array.reshape(-1, d)[nodes]


def _carried(pair: Admissible, part: str, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """sigma^ n and u^ of another mesh at points (f, q, d) of this one, on the nearest facets; collective."""
    model, d, k = pair.model, pair.model.d, pair.model.degree
    gathered = model.comm.allgather(_facets(pair, part))
    corners, t, u = (np.concatenate(of) for of in zip(*gathered, strict=True))
    number, local, _ = nearest(x.reshape(-1, d), corners)
    shape = bernstein(d - 1, k, local[:, 1:]), lagrange(d - 1, k, local[:, 1:])
    values = [np.einsum("nm,nmi->ni", s, v[number]) for s, v in zip(shape, (t, u), strict=True)]
    return values[0].reshape(x.shape), values[1].reshape(x.shape)


def _work_in_body(pair: Admissible, before: Admissible | None) -> float:
    """Work of the loads in the body in a step [force length]; collective."""
    model = pair.model
    old = None if before is None else before.model
    total = 0.5 * _of_body_force(model, model, pair)
    if old is not None and before is not None:
        total -= 0.5 * _of_body_force(old, old, before)
        total += 0.5 * (_of_body_force(old, model, pair) - _of_body_force(model, old, before))
    return total


def _of_body_force(loads: Model, model: Model, pair: Admissible) -> float:
    """Work of the loads in the body of one scene on u^ of a pair, on the model of the pair."""
    if loads.body_force is None:
        return 0.0
    there = model if loads is model else Model(loads.scene, model.domain, model.degree)
    return assembled(there, there.loads(pair.displacement, on=[None]))
