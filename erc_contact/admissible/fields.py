"""Give the fields of an admissible pair to forms of a user.

sigma^ is a polynomial in each of the sub-simplices of a cell, and jumps between them. A
rule of the cell would integrate it wrongly. So it is given at the points of a rule of
the sub-simplices, and the measure :func:`sub_dx` has this rule.

Symbols: d dimension, k degree, q points of a cell.
"""

from __future__ import annotations

from functools import cache

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.cells import CellGeometry, tractions_of
from erc_contact.admissible.macro import macro_values
from erc_contact.base.exceptions import InputError
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.quadrature import cell_pieces, polynomials
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.simplex import barycentric, rule

FIELD_DEGREE = 4
"""Degree up to which integrals over sub-simplices are exact by default."""
ON_FACET = 1e-12
"""Barycentric coordinate of points on a facet [-]."""


@cache
def _sub_rule(d: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points (q, d) and weights of a rule of all sub-simplices of a cell."""
    points, weights = rule(d, degree)
    places = np.matmul(barycentric(points), cell_pieces(d))
    # The weights have the sum 1 there, and the volume of the reference cell here.
    volume = 1 / (2 if d == 2 else 6)
    return places.reshape(-1, d + 1)[:, 1:], np.tile(weights, d + 1) * volume / (d + 1)


def sub_dx(space: Space, degree: int) -> Ufl:
    """Return the measure of the body by a rule of the sub-simplices, UFL.

    Args:
        space: The mesh.
        degree: Degree of the polynomials that it integrates exactly there.
    """
    points, weights = _sub_rule(space.d, degree)
    metadata = {
        "quadrature_rule": "custom",
        "quadrature_points": points,
        "quadrature_weights": weights,
    }
    return ufl.Measure("dx", domain=space.mesh, metadata=metadata)


def stress_function(
    model: Model, cells: CellGeometry, stress: np.ndarray, degree: int
) -> fem.Function:
    """Return sigma^ as a Function for the measure :func:`sub_dx`; collective.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        stress: Coefficients of sigma^, see :class:`Admissible`.
        degree: Degree of the measure.

    Returns:
        A Function of quadrature points, of shape (d, d) [force/area], of an
        axisymmetric body (3, 3) with the rows r, z and hoop.
    """
    space = model.space
    d = space.d
    basis, rows = space.section.basis, space.section.rows
    owned = model.domain.owned_cells
    points, weights = _sub_rule(d, degree)
    cell = space.mesh.basix_cell()
    element = basix.ufl.quadrature_element(cell, (rows, rows), points=points, weights=weights)
    function = fem.Function(fem.functionspace(space.mesh, element))
    # The coefficients of sigma^ belong to the vertices in another order.
    places = barycentric(points)[:, cells.order[:owned]].swapaxes(0, 1)
    of_cells = np.arange(owned)
    parts = np.split(places, d + 1, axis=1)
    of_parts = [macro_values(stress, space.degree, of_cells, part) for part in parts]
    components = np.concatenate(of_parts, axis=1)
    x = np.matmul(barycentric(points), space.cell_corners()[:owned])
    components = space.section.over(model.hoop_load.plus(components, x, of_cells), x)
    at_points = np.tensordot(components, basis, axes=1)
    nodal = function.x.array.reshape(-1, rows * rows)
    nodal[function.function_space.dofmap.list[:owned]] = at_points.reshape(
        *components.shape[:2], rows * rows
    )
    function.x.scatter_forward()
    return function


def sides_of(model: Model, part: str) -> np.ndarray:
    """Return the sides (cell, local facet) of a part in owned cells, shape (n, 2).

    The sides of a part of a tied joint are sides of its body.
    """
    for tie in model.ties:
        for name, side in zip(tie.side_names, (tie.trace.here, tie.trace.there), strict=True):
            if name == part:
                return side.facets[side.owned]
    return model.domain.owned_facets(part)


def traction_function(
    model: Model, geometry: CellGeometry, moments: np.ndarray, part: str
) -> fem.Function:
    """Return sigma^ n on a boundary part as a Function [force/area]; collective.

    Args:
        model: The scene on a mesh.
        geometry: Geometry of the cells.
        moments: Moments of all facets, see :class:`Admissible`.
        part: Name of the boundary part.

    Raises:
        InputError: If no part has this name, or two facets of it have a common cell.
    """
    space = model.space
    d = space.d
    facets = sides_of(model, part)
    cells, local = facets.T
    twice = bool(len(np.unique(cells)) < len(cells))
    if space.comm.allreduce(twice, MPI.LOR):
        raise InputError(
            f"traction_function: two facets of {part!r} belong to one cell, where a Function has"
            " one value at their common point. Give them two names, or take the profile."
        )
    function = fem.Function(fem.functionspace(space.mesh, ("DG", space.degree, (d,))))
    coefficients = tractions_of(space, moments, facets)
    # The moments are those on the first cell of a facet.
    first = geometry.side[0][space.facet_numbers(facets)] // (d + 1)
    coefficients = np.where(first == cells, 1.0, -1.0)[:, None, None] * coefficients
    # The vertices of a facet may have another order than in its cell.
    of_facets = space.facet_nodes(facets)[:, :d]
    of_cells = space.V.dofmap.list[cells][:, : d + 1]
    vertex = (of_cells[:, None, :] == of_facets[:, :, None]).argmax(axis=2)
    nodes = barycentric(function.function_space.element.interpolation_points)
    nodal = function.x.array.reshape(-1, d)
    dofs = function.function_space.dofmap.list
    for number in range(d + 1):
        of_number = local == number
        on_facet = abs(nodes[:, number]) < ON_FACET
        places = nodes[on_facet][:, vertex[of_number]].swapaxes(0, 1)
        values = np.matmul(polynomials(space.degree, places), coefficients[of_number])
        nodal[dofs[cells[of_number]][:, on_facet]] = values
    function.x.scatter_forward()
    return function


def integral(space: Space, density: Ufl, degree: int) -> float:
    """Integrate a density over the body by the measure :func:`sub_dx`; collective.

    Args:
        space: The mesh.
        density: A scalar, UFL.
        degree: Degree up to which it is exact in sub-simplices.

    Raises:
        InputError: If the density is no scalar.
    """
    expression = ufl.as_ufl(density)
    if expression.ufl_shape:
        raise InputError(
            f"integrate: the density has the shape {expression.ufl_shape}; return a scalar, e.g."
            " ufl.inner(sigma, sigma)."
        )
    form = compiled.form(space.on_meridian(expression) * sub_dx(space, degree))
    return float(space.comm.allreduce(fem.assemble_scalar(form), MPI.SUM))
