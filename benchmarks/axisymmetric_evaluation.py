"""Evaluate the equilibrium of axisymmetric pairs with numpy alone.

It serves ``axisymmetric.py``.

Nothing here uses the package but to read the coefficients of S and the mesh: each piece
of a cell has the vertices of the cell, one of them replaced by the barycentre, and
Bernstein coefficients of ``S_rr, S_zz, sqrt(2) S_rz`` and ``2 pi r sigma_tt``, without
what a radial body force adds to the hoop stress.
"""

from __future__ import annotations

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first

UNBALANCED = 1e-9
"""What is missing at a point, over the greatest stress, that is no round-off [-]."""
STEP = 1e-2
"""Step of differences, over the size of a cell [-]."""
SHEAR = 1 / np.sqrt(2)
"""Shear of a unit Mandel component [-]."""


def own_imbalance(pair: ec.Admissible, rng: np.random.Generator) -> float:
    """Return what is missing at random points over the greatest stress, on one rank."""
    worst = max(_in_pieces(pair, rng), _between_pieces(pair, rng), _between_cells(pair, rng))
    for contact in pair.tractions:
        pressure, shear, bound = contact.in_law()
        worst = max(worst, float(np.maximum(-pressure, shear - bound).max(initial=0.0)))
    return worst / float(abs(pair.stress).max())


def _corners(pair: ec.Admissible) -> np.ndarray:
    """Return the vertices of the cells [length], shape (n, 3, 2)."""
    return pair.model.space.V.tabulate_dof_coordinates()[:, :2][pair.cell_geometry.vertices]


def _in_pieces(pair: ec.Admissible, rng: np.random.Generator) -> float:
    """Return what is missing in axial balance and the definition of the hoop stress.

    Derivatives are central differences, which are exact for quadratic polynomials.
    """
    corners = _corners(pair)
    size = np.ptp(corners, axis=1).max(axis=1)
    n = len(corners)
    axial = np.zeros((n, 3))
    if pair.cell_forces is not None:
        # Degree k-1 is at most 1: coefficients are values at the vertices of the cell.
        of_cells = np.broadcast_to(pair.cell_forces[..., 1], (n, 3))
        axial = of_cells / pair.cell_geometry.volume[:, None]
    worst = 0.0
    for piece in range(3):
        of_piece = corners.copy()
        of_piece[:, piece] = corners.mean(axis=1)
        in_cell = np.eye(3)
        in_cell[piece] = 1 / 3
        own = 0.7 * rng.dirichlet(np.ones(3), n) + 0.1
        radius = np.einsum("nv,nv->n", own, of_piece[..., 0])
        inverse = np.linalg.inv((of_piece[:, 1:] - of_piece[:, :1]).swapaxes(1, 2))
        by_axis = []
        for axis in range(2):
            shift = inverse[:, :, axis] * (STEP * size)[:, None]
            move = np.column_stack([-shift.sum(axis=1), shift])
            ahead = evaluated(pair.stress[:, piece], own + move)
            behind = evaluated(pair.stress[:, piece], own - move)
            by_axis.append((ahead - behind) / (2 * STEP * size[:, None]))
        by_r, by_z = by_axis
        force = np.einsum("nw,nw->n", own @ in_cell, axial)
        missing = SHEAR * by_r[:, 2] + by_z[:, 1] + force
        hoop = evaluated(pair.stress[:, piece], own)[:, 3]
        hoop = hoop - radius * (by_r[:, 0] + SHEAR * by_z[:, 2])
        hoop *= np.minimum(1.0, size / radius)
        worst = max(worst, float(abs(missing * size).max()), float(abs(hoop).max()))
    return worst


def _between_pieces(pair: ec.Admissible, rng: np.random.Generator) -> float:
    """Return the greatest jump of a traction between two pieces of a cell."""
    corners = _corners(pair)
    worst = 0.0
    for piece in range(3):
        for other in range(piece):
            (shared,) = {0, 1, 2} - {piece, other}
            t = rng.uniform(size=len(corners))
            here, there = np.zeros((2, len(corners), 3))
            here[:, shared] = there[:, shared] = t
            here[:, piece] = there[:, other] = 1 - t
            along = corners[:, shared] - corners.mean(axis=1)
            normal = np.column_stack([along[:, 1], -along[:, 0]])
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            jump = evaluated(pair.stress[:, piece], here) - evaluated(pair.stress[:, other], there)
            worst = max(worst, float(abs(pushed(jump, normal)).max()))
    return worst


def _between_cells(pair: ec.Admissible, rng: np.random.Generator) -> float:
    """Return the greatest sum of the tractions of both cells at a point of a facet."""
    cells = pair.cell_geometry
    facets = np.flatnonzero(cells.has_second)
    if not facets.size:
        return 0.0
    ends = cells.vertices_of_facets[facets]
    t = rng.uniform(size=(len(facets), 1))
    total = np.zeros((len(facets), 2))
    for side in cells.side[:, facets]:
        cell, piece = np.divmod(side, 3)
        vertices = cells.vertices[cell]
        places = t * (vertices == ends[:, :1]) + (1 - t) * (vertices == ends[:, 1:])
        area = cells.area[cell, piece]
        normal = area / np.linalg.norm(area, axis=1)[:, None]
        total += pushed(evaluated(pair.stress[cell, piece], places), normal)
    return float(abs(total).max())


def evaluated(coefficients: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Evaluate Bernstein polynomials (n, N, c) at barycentric places (n, 3), (n, c)."""
    shape = places
    if coefficients.shape[1] == 6:
        a, b, c = places.T
        shape = np.column_stack([a * a, b * b, c * c, 2 * b * c, 2 * a * c, 2 * a * b])
    return np.asarray(np.einsum("nv,nvc->nc", shape, coefficients))


def pushed(mandel: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return ``S n`` of Mandel components (n, 4) in the half plane, (n, 2)."""
    shear = SHEAR * mandel[:, 2]
    along_r = mandel[:, 0] * normal[:, 0] + shear * normal[:, 1]
    along_z = shear * normal[:, 0] + mandel[:, 1] * normal[:, 1]
    return np.column_stack([along_r, along_z])
