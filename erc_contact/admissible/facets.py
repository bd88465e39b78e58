"""Facet tractions in equilibrium with the loads on every cell.

Given a cell-wise constant stress sigma_h in equilibrium with the data against all continuous P1 fields, find
tractions on facets that are opposite on the two sides, equal F on Gamma_N and r^ on Gamma_C, and balance forces
and moments on every cell. Unknown: discontinuous P1 multipliers lambda; with <.,.> lumped at the nodes of a facet,

    sum_F w_F <[lambda], [mu]> = residual of the averaged tractions against mu,

the traction is the average plus ``w_F [lambda]`` (as moments). Lumping decouples the vertices: one small weighted
graph Laplacian for each vertex patch and component, solved directly, batched by patch size. Every patch is complete
on its rank, so nothing is communicated.

Source: Ladeveze, Leguillon, SIAM J. Numer. Anal. 20 (1983), the equilibration of densities; the form is ours.
"""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.geometry import Simplices, signed
from erc_contact.model import facet_vertices


def equilibrated_moments(
    cells: Simplices,
    stress: np.ndarray,
    force: np.ndarray | None,
    given: np.ndarray,
    fixed: np.ndarray,
    complete: np.ndarray,
) -> np.ndarray:
    """Moments of the equilibrated facet tractions.

    Args:
        cells: Geometry, n cells.
        stress: sigma_h [force/area], shape (n, d, d).
        force: Total body force of each cell [force], shape (n, d), or None.
        given: Moments of the tractions known on the boundary [force], shape (facets, d, d).
        fixed: Components of boundary facets whose traction is unknown (Gamma_D), shape (facets, d).
        complete: Nodes whose patch is complete on this rank, shape (nodes,).

    Returns:
        Moments ``int_F t phi_m`` [force] of the traction on the first side of each facet, nodes ascending,
        shape (facets, d, d).
    """
    d = cells.d
    push = np.einsum("nij,nkj->nki", stress, cells.area)  # force of sigma_h on each facet
    flat = push.reshape(-1, d)
    inner = cells.has_second
    first, second = cells.side
    average = np.where(inner[:, None], 0.5 * (flat[first] - flat[second]), np.where(fixed, flat[first], 0.0))
    moment = given + average[:, None, :] / d

    residual = _residual(cells, moment, push, force)
    area = np.linalg.norm(cells.area, axis=2).ravel()[first]
    weight = np.where(first >= 0, area ** ((d - 2) / (d - 1)), 0.0)  # |F|/h_F with h_F = |F|^(1/(d-1))
    jump = _patch_jumps(cells, residual, weight, inner, fixed, complete)
    return moment - jump


def _residual(cells: Simplices, moment: np.ndarray, push: np.ndarray, force: np.ndarray | None) -> np.ndarray:
    """``int_dT t phi_v + (f, phi_v) - (sigma_h, grad phi_v)`` [force] for each vertex v, shape (n, d+1, d)."""
    d = cells.d
    residual = push / d  # -|T| grad phi_v = area_v / d
    if force is not None:
        residual = residual + force[:, None, :] / (d + 1)
    seen = signed(cells, moment)
    for i, vertices in enumerate(facet_vertices(d)):
        residual[:, vertices] += seen[:, i]
    return residual


def _patch_jumps(
    cells: Simplices,
    residual: np.ndarray,
    weight: np.ndarray,
    inner: np.ndarray,
    fixed: np.ndarray,
    complete: np.ndarray,
) -> np.ndarray:
    """Solve the graph Laplacians of all vertex patches; return ``w_F [lambda]`` at facet nodes, (facets, d, d).

    A patch that no Gamma_D grounds determines lambda up to a constant: the mean is set to zero, which also
    spreads the round-off of an incompatible right side evenly, on any number of ranks the same way.
    """
    d = cells.d
    vertex = cells.nodes.ravel()
    order = np.argsort(vertex, kind="stable")
    order = order[complete[vertex[order]]]
    sizes = np.bincount(vertex[order], minlength=len(complete))
    starts = np.cumsum(sizes) - sizes
    place = np.full(cells.nodes.size, -1)
    place[order] = np.arange(len(order)) - starts[vertex[order]]  # position of (cell, vertex) in its patch

    # one edge of a graph for each facet and node; (cell, vertex) of either side as flat index
    used = np.flatnonzero(cells.side[0] >= 0)
    nodes_of = facet_vertices(d)
    ends = []
    for side in cells.side[:, used]:
        cell, i = np.divmod(side, d + 1)
        ends.append(cell[:, None] * (d + 1) + nodes_of[i])
    a, b = ends
    keep = place[a] >= 0
    between = inner[used]

    solution = np.zeros((cells.nodes.size, d))
    grounded = np.zeros((cells.nodes.size, d))
    for c in range(d):
        held = keep & (fixed[used, c] & ~between)[:, None]
        np.add.at(grounded[:, c], a[held], np.broadcast_to(weight[used, None], a.shape)[held])
    is_grounded = np.stack([np.bincount(vertex, grounded[:, c], len(complete)) > 0 for c in range(d)], axis=1)

    joined = keep & between[:, None]
    ea, eb = a[joined], b[joined]
    ew = np.broadcast_to(weight[used, None], a.shape)[joined]
    for c in range(d):
        # the first component solves for all; another one only where its grounding differs
        todo = sizes > 0 if c == 0 else (sizes > 0) & _differs(vertex, grounded, c, len(complete))
        columns = np.arange(d) if c == 0 else np.array([c])
        edge_todo = todo[vertex[ea]]
        for size in np.unique(sizes[todo]):
            patches = np.flatnonzero(todo & (sizes == size))
            number = np.full(len(complete), -1)
            number[patches] = np.arange(len(patches))
            pick = edge_todo & (sizes[vertex[ea]] == size)
            row, i, j, w = number[vertex[ea[pick]]], place[ea[pick]], place[eb[pick]], ew[pick]
            matrix = np.zeros(len(patches) * size * size)
            at = row * size * size
            for p, q, s in ((i, i, w), (j, j, w), (i, j, -w), (j, i, -w)):
                matrix += np.bincount(at + p * size + q, s, len(matrix))
            members = order[starts[patches][:, None] + np.arange(size)]
            matrix = matrix.reshape(-1, size, size)
            diagonal = np.einsum("nii->ni", matrix)
            mean = np.where(size > 1, diagonal.mean(axis=1) / size, 1.0)  # a corner of a single cell has no edge
            diagonal += grounded[members, c]
            matrix += np.where(is_grounded[patches, c], 0.0, mean)[:, None, None]
            rhs = residual.reshape(-1, d)[members][:, :, columns]
            solution[members[:, :, None], columns] = np.linalg.solve(matrix, rhs)

    jump = np.zeros((len(weight), d, d))
    difference = solution[a] - np.where(between[:, None, None], solution[b], 0.0)
    difference *= between[:, None, None] | fixed[used][:, None, :]
    jump[used] = weight[used, None, None] * difference * keep[:, :, None]
    return jump


def _differs(vertex: np.ndarray, grounded: np.ndarray, c: int, count: int) -> np.ndarray:
    """Patches whose grounding of component c is not that of component 0."""
    return np.bincount(vertex, abs(grounded[:, c] - grounded[:, 0]), count) > 0
