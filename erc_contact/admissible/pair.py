"""From a solution to an admissible pair: a displacement and a stress.

The pair satisfies all equations but Hooke's law. It is (u^, sigma^) with the contact
traction r^. The displacement satisfies u^ = U on Gamma_D and u^_n <= g on Gamma_C. The
stress is symmetric and in exact equilibrium with the projections of the loads. On
Gamma_C it satisfies sigma^ n = r^, and the friction law allows r^. The error e (16) of
this pair bounds its distance to the exact solution, for any result of the contact
solver.

Source: Coorevits, Hild, Hjiaj, equations (9), (10); Ladeveze, Leguillon (1983).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dolfinx import fem

from erc_contact.admissible.cells import CellGeometry, tractions_of
from erc_contact.admissible.elastic import CellStress
from erc_contact.admissible.fields import FIELD_DEGREE, stress_function, sub_dx, traction_function
from erc_contact.admissible.macro import macro_points, macro_values
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.status import facet_status
from erc_contact.model.model import Model
from erc_contact.model.profile import profile_points, profile_weights
from erc_contact.newton.solution import Solution
from namedmesh import Domain
from namedmesh.base import checks
from namedmesh.simplex import measures


@dataclass(frozen=True, eq=False)
class Admissible:
    """Hold an admissible pair.

    Polynomials are given by Bernstein coefficients; for degree 1 these are the nodal
    values.

    Attributes:
        solution: The solution from which it was reconstructed.
        displacement: u^ [length], a continuous Function of degree k.
        tractions: r^ on each contact.
        spring_tractions: t^ on each part with springs [force/area], as Bernstein
            coefficients of shape (f, m, d).
        cell_geometry: Vertices, facets and volumes of the cells.
        balanced: The rebalanced finite element stress.
        stress: sigma^ of the owned cells in Mandel components, of degree k in the
            sub-simplices [force/area], shape (owned, d+1, N_k, s). Of an axisymmetric
            body it is times the circumference, and has a hoop component.
        facet_moments: Moments of the facet tractions on the first side of each facet
            [force], shape (facets, m, d).
        cell_forces: Body force times volume of each cell, projected on degree k-1
            [force], shape (n, N_(k-1), d), or None without body force.
        relief: What ``cell_forces`` have more than the loads, for projected loads to be
            in balance on motions that nothing holds [force/volume], shape (n, d); None
            without.
        tightening: Number of iterations that tightened sigma^.
        correction: What they have added to ``facet_moments`` [force]; None without any.
        imbalance: Greatest force that is missing in the equilibrium of sigma^, over the
            greatest one on a facet [-]: round-off, see
            ``erc_contact.admissible.imbalance``.
        seconds: Wall time, the largest over the ranks [s].

    Example:
        >>> admissible.stress.shape, admissible.displacement.x.array.size
        ((16, 3, 3, 3), 30)
    """

    solution: Solution
    displacement: fem.Function
    tractions: list[ContactTraction]
    spring_tractions: list[np.ndarray]
    cell_geometry: CellGeometry
    balanced: CellStress
    stress: np.ndarray
    facet_moments: np.ndarray
    cell_forces: np.ndarray | None
    relief: np.ndarray | None
    tightening: int
    correction: np.ndarray | None
    imbalance: float
    seconds: float

    def __repr__(self) -> str:
        """Describe the pair in a line.

        Nothing is computed, so one rank alone may ask.
        """
        return (
            f"<Admissible pair of degree {self.model.space.degree} on {self.domain.cells} cells, "
            f"{len(self.tractions)} contacts, tightened {self.tightening} times>"
        )

    @property
    def fe_stress(self) -> np.ndarray:
        """Return the rebalanced finite element stress in each cell [force/area].

        It is projected on polynomials of degree k-1, shape (n, N_(k-1), d, d).
        """
        return self.balanced.in_plane

    @property
    def model(self) -> Model:
        """Return the scene on the mesh, with forms."""
        return self.solution.model

    @property
    def domain(self) -> Domain:
        """Return the mesh with names."""
        return self.solution.domain

    @property
    def tractions_per_area(self) -> list[ContactTraction]:
        """Return r^ on each contact for pictures and files, see :meth:`per_area`."""
        return [self.per_area(traction) for traction in self.tractions]

    def stress_at(self, cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate sigma^ at points of pieces of owned cells [force/area].

        Args:
            cell: Cell of each piece, shape (n,).
            places: Barycentric coordinates for the sorted vertices, shape (n, q, d+1).
            x: The points [length], shape (n, q, d).

        Returns:
            Mandel components, times the weights of the section, shape (n, q, s).
        """
        values = macro_values(self.stress, self.model.space.degree, cell, places)
        return self.model.hoop_load.plus(values, x, cell)

    def stress_at_macro_points(self, x: np.ndarray) -> np.ndarray:
        """Evaluate sigma^ at the points of :func:`.macro.macro_points` [force/area].

        Args:
            x: The points [length], shape (owned, q, d).

        Returns:
            Mandel components, times the weights of the section, shape (owned, q, s).
        """
        model = self.model
        shape = macro_points(model.space.d, model.space.degree).shape
        values = np.matmul(shape, self.stress).reshape(*x.shape[:2], self.stress.shape[-1])
        return model.hoop_load.plus(values, x, model.space.owned_cells)

    def traction(self, name: str) -> ContactTraction:
        """Return r^ on the contact of a name, or sigma^ n on a tied joint.

        Raises:
            InputError: If no contact has this name.
        """
        model = self.model
        contact = model.contact(name)
        if contact in model.ties:
            return self._traction_through(contact)
        return self.tractions[model.contacts.index(contact)]

    def _traction_through(self, tie: ContactOnMesh) -> ContactTraction:
        """Return the traction of sigma^ on the first side of a tied joint."""
        space = self.model.space
        here = tie.trace.here
        cells = self.cell_geometry
        first = cells.side[0][space.facet_numbers(here.facets)] // (space.d + 1)
        sign = np.where(first == here.facets[:, 0], 1.0, -1.0)
        values = sign[:, None, None] * tractions_of(space, self.facet_moments, here.facets)
        # A tied joint carries any shear.
        bound = np.full(values.shape[:2], np.inf)
        return ContactTraction(tie, here.nodes, here.areas, values, bound)

    def per_area(self, traction: ContactTraction) -> ContactTraction:
        """Return a traction for pictures and files [force/area].

        It is the traction on the side that the scene names first. On rings it
        interpolates the traction at the nodes of facets.
        """
        space = self.model.space
        corners = traction.contact.trace.here.corners
        named = traction.contact.named_corners
        bound = traction.friction_bound
        if np.isfinite(bound).all():
            bound = space.section.shown(bound[..., None], corners, named)[..., 0]
        values = space.section.shown(traction.values, corners, named)
        return replace(traction, area=measures(named), values=values, friction_bound=bound)

    def at_profile_points(self, traction: ContactTraction) -> tuple[np.ndarray, np.ndarray]:
        """Return r^ and its friction bound at the points of a profile [force/area].

        Their shapes are (f, q, d) and (f, q); the bound is infinite of a tied joint and
        of sides of copies.
        """
        model = self.model
        points = profile_points(model.space)
        corners = traction.contact.trace.here.corners
        r = model.space.section.per_area(corners, traction.values, points)
        if model.carries_any_shear(traction.contact):
            return r, np.full(r.shape[:2], np.inf)
        return r, model.space.section.per_area(corners, traction.friction_bound, points)

    def status(self, traction: ContactTraction) -> np.ndarray:
        """Tell which facets are open, slip, stick or are closed, (f,); collective.

        See :func:`erc_contact.model.contact.status.facet_status`.
        """
        space = self.model.space
        r, bound = self.at_profile_points(traction)
        points, weights = profile_points(space), profile_weights(space)
        u = self.displacement
        return facet_status(space, traction.contact, u, r, bound, points, weights)

    def dx(self, degree: int = FIELD_DEGREE) -> Ufl:
        """Return the measure of the body for forms with sigma^, UFL.

        Its rule is exact up to this degree in each sub-simplex.
        """
        return sub_dx(self.model.space, degree)

    def stress_function(self, degree: int = FIELD_DEGREE) -> fem.Function:
        """Return sigma^ as a Function of shape (d, d) [force/area]; collective.

        It has values at the points of :meth:`dx` of the same degree alone, so forms
        with it need this measure.

        Example:
            >>> admissible.stress_function().ufl_shape, admissible.dx().integral_type()
            ((2, 2), 'cell')
        """
        return stress_function(self.model, self.cell_geometry, self.stress, degree)

    def traction_function(self, part: str) -> fem.Function:
        """Return sigma^ n on a boundary part as a Function [force/area]; collective.

        On a contact it is r^. It is discontinuous, of degree k, and zero away from the
        part: integrate it over ``model.space.ds(domain.tag(part))``. No two facets of
        the part may have a common cell.
        """
        return traction_function(self.model, self.cell_geometry, self.facet_moments, part)


def pair_of(result: Any) -> Admissible:
    """Return the pair itself, or the pair of an error, or of the error of a history.

    Raises:
        InputError: If it is none of them.
    """
    error = getattr(result, "error", result)
    pair = getattr(error, "admissible", error)
    if not isinstance(pair, Admissible):
        raise InputError(
            f"The admissible pair is {checks.description(result)}; give a history, an error, "
            "or what equilibrate() returns."
        )
    return pair
