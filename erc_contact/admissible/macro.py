"""A symmetric stress in exact equilibrium from facet tractions and body force, cell by cell.

Each simplex is split at its barycentre into d+1 sub-simplices (Alfeld split). Symmetric linear stresses on them
with continuous traction across the inner facets: for balanced linear tractions and a constant body force there is
exactly one (Johnson, Mercier, Numer. Math. 30 (1978); 15 degrees of freedom in 2D, 42 in 3D). On the reference
simplex the map from (tractions, body force) to nodal stresses is one small matrix; the Piola transform
``sigma = J S J^T / |det J|`` carries it to all cells, forces being mapped by J.

Tensors are in Mandel's notation, components in an orthonormal basis of symmetric matrices, s = d(d+1)/2.
Sub-simplex k has the vertices of the cell with vertex k replaced by the barycentre.
"""

from __future__ import annotations

from functools import cache
from math import sqrt

import numpy as np

from erc_contact.admissible.geometry import Simplices
from erc_contact.model import facet_vertices

CHUNK = 2048
"""Number of cells that are worked on at once: what stays in the cache."""


@cache
def mandel_basis(d: int) -> np.ndarray:
    """Orthonormal basis of the symmetric (d, d) matrices, shape (s, d, d)."""
    basis = [np.outer(e, e) for e in np.eye(d)]
    for i in range(d):
        for j in range(i + 1, d):
            b = np.zeros((d, d))
            b[i, j] = b[j, i] = 1 / sqrt(2)
            basis.append(b)
    return np.array(basis)


@cache
def reference_map(d: int) -> np.ndarray:
    """The matrix from facet forces and body force to nodal stresses on the reference simplex.

    Returns:
        Shape (d+1, d+1, s, (d+1)d+1, d): stress component of sub-simplex k at its node m, from ``|F_i| t`` at the
        d nodes of facet i (first (d+1)d rows) and the total body force (last row), each a vector of d components.
    """
    basis = mandel_basis(d)
    s = len(basis)
    vertices = np.vstack([np.zeros(d), np.eye(d)])
    centre = vertices.mean(axis=0)
    subs = []
    for k in range(d + 1):
        points = vertices.copy()
        points[k] = centre
        subs.append(points)
    stresses = np.eye((d + 1) * (d + 1) * s).reshape(d + 1, d + 1, s, -1)
    faces = facet_vertices(d)
    volume = abs(np.linalg.det(vertices[1:] - vertices[0]))  # times d!, which cancels

    rows, data = [], []
    inputs = np.eye(((d + 1) * d + 1) * d).reshape((d + 1) * d + 1, d, -1)
    for k, points in enumerate(subs):
        gradient = np.linalg.inv(np.column_stack([points, np.ones(d + 1)]))[:d].T  # of the barycentrics
        tensor = np.einsum("msz,sij->mijz", stresses[k], basis)
        divergence = np.einsum("mj,mijz->iz", gradient, tensor)
        rows.append(divergence)
        data.append(-inputs[-1] / (volume / _factorial(d)))
        normal = -gradient[k] * (1 / np.linalg.norm(gradient[k]))
        reference_area = _area(points[faces[k]])
        traction = np.einsum("mijz,j->miz", tensor[faces[k]], normal)
        rows.extend(traction)
        data.extend(inputs[k * d + m] / reference_area for m in range(d))
    for k in range(d + 1):
        for other in range(k + 1, d + 1):
            # sub-simplices k and other share the facet of the centre and all other vertices
            gradient = np.linalg.inv(np.column_stack([subs[k], np.ones(d + 1)]))[:d].T[other]
            normal = gradient / np.linalg.norm(gradient)
            common = [v for v in range(d + 1) if v not in (k, other)]
            pairs = [(k, other), *((v, v) for v in common)]
            for mine, theirs in pairs:
                difference = stresses[k, mine] - stresses[other, theirs]
                rows.append(np.einsum("sz,sij,j->iz", difference, basis, normal))
                data.append(np.zeros_like(inputs[0]))
    solution = np.linalg.pinv(np.vstack(rows), rcond=1e-10) @ np.vstack(data)
    return solution.reshape(d + 1, d + 1, s, (d + 1) * d + 1, d)


def _factorial(d: int) -> int:
    return (1, 1, 2, 6)[d]


def _area(points: np.ndarray) -> float:
    edges = points[1:] - points[0]
    return float(np.sqrt(np.linalg.det(edges @ edges.T))) / _factorial(len(edges))


def mandel(tensor: np.ndarray) -> np.ndarray:
    """Mandel components of symmetric tensors, shape (..., d, d) -> (..., s)."""
    d = tensor.shape[-1]
    return tensor.reshape(*tensor.shape[:-2], d * d) @ mandel_basis(d).reshape(-1, d * d).T


def tensors(components: np.ndarray, d: int) -> np.ndarray:
    """Symmetric tensors from Mandel components, shape (..., s) -> (..., d, d)."""
    return np.tensordot(components, mandel_basis(d), axes=1)


def macro_stress(
    cells: Simplices, count: int, stress: np.ndarray, forces: np.ndarray, force: np.ndarray | None
) -> np.ndarray:
    """The admissible stress ``sigma^ = sigma_h + map(F^ - sigma_h n, f)`` at the nodes of the sub-simplices.

    Args:
        cells: Geometry; the first ``count`` cells are done.
        count: Number of owned cells.
        stress: sigma_h, constant in each cell, shape (n, d, d).
        forces: ``|F| t`` at the nodes of the facets of each cell, shape (count, d+1, d, d).
        force: Total body force of each cell, shape (n, d), or None.

    Returns:
        sigma^ in Mandel components [force/area], shape (count, d+1, d+1, s).
    """
    d, s = cells.d, len(mandel_basis(cells.d))
    matrix = reference_map(d).reshape((d + 1) ** 2 * s, -1, d)
    facet_part = np.ascontiguousarray(matrix[:, :-1].reshape(len(matrix), -1).T)
    sigma = np.empty((count, (d + 1) ** 2, s))
    for some in (slice(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK)):
        base = stress[some]
        defect = forces[some] - np.matmul(cells.area[some], base)[:, :, None, :]
        inverse = -cells.area[some, 1:] / (d * cells.volume[some, None, None])
        reference = np.matmul(defect.reshape(len(base), -1, d), inverse.transpose(0, 2, 1))
        nodal = reference.reshape(len(base), -1) @ facet_part
        if force is not None:
            nodal += np.einsum("nij,nj->ni", inverse, force[some]) @ matrix[:, -1].T
        np.matmul(nodal.reshape(len(base), -1, s), piola(cells, some), out=sigma[some])
        sigma[some] += mandel(base)[:, None, :]
    return sigma.reshape(count, d + 1, d + 1, s)


def piola(cells: Simplices, some: slice) -> np.ndarray:
    """Images ``J b J^T / |det J|`` of the basis tensors b in some cells, row by row in Mandel components, (n, s, s)."""
    d, basis, J = cells.d, mandel_basis(cells.d), cells.J[some]
    products = (J[:, :, :, None, None] * J[:, None, None]) / (cells.volume[some] * _factorial(d))[
        :, None, None, None, None
    ]
    symmetric = np.einsum("aij,bkl->ikjlba", basis, basis).reshape(d**4, -1)
    return (products.reshape(-1, d**4) @ symmetric).reshape(-1, len(basis), len(basis))


@cache
def macro_points(d: int) -> tuple[np.ndarray, np.ndarray]:
    """Quadrature on the sub-simplices, exact for the square of a linear function, with equal weights.

    Point m of a sub-simplex lies near its node m, so that a permutation of vertices permutes the points.

    Returns:
        Shape functions of a sub-simplex at its points (d+1, d+1); points of the cell ((d+1)^2, d).
    """
    near = (d + 2 - sqrt(d + 2)) / ((d + 1) * (d + 2))
    shape = near + (1 - (d + 1) * near) * np.eye(d + 1)
    corners = np.repeat(np.eye(d + 1)[None], d + 1, axis=0)
    corners[np.arange(d + 1), np.arange(d + 1)] = 1 / (d + 1)
    return shape, np.matmul(shape, corners).reshape(-1, d + 1)[:, 1:]
