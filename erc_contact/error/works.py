"""Work of stresses, loads and friction on displacements.

It is known up to what the integrals leave unknown. The integrals are exact where no
data vary inside cells. Elsewhere they are adapted to the data
(:mod:`erc_contact.mesh.quadrature`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.cells import cell_geometry, sorted_corners
from erc_contact.admissible.elastic import act, strains
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.springs import spring_work
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.error.bulk import data_vary
from erc_contact.error.contact_integral import contact_integral
from erc_contact.error.foundations import foundation_energies
from erc_contact.mesh.quadrature import (
    Integral,
    Integrand,
    cell_pieces,
    facet_pieces,
    integrate,
    polynomials,
)
from erc_contact.mesh.simplex import bernstein, coefficients
from erc_contact.model.contact_data import ContactData
from erc_contact.model.expressions import Everywhere
from erc_contact.model.foundation import pressures
from erc_contact.model.model import Model
from erc_contact.model.symbolic import varies_in_cells
from erc_contact.model.trace import split


@dataclass(frozen=True)
class BoundedNumber:
    """Hold a number with a bound of its error: an integral over all ranks.

    Attributes:
        value: Its value.
        bound: Bound or estimate of its error, see
            :class:`erc_contact.mesh.quadrature.Integral`.
        resolved: Whether ``bound`` is within the tolerance.
    """

    value: float
    bound: float = 0.0
    resolved: bool = True

    @classmethod
    def summed(cls, comm: MPI.Comm, integral: Integral) -> BoundedNumber:
        """Add up all integrals of all ranks; collective."""
        local = np.array([integral.value.sum(), integral.rest.sum()])
        value, bound = comm.allreduce(local, MPI.SUM)
        return cls(float(value), float(bound), bool(integral.resolved.all()))

    def __add__(self, other: BoundedNumber) -> BoundedNumber:
        resolved = self.resolved and other.resolved
        return BoundedNumber(self.value + other.value, self.bound + other.bound, resolved)

    def __sub__(self, other: BoundedNumber) -> BoundedNumber:
        return self + -1.0 * other

    def __rmul__(self, factor: float) -> BoundedNumber:
        return BoundedNumber(factor * self.value, abs(factor) * self.bound, self.resolved)


def elastic_work(pair: Admissible, v: fem.Function, w: fem.Function) -> BoundedNumber:
    """Compute ``a(v, w)``, with the springs [force length]; collective."""
    model = pair.model
    cells = pair.cell_geometry
    if not model.elasticity.varies_in_cells:
        return BoundedNumber(assembled(model, model.stiffness(v, w)))
    of_cells = model.owned_cells
    strain_v = strains(cells, v)
    strain_w = strains(cells, w)

    def density(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape = polynomials(model.degree - 1, places)
        stress = act(model.elasticity(x, of_cells[entity]), np.matmul(shape, strain_v[entity]))
        return (stress * np.matmul(shape, strain_w[entity])).sum(axis=-1, keepdims=True)

    total = _over_cells(pair, density)
    for spring in model.springs:
        total += BoundedNumber(assembled(model, spring.work(v, w)))
    return total


def strain_work(pair: Admissible, v: fem.Function) -> BoundedNumber:
    """Compute ``int C eps_0 : eps(v)`` [force length]; collective.

    It is zero without given strains.
    """
    model = pair.model
    given = model.strains
    if given is None:
        return BoundedNumber(0.0)
    if not data_vary(model):
        return BoundedNumber(assembled(model, model.strain_loads(v)))
    cells = pair.cell_geometry
    of_cells = model.owned_cells
    strain_v = strains(cells, v)

    def density(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        strain = np.matmul(polynomials(model.degree - 1, places), strain_v[entity])
        stress = act(model.elasticity(x, of_cells[entity]), given(x, of_cells[entity]))
        return (stress * strain).sum(axis=-1, keepdims=True)

    return _over_cells(pair, density)


def strain_energy(pair: Admissible, u: fem.Function) -> BoundedNumber:
    """Compute the strain energy of a displacement [force length]; collective.

    It is that of the elastic strain, ``|C (eps(u) - eps_0)|^2/2``.
    """
    model = pair.model
    energy = 0.5 * elastic_work(pair, u, u)
    given = model.strains
    if given is None:
        return energy
    of_cells = model.owned_cells

    def density(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        strain = given(x, of_cells[entity])
        stress = act(model.elasticity(x, of_cells[entity]), strain)
        return 0.5 * (stress * strain).sum(axis=-1, keepdims=True)

    return energy - strain_work(pair, u) + _over_cells(pair, density)


def _over_cells(pair: Admissible, density: Integrand) -> BoundedNumber:
    """Integrate a density over all cells, adapted to it; collective."""
    model = pair.model
    cells = pair.cell_geometry
    owned = model.domain.owned_cells
    corners = sorted_corners(model, cells)[:owned]
    volume = cells.volume[:owned]
    integral = integrate(model.comm, density, corners, volume, cell_pieces(model.d))
    return BoundedNumber.summed(model.comm, integral)


def stress_work(pair: Admissible, v: fem.Function) -> BoundedNumber:
    """Compute ``(sigma^, eps(v))``, which is exact [force length]; collective.

    With the work of the springs it is that of r^ and of the projected loads.
    """
    model = pair.model
    cells = pair.cell_geometry
    k = cells.degree
    owned = model.domain.owned_cells
    shape, points, weights = macro_points(model.d, k)
    sigma = np.matmul(shape, pair.stress).reshape(owned, len(points), pair.stress.shape[3])
    strain = np.matmul(bernstein(model.d, k - 1, points), strains(cells, v)[:owned])
    # sigma^ is a polynomial on each sub-simplex, so the rule is exact.
    means = np.einsum("nqs,nqs,q->n", sigma, strain, weights)
    local = float(np.sum(cells.volume[:owned] * means))
    local += spring_work(model, v, pair.spring_tractions)
    return BoundedNumber(float(model.comm.allreduce(local, MPI.SUM)))


def friction_work(
    model: Model, traction: ContactTraction, u: fem.Function, floor: float
) -> BoundedNumber:
    """Add up :func:`friction_works`; collective."""
    if traction.contact.friction is None:
        return BoundedNumber(0.0)
    return BoundedNumber.summed(model.comm, friction_works(model, traction, u, floor))


def foundation_energy(
    model: Model, traction: ContactTraction, u: fem.Function, floor: float
) -> BoundedNumber:
    """Add up :func:`foundation_energies`, 0 on a rigid foundation; collective."""
    if traction.contact.stiffness is None:
        return BoundedNumber(0.0)
    return BoundedNumber.summed(model.comm, foundation_energies(model, traction, u, floor))


def friction_works(
    model: Model, traction: ContactTraction, u: fem.Function, floor: float
) -> Integral:
    """Compute ``int b(p^) |u_t - s|`` on each facet [force length]; collective.

    It is 0 for ghosts; s is of the last step. It is never below zero. The integrals may
    leave their share or ``floor`` unknown.
    """
    contact = traction.contact
    data = ContactData(contact, model.mesh)

    def density(facet: np.ndarray, shape: np.ndarray, w: np.ndarray, x: np.ndarray) -> np.ndarray:
        n = contact.direction[facet][:, None, :]
        pressure = pressures(np.matmul(shape, traction.values[facet]), n)
        _, _, slip = split(w, n)
        return data.bound(facet, x, pressure) * slip

    return contact_integral(model, contact, u, density, floor)


def load_work(model: Model, v: fem.Function) -> BoundedNumber:
    """Compute ``f(v) + F(v)`` [force length]; collective."""
    constant_loads = model.loads(v, varying=False)
    # Loads that do not vary in space are exact in a form, the others are adapted.
    total = BoundedNumber(0.0)
    if constant_loads is not None:
        total = BoundedNumber(assembled(model, constant_loads))
    for load in model.surface_loads:
        if load.varies:
            total += _surface_work(model, load.facets, load.density, v)
    if model.body_force is not None and varies_in_cells(model.body_force):
        total += _body_work(model, v)
    if model.face_forces is not None:
        # The resultants of loose rigid faces work on their motions.
        local = float(model.face_forces.x.array @ v.x.array)
        total += BoundedNumber(float(model.comm.allreduce(local, MPI.SUM)))
    return total


def _surface_work(model: Model, part: str, density: Ufl, v: fem.Function) -> BoundedNumber:
    """Compute the work of a varying traction [force length]; collective."""
    d, k = model.d, model.degree
    nodal = v.x.array.reshape(-1, d)
    facets = model.domain.facets(part)
    # Every facet counts on one rank.
    area = np.where(model.owned(facets), model.facet_areas(facets), 0.0)
    on_facets = np.matmul(coefficients(d - 1, k), nodal[model.facet_nodes(facets)])
    work = _products(Everywhere(density, model.mesh), facets, on_facets, k)
    corners = model.facet_corners(facets)
    integral = integrate(model.comm, work, corners, area, facet_pieces(d - 1))
    return BoundedNumber.summed(model.comm, integral)


def _body_work(model: Model, v: fem.Function) -> BoundedNumber:
    """Compute the work of a varying body force [force length]; collective."""
    d, k = model.d, model.degree
    nodal = v.x.array.reshape(-1, d)
    owned = model.domain.owned_cells
    cells = cell_geometry(model)
    in_cells = np.matmul(coefficients(d, k), nodal[cells.nodes])
    work = _products(Everywhere(model.body_force, model.mesh), model.owned_cells, in_cells, k)
    corners = sorted_corners(model, cells)[:owned]
    volume = cells.volume[:owned]
    integral = integrate(model.comm, work, corners, volume, cell_pieces(d))
    return BoundedNumber.summed(model.comm, integral)


def _products(load: Everywhere, entities: np.ndarray, of_v: np.ndarray, degree: int) -> Integrand:
    """Return the work of each component of a load on a polynomial.

    Its coefficients have the shape (entities, N, d).
    """

    def components(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return load(x, entities[entity]) * np.matmul(polynomials(degree, places), of_v[entity])

    return components


def assembled(model: Model, form: Ufl) -> float:
    """Return the value of a UFL form without arguments, all ranks; collective."""
    return float(model.comm.allreduce(fem.assemble_scalar(compiled.form(form)), MPI.SUM))
