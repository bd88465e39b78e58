"""Contact equations in which affine maps stand in for the projection of the law.

A contact method asks the law for the traction r = P(z) of a trial traction z. An
interior point step (:mod:`erc_contact.newton.interior_point`) has ``r = W z + o``
instead, with a weight W and an offset o at each point of the quadrature. The equations
are then linear, and Newton's method solves them in one step.

On a facet, W and o are the polynomials that have their values at the points. So they
are Functions, discontinuous between cells.

Symbols: f facets, q points of a facet, c values at a point, d dimension.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.methods import Method
from namedmesh.simplex import barycentric, rule

ON_FACET = 1e-9
"""Barycentric coordinate of a point on a facet [-]."""


class InteriorForms(ContactForms):
    """Hold the equations of a method with weights and offsets on all contacts.

    Args:
        model: The scene on a mesh.
        method: The contact method, one of the package's.
    """

    def __init__(self, model: Model, method: Method) -> None:
        space = model.space
        points = space.facet_points
        if not method.multiplier:
            points, _ = rule(space.d - 1, space.contact_degree)
        self.points = points
        self._degree = _degree_through(points)
        self._affine: list[fem.Function] = []
        super().__init__(model, method)
        self._interpolations = []
        for contact, function in zip(model.contacts, self._affine, strict=True):
            facets = contact.facets[contact.trace.here.owned]
            self._interpolations.append(_Interpolation(space, function, facets, points))

    def trials(self) -> list[np.ndarray]:
        """Return the trial tractions at the points of the owned facets of each contact.

        Shape (f, q, d) [force/area].
        """
        values = []
        for expression, facets in self._values_of_facets:
            values.append(expression.eval(self.model.space.mesh, facets))
        return values

    def set_affine(self, weights: list[np.ndarray], offsets: list[np.ndarray]) -> None:
        """Set W [-] and o [force/area] at the points of the owned facets.

        Args:
            weights: For each contact shape (f, q, d, d).
            offsets: For each contact shape (f, q, d).
        """
        for interpolation, weight, offset in zip(
            self._interpolations, weights, offsets, strict=True
        ):
            facets, points, d = offset.shape
            flat = weight.reshape(facets, points, d * d)
            interpolation.set(np.concatenate([flat, offset], axis=2))

    @property
    def _points(self) -> np.ndarray:
        """Return the points of the quadrature."""
        return self.points

    def _look_at(self, projections: list[Ufl]) -> list[Ufl]:
        """Return the trial tractions that the projections of contacts get, in UFL."""
        trials = []
        for contact, multiplier in self._with_multipliers():
            plain = replace(contact, projection=lambda z: z)
            trials.append(self.method.projected(self.model, plain, self.u, multiplier))
        return trials

    def _of_solver(self, contact: ContactOnMesh) -> ContactOnMesh:
        """Return a contact as the forms see it, with its weights and offsets."""
        d = self.model.space.d
        affine = self.model.domain.function("DG", self._degree, (d * (d + 1),))
        self._affine.append(affine)
        weight = ufl.as_matrix([[affine[d * i + j] for j in range(d)] for i in range(d)])
        offset = ufl.as_vector([affine[d * d + i] for i in range(d)])

        def projection(z: Ufl) -> Ufl:
            return ufl.dot(weight, z) + offset

        return replace(super()._of_solver(contact), projection=projection)


class _Interpolation:
    """Set a Function on facets to the polynomials with given values at points.

    Args:
        space: The mesh.
        function: The Function, discontinuous between cells, c components.
        facets: The facets (cell, local facet), shape (f, 2).
        points: Reference points of the values, shape (q, d-1).
    """

    def __init__(
        self, space: Space, function: fem.Function, facets: np.ndarray, points: np.ndarray
    ) -> None:
        field = function.function_space
        element = field.element.basix_element
        self._values = function.x.array.reshape(-1, field.dofmap.bs)
        places = barycentric(element.points)
        on_facets = np.array([np.flatnonzero(abs(place) < ON_FACET) for place in places.T])
        nodes = on_facets[facets[:, 1]]
        self._dofs = np.take_along_axis(field.dofmap.list[facets[:, 0]], nodes, axis=1)
        vertices = space.local_vertices(facets)
        in_facet = np.take_along_axis(places[nodes], vertices[:, None, :], axis=2)
        degree = element.degree
        from_points = np.linalg.pinv(_monomials(barycentric(points), degree))
        self._matrices = np.matmul(_monomials(in_facet, degree), from_points)

    def set(self, values: np.ndarray) -> None:
        """Set the Function to values at the points, shape (f, q, c)."""
        self._values[self._dofs] = np.matmul(self._matrices, values)


def _monomials(places: np.ndarray, degree: int) -> np.ndarray:
    """Evaluate the monomials of a degree in barycentric coordinates (..., d)."""
    count = places.shape[-1]
    products = []
    for factors in combinations_with_replacement(range(count), degree):
        products.append(places[..., factors].prod(axis=-1))
    return np.stack(products, axis=-1)


def _degree_through(points: np.ndarray) -> int:
    """Return the least degree of polynomials with any values at points (q, d-1)."""
    places = barycentric(points)
    degree = 1
    while np.linalg.matrix_rank(_monomials(places, degree)) < len(points):
        degree += 1
    return degree
