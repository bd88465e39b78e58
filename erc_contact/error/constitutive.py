"""The error in the constitutive relation of an admissible pair: global, in parts, and per element.

    e^2 = |sigma^ - C eps(u^)|^2 + 2 int_GammaC ( b(p^) |w_t| + r^_t.w_t + r^_n (w_n - g) ),  p^ = -r^_n   (16)
    eps = e / |sigma^ + C eps(u^)|                                                                       (17)

in energy norms ``|sigma|^2 = int C^-1 sigma : sigma``, with b the friction bound of the law: mu p for Coulomb, s for
Tresca. Both terms are never negative; e = 0 only for the solution. For
frictionless contact and given friction (Tresca) e bounds the errors of u^ and of sigma^ with constant 1:

    |u - u^|^2 + |sigma - sigma^|^2 + 2 int_GammaC (b(p) - b(p^))(|w_t| - |w^_t|)  <=  e^2.

Where the bound depends on the pressure, as Coulomb's, the third term is a product of two errors and has no sign: e is
then a bound up to a term of higher order, not a guarantee. A bilateral contact takes ``w_n = g`` as a support does.

Where moduli, gap or friction bound vary inside cells, the integrals are adapted to them, and e contains what they leave
unknown. What the mesh cannot carry of the data is the oscillation, reported beside e and not part of it.

Source: Coorevits, Hild, Hjiaj, equations (16)-(18); the gap g is ours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.cells import sorted_corners
from erc_contact.admissible.contact import ContactTraction, split
from erc_contact.admissible.elastic import act, elastic_stress, macro_moduli, moduli, strains
from erc_contact.admissible.macro import macro_points, macro_values
from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError
from erc_contact.error.oscillation import COARSE, EXACT, Oscillations, facet_sizes, of_loads, of_supports
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.quadrature import cell_pieces, facet_pieces, integrate, polynomials
from erc_contact.mesh.simplex import bernstein, coefficients, lagrange, rule
from erc_contact.mesh.surface import pairs, swept
from erc_contact.model.expressions import Everywhere, evaluate, varies_in_cells
from erc_contact.model.foundation import CONSTANT, BoundContact, ContactData
from erc_contact.model.motions import rigid_motions
from erc_contact.newton.solve import Solution
from erc_contact.results import questions as results
from erc_contact.results.questions import Force, Values

RESOLUTION = 1e-12
"""What a displacement is known to, over its size: the solver goes no further [-]."""
NOISE = 100.0
"""Where a rigid motion is the solution, energy norms below this multiple of what is known are zero [-]."""
UNKNOWN = 1e-4
"""What the integrals of data that vary may leave unknown of e^2, which contains it [-]."""
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
        geometry: What the flat facets of a curved body cost [sqrt(force length)], an estimate, not part of e: the
            energy norm of the stress between the facets and the true surface, ``geometry^2 = int |offset| |sigma|^2``,
            at an interface with the difference of ``|sigma|^2``. Half of its square is about what the polygon changes
            of the potential energy (0.78 to 0.94 of it on a pressed ring of 5 to 30 facets). It is zero where all
            facets are exact, and where only a mesh is known: the body is then the mesh.
        oscillations: What the data have beyond the mesh, in parts, estimates without the constants of Korn and Poincare
            type, not part of e.
        cells: eps_E (18) of the owned cells; the squares sum to eps^2 over all ranks.
        indicators: eps_E together with the share of the geometry, what refinement goes by: the squares sum to total^2.
        seconds: Wall time, the largest over the ranks [s].
    """

    admissible: Admissible
    absolute: float
    scale: float
    bulk: float
    contact: float
    geometry: float
    oscillations: Oscillations
    cells: np.ndarray
    indicators: np.ndarray
    seconds: float

    @property
    def relative(self) -> float:
        """Eps (17) [-]; 0 where nothing is loaded."""
        return self.absolute / self.scale if self.scale > 0 else 0.0

    @property
    def total(self) -> float:
        """Eps with the estimate of the geometry [-], what a run brings below its accuracy; eps for straight bodies."""
        return float(np.hypot(self.absolute, self.geometry)) / self.scale if self.scale > 0 else 0.0

    @property
    def solution(self) -> Solution:
        """The solution that the pair comes from."""
        return self.admissible.solution

    @property
    def domain(self) -> Domain:
        """The mesh with names."""
        return self.solution.domain

    def force(self, part: str) -> Force:
        """Resultant and moment on a boundary part, see :func:`erc_contact.results.questions.force`; collective."""
        return results.force(self.admissible, part)

    def reactions(self) -> dict[str, Force]:
        """Forces of supports, contacts and loads, and their balance, see :func:`results.reactions`; collective."""
        return results.reactions(self.admissible)

    def profile(self, contact: str) -> np.ndarray:
        """Gap, slip and tractions along a contact, see :func:`erc_contact.results.questions.profile`; collective."""
        return results.profile(self.admissible, contact)

    def at(self, points: Any) -> Values:
        """Displacement and stresses at points, see :func:`erc_contact.results.questions.at`; collective."""
        return results.at(self.admissible, points)

    @property
    def oscillation(self) -> float:
        """Root of the sum of the squares of the oscillations [sqrt(force length)]."""
        return self.oscillations.total


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
    per_cell, both, moduli_2 = _bulk(admissible)
    geometry = _geometry(admissible, both)
    bulk_2, scale_2, geometry_2 = model.comm.allreduce(np.array([per_cell.sum(), both.sum(), geometry.sum()]), MPI.SUM)
    squares = np.array([0.0, of_loads(admissible), of_supports(model), moduli_2, 0.0, 0.0])
    for traction in admissible.tractions:
        parts, gaps_2, friction_2 = _contact(admissible, traction, UNKNOWN * float(bulk_2))
        parts = np.maximum(parts, 0.0)  # negative by round-off only
        own = traction.contact.facets[:, 0] < len(per_cell)
        np.add.at(per_cell, traction.contact.facets[own, 0], parts[own])
        squares += float(parts.sum()), 0.0, 0.0, 0.0, gaps_2, friction_2
    contact_2, *parts_2 = model.comm.allreduce(squares, MPI.SUM)
    floor_2, lost = _round_off(admissible)
    if lost or not np.isfinite([bulk_2, scale_2, contact_2, *parts_2]).all():
        raise InputError(
            "The energy of this scene is no number of double precision; loads or moduli are too large or too small. "
            "Choose units in which they are nearer to 1."
        )
    if scale_2 <= NOISE**2 * floor_2 and _moves_rigidly(admissible, floor_2):  # what is left is round-off
        per_cell[:] = geometry[:] = bulk_2 = contact_2 = scale_2 = geometry_2 = 0.0
    e = float(np.sqrt(bulk_2 + contact_2))
    norm = float(np.sqrt(scale_2))
    cells, indicators = (np.sqrt(square) / (norm or 1.0) for square in (per_cell, per_cell + geometry))
    seconds = model.comm.allreduce(perf_counter() - began, MPI.MAX)
    return ConstitutiveError(
        admissible,
        e,
        norm,
        float(np.sqrt(bulk_2)),
        float(np.sqrt(contact_2)),
        float(np.sqrt(geometry_2)),
        Oscillations(*(float(np.sqrt(part)) for part in parts_2)),
        cells,
        indicators,
        seconds,
    )


def _bulk(admissible: Admissible) -> tuple[np.ndarray, np.ndarray, float]:
    """``|sigma^ - C eps(u^)|^2`` and ``|sigma^ + C eps(u^)|^2`` of each owned cell; collective.

    Where the moduli vary inside cells the first contains what its integral leaves unknown; the third number is that of
    the rank where it is more than the tolerance, else 0.
    """
    model, cells = admissible.solution.model, admissible.cells
    owned, k = model.domain.owned_cells, model.degree
    shape, _, weights = macro_points(model.d, k)
    compliance = macro_moduli(model, cells, owned, inverse=True)
    sigma = np.matmul(shape, admissible.stress).reshape(owned, len(weights), admissible.stress.shape[3])
    elastic = elastic_stress(model, cells, admissible.displacement, owned)

    def energy(tau: np.ndarray) -> np.ndarray:
        return cells.volume[:owned] * np.einsum("nqa,nqa,q->n", act(compliance, tau), tau, weights)

    difference, both = energy(sigma - elastic), energy(sigma + elastic)
    if not model.varying_moduli:
        return difference, both, 0.0
    stiffness_at, compliance_at = (
        Everywhere(matrix, model.domain) for matrix in (model.stiffness_matrix, model.compliance_matrix)
    )
    of_cells = np.arange(owned, dtype=np.int32)
    strain = strains(cells, admissible.displacement)[:owned]

    def energies(of: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        S = compliance_at(x, of_cells[of])
        elastic = act(stiffness_at(x, of_cells[of]), np.matmul(polynomials(k - 1, at), strain[of]))
        sigma = macro_values(admissible.stress, k, of, at)
        return np.stack([(act(S, tau) * tau).sum(axis=-1) for tau in (sigma - elastic, sigma + elastic)], axis=-1)

    corners = sorted_corners(model, cells)[:owned]
    floor = np.array([EXACT**2 * model.comm.allreduce(float(both.sum()), MPI.SUM), 0.0])
    total = integrate(
        model.comm, energies, corners, cells.volume[:owned], cell_pieces(model.d), share=UNKNOWN, floor=floor
    )
    unknown = 0.0 if total.resolved.all() else float(total.rest.max(axis=1).sum())
    return total.value[:, 0] + total.rest[:, 0], total.value[:, 1], unknown


def _geometry(admissible: Admissible, both: np.ndarray) -> np.ndarray:
    """The square of ``geometry`` by owned cells, from ``|sigma^ + C eps(u^)|^2 = 4 |sigma_m|^2`` of each.

    A facet at the edge of the body counts for its cell, one between two cells for both by halves.
    """
    model, cells = admissible.solution.model, admissible.cells
    result = np.zeros(len(both))
    if model.offset is None or model.domain.marks is None:
        return result
    density = fem.Function(fem.functionspace(model.mesh, ("DG", 0)))
    density.x.array[: len(both)] = both / (4 * cells.volume[: len(both)])
    density.x.scatter_forward()
    sides = pairs(model.mesh, model.domain.marks.indices)
    sides = sides[sides[:, 0] < len(both)]
    facets = model.mesh.topology.connectivity(model.d, model.d - 1).array.reshape(-1, model.d + 1)[tuple(sides.T)]
    beyond = cells.side[:, facets] // (model.d + 1)
    beyond = np.where(beyond[0] == sides[:, 0], beyond[1], beyond[0])
    inside = beyond != sides[:, 0]
    jump = density.x.array[sides[:, 0]] - np.where(inside, density.x.array[beyond], 0.0)
    cost = abs(jump) * swept(model.offset, sides, model.facet_areas(sides))
    np.add.at(result, sides[:, 0], np.where(inside, 0.5, 1.0) * cost)
    return result


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
    motions = rigid_motions(model).reshape(len(u), -1)
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


def contact_density(
    contact: BoundContact, n: np.ndarray, r: np.ndarray, w: np.ndarray, gap: Any, bound: np.ndarray
) -> np.ndarray:
    """Twice the contact term of (16), ``2 (b(p^) |w_t| + r^_t.w_t + r^_n (w_n - g))``, at points, shape (n, q).

    Args:
        contact: The contact.
        n: Normal of the foundation, shape (n, 1, d).
        r: r^ at the points [force/area], shape (n, q, d).
        w: u^ there [length], shape (n, q, d).
        gap: The gap there [length], shape (n, q), or a number.
        bound: The friction bound there [force/area], shape (n, q).
    """
    (r_n, r_t, _), (w_n, w_t, slip) = split(r, n), split(w, n)
    density = np.zeros(r_n.shape) if contact.bilateral else r_n * (w_n - gap)
    if contact.friction is not None:
        density += bound * slip + (r_t * w_t).sum(axis=-1)
    # a difference of two works that agree to round-off is no error; without this, e would end at 1e-8 of the norm
    resolution = 16 * np.finfo(float).eps * np.linalg.norm(r, axis=-1) * (np.linalg.norm(w, axis=-1) + abs(gap))
    return 2 * np.where(abs(density) <= resolution, 0.0, density)


def contact_parts(admissible: Admissible, traction: ContactTraction) -> np.ndarray:
    """Twice the integral of the contact term over each facet of an owned cell; ghosts get 0. Collective."""
    return _contact(admissible, traction, 0.0)[0]


def _contact(admissible: Admissible, traction: ContactTraction, floor: float) -> tuple[np.ndarray, float, float]:
    """The same, and the squares of the oscillations of gap and friction bound on this rank.

    Where the data of the contact vary, or given friction meets a slip that changes its direction, the integrals are
    adapted to both, up to ``floor`` or their UNKNOWN, and contain what they leave unknown.
    """
    model, contact = admissible.solution.model, traction.contact
    d, facets = model.d, contact.facets
    area = np.where(model.owned(facets), traction.area, 0.0)
    nodal = admissible.displacement.x.array.reshape(-1, d)[traction.nodes]
    if not (contact.varies or (contact.friction is not None and contact.friction.dependence == CONSTANT)):
        points, weights = rule(d - 1, CONTACT_DEGREE)
        r = np.matmul(bernstein(d - 1, model.degree, points), traction.values)
        w = np.matmul(lagrange(d - 1, model.degree, points), nodal)
        n = contact.direction[:, None, :]
        gap = 0.0 if contact.gap is None else evaluate(contact.gap, model.domain, points, facets)
        bound = contact.friction_bound(np.maximum(-split(r, n)[0], 0.0), model.friction_parameters(contact, points))
        return area * (contact_density(contact, n, r, w, gap, bound) @ weights), 0.0, 0.0
    given = ContactData(contact, model.domain)
    hat = np.matmul(coefficients(d - 1, model.degree), nodal)
    size, stiffness = facet_sizes(model, facets), model.at_middles(model.modulus, facets[:, 0])
    least = [
        EXACT * model.comm.allreduce(float(abs(v).max(initial=0.0)), MPI.MAX) for v in (hat, *[traction.values] * 2)
    ]

    def terms(of: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape, n = polynomials(model.degree, at), contact.direction[of][:, None, :]
        r, w = np.matmul(shape, traction.values[of]), np.matmul(shape, hat[of])
        r_n, _, friction = split(r, n)
        gap, normal, bound = given.gap(of, x), given.normal(of, x), given.bound(of, x, np.maximum(-r_n, 0.0))
        beyond = (w * normal).sum(axis=-1) - gap
        beyond = abs(beyond) if contact.bilateral else np.maximum(beyond, 0.0)
        turned = np.linalg.norm(r, axis=-1) * np.linalg.norm(normal - n, axis=-1)
        excess = friction - bound
        beyond, turned, excess = (
            np.where(v <= most, 0.0, v) for v, most in zip((beyond, turned, excess), least, strict=True)
        )
        soft = (size / stiffness)[of][:, None]
        density = contact_density(contact, n, r, w, gap, bound)
        return np.stack([density, beyond**2 / soft + turned**2 * soft, excess**2 * soft], axis=-1)

    corners, share = model.facet_corners(facets), np.array([UNKNOWN, COARSE, COARSE])
    total = integrate(
        model.comm,
        terms,
        corners,
        area,
        facet_pieces(d - 1),
        share=share,
        floor=np.array([floor, 0.0, 0.0]),
    )
    parts, gaps, friction = total.value.T
    unknown = np.zeros(2)
    if not total.resolved[0]:
        unknown[0 if contact.gap is not None and varies_in_cells(contact.gap) else 1] = total.rest[:, 0].sum()
    return parts + total.rest[:, 0], float(gaps.sum() + unknown[0]), float(friction.sum() + unknown[1])
