"""The energies of a step of a history: strain energy, work of the loads and supports, work of the contacts.

Between two steps displacement and forces change along straight lines. So the work of a traction t on a boundary part is

    int (t_n + t_(n-1))/2 . (u_n - u_(n-1)),

and that of a body force f is alike. In equilibrium the works of all parts are the change of the strain energy, for any
length of the step. Of an admissible pair, sigma^ gives t and u^ gives u, and what is left is of the order of its error.

What friction takes in a step is the dissipation function of its law at the end of the step, for the slip of the step
(backward Euler), ``int b(r^) |u^_t - s|``. For the exact solution it is ``- int r_t . (u_t - s)``. For the pair that is
less by the friction part of e^2/2, and may be below zero: on a facet with an open and a sticking node, say. It differs
from the work of the contacts by this and by the error of the steps in time.

Symbols: r^ and u^ admissible traction and displacement, b friction bound, s tangential displacement of the last step, d
dimension, f facets, m coefficients of a facet, q points of a facet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cells import facet_order
from erc_contact.admissible.pair import Admissible
from erc_contact.error.constitutive import ROUND_OFF, ConstitutiveError
from erc_contact.error.works import assembled, elastic_work, friction_work
from erc_contact.mesh.simplex import barycentric, bernstein, from_means, lagrange, rule
from erc_contact.model.last_step import nearest
from erc_contact.model.model import Model


@dataclass(frozen=True)
class Energies:
    """Energies of a step [force length].

    Attributes:
        work: Work of loads and supports on the body in the step.
        contact: Work of the contacts on the body in the step.
        dissipated: Energy that friction takes in the step.
        stored: Strain energy at its end.
    """

    work: float
    contact: float
    dissipated: float
    stored: float


def energies(error: ConstitutiveError, last: ConstitutiveError | None) -> Energies:
    """The energies of a step; collective.

    A body at rest has none: all is known of it, and the pair of a curved one is only what its facets make of its gaps.

    Args:
        error: The error at its end.
        last: The error at the end of the last step; None starts from rest, without forces.
    """
    before = None if last is None or last.solution.at_rest else last.admissible
    if before is None and error.solution.at_rest:
        return Energies(0.0, 0.0, 0.0, 0.0)
    pair = error.admissible
    model = error.solution.model
    contacts = {contact.name for contact in model.contacts}
    work, contact = _work_in_body(pair, before), 0.0
    for part in sorted(_working(pair) | (set() if before is None else _working(before))):  # the same on all ranks
        of_part = _work(pair, before, part)
        work, contact = (work, contact + of_part) if part in contacts else (work + of_part, contact)
    stored = 0.5 * elastic_work(pair, pair.displacement, pair.displacement).value
    floor = ROUND_OFF * stored
    friction = sum(friction_work(model, t, pair.displacement, floor).value for t in pair.tractions)
    return Energies(work, contact, friction, stored)


def _working(pair: Admissible) -> set[str]:
    """The names of the boundary parts whose tractions may do work."""
    scene = pair.solution.model.scene
    loaded = {load.facets for load in scene.loads if load.facets is not None}
    return loaded | {support.facets for support in scene.supports} | {contact.facets for contact in scene.contacts}


def _work(pair: Admissible, before: Admissible | None, part: str) -> float:
    """Work of the tractions on a boundary part in a step [force length]; collective.

    On a mesh that refines the last one the integral is exact, on another one it is not.
    """
    model = pair.solution.model
    points, weights = rule(model.d - 1, 2 * model.degree)
    facets = model.domain.facets(part)
    facets = facets[model.owned(facets)]
    t, u = _at(pair, part, points)
    if before is not None:
        if before.solution.domain is model.domain and before.solution.model.degree == model.degree:
            old_t, old_u = _at(before, part, points)
        else:
            x = np.matmul(barycentric(points), model.facet_corners(facets))
            old_t, old_u = _carried(before, part, x)
        t, u = 0.5 * (t + old_t), u - old_u
    else:
        t = 0.5 * t
    local = float(model.facet_areas(facets) @ ((t * u).sum(axis=-1) @ weights))
    return float(model.comm.allreduce(local, MPI.SUM))


def _at(pair: Admissible, part: str, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """sigma^ n [force/area] and u^ [length] at reference points of the owned facets of a part, shape (f, q, d) each."""
    model = pair.solution.model
    _, t, u = _facets(pair, part)
    shape = bernstein(model.d - 1, model.degree, points), lagrange(model.d - 1, model.degree, points)
    return np.matmul(shape[0], t), np.matmul(shape[1], u)


def _facets(pair: Admissible, part: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners (f, d, d), coefficients of sigma^ n (f, m, d) and nodal values of u^ (f, m, d) of owned facets."""
    model, d, k = pair.solution.model, pair.solution.model.d, pair.solution.model.degree
    facets = model.domain.facets(part)
    facets = facets[model.owned(facets)]
    nodes = model.facet_nodes(facets)
    moments = np.empty((*nodes.shape, d))
    order = facet_order(nodes[:, :d], k)[:, :, None]
    np.put_along_axis(moments, order, pair.facet_moments[model.facet_numbers(facets)], axis=1)
    t = from_means(d - 1, k, moments / model.facet_areas(facets)[:, None, None])
    return model.facet_corners(facets), t, pair.displacement.x.array.reshape(-1, d)[nodes]


def _carried(pair: Admissible, part: str, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """sigma^ n and u^ of another mesh at points (f, q, d) of this one, on the nearest facets; collective."""
    model, d, k = pair.solution.model, pair.solution.model.d, pair.solution.model.degree
    gathered = model.comm.allgather(_facets(pair, part))
    corners, t, u = (np.concatenate(of) for of in zip(*gathered, strict=True))
    number, local, _ = nearest(x.reshape(-1, d), corners)
    shape = bernstein(d - 1, k, local[:, 1:]), lagrange(d - 1, k, local[:, 1:])
    values = [np.einsum("nm,nmi->ni", s, v[number]) for s, v in zip(shape, (t, u), strict=True)]
    return values[0].reshape(x.shape), values[1].reshape(x.shape)


def _work_in_body(pair: Admissible, before: Admissible | None) -> float:
    """Work of the loads in the body in a step [force length]; collective."""
    model = pair.solution.model
    old = None if before is None else before.solution.model
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
