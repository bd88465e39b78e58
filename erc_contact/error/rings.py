"""The bulk part of the error of axisymmetric bodies, by rules.

The squares of how far a stress S and a strain are from the law are polynomials of
degree 2k over the radius r, if moduli are constant in each cell and nothing else is
given. Rules integrate them over the pieces of the cells with an error that is bounded.
"""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.axisymmetric.elements import law_of_cells, strides
from erc_contact.admissible.axisymmetric.kernels import ring_kernels
from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.elastic import CellStrains, RingStrains
from erc_contact.error.oscillation import UNKNOWN_SHARE
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.meridian import ON_AXIS
from erc_contact.model.model import Model
from namedmesh.simplex import barycentric, rule

SERIES = (0, 1, 2, 4, 8, 16, 24)
"""Degrees of the series of 1/r beyond which rules are not exact."""
SERIES_SHARE = 0.1
"""What the series may leave of what integrals may leave unknown [-]."""


def is_rational(model: Model) -> bool:
    """Tell whether the squares of rings are polynomials of degree 2k over r."""
    of_material = any(varies_in_cells(value) for value in model.parameters.values())
    nothing_given = model.strains is None and model.hoop_load.hoop is None
    return model.space.axisymmetric and nothing_given and not of_material


def squares_of_rings(
    model: Model, cells: CellGeometry, stress: np.ndarray, strain: CellStrains
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrate squares of rings over the cells where rules are near enough.

    A rule of degree ``2k + p`` is exact for a polynomial of degree 2k times p + 1 terms
    of the geometric series of 1/r about the middle of a piece. What the series leaves
    is at most ``rho^(p+1)/r``, with rho the greatest distance from the middle over its
    radius. As squares and weights are not negative, the error is at most twice
    ``rho^(p+1)`` of the integral.

    At the axis, stress and radial displacement vanish. Where an edge of a piece is on
    it, r divides both, and the squares over r are polynomials. Where a vertex is, r
    divides both along each ray from it: a polar rule has the series on the edge beyond.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        stress: Coefficients of the n owned cells, shape (n, 3, N_k, 4).
        strain: Strain of u^.

    Returns:
        The integrals of ``|S - C eps|^2`` and ``|S + C eps|^2`` [force length] and
        bounds of their errors, shape (n, 2) each, and which cells are done, shape (n,).
    """
    k = model.space.degree
    corners = cells.corners[: len(stress)]
    middle_point = np.full((1, 2), 1 / 3)
    stiffness, compliance = (
        law_of_cells(matrix, corners, middle_point)
        for matrix in (model.constitution.stiffness, model.constitution.metric)
    )
    assert isinstance(strain, RingStrains)
    fields = (stress, strain.in_plane, np.ascontiguousarray(strain.radial))
    material = (strides(stiffness)[0], stiffness, compliance)
    geometry = (corners, cells.volume)
    rho, apex = _of_pieces(corners[..., 0], ON_AXIS * model.domain.extent)
    value, bound = np.zeros((2, len(rho), 2))
    done = np.zeros(len(rho), dtype=bool)
    for more in SERIES:
        left = 2 * rho ** (more + 1)
        near = ~done & (left <= SERIES_SHARE * UNKNOWN_SHARE)
        for vertex in (-1, 0, 1, 2):
            chosen = np.flatnonzero(near & (apex == vertex))
            if not len(chosen):
                continue
            points, weights = _rule(2 * k + more, vertex)
            squares = np.empty((len(chosen), 2))
            of_rule = (len(points), points, weights)
            ring_kernels()(
                "ring_squares",
                k,
                len(chosen),
                chosen,
                *geometry,
                *of_rule,
                *material,
                *fields,
                squares,
            )
            value[chosen] = squares
            bound[chosen] = left[chosen, None] * squares
        done |= near
    is_done = done.reshape(-1, 3).all(axis=1)
    value, bound = (_of_cells(values, is_done) for values in (value, bound))
    return value, bound, is_done


def _of_pieces(radius: np.ndarray, axis: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how far the pieces of cells are from their middles over their radii.

    Args:
        radius: Radii of the vertices [length], shape (n, 3).
        axis: Radius that counts as zero [length].

    Returns:
        The greatest distance of a vertex off the axis from the middle of those
        vertices, over the radius of the middle [-], shape (3 n,); and the only vertex
        on the axis of each piece, -1 where none or an edge is, shape (3 n,).
    """
    rho = np.zeros((len(radius), 3))
    apex = np.full((len(radius), 3), -1)
    barycentre = radius.mean(axis=1)
    for piece in range(3):
        second, third = (piece + 1) % 3, (piece + 2) % 3
        of_piece = [barycentre, radius[:, second], radius[:, third]]
        off = [r > axis for r in of_piece]
        count = sum(is_off.astype(int) for is_off in off)
        middle = (
            sum(np.where(is_off, r, 0.0) for is_off, r in zip(off, of_piece, strict=True)) / count
        )
        for is_off, r in zip(off, of_piece, strict=True):
            distance = np.where(is_off, abs(r - middle) / middle, 0.0)
            rho[:, piece] = np.maximum(rho[:, piece], distance)
        alone = count == 2
        apex[:, piece] = np.where(alone, np.where(off[1], third, second), -1)
    return rho.ravel(), apex.ravel()


def _of_cells(values: np.ndarray, is_done: np.ndarray) -> np.ndarray:
    """Sum values (3 n, 2) of pieces, of cells that are done."""
    first, second, third = values.reshape(-1, 3, 2).swapaxes(0, 1)
    return np.where(is_done[:, None], first + second + third, 0.0)


def _rule(degree: int, apex: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a rule on a triangle, of a degree along the edge beyond an apex.

    Returns:
        Barycentric points (q, 3), and weights with sum 1.
    """
    if apex < 0:
        points, weights = rule(2, degree)
        return np.ascontiguousarray(barycentric(points)), weights
    # Along the rays the polynomial has a degree more by the rule's own factor.
    on_edge, of_edge = rule(1, degree)
    on_ray, of_ray = rule(1, degree + 1)
    share, t = on_edge[:, 0], on_ray[:, :1]
    points = np.empty((len(t), len(share), 3))
    points[..., apex] = 1 - t
    points[..., (apex + 1) % 3] = t * (1 - share)
    points[..., (apex + 2) % 3] = t * share
    weights = 2 * t * of_ray[:, None] * of_edge
    return points.reshape(-1, 3), weights.ravel()
