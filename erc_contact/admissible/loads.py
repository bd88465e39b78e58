"""Projections of the loads on polynomials: the loads that sigma^ balances.

They have degree k on facets and degree k-1 in cells. If a load varies in space, the
integrals are adapted to it. So each facet and each cell has the resultant of the load,
even with a jump or a peak inside. The difference of load and projection is the
oscillation of the loads.

Symbols: k degree, m nodes of a facet, N_(k-1) coefficients of a polynomial of degree
k-1 in a cell.
"""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.cells import CellGeometry, add_moments
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.jumps import kinks_on_facets
from erc_contact.model.data.quadrature import cell_pieces, facet_pieces, integrate, polynomials
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.data.values import DATA_DEGREE
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.simplex import bernstein, from_means, nodes, rule


def traction_moments(space: Space, facets: np.ndarray, traction: Ufl) -> np.ndarray:
    """Compute the moments ``int_F t B_m`` of a traction on facets [force]; collective.

    On the axis the projection of a traction that has these moments is zero.

    Args:
        space: The mesh.
        facets: Pairs (cell, local facet), shape (facets, 2).
        traction: The traction, UFL [force/area], shape (d,).

    Returns:
        The moments [force], shape (facets, m, d), in the order of
        :meth:`Model.facet_nodes`.
    """
    d, k = space.d, space.degree
    area = space.facet_areas(facets)
    if not varies_in_cells(traction):
        points, weights = rule(d - 1, DATA_DEGREE)
        values = space.evaluate(traction, points, facets)
        weighted = weights[:, None] * bernstein(d - 1, k, points)
        moments = np.einsum("qm,fqi->fmi", weighted, values) * area[:, None, None]
        return space.section.vanishing_moments(moments, space.facet_corners(facets))
    load = space.everywhere(traction)

    def products(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return _products(polynomials(k, places), load(x, facets[entity]))

    total = integrate(
        space.comm,
        products,
        space.facet_corners(facets),
        area,
        facet_pieces(d - 1),
        components=d,
        cuts=kinks_on_facets(space, [traction], facets),
        owned=space.owned(facets),
        most=space.points_on_facets,
    )
    of_facets = total.value.reshape(len(facets), len(space.facet_points), d)
    return space.section.vanishing_moments(of_facets, space.facet_corners(facets))


def cell_forces(model: Model, cells: CellGeometry) -> np.ndarray | None:
    """Project the body force times volume on degree k-1 [force]; collective.

    Of an axisymmetric body it is the axial force alone: the radial one is a part of the
    hoop stress.

    Returns:
        Coefficients, shape (n, N_(k-1), d), or None without body force.
    """
    space = model.space
    if model.body_force is None:
        return None
    d, k = cells.d, cells.degree
    of_cells = np.arange(len(cells.nodes), dtype=np.int32)
    if not varies_in_cells(model.body_force):
        values = space.at_middles(model.body_force, of_cells)[:, None]
        return np.repeat(values, len(nodes(d, k - 1)), axis=1) * cells.volume[:, None, None]
    load = space.everywhere(model.body_force)

    def moments(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return _products(polynomials(k - 1, places), load(x, of_cells[entity]))

    # All ranks have DOLFINx's order of the vertices, and so the same integration points
    # and forces of a cell. Only then the vertices are sorted.
    corners = space.cell_corners()
    body = corners, cells.volume, cell_pieces(d)
    owned = of_cells < model.domain.owned_cells
    most = space.points_in_cells // 2  # half is for the oscillation
    total = integrate(space.comm, moments, *body, components=d, owned=owned, most=most)
    means = total.value.reshape(len(of_cells), len(nodes(d, k - 1)), d)
    forces = from_means(d, k - 1, space.section.carried(means))
    if k == 1:
        return forces
    return np.take_along_axis(forces, cells.order[:, :, None], axis=1)


def _products(shape: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Multiply polynomials (n, q, N) and components of vectors (n, q, d).

    Returns:
        All products, shape (n, q, N d).
    """
    products = shape[..., None] * values[:, :, None, :]
    return products.reshape(*values.shape[:2], shape.shape[2] * values.shape[2])


def load_moments(model: Model, cells: CellGeometry) -> np.ndarray:
    """Compute the moments of the loads on facets, projected on degree k; collective.

    Returns:
        Moments [force], shape (facets, m, d).
    """
    space = model.space
    result = np.zeros((cells.side.shape[1], len(space.facet_points), cells.d))
    for load in model.surface_loads:
        facets = model.domain.facets(load.facets)
        add_moments(space, result, facets, traction_moments(space, facets, load.density))
    return result
