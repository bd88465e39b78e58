"""Stresses of the split reference simplex from facet tractions and body force.

The simplex is split at its barycentre into d+1 sub-simplices (Alfeld split). On these a
stress is symmetric, of degree k, with continuous traction across the inner facets. See
:mod:`erc_contact.admissible.macro`, which has the symbols, too.
"""

from __future__ import annotations

from functools import cache
from math import factorial

import numpy as np

from erc_contact.model.data.quadrature import cell_pieces
from erc_contact.scene.material import mandel_basis
from namedmesh.simplex import (
    bernstein,
    gradients,
    local_facet_nodes,
    mass,
    measures,
    node_vertices,
    nodes,
)

RANK = 1e-10
"""Singular value of the conditions that counts as zero, over the largest one [-]."""


@cache
def _reference(d: int, k: int, on_pieces: bool) -> tuple[np.ndarray, np.ndarray]:
    """Compute the map and the bubbles on the reference simplex.

    See :func:`reference_map` and :func:`bubbles`. The map is the solution of linear
    conditions: the divergence in the sub-simplices, the tractions on the facets of the
    cell, and continuous tractions between the sub-simplices.
    """
    s = len(mandel_basis(d))
    N = len(nodes(d, k))
    m = len(nodes(d - 1, k))
    b = len(nodes(d, k - 1)) * (d + 1 if on_pieces else 1)
    stresses = np.eye((d + 1) * N * s).reshape(d + 1, N, s, -1)
    inputs = np.eye(((d + 1) * m + b) * d).reshape((d + 1) * m + b, d, -1)
    equilibrium, loads = _equilibrium_rows(d, k, stresses, inputs, on_pieces)
    continuity = _continuity_rows(d, k, stresses)
    no_load = np.zeros((len(continuity), *inputs.shape[1:]))
    rows = np.concatenate([equilibrium, continuity]).reshape(-1, stresses.shape[-1])
    data = np.concatenate([loads, no_load]).reshape(-1, inputs.shape[-1])
    left, values, right = np.linalg.svd(rows)
    rank = int(np.sum(values > RANK * values[0]))
    solution = right[:rank].T @ ((left[:, :rank].T @ data) / values[:rank, None])
    kernel = right[rank:].T
    if kernel.size:
        # Take the stress of least norm on the regular simplex, which does not depend on
        # the order of the vertices.
        basis = mandel_basis(d)
        J = np.linalg.cholesky((np.ones((d, d)) + np.eye(d)) / 2).T
        images = mandel(J @ basis @ J.T)
        norm = np.kron(np.eye(d + 1), np.kron(mass(d, k, k), images @ images.T))
        solution -= kernel @ np.linalg.solve(kernel.T @ norm @ kernel, kernel.T @ norm @ solution)
    bubble = np.ascontiguousarray(kernel).reshape(d + 1, N, s, len(right) - rank)
    return solution.reshape(d + 1, N, s, (d + 1) * m + b, d), bubble


def _equilibrium_rows(
    d: int, k: int, stresses: np.ndarray, inputs: np.ndarray, on_pieces: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return the conditions of equilibrium, as vectors of d components.

    Args:
        d: Dimension.
        k: Degree.
        stresses: All stresses of the sub-simplices, shape (d+1, N, s, number).
        inputs: All facet forces, then all body forces, shape ((d+1) m + b, d, number).
        on_pieces: Whether each sub-simplex has a body force of its own.

    Returns:
        The left sides for the stresses, and the right sides for the inputs.
    """
    basis = mandel_basis(d)
    m = len(nodes(d - 1, k))
    body_forces = inputs[(d + 1) * m :]
    table = gradients(d, k)
    on_facet = local_facet_nodes(d, k)
    rows: list[np.ndarray] = []
    data: list[np.ndarray] = []
    for i, points in enumerate(cell_pieces(d)[..., 1:]):
        gradient = _barycentric_gradients(points)
        rows.extend(
            np.einsum("cjm,ja,msz,sai->ciz", table, gradient, stresses[i], basis, optimize=True)
        )
        data.extend(-factorial(d) * _on_piece(d, k, i, points, body_forces, on_pieces))
        normal = -gradient[i] / np.linalg.norm(gradient[i])
        rows.extend(np.einsum("msz,sij,j->miz", stresses[i, on_facet[i]], basis, normal))
        corners = points[np.arange(d + 1) != i]
        data.extend(inputs[i * m : (i + 1) * m] / measures(corners))
    return np.array(rows), np.array(data)


def _on_piece(
    d: int, k: int, i: int, points: np.ndarray, body_forces: np.ndarray, on_pieces: bool
) -> np.ndarray:
    """Return the coefficients of body forces on sub-simplex i."""
    b = len(nodes(d, k - 1))
    if on_pieces:
        return body_forces[i * b : (i + 1) * b]
    # The body force is of degree at most 1: its values are its coefficients.
    places = nodes(d, k - 1) @ (points[1:] - points[0]) + points[0]
    return np.einsum("cb,biz->ciz", bernstein(d, k - 1, places), body_forces)


def _continuity_rows(d: int, k: int, stresses: np.ndarray) -> np.ndarray:
    """Return the differences of tractions between two sub-simplices, which are zero.

    Args:
        d: Dimension.
        k: Degree.
        stresses: All stresses of the sub-simplices, shape (d+1, N, s, number).

    Returns:
        The left sides, shape (conditions, d, number).
    """
    basis = mandel_basis(d)
    subs = cell_pieces(d)[..., 1:]
    rows = []
    for i in range(d + 1):
        for second_facet in range(i + 1, d + 1):
            # Sub-simplices i and other share the facet of the barycentre and the other
            # vertices.
            gradient = _barycentric_gradients(subs[i])[second_facet]
            normal = gradient / np.linalg.norm(gradient)
            theirs = named_nodes(d, k, second_facet, i)
            for name, n in named_nodes(d, k, i, second_facet).items():
                difference = stresses[i, n] - stresses[second_facet, theirs[name]]
                rows.append(np.einsum("sz,sij,j->iz", difference, basis, normal))
    return np.array(rows)


def _barycentric_gradients(points: np.ndarray) -> np.ndarray:
    """Return the gradients of barycentric coordinates of a simplex, shape (d+1, d)."""
    d = points.shape[1]
    return np.linalg.inv(np.column_stack([points, np.ones(d + 1)]))[:d].T


def named_nodes(d: int, k: int, sub: int, facet: int) -> dict[frozenset[int], int]:
    """Return the nodes on a facet of a sub-simplex by name.

    The name is the set of the vertices that a node lies between. The vertices are
    numbered as in the cell; d+1 is the barycentre.
    """
    vertices = node_vertices(d, k)
    named = {}
    for node in local_facet_nodes(d, k)[facet]:
        ends = np.where(vertices[node] == sub, d + 1, vertices[node])
        named[frozenset(ends.tolist())] = int(node)
    return named


def reference_map(d: int, k: int, *, on_pieces: bool = False) -> np.ndarray:
    """Return the matrix from facet forces and body force to stresses.

    Args:
        d: Dimension.
        k: Degree.
        on_pieces: Whether each sub-simplex has a body force of its own. The body force
            then has (d+1) N_(k-1) rows, sub-simplex by sub-simplex.

    Returns:
        Shape (d+1, N_k, s, (d+1)m + N_(k-1), d) on the reference simplex: stress
        coefficient of sub-simplex i at its node n, from ``|F_i| t`` at the m nodes of
        facet i (first rows) and the body force times the volume, each a vector of d
        components.
    """
    table, _ = _reference(d, k, on_pieces)
    return table


def bubbles(d: int, k: int) -> np.ndarray:
    """Return a basis of the stresses without tractions and divergence.

    Returns:
        Coefficients on the reference simplex, shape (d+1, N_k, s, number).
    """
    _, bubble = _reference(d, k, False)
    return bubble


def mandel(tensor: np.ndarray) -> np.ndarray:
    """Return Mandel components of symmetric tensors, (..., d, d) -> (..., s)."""
    d = tensor.shape[-1]
    flat = tensor.reshape(*tensor.shape[:-2], d * d)
    return flat @ mandel_basis(d).reshape(-1, d * d).T


def tensors(components: np.ndarray, d: int) -> np.ndarray:
    """Return symmetric tensors from Mandel components, (..., s) -> (..., d, d)."""
    return np.tensordot(components, mandel_basis(d), axes=1)
