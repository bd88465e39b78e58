"""The oscillation: the part of the data that the mesh cannot represent.

It is measured in energy norms, and not part of e. sigma^ balances projections of the
loads, and u^ interpolates the supports. So the pair is admissible for these other data,
and e bounds its error in the problem with them. The distance of the two problems is, up
to constants of Korn and Poincare,

    sum h^2/(pi^2 E) |f - f_T|^2 + sum h/E |F - F_h|^2 + sum E/h |U - U_h|^2,

with E the modulus of the material. The moduli are not projected; their part is what the
integrals of the energies leave unknown (:mod:`erc_contact.model.data.quadrature`). u^
and r^ may violate the gap and the friction bound of the scene at the points of
quadrature. These violations are measured as for a support and a load. Each part is
exactly 0 if the mesh represents the data: constants, constants by region, tractions and
supports that are polynomials of degree k on each facet, and body forces of degree k-1
in each cell.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.loads import traction_moments
from erc_contact.base.traced import field_of
from erc_contact.model.data.expressions import Everywhere
from erc_contact.model.data.quadrature import (
    Integrand,
    facet_pieces,
    integrate,
    polynomials,
    whole,
)
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.simplex import coefficients, from_means

DATA_ROUND_OFF = 1e-12
"""Difference between data and their projection that counts as round-off [-].

It is over the largest value.
"""
UNKNOWN_SHARE = 1e-4
"""Share of e^2 that integrals with varying data may leave unknown [-].

e^2 contains it.
"""
OSCILLATION_SHARE = 1e-2
"""Share of an oscillation that its integral may leave unknown [-]."""


@dataclass(frozen=True)
class Oscillations:
    """Hold estimates of what the mesh cannot represent [sqrt(force length)].

    Attributes:
        loads: Part of tractions and body forces.
        supports: Part of prescribed displacements.
        moduli: Part of moduli: what the integrals of the energies leave unknown, if it
            is more than their tolerance.
        gaps: Part of gaps, and of normals of foundations.
        friction: Part of friction bounds.
        history: Part of the tangential displacement at the end of the last step, which
            a mesh interpolates if it does not refine the mesh of the last step.

    Example:
        >>> error.oscillations  # the mesh represents all data of this scene
        Oscillations(loads=0.0, supports=0.0, ..., history=0.0)
    """

    loads: float = 0.0
    supports: float = 0.0
    moduli: float = 0.0
    gaps: float = 0.0
    friction: float = 0.0
    history: float = 0.0

    @property
    def total(self) -> float:
        """Return the root of the sum of the squares."""
        return float(np.linalg.norm(astuple(self)))


def of_loads(
    model: Model, cells: CellGeometry, force: np.ndarray | None, relief: np.ndarray | None
) -> float:
    """Compute the square of the oscillation of the loads on this rank; collective.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        force: Body force times volume that sigma^ balances, of degree k-1 [force],
            shape (n, N_(k-1), d), or None.
        relief: What it has more than the projected loads [force/volume], constant in
            cells, shape (n, d), or None.
    """
    space = model.space
    d, k = space.d, space.degree
    total = 0.0
    carried = model.space.section.carried_density(model.body_force)
    if carried is not None and varies_in_cells(carried):
        total += _of_body_force(model, cells, force, relief)
    if relief is not None:
        total += _of_relief(model, cells, relief)
    for load in model.surface_loads:
        if load.varies:
            facets = model.domain.owned_facets(load.facets)
            # The reconstruction projects the load, too: sigma^ balances this
            # projection.
            moments = traction_moments(space, facets, load.density)
            means = moments / space.facet_areas(facets)[:, None, None]
            projected = from_means(d - 1, k, means)
            square = _on_facets(space, space.everywhere(load.density), facets, projected)
            modulus = space.at_middles(model.modulus, facets[:, 0])
            total += float(np.sum(square * facet_sizes(space, facets) / modulus))
    return total


def _of_relief(model: Model, cells: CellGeometry, relief: np.ndarray) -> float:
    """Compute the square of what forces cost that balance projected loads; collective.

    Their means in cells are not zero, so the size of the body stands for the cell size.
    The least modulus does for the modulus.
    """
    space = model.space
    owned = model.domain.owned_cells
    square = cells.volume[:owned] @ (relief[:owned] ** 2).sum(axis=1)
    modulus, _ = space.extremes(space.at_middles(model.modulus, space.owned_cells))
    return float(model.domain.extent**2 / np.pi**2 * square / modulus)


def _of_body_force(
    model: Model, cells: CellGeometry, force: np.ndarray | None, relief: np.ndarray | None
) -> float:
    """Compute the square of the oscillation of the body force; collective."""
    space = model.space
    d, k = space.d, space.degree
    owned = model.domain.owned_cells
    volume = cells.volume[:owned]
    corners = cells.corners[:owned]
    assert force is not None
    projected = force[:owned] / volume[:, None, None]
    if relief is not None:
        projected = projected - relief[:owned, None]
    data = space.everywhere(space.section.carried_density(model.body_force))
    difference = _squares(space, data, space.owned_cells, projected, k - 1)
    # Nothing is split at the middles of cells, as stresses are.
    body = corners, volume, whole(d)
    most = space.points_in_cells // 2
    integral = integrate(space.comm, difference, *body, share=OSCILLATION_SHARE, most=most)
    square = integral.value[:, 0]
    modulus = space.at_middles(model.modulus, space.owned_cells)
    return float(np.sum(volume ** (2 / d) / np.pi**2 * square / modulus))


def of_supports(model: Model) -> float:
    """Compute the square of the oscillation of the supports; collective.

    It is summed over the facets of this rank.
    """
    space = model.space
    d, k = space.d, space.degree
    prescribed = model.prescribed.x.array.reshape(-1, d)
    total = 0.0
    for support in model.scene.supports:
        for i, component in enumerate(support.value):
            if not callable(component):
                continue
            facets = model.domain.owned_facets(support.facets)
            # u^ interpolates the support at the nodes.
            nodal = prescribed[space.facet_nodes(facets), i]
            interpolated = (nodal @ coefficients(d - 1, k).T)[..., None]
            data = space.everywhere(field_of(component, space.x))
            square = _on_facets(space, data, facets, interpolated)
            modulus = space.at_middles(model.modulus, facets[:, 0])
            total += float(np.sum(square * modulus / facet_sizes(space, facets)))
    return total


def of_history(model: Model) -> float:
    """Compute the square of the oscillation of the last step on this rank.

    The tangential displacement of that step is measured like the displacement of a
    support.
    """
    total = 0.0
    for contact in model.contacts:
        if contact.lost is not None:
            trace = contact.trace
            square = contact.lost * trace.stiffness
            total += float(np.sum(square[trace.here.owned]))
    return total


def _on_facets(
    space: Space, data: Everywhere, facets: np.ndarray, coefficients: np.ndarray
) -> np.ndarray:
    """Compute ``int_F |data - polynomial|^2`` on each facet; collective.

    Args:
        space: The mesh.
        data: The data, of c components.
        facets: Pairs (cell, local facet), shape (f, 2).
        coefficients: Bernstein coefficients of the polynomials, shape (f, m, c).

    Returns:
        The integrals, shape (f,).
    """
    difference = _squares(space, data, facets, coefficients, space.degree)
    corners = space.facet_corners(facets)
    area = space.facet_areas(facets)
    integral = integrate(
        space.comm,
        difference,
        corners,
        area,
        facet_pieces(space.d - 1),
        share=OSCILLATION_SHARE,
        most=space.points_on_facets,
    )
    return integral.value[:, 0]


def _squares(
    space: Space, data: Everywhere, entities: np.ndarray, coefficients: np.ndarray, degree: int
) -> Integrand:
    """Return the integrand ``|data - polynomial|^2`` on cells or facets; collective.

    Differences that are round-off count as zero.
    """
    local = float(abs(coefficients).max(initial=0.0))
    # All ranks must agree, also those that have none of the facets.
    least = DATA_ROUND_OFF * space.comm.allreduce(local, MPI.MAX)

    def square(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        polynomial = np.matmul(polynomials(degree, places), coefficients[entity])
        difference = data(x, entities[entity]).reshape(polynomial.shape) - polynomial
        squares = np.where(abs(difference) <= least, 0.0, difference**2)
        return squares.sum(axis=2, keepdims=True)

    return square


def facet_sizes(space: Space, facets: np.ndarray) -> np.ndarray:
    """Return approximate diameters of facets [length]."""
    return space.facet_areas(facets) ** (1 / (space.d - 1))
