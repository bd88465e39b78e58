"""The error in the constitutive relation of an admissible pair: global, in parts, and per element.

    e^2 = |sigma^ - C eps(u^)|^2 + 2 int_GammaC ( b(p^) |w_t| + r^_t.w_t + r^_n (w_n - g) ),  p^ = -r^_n   (16)
    eps = e / |sigma^ + C eps(u^)|                                                                       (17)

in energy norms ``|sigma|^2 = int C^-1 sigma : sigma``, with b the friction bound of the law: mu p for Coulomb, s for
Tresca. Both terms are never negative; e = 0 only for the solution. For
frictionless contact and given friction (Tresca) e bounds the errors of u^ and of sigma^ with constant 1:

    |u - u^|^2 + |sigma - sigma^|^2 + 2 int_GammaC (b(p) - b(p^))(|w_t| - |w^_t|)  <=  e^2.

Where the bound depends on the pressure, as Coulomb's, the third term is a product of two errors and has no sign: e is
then a bound up to a term of higher order, not a guarantee. A bilateral contact takes ``w_n = g`` as a support does.
What the finite element spaces cannot carry of the data is the oscillation, reported
beside e and not part of it.

Source: Coorevits, Hild, Hjiaj, equations (16)-(18); the gap g is ours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible import Admissible, act, elastic_stress, macro_moduli, moduli
from erc_contact.admissible.contact import ContactTraction, split
from erc_contact.admissible.geometry import evaluate_sorted
from erc_contact.admissible.macro import macro_points
from erc_contact.exceptions import InputError
from erc_contact.expressions import evaluate
from erc_contact.model import Model
from erc_contact.motions import rigid_motions
from erc_contact.simplex import bernstein, coefficients, lagrange, mass, rule

RESOLUTION = 1e-12
"""What a displacement is known to, over its size: the solver goes no further [-]."""
NOISE = 100.0
"""Where a rigid motion is the solution, energy norms below this multiple of what is known are zero [-]."""
OSCILLATION_DEGREE = 6
CONTACT_DEGREE = 21
"""Quadrature degree for the contact part; its integrand has kinks where the slip changes its direction."""


@dataclass(frozen=True, eq=False)
class ConstitutiveError:
    """The error of an admissible pair.

    Attributes:
        admissible: The pair.
        absolute: e (16) [sqrt(force length)].
        scale: ``|sigma^ + C eps(u^)|`` [sqrt(force length)].
        bulk: Bulk part of e.
        contact: Contact part of e; ``bulk^2 + contact^2 = e^2``.
        oscillation: Size of what the data have beyond the finite element spaces [sqrt(force length)], an estimate
            without the constants of Korn and Poincare type, not part of e.
        cells: eps_E (18) of the owned cells; the squares sum to eps^2 over all ranks.
        seconds: Wall time, the largest over the ranks [s].
    """

    admissible: Admissible
    absolute: float
    scale: float
    bulk: float
    contact: float
    oscillation: float
    cells: np.ndarray
    seconds: float

    @property
    def relative(self) -> float:
        """Eps (17) [-]; 0 where nothing is loaded."""
        return self.absolute / self.scale if self.scale > 0 else 0.0


def constitutive_error(admissible: Admissible) -> ConstitutiveError:
    """Measure the error in the constitutive relation; collective.

    Args:
        admissible: An admissible pair.

    Returns:
        e, eps, their parts and eps_E; all zero where nothing is loaded (but for a rigid motion).

    Raises:
        InputError: If the energy overflows or underflows double precision.
    """
    began = perf_counter()
    model = admissible.solution.model
    bulk, scale = _bulk(admissible)
    per_cell = bulk.copy()
    contact = 0.0
    for traction in admissible.tractions:
        part = np.maximum(contact_parts(admissible, traction), 0.0)  # negative by round-off only
        own = traction.contact.facets[:, 0] < len(per_cell)
        np.add.at(per_cell, traction.contact.facets[own, 0], part[own])
        contact += float(part.sum())
    total = model.comm.allreduce(np.array([bulk.sum(), contact, scale, _oscillation(admissible)]), MPI.SUM)
    bulk_2, contact_2, scale_2, oscillation_2 = total
    floor_2, lost = _round_off(admissible)
    if lost or not np.isfinite(total).all():
        raise InputError(
            "The energy of this scene is no number of double precision; loads or moduli are too large or too small. "
            "Choose units in which they are nearer to 1."
        )
    if scale_2 <= NOISE**2 * floor_2 and _moves_rigidly(admissible, floor_2):  # what is left is round-off
        per_cell[:] = bulk_2 = contact_2 = scale_2 = 0.0
    e = float(np.sqrt(bulk_2 + contact_2))
    norm = float(np.sqrt(scale_2))
    cells = np.sqrt(per_cell) / norm if norm > 0 else per_cell
    seconds = model.comm.allreduce(perf_counter() - began, MPI.MAX)
    return ConstitutiveError(
        admissible,
        e,
        norm,
        float(np.sqrt(bulk_2)),
        float(np.sqrt(contact_2)),
        float(np.sqrt(oscillation_2)),
        cells,
        seconds,
    )


def _bulk(admissible: Admissible) -> tuple[np.ndarray, float]:
    """``|sigma^ - C eps(u^)|^2`` of each owned cell, and ``|sigma^ + C eps(u^)|^2`` of the rank."""
    model, cells = admissible.solution.model, admissible.cells
    owned = model.domain.owned_cells
    shape, _, weights = macro_points(model.d, model.degree)
    compliance = macro_moduli(model, cells, owned, inverse=True)
    sigma = np.matmul(shape, admissible.stress).reshape(owned, len(weights), admissible.stress.shape[3])
    elastic = elastic_stress(model, cells, admissible.displacement, owned)

    def energy(tau: np.ndarray) -> np.ndarray:
        return cells.volume[:owned] * np.einsum("nqa,nqa,q->n", act(compliance, tau), tau, weights)

    return energy(sigma - elastic), float(energy(sigma + elastic).sum())


def _round_off(admissible: Admissible) -> tuple[float, bool]:
    """Square of the energy norm that a stress ``C eps(u)`` is known to, and whether it underflows.

    A displacement of size |u| is known to ``RESOLUTION |u|``, so its strain in a cell of size h to that over h.
    """
    model, cells = admissible.solution.model, admissible.cells
    comm, owned = model.comm, model.domain.owned_cells
    size = comm.allreduce(float(abs(admissible.displacement.x.array).max(initial=0.0)), MPI.MAX)
    stiffness = moduli(model, cells, np.full((1, model.d), 1 / (model.d + 1)), owned)[:, 0].max(axis=(1, 2))
    volume = cells.volume[:owned]
    local = np.sum(stiffness * volume ** (1 - 2 / model.d))
    floor = float((RESOLUTION * size) ** 2 * comm.allreduce(float(local), MPI.SUM))
    return floor, size > 0.0 and floor == 0.0


def _moves_rigidly(admissible: Admissible, floor_2: float) -> bool:
    """Whether a rigid motion is the solution but for round-off: no load, and it keeps the supports and the gaps.

    What the supports leave free of it is taken from u^. A friction bound without pressure must not resist it.
    """
    model, u = admissible.solution.model, admissible.displacement.x.array
    comm, owned = model.comm, model.V.dofmap.index_map.size_local * model.d
    motions = rigid_motions(model)[0].reshape(len(u), -1)
    free = np.column_stack([motion.x.array for motion in model.free_motions] or [np.zeros((len(u), 0))])
    fixed = model.fixed.ravel()

    def nearest(motions: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The combination of motions that is nearest to values, all ranks."""
        products = comm.allreduce(motions[:owned].T @ np.column_stack([motions, values])[:owned], MPI.SUM)
        return np.linalg.lstsq(products[:, :-1], products[:, -1], rcond=1e-10)[0]

    held = motions @ nearest(motions * fixed[:, None], model.prescribed.x.array * fixed)
    rigid = held + free @ nearest(free, u - held)
    wrong = [abs(rigid - model.prescribed.x.array)[fixed].max(initial=0.0)]
    friction = 0.0
    moved = replace(admissible, displacement=admissible.displacement.copy())
    moved.displacement.x.array[:] = rigid
    for t in admissible.tractions:
        beyond = np.einsum("fmi,fi->fm", rigid.reshape(-1, model.d)[t.nodes], t.contact.direction)
        beyond -= model.gap_at_nodes(t.contact)
        wrong.append((abs(beyond) if t.contact.bilateral else beyond).max(initial=0.0))
        friction += float(contact_parts(moved, replace(t, values=np.zeros_like(t.values))).sum())
    loads = admissible.solution.stiffness.load_vector().x.array  # parts of nodes between ranks: their size is enough
    sizes = np.array([max(wrong), abs(loads).max(initial=0.0), abs(u).max(initial=0.0)])
    comm.Allreduce(MPI.IN_PLACE, sizes, MPI.MAX)
    friction = comm.allreduce(friction, MPI.SUM)
    return sizes[0] <= RESOLUTION * sizes[2] and sizes[1] * sizes[2] <= floor_2 / RESOLUTION and friction <= floor_2


def contact_parts(admissible: Admissible, traction: ContactTraction) -> np.ndarray:
    """Twice the integral of the contact term over each facet of an owned cell; ghosts get 0."""
    model, contact = admissible.solution.model, traction.contact
    d, n = model.d, contact.direction[:, None, :]
    points, weights = rule(d - 1, CONTACT_DEGREE)
    r = np.matmul(bernstein(d - 1, model.degree, points), traction.values)
    nodal = admissible.displacement.x.array.reshape(-1, d)[traction.nodes]
    w = np.matmul(lagrange(d - 1, model.degree, points), nodal)
    (r_n, r_t, _), (w_n, w_t, slip) = split(r, n), split(w, n)
    gap: Any = 0.0 if contact.gap is None else evaluate(contact.gap, model.domain, points, contact.facets)
    density = np.zeros(r_n.shape) if contact.bilateral else r_n * (w_n - gap)
    if contact.law is not None:
        parameters = model.friction_parameters(contact, points)
        density += contact.friction_bound(np.maximum(-r_n, 0.0), parameters) * slip + (r_t * w_t).sum(axis=-1)
    # a difference of two works that agree to round-off is no error; without this, e would end at 1e-8 of the norm
    resolution = 16 * np.finfo(float).eps * np.linalg.norm(r, axis=-1) * (np.linalg.norm(w, axis=-1) + abs(gap))
    density = np.where(abs(density) <= resolution, 0.0, density)
    part = 2 * traction.area * (density @ weights)
    return np.where(contact.facets[:, 0] < model.domain.owned_cells, part, 0.0)


def _oscillation(admissible: Admissible) -> float:
    """Square of the oscillation of the data on this rank.

    ``sum h^2/(pi^2 E) |f - f_T|^2 + sum h/E |F - F_h|^2 + sum E/h |U - U_h|^2`` with E the modulus of the material.
    """
    model, cells = admissible.solution.model, admissible.cells
    scene, d, owned = model.scene, model.d, model.domain.owned_cells
    total = 0.0
    varies = any(callable(b.value) or any(map(callable, b.value)) for b in scene.body_forces)
    if admissible.force is not None and varies:
        points, weights = rule(d, OSCILLATION_DEGREE)
        of, volume = np.arange(owned, dtype=np.int32), cells.volume[:owned]
        projected = np.matmul(bernstein(d, model.degree - 1, points), admissible.force[:owned] / volume[:, None, None])
        rest = evaluate_sorted(model.body_force, model, cells, points, owned) - projected
        square = volume * np.einsum("nqi,nqi,q->n", rest, rest, weights)
        total += float(np.sum(volume ** (2 / d) / np.pi**2 * square / _modulus(model, of)))
    points, weights = rule(d - 1, OSCILLATION_DEGREE)
    shape = bernstein(d - 1, model.degree, points)
    project = np.linalg.solve(mass(d - 1, model.degree, model.degree), shape.T * weights)

    def rest_on(
        facets: np.ndarray, values: np.ndarray, of_coefficients: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        area = model.facet_areas(facets)
        difference = values - np.matmul(shape, of_coefficients)
        square = (difference**2).sum(axis=2)
        return area * (square @ weights), area ** (1 / (d - 1)), _modulus(model, facets[:, 0])

    for load, (name, _, traction) in zip(scene.tractions, model.tractions, strict=True):
        given = (load.pressure,) if load.value is None else load.value
        if callable(given) or any(map(callable, given)):
            facets = _owned(model, name)
            values = evaluate(traction, model.domain, points, facets)
            rest, size, modulus = rest_on(facets, values, np.einsum("mq,fqi->fmi", project, values))
            total += float(np.sum(rest * size / modulus))
    for support in scene.supports:
        for i, component in enumerate(support.value):
            if callable(component):
                facets = _owned(model, support.facets)
                values = evaluate(component(model.x), model.domain, points, facets)
                nodal = model.prescribed.x.array.reshape(-1, d)[model.facet_nodes(facets), i]
                given = nodal @ coefficients(d - 1, model.degree).T
                rest, size, modulus = rest_on(facets, values[..., None], given[..., None])
                total += float(np.sum(rest * modulus / size))
    return total


def _owned(model: Model, name: str) -> np.ndarray:
    facets = model.domain.facets(name)
    return facets[facets[:, 0] < model.domain.owned_cells]


def _modulus(model: Model, cells: np.ndarray) -> np.ndarray:
    """Modulus of the material at the middle of cells [force/area]."""
    middle = np.full((1, model.d), 1 / (model.d + 1))
    return evaluate(model.scene.material.modulus(**model.parameters), model.domain, middle, cells)[:, 0]
