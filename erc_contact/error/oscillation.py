"""The oscillation: the part of the data that the mesh cannot represent, in energy norms, not part of e.

sigma^ balances projections of the loads, and u^ interpolates the supports. So the pair
is admissible for these other data, and e bounds its error in the problem with them. The
distance of the two problems is, up to constants of Korn and Poincare,

    sum h^2/(pi^2 E) |f - f_T|^2 + sum h/E |F - F_h|^2 + sum E/h |U - U_h|^2,

with E the modulus of the material. The moduli are not projected; their part is what the
integrals of the energies leave unknown (:mod:`erc_contact.mesh.quadrature`). u^ and r^
may violate the gap and the friction bound of the scene at the points of quadrature.
These violations are measured as for a support and a load.

Each part is exactly 0 if the mesh represents the data: constants, constants by region,
tractions and supports that are polynomials of degree k on each facet, and body forces
of degree k-1 in each cell.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.cells import CellGeometry, sorted_corners
from erc_contact.admissible.loads import traction_moments
from erc_contact.mesh.quadrature import Integrand, cell_pieces, facet_pieces, integrate, polynomials
from erc_contact.mesh.simplex import coefficients, from_means
from erc_contact.model.expressions import Everywhere, varies_in_cells
from erc_contact.model.model import Model

EXACT = 1e-12
"""Difference between data and their projection that counts as round-off, over the largest value [-]."""
UNKNOWN = 1e-4
"""Share of e^2 that the integrals with varying data may leave unknown; e^2 contains it [-]."""
COARSE = 1e-2
"""Share of an oscillation that its integral may leave unknown [-]."""


@dataclass(frozen=True)
class Oscillations:
    """Estimates of the part of the data that the mesh cannot represent [sqrt(force length)].

    Attributes:
        loads: Part of tractions and body forces.
        supports: Part of prescribed displacements.
        moduli: Part of moduli: what the integrals of the energies leave unknown, if it
            is more than their tolerance.
        gaps: Part of gaps, and of normals of foundations.
        friction: Part of friction bounds.
        history: Part of the tangential displacement at the end of the last step, which
            a mesh that does not refine that of the last step interpolates.

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
        """Root of the sum of the squares."""
        return float(np.linalg.norm(astuple(self)))


def of_loads(model: Model, cells: CellGeometry, force: np.ndarray | None) -> float:
    """Square of the oscillation of the loads on this rank; collective.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        force: Body force times volume, projected on degree k-1 [force], shape (n,
            N_(k-1), d), or None.
    """
    d, k, owned, total = model.d, model.degree, model.domain.owned_cells, 0.0
    if force is not None and varies_in_cells(model.body_force):
        volume, of_cells = cells.volume[:owned], model.owned_cells
        corners = sorted_corners(model, cells)[:owned]
        projected = force[:owned] / volume[:, None, None]
        rest = _squares(model, Everywhere(model.body_force, model.mesh), of_cells, projected, k - 1)
        square = integrate(model.comm, rest, corners, volume, cell_pieces(d), share=COARSE).value[
            :, 0
        ]
        total += float(
            np.sum(
                volume ** (2 / d) / np.pi**2 * square / model.at_middles(model.modulus, of_cells)
            )
        )
    for load in model.surface_loads:
        if load.varies:
            facets = _owned(model, load.facets)
            moments = (
                traction_moments(model, facets, load.density)
                / model.facet_areas(facets)[:, None, None]
            )
            projected = from_means(d - 1, k, moments)
            square = _on_facets(model, Everywhere(load.density, model.mesh), facets, projected)
            total += float(
                np.sum(
                    square
                    * facet_sizes(model, facets)
                    / model.at_middles(model.modulus, facets[:, 0])
                )
            )
    return total


def of_supports(model: Model) -> float:
    """Square of the oscillation of the prescribed displacements on this rank; collective."""
    total = 0.0
    for support in model.scene.supports:
        for i, component in enumerate(support.value):
            if not callable(component):
                continue
            facets = _owned(model, support.facets)
            nodal = model.prescribed.x.array.reshape(-1, model.d)[model.facet_nodes(facets), i]
            given = Everywhere(component(model.x), model.mesh)
            square = _on_facets(
                model, given, facets, (nodal @ coefficients(model.d - 1, model.degree).T)[..., None]
            )
            total += float(
                np.sum(
                    square
                    * model.at_middles(model.modulus, facets[:, 0])
                    / facet_sizes(model, facets)
                )
            )
    return total


def of_history(model: Model) -> float:
    """Square of the oscillation of the tangential displacement of the last step on this rank: that of a support."""
    total = 0.0
    for contact in model.contacts:
        if contact.lost is not None:
            trace = contact.trace
            total += float(np.sum((contact.lost * trace.stiffness)[trace.here.owned]))
    return total


def _on_facets(
    model: Model, given: Everywhere, facets: np.ndarray, coefficients: np.ndarray
) -> np.ndarray:
    """``int_F |given - polynomial|^2`` on each facet for polynomials of coefficients (f, m, c), shape (f,)."""
    rest = _squares(model, given, facets, coefficients, model.degree)
    corners, area = model.facet_corners(facets), model.facet_areas(facets)
    return integrate(
        model.comm, rest, corners, area, facet_pieces(model.d - 1), share=COARSE
    ).value[:, 0]


def _squares(
    model: Model, given: Everywhere, entities: np.ndarray, coefficients: np.ndarray, degree: int
) -> Integrand:
    """``|given - polynomial|^2`` at points of cells or facets; differences that are round-off count as zero."""
    local = float(abs(coefficients).max(initial=0.0))
    least = EXACT * model.comm.allreduce(local, MPI.MAX)

    def square(of: np.ndarray, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        polynomial = np.matmul(polynomials(degree, at), coefficients[of])
        rest = given(x, entities[of]).reshape(polynomial.shape) - polynomial
        return np.where(abs(rest) <= least, 0.0, rest**2).sum(axis=2, keepdims=True)

    return square


def facet_sizes(model: Model, facets: np.ndarray) -> np.ndarray:
    """Approximate diameters of facets [length]."""
    return model.facet_areas(facets) ** (1 / (model.d - 1))


def _owned(model: Model, name: str) -> np.ndarray:
    """The facets of a boundary part that this rank owns, shape (n, 2)."""
    facets = model.domain.facets(name)
    return facets[model.owned(facets)]
