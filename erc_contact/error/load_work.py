"""Work of the loads on displacements.

It is known up to what the integrals leave unknown: the integrals of loads that vary in
space are adapted to the loads (:mod:`erc_contact.model.data.quadrature`).
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.cells import cell_geometry
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.error.numbers import BoundedNumber
from erc_contact.model.data.expressions import Everywhere
from erc_contact.model.data.quadrature import (
    Integrand,
    cell_pieces,
    facet_pieces,
    integrate,
    polynomials,
)
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.loads import bind_loads
from erc_contact.model.model import Model
from erc_contact.model.preload import PreloadOnMesh
from erc_contact.model.space import Space
from erc_contact.scene.load import Load
from namedmesh.simplex import coefficients, lattice


def load_work(model: Model, v: fem.Function, part: str | None = None) -> BoundedNumber:
    """Compute ``f(v) + F(v)`` [force length]; collective.

    Args:
        model: The scene on a mesh.
        v: A displacement [length].
        part: Name of the boundary part whose loads are meant; None for all loads.
    """
    space = model.space
    on = None if part is None else [part]
    constant_loads = model.loads(v, varying=False, on=on)
    # Loads that do not vary in space are exact in a form, the others are adapted.
    total = BoundedNumber(0.0)
    if constant_loads is not None:
        total = BoundedNumber(assemble_number(space, constant_loads))
    for load in model.surface_loads:
        if load.varies and part in (None, load.facets):
            total += _surface_work(space, load.facets, load.density, v)
    if part is not None:
        return total
    if model.body_force is not None and varies_in_cells(model.body_force):
        total += _body_work(space, model.body_force, v)
    if model.face_forces is not None:
        # The resultants of loose rigid faces work on their motions.
        local = float(model.face_forces.x.array @ v.x.array)
        total += BoundedNumber(float(space.comm.allreduce(local, MPI.SUM)))
    return total


def load_work_on_jump(model: Model, preload: PreloadOnMesh) -> BoundedNumber:
    """Compute the work of the loads on psi [force length]; collective.

    It is not resolved where loads that vary in space act on the cells of psi.
    """
    space = model.space
    middle = model.domain.function("DG", 0, (space.d,))
    middle.x.array[:] = space.cell_corners().mean(axis=1).ravel()
    value = model.domain.function("DG", 0)
    value.x.array[:] = preload.weights.mean(axis=1)
    chi = value + ufl.dot(preload.gradient, space.x - middle)
    axis = compiled.constant(space.mesh, preload.axis)
    # psi is zero in all other cells.
    inside = model.domain.function("DG", 0)
    inside.x.array[:] = np.where(preload.weights.any(axis=1), 1.0, 0.0)
    works = []
    for form in (model.loads(inside * chi * axis, varying=False), model.loads(inside * chi * axis)):
        works.append(0.0 if form is None else assemble_number(space, form))
    constant, every = works
    size = abs(constant) + abs(every)
    return BoundedNumber(every, resolved=abs(every - constant) <= 1e-14 * size)


def work_of_load(space: Space, load: Load, v: fem.Function) -> BoundedNumber:
    """Compute the work of a load that the scene need not have; collective.

    Raises:
        InputError: If the load cannot be put on the mesh.
    """
    on_surface, in_body = bind_loads(space, [load])
    if in_body is not None:
        if varies_in_cells(in_body):
            return _body_work(space, in_body, v)
        return BoundedNumber(assemble_number(space, ufl.inner(in_body, v) * space.dx))
    bound = on_surface[0]
    if bound.varies:
        return _surface_work(space, bound.facets, bound.density, v)
    return BoundedNumber(assemble_number(space, ufl.inner(bound.density, v) * bound.ds))


def load_size(space: Space, load: Load) -> tuple[float, bool]:
    """Estimate ``int |psi|`` of a load, and tell whether it varies; collective."""
    on_surface, in_body = bind_loads(space, [load])
    if in_body is not None:
        density = in_body
        entities = space.owned_cells
        sizes = cell_geometry(space).volume[: len(entities)]
        points = lattice(space.d, space.degree)
    else:
        density = on_surface[0].density
        entities = space.domain.owned_facets(on_surface[0].facets)
        sizes = space.facet_areas(entities)
        points = space.facet_points
    values = space.evaluate(density, points, entities)
    local = float(sizes @ np.linalg.norm(values, axis=2).mean(axis=1))
    return float(space.comm.allreduce(local, MPI.SUM)), varies_in_cells(density)


def _surface_work(space: Space, part: str, density: Ufl, v: fem.Function) -> BoundedNumber:
    """Compute the work of a varying traction [force length]; collective."""
    d, k = space.d, space.degree
    nodal = v.x.array.reshape(-1, d)
    facets = space.domain.facets(part)
    # Every facet counts on one rank.
    area = np.where(space.owned(facets), space.facet_areas(facets), 0.0)
    on_facets = np.matmul(coefficients(d - 1, k), nodal[space.facet_nodes(facets)])
    work = _products(space.everywhere(density), facets, on_facets, k)
    corners = space.facet_corners(facets)
    pieces = facet_pieces(d - 1)
    most = space.points_of_numbers
    integral = integrate(space.comm, work, corners, area, pieces, components=d, most=most)
    return BoundedNumber.summed(space.comm, integral)


def _body_work(space: Space, force: Ufl, v: fem.Function) -> BoundedNumber:
    """Compute the work of a varying body force [force length]; collective."""
    d, k = space.d, space.degree
    nodal = v.x.array.reshape(-1, d)
    owned = space.domain.owned_cells
    cells = cell_geometry(space)
    in_cells = np.matmul(coefficients(d, k), nodal[cells.nodes])
    work = _products(space.everywhere(force), space.owned_cells, in_cells, k)
    corners = cells.corners[:owned]
    volume = cells.volume[:owned]
    pieces = cell_pieces(d)
    most = space.points_of_numbers
    integral = integrate(space.comm, work, corners, volume, pieces, components=d, most=most)
    return BoundedNumber.summed(space.comm, integral)


def _products(load: Everywhere, entities: np.ndarray, of_v: np.ndarray, degree: int) -> Integrand:
    """Return the work of each component of a load on a polynomial.

    Its coefficients have the shape (entities, N, d).
    """

    def components(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return load(x, entities[entity]) * np.matmul(polynomials(degree, places), of_v[entity])

    return components


def assemble_number(space: Space, form: Ufl) -> float:
    """Return the value of a UFL form without arguments, all ranks; collective."""
    return float(space.comm.allreduce(fem.assemble_scalar(compiled.form(form)), MPI.SUM))
