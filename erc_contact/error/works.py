"""Work of stresses, loads and friction on displacements, with what the integrals leave unknown.

The integrals are exact where no data vary inside cells. Elsewhere they are adapted to
the data (:mod:`erc_contact.mesh.quadrature`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.cells import cell_geometry, sorted_corners
from erc_contact.admissible.elastic import act, strains
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.runtime import compiled
from erc_contact.mesh.quadrature import (
    Integral,
    Integrand,
    cell_pieces,
    facet_pieces,
    integrate,
    polynomials,
)
from erc_contact.mesh.simplex import bernstein, coefficients
from erc_contact.model.expressions import Everywhere
from erc_contact.model.foundation import ContactData, pressures
from erc_contact.model.model import Model
from erc_contact.model.symbolic import varies_in_cells
from erc_contact.model.trace import split


@dataclass(frozen=True)
class BoundedNumber:
    """A number with a bound of its error: an integral over all ranks.

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
    def of(cls, comm: MPI.Comm, integral: Integral) -> BoundedNumber:
        """Add up all integrals of all ranks; collective."""
        value, bound = comm.allreduce(
            np.array([integral.value.sum(), integral.rest.sum()]), MPI.SUM
        )
        return cls(float(value), float(bound), bool(integral.resolved.all()))

    def __add__(self, other: BoundedNumber) -> BoundedNumber:
        resolved = self.resolved and other.resolved
        return BoundedNumber(self.value + other.value, self.bound + other.bound, resolved)

    def __sub__(self, other: BoundedNumber) -> BoundedNumber:
        return self + -1.0 * other

    def __rmul__(self, factor: float) -> BoundedNumber:
        return BoundedNumber(factor * self.value, abs(factor) * self.bound, self.resolved)


def elastic_work(pair: Admissible, v: fem.Function, w: fem.Function) -> BoundedNumber:
    """``a(v, w)`` [force length]; collective."""
    model, cells = pair.solution.model, pair.cell_geometry
    if not model.elasticity.varies_in_cells:
        return BoundedNumber(assembled(model, model.stiffness(v, w)))
    owned, k = model.domain.owned_cells, model.degree
    of_cells, of_v, of_w = model.owned_cells, strains(cells, v), strains(cells, w)

    def density(of: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape = polynomials(k - 1, at)
        image = act(model.elasticity(x, of_cells[of]), np.matmul(shape, of_v[of]))
        return (image * np.matmul(shape, of_w[of])).sum(axis=-1, keepdims=True)

    corners, volume = sorted_corners(model, cells)[:owned], cells.volume[:owned]
    return BoundedNumber.of(
        model.comm, integrate(model.comm, density, corners, volume, cell_pieces(model.d))
    )


def stress_work(pair: Admissible, v: fem.Function) -> BoundedNumber:
    """``(sigma^, eps(v))`` [force length], exact; collective. It is the work of r^ and of the projected loads."""
    model, cells, k = pair.solution.model, pair.cell_geometry, pair.cell_geometry.degree
    owned = model.domain.owned_cells
    shape, points, weights = macro_points(model.d, k)
    sigma = np.matmul(shape, pair.stress).reshape(owned, len(points), pair.stress.shape[3])
    strain = np.matmul(bernstein(model.d, k - 1, points), strains(cells, v)[:owned])
    local = float(np.sum(cells.volume[:owned] * np.einsum("nqs,nqs,q->n", sigma, strain, weights)))
    return BoundedNumber(float(model.comm.allreduce(local, MPI.SUM)))


def friction_work(
    model: Model, traction: ContactTraction, u: fem.Function, floor: float
) -> BoundedNumber:
    """Add up :func:`friction_works`; collective."""
    if traction.contact.friction is None:
        return BoundedNumber(0.0)
    return BoundedNumber.of(model.comm, friction_works(model, traction, u, floor))


def friction_works(
    model: Model, traction: ContactTraction, u: fem.Function, floor: float
) -> Integral:
    """``int b(p^) |u_t - s|`` on each facet of a contact [force length], 0 for ghosts, s of the last step; collective.

    It is never below zero. The integrals may leave their share or ``floor`` unknown.
    """
    contact, d, k = traction.contact, model.d, model.degree
    given = ContactData(contact, model.mesh)
    trace = contact.trace
    area = trace.here.owned_areas
    hat = trace.coefficients(trace.since(u.x.array))

    def density(of: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        shape, n = polynomials(k, at), contact.direction[of][:, None, :]
        pressure = pressures(np.matmul(shape, traction.values[of]), n)
        return (given.bound(of, x, pressure) * split(np.matmul(shape, hat[of]), n)[2])[..., None]

    corners = contact.trace.here.corners
    return integrate(model.comm, density, corners, area, facet_pieces(d - 1), floor=floor)


def load_work(model: Model, v: fem.Function) -> BoundedNumber:
    """``f(v) + F(v)`` [force length]; collective."""
    d, k, domain = model.d, model.degree, model.domain
    loads = model.loads(v, varying=False)
    total = BoundedNumber(0.0 if loads is None else assembled(model, loads))
    nodal = v.x.array.reshape(-1, d)
    for load in model.surface_loads:
        if load.varies:
            facets = domain.facets(load.facets)
            area = np.where(model.owned(facets), model.facet_areas(facets), 0.0)
            on_facets = np.matmul(coefficients(d - 1, k), nodal[model.facet_nodes(facets)])
            work = _products(Everywhere(load.density, domain.mesh), facets, on_facets, k)
            total += BoundedNumber.of(
                model.comm,
                integrate(model.comm, work, model.facet_corners(facets), area, facet_pieces(d - 1)),
            )
    if model.body_force is not None and varies_in_cells(model.body_force):
        cells = cell_geometry(model)
        owned, in_cells = domain.owned_cells, np.matmul(coefficients(d, k), nodal[cells.nodes])
        work = _products(Everywhere(model.body_force, domain.mesh), model.owned_cells, in_cells, k)
        corners, volume = sorted_corners(model, cells)[:owned], cells.volume[:owned]
        total += BoundedNumber.of(
            model.comm, integrate(model.comm, work, corners, volume, cell_pieces(d))
        )
    return total


def _products(load: Everywhere, entities: np.ndarray, of_v: np.ndarray, degree: int) -> Integrand:
    """Return the work of each component of a load on a polynomial of coefficients (entities, N, d)."""

    def components(of: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        return load(x, entities[of]) * np.matmul(polynomials(degree, at), of_v[of])

    return components


def assembled(model: Model, form: Any) -> float:
    """Return the value of a UFL form without arguments, all ranks; collective."""
    return float(model.comm.allreduce(fem.assemble_scalar(compiled.form(form)), MPI.SUM))
