"""Facet tractions in equilibrium with the loads on every cell.

A stress sigma_h of degree k-1 in each cell is given, which is in equilibrium with the
data against all continuous P_k fields. The unknown tractions have degree k on facets.
They are opposite on the two sides of a facet, and equal to F on Gamma_N and to r^ on
Gamma_C. On every cell they do the same work on P_k fields as sigma_h and f. So they
balance forces and moments there. They follow from discontinuous P_k multipliers lambda
with

    sum_F w_F <[lambda], [mu]> = residual of the averaged tractions against mu,

where <.,.> is lumped at the nodes of a facet. The moments of the tractions are the
moments of the average less ``w_F [lambda]``, with [lambda] on the first side of a facet
less lambda on the second. Lumping decouples the nodes: for each node
and component there is one small weighted graph Laplacian of the patch of cells around
the node. They are solved directly, all patches of one size at once. Every patch is
complete on its rank, so nothing is communicated.

Source: Ladeveze, Leguillon, SIAM J. Numer. Anal. 20 (1983), the equilibration of
densities; the form is ours.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from erc_contact.admissible.cells import CellGeometry, facet_forces, moments_of_cells
from erc_contact.admissible.kernels import kernels
from namedmesh.simplex import (
    barycentric,
    bernstein,
    facet_vertices,
    gradients,
    local_facet_nodes,
    mass,
    nodes,
    rule,
)


def equilibrated_moments(
    cells: CellGeometry,
    stress: np.ndarray,
    body: np.ndarray | None,
    boundary: np.ndarray,
    fixed: np.ndarray,
    complete: np.ndarray,
) -> np.ndarray:
    """Compute the moments of the equilibrated facet tractions [force].

    Args:
        cells: Geometry, n cells.
        stress: Coefficients of sigma_h [force/area], shape (n, N_(k-1), d, d).
        body: Work of the body force on each Bernstein polynomial of degree k [force],
            shape (n, N_k, d), or None.
        boundary: Moments of the tractions known on the boundary [force], shape
            (facets, m, d).
        fixed: Components of boundary facets whose traction is unknown (Gamma_D), shape
            (facets, d).
        complete: Nodes whose patch is complete on this rank, shape (nodes,).

    Returns:
        Moments ``int_F t B_m`` [force] of the traction on the first side of each facet,
        shape (facets, m, d).
    """
    d, k = cells.d, cells.degree
    count = len(cells.nodes)
    inner = cells.has_second
    first, second = cells.side
    on_facets = _tests(d, k)
    by_facet = facet_forces(cells.area, stress)

    # The average of both sides; the traction of the only side on Gamma_D.
    flat = by_facet.reshape(-1, *by_facet.shape[2:])
    on_first = np.matmul(on_facets[first % (d + 1)], flat[first])
    on_second = np.matmul(on_facets[second % (d + 1)], flat[second])
    of_support = np.where(fixed[:, None], on_first, 0.0)
    moment = np.where(inner[:, None, None], 0.5 * (on_first - on_second), of_support)
    moment += boundary

    # (f, B_v) - (sigma_h, grad B_v) + int_dT t B_v on every cell
    by_cell = by_facet.reshape(count, (d + 1) * by_facet.shape[2], d)
    residual = np.matmul(divergence(d, k), by_cell)
    if body is not None:
        residual += body
    to_nodes = _incidence(d, k)
    residual += np.matmul(
        to_nodes, moments_of_cells(cells, moment).reshape(count, to_nodes.shape[1], d)
    )

    # w_F = |F|/h_F with h_F = |F|^(1/(d-1))
    area = np.linalg.norm(cells.area, axis=2).ravel()[first]
    weight = np.where(first >= 0, area ** ((d - 2) / (d - 1)), 0.0)
    return moment - _patch_jumps(cells, residual, weight, inner, fixed, complete)


@cache
def divergence(d: int, k: int) -> np.ndarray:
    """Compute ``-|T| (B_c, grad B_v)``, which tests a stress with polynomials.

    The stress is of degree k-1, the Bernstein polynomials B_v of degree k.

    Returns:
        Matrix that acts on the forces ``S_c |F_j| n_j`` of :func:`facet_forces`, shape
        (N_k, (d+1) N_(k-1)).
    """
    # |F_j| n_j = -d |T| grad lambda_j
    inside = np.einsum("bc,cjv->vjb", mass(d, k - 1, k - 1), gradients(d, k)) / d
    return inside.reshape(len(nodes(d, k)), -1)


@cache
def _tests(d: int, k: int) -> np.ndarray:
    """Compute the means of B_c B_m over each facet, shape (d+1, m, N_(k-1))."""
    points, weights = rule(d - 1, 2 * k - 1)
    on_facets = []
    for vertices in facet_vertices(d):
        lower = bernstein(d, k - 1, barycentric(points) @ nodes(d, 1)[vertices])
        on_facets.append(bernstein(d - 1, k, points).T @ (weights[:, None] * lower))
    return np.array(on_facets)


@cache
def _incidence(d: int, k: int) -> np.ndarray:
    """Return the matrix (N_k, (d+1) m) that sums values at facet nodes of a cell.

    The values are given facet by facet, the sums at the nodes of the cell.
    """
    cell_nodes = np.arange(len(nodes(d, k)))[:, None]
    return (cell_nodes == local_facet_nodes(d, k).ravel()).astype(float)


def _patch_jumps(
    cells: CellGeometry,
    residual: np.ndarray,
    weight: np.ndarray,
    inner: np.ndarray,
    fixed: np.ndarray,
    complete: np.ndarray,
) -> np.ndarray:
    """Solve the graph Laplacians of all patches.

    Each node of a facet between two cells is an edge of weight w_F between them, in the
    graph of the patch of this node. Each node of a facet of Gamma_D adds w_F to the
    diagonal. If a patch has no facet of Gamma_D, lambda is determined up to a constant,
    and its mean is set to zero. This also distributes the round-off of an incompatible
    right side evenly, in the same way on any number of ranks.

    Args:
        cells: Geometry of the n cells.
        residual: Residual of the averaged tractions at the nodes of cells [force],
            shape (n, N_k, d). lambda is written there.
        weight: w_F of each facet, shape (facets,).
        inner: Whether a facet is between two cells, shape (facets,).
        fixed: Which components Gamma_D prescribes on a facet, shape (facets, d).
        complete: Which nodes have all their cells on this rank, shape (nodes,).

    Returns:
        ``w_F [lambda]`` at facet nodes, shape (facets, m, d).
    """
    d = cells.d
    nodes = np.ascontiguousarray(cells.nodes)
    on_facet = np.ascontiguousarray(local_facet_nodes(d, cells.degree), dtype=np.int32)
    on_support = fixed & ~inner[:, None]
    sizes = (nodes.shape[1], on_facet.shape[1], len(nodes), len(complete), len(weight))
    mesh = (nodes, cells.facets, cells.side, on_facet)
    # The kernel lists the cells of each patch in these arrays, and writes lambda where
    # the residual was.
    start = np.empty(len(complete) + 1, dtype=np.int32)
    member, place = np.empty((2, *nodes.shape), dtype=np.int32)
    multiplier = residual
    work = (start, member, place, multiplier)
    kernels(d)("patch_jumps", *sizes, *mesh, weight, on_support, complete, *work)

    used = np.flatnonzero(cells.side[0] >= 0)
    a, b = _graph_edges(cells, used)
    flat = multiplier.reshape(-1, d)
    between = inner[used, None, None]
    difference = flat[a] - np.where(between, flat[b], 0.0)
    # Only edges inside a patch, or to Gamma_D, have a traction to correct.
    in_patch = (place.ravel()[a] >= 0)[:, :, None]
    difference *= (between | fixed[used, None]) & in_patch
    jump = np.zeros((len(weight), *a.shape[1:], d))
    jump[used] = weight[used, None, None] * difference
    return jump


def _graph_edges(cells: CellGeometry, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the edges of the graphs, as flat indices of (cell, node).

    Args:
        cells: Geometry.
        used: Facets of the cells of this rank.

    Returns:
        The two ends, shape (facets used, m) each.
    """
    nodes_of = local_facet_nodes(cells.d, cells.degree)
    ends = []
    for side in cells.side[:, used]:
        cell, i = np.divmod(side, cells.d + 1)
        ends.append(cell[:, None] * cells.nodes.shape[1] + nodes_of[i])
    return ends[0], ends[1]
