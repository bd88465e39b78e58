"""A symmetric stress in exact equilibrium from facet tractions and body force, cell by cell.

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

from collections.abc import Iterator
from functools import cache
from math import factorial

import numpy as np

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.mesh.quadrature import cell_pieces, polynomials
from erc_contact.mesh.simplex import (
    barycentric,
    bernstein,
    coefficients,
    facet_vertices,
    gradients,
    local_facet_nodes,
    mass,
    measures,
    node_vertices,
    nodes,
    rule,
)
from erc_contact.scene.material import mandel_basis

CHUNK = 1024
"""Number of cells that numpy works on at once, so that their arrays stay in the cache."""


def chunks(count: int) -> Iterator[slice]:
    """Slices of ``range(count)`` of this size."""
    return (slice(i, min(i + CHUNK, count)) for i in range(0, count, CHUNK))


@cache
def _reference(d: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Map and bubbles on the reference simplex, see :func:`reference_map` and :func:`bubbles`."""
    basis = mandel_basis(d)
    s, N, m, b = len(basis), len(nodes(d, k)), len(nodes(d - 1, k)), len(nodes(d, k - 1))
    subs = cell_pieces(d)[..., 1:]
    stresses = np.eye((d + 1) * N * s).reshape(d + 1, N, s, -1)
    inputs = np.eye(((d + 1) * m + b) * d).reshape((d + 1) * m + b, d, -1)
    table, on_facet = gradients(d, k), local_facet_nodes(d, k)
    lower = nodes(d, k - 1)

    rows, data = [], []
    for i, points in enumerate(subs):
        gradient = np.linalg.inv(np.column_stack([points, np.ones(d + 1)]))[
            :d
        ].T  # of the barycentrics
        divergence = np.einsum(
            "cjm,ja,msz,sai->ciz", table, gradient, stresses[i], basis, optimize=True
        )
        rows.extend(divergence)
        of_cell = bernstein(
            d, k - 1, lower @ (points[1:] - points[0]) + points[0]
        )  # degree at most 1: coefficients
        data.extend(-factorial(d) * np.einsum("cb,biz->ciz", of_cell, inputs[(d + 1) * m :]))
        normal = -gradient[i] / np.linalg.norm(gradient[i])
        rows.extend(np.einsum("msz,sij,j->miz", stresses[i, on_facet[i]], basis, normal))
        data.extend(inputs[i * m : (i + 1) * m] / measures(points[np.arange(d + 1) != i]))
    names = node_vertices(d, k)
    for i in range(d + 1):
        for other in range(i + 1, d + 1):
            # sub-simplices i and other share the facet of the barycentre (number d+1)
            # and the other vertices
            gradient = np.linalg.inv(np.column_stack([subs[i], np.ones(d + 1)]))[:d].T[other]
            normal = gradient / np.linalg.norm(gradient)
            mine, theirs = (
                {frozenset(np.where(names[n] == sub, d + 1, names[n])): n for n in on_facet[facet]}
                for sub, facet in ((i, other), (other, i))
            )
            for name, n in mine.items():
                difference = stresses[i, n] - stresses[other, theirs[name]]
                rows.append(np.einsum("sz,sij,j->iz", difference, basis, normal))
                data.append(np.zeros_like(inputs[0]))
    left, values, right = np.linalg.svd(np.vstack(rows))
    rank = int(np.sum(values > 1e-10 * values[0]))
    solution = right[:rank].T @ ((left[:, :rank].T @ np.vstack(data)) / values[:rank, None])
    kernel = right[rank:].T
    if kernel.size:
        # take the stress of least norm on the regular simplex, which does not depend on
        # the order of the vertices
        J = np.linalg.cholesky((np.ones((d, d)) + np.eye(d)) / 2).T
        images = mandel(J @ basis @ J.T)
        norm = np.kron(np.eye(d + 1), np.kron(mass(d, k, k), images @ images.T))
        solution -= kernel @ np.linalg.solve(kernel.T @ norm @ kernel, kernel.T @ norm @ solution)
    return (
        solution.reshape(d + 1, N, s, (d + 1) * m + b, d),
        np.ascontiguousarray(kernel).reshape(d + 1, N, s, len(right) - rank),
    )


def reference_map(d: int, k: int) -> np.ndarray:
    """The matrix from facet forces and body force to stresses on the reference simplex.

    Returns:
        Shape (d+1, N_k, s, (d+1)m + N_(k-1), d): stress coefficient of sub-simplex i at
        its node n, from ``|F_i| t`` at the m nodes of facet i (first rows) and the body
        force times the volume, each a vector of d components.
    """
    return _reference(d, k)[0]


def bubbles(d: int, k: int) -> np.ndarray:
    """Basis of the stresses without tractions and divergence on the reference simplex, shape (d+1, N_k, s, number)."""
    return _reference(d, k)[1]


def mandel(tensor: np.ndarray) -> np.ndarray:
    """Mandel components of symmetric tensors, shape (..., d, d) -> (..., s)."""
    d = tensor.shape[-1]
    return tensor.reshape(*tensor.shape[:-2], d * d) @ mandel_basis(d).reshape(-1, d * d).T


def tensors(components: np.ndarray, d: int) -> np.ndarray:
    """Symmetric tensors from Mandel components, shape (..., s) -> (..., d, d)."""
    return np.tensordot(components, mandel_basis(d), axes=1)


@cache
def _elevation(d: int, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of degree k of a polynomial of degree k-1 of the cell, from its own.

    Returns:
        On the sub-simplices (d+1, N_k, N_(k-1)), and on the facets (d+1, m, N_(k-1)).
    """
    of_subs, of_facets = [], []
    for sub, facet in zip(cell_pieces(d)[..., 1:], facet_vertices(d), strict=True):
        of_subs.append(coefficients(d, k) @ bernstein(d, k - 1, barycentric(nodes(d, k)) @ sub))
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
    """The admissible stress ``sigma^ = sigma_h + map(F^ - sigma_h n, f + div sigma_h)`` on the sub-simplices.

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
    of_subs, of_facets = (np.ascontiguousarray(table) for table in _elevation(d, k))
    sigma = np.empty((count, *matrix.shape[:3]))
    kernels()(
        "macro_stresses",
        *(
            d,
            matrix.shape[1],
            forces.shape[2],
            stress.shape[1],
            count,
            cells.edges,
            np.ascontiguousarray(stress),
        ),
        *(np.ascontiguousarray(forces), force, matrix, of_facets, of_subs, sigma),
    )
    return sigma


def macro_values(stress: np.ndarray, k: int, of: np.ndarray, at: np.ndarray) -> np.ndarray:
    """sigma^ at points of pieces, each of which lies in one sub-simplex, in Mandel components (n, q, s).

    Args:
        stress: Coefficients of all cells, shape (cells, d+1, N_k, s).
        k: Their degree.
        of: Cell of each piece, shape (n,).
        at: Barycentric coordinates in the cell, shape (n, q, d+1).
    """
    every, sub = (
        np.arange(len(of)),
        at.mean(axis=1).argmin(axis=1),
    )  # the vertex that the barycentre replaces
    least = at[every, :, sub]
    local = at - least[..., None]
    local[every, :, sub] = at.shape[2] * least
    return np.matmul(polynomials(k, local), stress[of, sub])


def piola(cells: CellGeometry, some: slice) -> np.ndarray:
    """Images ``J b J^T / |det J|`` of the basis tensors b in some cells, row by row in Mandel components, (n, s, s)."""
    d, basis, J = cells.d, mandel_basis(cells.d), cells.J[some]
    products = (J[:, :, :, None, None] * J[:, None, None]) / (cells.volume[some] * factorial(d))[
        :, None, None, None, None
    ]
    symmetric = np.einsum("aij,bkl->ikjlba", basis, basis).reshape(d**4, -1)
    return (products.reshape(-1, d**4) @ symmetric).reshape(-1, len(basis), len(basis))


def reference_metric(cells: CellGeometry, some: slice, compliance: np.ndarray) -> np.ndarray:
    """``|T| P C^-1 P^T`` with P the Piola transform: the compliance for reference stresses, (c, Q or 1, s, s)."""
    P = piola(cells, some)[:, None] * np.sqrt(cells.volume[some])[:, None, None, None]
    local = compliance[some] if len(compliance) > 1 else compliance
    return np.matmul(np.matmul(P, local), P.transpose(0, 1, 3, 2))


@cache
def macro_points(d: int, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quadrature on the sub-simplices, exact for the square of a polynomial of degree k.

    Returns:
        Bernstein polynomials of a sub-simplex at its points (q, N_k); points of the
        cell ((d+1) q, d), which a permutation of the vertices permutes; their weights,
        with sum 1.
    """
    points, weights = rule(d, 2 * k)
    places = np.matmul(barycentric(points), cell_pieces(d)).reshape(-1, d + 1)[:, 1:]
    return np.ascontiguousarray(bernstein(d, k, points)), places, np.tile(weights / (d + 1), d + 1)
