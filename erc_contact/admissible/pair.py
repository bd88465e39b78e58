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

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.boundary import load_moments, supported
from erc_contact.admissible.cells import (
    CellGeometry,
    add_moments,
    cell_geometry,
    force_coefficients,
    moments,
    signed,
)
from erc_contact.admissible.contact import admissible_tractions
from erc_contact.admissible.displacement import admissible_displacement
from erc_contact.admissible.elastic import elastic_coefficients, macro_moduli
from erc_contact.admissible.facets import equilibrated_moments
from erc_contact.admissible.fields import (
    FIELD_DEGREE,
    stress_function,
    sub_dx,
    traction_function,
)
from erc_contact.admissible.loads import cell_forces
from erc_contact.admissible.macro import macro_stress
from erc_contact.admissible.rebalance import load_forces, other_forces, rebalanced_stress
from erc_contact.admissible.springs import (
    chosen_tractions,
    spring_moments,
    spring_tractions,
)
from erc_contact.admissible.tighten.complementary import relaxed
from erc_contact.admissible.tighten.iteration import TIGHTEN, tightened
from erc_contact.admissible.traction import ContactTraction
from erc_contact.base import checks
from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.mesh.domain import Domain
from erc_contact.model.model import Model
from erc_contact.newton.solution import Solution


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
        fe_stress: The rebalanced finite element stress, projected on polynomials of
            degree k-1 in each cell [force/area], shape (n, N_(k-1), d, d).
        stress: sigma^ of the owned cells in Mandel components, of degree k in the
            sub-simplices [force/area], shape (owned, d+1, N_k, s).
        facet_moments: Moments of the facet tractions on the first side of each facet
            [force], shape (facets, m, d).
        cell_forces: Body force times volume of each cell, projected on degree k-1
            [force], shape (n, N_(k-1), d), or None without body force.
        tightening: Number of iterations that tightened sigma^.
        correction: What they have added to ``facet_moments`` [force]; None without any.
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
    fe_stress: np.ndarray
    stress: np.ndarray
    facet_moments: np.ndarray
    cell_forces: np.ndarray | None
    tightening: int
    correction: np.ndarray | None
    seconds: float

    def __repr__(self) -> str:
        """Describe the pair in a line.

        Nothing is computed, so one rank alone may ask.
        """
        return (
            f"<Admissible pair of degree {self.model.degree} on {self.domain.cells} cells, "
            f"{len(self.tractions)} contacts, tightened {self.tightening} times>"
        )

    @property
    def model(self) -> Model:
        """Return the scene on the mesh, with forms."""
        return self.solution.model

    @property
    def domain(self) -> Domain:
        """Return the mesh with names."""
        return self.solution.domain

    def dx(self, degree: int = FIELD_DEGREE) -> Ufl:
        """Return the measure of the body for forms with sigma^, UFL.

        Its rule is exact up to this degree in each sub-simplex.
        """
        return sub_dx(self.model, degree)

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
        part: integrate it over ``model.ds(domain.tag(part))``. No two facets of the
        part may have a common cell.
        """
        return traction_function(self.model, self.cell_geometry, self.facet_moments, part)


def pair_of(result: Any) -> Admissible:
    """Return the pair itself, or that of an error, or that of the error of a history.

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


def equilibrate(solution: Solution, tighten: int = TIGHTEN) -> Admissible:
    """Reconstruct an admissible pair from a solution; collective.

    Args:
        solution: Any state of the contact solver; the bound does not depend on its
            quality.
        tighten: Greatest number of iterations that tighten sigma^, 0 for none. They end
            when as many again, at the present pace, would lower e by less than 8%; 4 to
            8 are usual, 10 to 30 near incompressibility.

    Returns:
        The admissible pair.

    Raises:
        NotHeldError: If no contact traction that the law allows balances the loads on a
            free rigid motion.

    Example:
        >>> ec.equilibrate(solution)
        <Admissible pair of degree 1 on 16 cells, 1 contacts, tightened 4 times>
    """
    return equilibrated(solution, tighten, None)


def equilibrated(solution: Solution, tighten: int, near: Admissible | None) -> Admissible:
    """Reconstruct an admissible pair, as :func:`equilibrate` does; collective.

    Args:
        solution: Any state of the contact solver.
        tighten: Greatest number of iterations that tighten sigma^.
        near: The pair of a scene on the same mesh that is nearly this one, with the
            same supports. Tightening starts from what it has added there. It ends after
            few iterations, and the difference of both stresses is as tight as they are.
    """
    began = perf_counter()
    model = solution.model
    owned = model.domain.owned_cells
    cells = cell_geometry(model)
    force = cell_forces(model, cells)
    hat, tractions, stress, moment, fixed = _before_tightening(solution, cells, force)

    # From degree 2 on, the tractions leave the bubbles of sigma^ to be chosen.
    has_bubbles = model.degree > 1
    iterations = 0
    correction = None
    if tighten > 0 or has_bubbles:
        elastic = elastic_coefficients(model, cells, hat, owned)
        compliance = macro_moduli(model, cells, len(cells.nodes), inverse=True)
    if tighten > 0:
        free = cells.has_second[:, None] | fixed
        untightened = moment.copy()
        if near is not None and near.correction is not None:
            moment += near.correction
        moment, iterations = tightened(
            model, cells, moment, force, free, elastic, compliance, tighten
        )
        correction = moment - untightened
    forces = force_coefficients(signed(cells, moment)[:owned], model.degree)
    sigma = macro_stress(cells, owned, stress, forces, force)
    if has_bubbles:
        sigma = relaxed(cells, sigma, elastic, compliance)
    of_springs = []
    if model.springs:
        of_springs = chosen_tractions(model, load_moments(model, cells), moment)
    seconds = model.comm.allreduce(perf_counter() - began, MPI.MAX)
    return Admissible(
        solution,
        hat,
        tractions,
        of_springs,
        cells,
        stress,
        sigma,
        moment,
        force,
        iterations,
        correction,
        seconds,
    )


def _before_tightening(
    solution: Solution, cells: CellGeometry, force: np.ndarray | None
) -> tuple[fem.Function, list[ContactTraction], np.ndarray, np.ndarray, np.ndarray]:
    """Reconstruct the pair before sigma^ is tightened, as facet tractions; collective.

    Returns:
        u^; r^ on each contact; the rebalanced stress [force/area], shape (n, N_(k-1),
        d, d); moments of facet tractions that balance every cell [force], shape
        (facets, m, d); which components of a facet have any traction, shape (facets,
        d).
    """
    model = solution.model
    fixed = supported(model, cells)
    loads = load_moments(model, cells)
    others = other_forces(model, cells, loads, fixed, force, solution.u)
    tractions = admissible_tractions(model, solution, others)
    # A support takes up the load on its components.
    boundary = np.where(fixed[:, None, :], 0.0, loads)
    # The gap allows u at rest, also where facets do not carry the gap.
    if not tractions or solution.at_rest:
        hat = solution.u
    else:
        hat = admissible_displacement(model, solution.u, tractions)
    for traction in tractions:
        of_contact = moments(traction.area, traction.values, model.degree)
        trace = traction.contact.trace
        add_moments(model, boundary, trace.here.facets, of_contact)
        if trace.there is not None:
            # Action and reaction: on the other body acts the opposite traction.
            add_moments(model, boundary, trace.there.facets, -trace.on_there(of_contact))
    b = load_forces(model, cells, boundary, force)
    stress, u = rebalanced_stress(model, solution.stiffness, cells, solution.u, b)
    if model.springs:
        # They pull at the displacement that is in equilibrium with their pull.
        pulled = spring_moments(model, spring_tractions(model, u))
        boundary += np.where(fixed[:, None, :], 0.0, pulled)
    # A rank has all cells around the nodes of its own cells, but not around others.
    complete = np.zeros(len(model.fixed), dtype=bool)
    complete[model.nodes[: model.domain.owned_cells]] = True
    moment = equilibrated_moments(cells, stress, force, boundary, fixed, complete)
    return hat, tractions, stress, moment, fixed
