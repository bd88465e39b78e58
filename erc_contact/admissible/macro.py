"""A symmetric stress in exact equilibrium from facet tractions and body force.

Each simplex is split at its barycentre into d+1 sub-simplices (Alfeld split). On these
a stress is symmetric, of degree k, with continuous traction across the inner facets.
For balanced tractions of degree k and a body force of degree k-1 such a stress exists.
For k = 1 there is exactly one (Johnson, Mercier, Numer. Math. 30 (1978); 15 degrees of
freedom in 2D, 42 in 3D). For k = 2 the stresses without tractions and divergence, the
bubbles, have 3 dimensions in 2D and 18 in 3D. On the reference simplex the map from
(tractions, body force) to stresses is one small matrix. The Piola transform ``sigma = J
S J^T / |det J|`` gives the stresses of all cells, with forces mapped by J.

Tensors are in Mandel's notation: components in an orthonormal basis of symmetric
matrices, s = d(d+1)/2. Polynomials are given by Bernstein coefficients, N_k in a cell,
m in a facet. Sub-simplex i has the vertices of the cell with vertex i replaced by the
barycentre.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.reference import reference_map
from erc_contact.model.data.quadrature import cell_pieces, polynomials
from namedmesh.simplex import (
    barycentric,
    bernstein,
    coefficients,
    facet_vertices,
    nodes,
    rule,
)


@cache
def _elevation(d: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return matrices that raise the degree k-1 of a polynomial of the cell to k.

    Returns:
        From its coefficients to those on the sub-simplices (d+1, N_k, N_(k-1)), and on
        the facets (d+1, m, N_(k-1)).
    """
    of_subs = []
    of_facets = []
    for sub, facet in zip(cell_pieces(d)[..., 1:], facet_vertices(d), strict=True):
        in_sub = barycentric(nodes(d, k)) @ sub
        of_subs.append(coefficients(d, k) @ bernstein(d, k - 1, in_sub))
        on_facet = barycentric(nodes(d - 1, k)) @ nodes(d, 1)[facet]
        of_facets.append(coefficients(d - 1, k) @ bernstein(d, k - 1, on_facet))
    return np.array(of_subs), np.array(of_facets)


def macro_stress(
    cells: CellGeometry,
    count: int,
    stress: np.ndarray,
    forces: np.ndarray,
    force: np.ndarray | None,
) -> np.ndarray:
    """Compute the admissible stress on the sub-simplices [force/area].

    It is ``sigma^ = sigma_h + map(F^ - sigma_h n, f + div sigma_h)``.

    Args:
        cells: Geometry.
        count: Number of cells, the first ones.
        stress: sigma_h in each cell, of degree k-1, shape (n, N_(k-1), d, d).
        forces: ``|F| t`` on the facets of each cell, shape (count, d+1, m, d).
        force: Body force times volume of each cell, of degree k-1, shape (n, N_(k-1),
            d), or None.

    Returns:
        sigma^ in Mandel components [force/area], of degree k, shape (count, d+1, N_k,
        s).
    """
    d, k = cells.d, cells.degree
    matrix = np.ascontiguousarray(reference_map(d, k))
    of_subs, of_facets = _elevation(d, k)
    tables = (matrix, np.ascontiguousarray(of_facets), np.ascontiguousarray(of_subs))
    sizes = (matrix.shape[1], forces.shape[2], stress.shape[1], count)
    fields = (np.ascontiguousarray(stress), np.ascontiguousarray(forces), force)
    sigma = np.empty((count, *matrix.shape[:3]))
    kernels(d)("macro_stresses", *sizes, cells.edges, *fields, *tables, sigma)
    return sigma


def macro_values(stress: np.ndarray, k: int, cell: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Evaluate sigma^ at points of pieces of cells [force/area].

    Each piece lies in one sub-simplex.

    Args:
        stress: Coefficients of all cells, shape (cells, d+1, N_k, s).
        k: Their degree.
        cell: Cell of each piece, shape (n,).
        places: Barycentric coordinates in the cell, shape (n, q, d+1).

    Returns:
        Mandel components, shape (n, q, s).
    """
    # The barycentre replaces the vertex that the piece is farthest from.
    # numpy's sums over an axis in the middle take four times as long.
    sub = np.einsum("nqv->nv", places).argmin(axis=1)
    pieces = np.arange(len(cell))
    least = places[pieces, :, sub]
    local = places - least[..., None]
    local[pieces, :, sub] = places.shape[2] * least
    return np.matmul(polynomials(k, local), stress[cell, sub])


class MacroPoints(NamedTuple):
    """Hold a quadrature on the sub-simplices of the reference cell.

    Attributes:
        shape: Bernstein polynomials of a sub-simplex at its points, shape (q, N_k).
        points: Points of the cell, which a permutation of the vertices permutes, shape
            ((d+1) q, d).
        weights: Their weights, with sum 1, shape ((d+1) q,).
    """

    shape: np.ndarray
    points: np.ndarray
    weights: np.ndarray


def macro_points(d: int, k: int) -> MacroPoints:
    """Return a quadrature that is exact for the square of a polynomial of degree k."""
    return _macro_rule(d, k, 2 * k)


def law_points(d: int, k: int) -> MacroPoints:
    """Return a quadrature with more points, for potentials, whose energies have kinks.

    Tetrahedra of degree 2 have as many points as :func:`macro_points`, 56.
    """
    return _macro_rule(d, k, min(2 * k + 2, 10 - 2 * d))


def rule_of(d: int, k: int, count: int) -> MacroPoints:
    """Return :func:`law_points` if they are count points, else :func:`macro_points`."""
    finer = law_points(d, k)
    return finer if len(finer.points) == count else macro_points(d, k)


@cache
def _macro_rule(d: int, k: int, degree: int) -> MacroPoints:
    """Return a quadrature on the sub-simplices that is exact for a degree."""
    points, weights = rule(d, degree)
    places = np.matmul(barycentric(points), cell_pieces(d)).reshape(-1, d + 1)[:, 1:]
    shape = np.ascontiguousarray(bernstein(d, k, points))
    return MacroPoints(shape, places, np.tile(weights / (d + 1), d + 1))
