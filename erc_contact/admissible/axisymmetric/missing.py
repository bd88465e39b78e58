"""Measure what is missing in the equilibrium of a stress of axisymmetric cells.

In each piece of a cell: the axial part of ``div S + c f``, and how far the hoop
component is from ``r div S . e_r``, which defines it. Between two pieces: the jumps of
``S n``. On each facet: S n less the traction of the facet. At nodes on the axis: S.
All are forces.

Symbols: n cells, N_k coefficients of a piece, m of a facet, b of degree k-1.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from erc_contact.admissible.axisymmetric.elements import Elements, on_pieces, times_linear
from erc_contact.admissible.reference import named_nodes, tensors
from erc_contact.mesh.quadrature import cell_pieces
from erc_contact.mesh.simplex import gradients, local_facet_nodes, node_vertices


def missing_forces(
    elements: Elements, stress: np.ndarray, forces: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the greatest missing force in each owned cell, and the greatest force.

    Args:
        elements: The cells with their body force.
        stress: Coefficients of the owned cells, shape (owned, 3, N_k, 4).
        forces: ``|F| t`` on their facets [force], shape (owned, 3, m, 2).

    Returns:
        Two arrays [force], shape (owned,).
    """
    owned = len(stress)
    cells = elements.cells
    k = cells.degree
    area = cells.area[:owned]
    in_plane = tensors(stress[..., :3], 2)
    found = [_in_pieces(elements, stress, in_plane), _at_axis(elements, in_plane)]
    for piece, on_facet in enumerate(local_facet_nodes(2, k)):
        push = np.matmul(in_plane[:, piece, on_facet], area[:, piece, None, :, None])[..., 0]
        found.append(push - forces[:, piece])
    for one, two in combinations(range(3), 2):
        theirs = named_nodes(2, k, two, one)
        names = named_nodes(2, k, one, two)
        across = (area[:, two] - area[:, one])[:, None, :, None]
        jump = in_plane[:, one, list(names.values())] - in_plane[:, two, [theirs[n] for n in names]]
        found.append(np.matmul(jump, across)[..., 0])
    amounts = [np.linalg.norm(part, axis=-1).reshape(owned, -1).max(axis=1) for part in found]
    largest = np.linalg.norm(stress, axis=-1).max(axis=(1, 2))
    longest = np.linalg.norm(area, axis=-1).max(axis=1)
    return np.max(amounts, axis=0), largest * longest


def _in_pieces(elements: Elements, stress: np.ndarray, in_plane: np.ndarray) -> np.ndarray:
    """Return what is missing in pieces, axial and hoop, shape (owned, forces, 1)."""
    cells = elements.cells
    k = cells.degree
    owned = len(stress)
    # Far from the axis, coordinates have fewer digits than their differences.
    about = elements.corners[:owned] - elements.corners[:owned, :1]
    corners = np.einsum("piv,nvj->npij", cell_pieces(2), about)
    radius = corners[..., 0] + elements.corners[:owned, :1, :1]
    edges = corners[:, :, 1:] - corners[:, :, :1]
    slopes = np.linalg.inv(edges).swapaxes(-1, -2)
    slopes = np.concatenate([-slopes.sum(axis=2, keepdims=True), slopes], axis=2)
    volume = cells.volume[:owned]
    divergence = np.einsum("cav,npvij,npaj->npci", gradients(2, k), in_plane, slopes, optimize=True)
    axial = divergence[..., 1] * volume[:, None, None]
    axial += np.einsum("pcb,nb->npc", on_pieces(k), elements.force[:owned])
    defined = np.einsum(
        "kac,npa,npc->npk", times_linear(k), radius, divergence[..., 0], optimize=True
    )
    size = np.linalg.norm(cells.area[:owned], axis=-1).max(axis=1)
    # As a radial force: far from the axis the hoop stress is a large multiple of it.
    share = size * np.minimum(1.0, size / elements.corners[:owned, :, 0].mean(axis=1))
    hoop = (stress[..., 3] - defined) * share[:, None, None]
    both = np.concatenate([axial.reshape(owned, -1), hoop.reshape(owned, -1)], axis=1)
    return both[..., None]


def _at_axis(elements: Elements, in_plane: np.ndarray) -> np.ndarray:
    """Return the stress on the axis times the size of the cell, (owned, ..., 2)."""
    owned = len(in_plane)
    ends = node_vertices(2, elements.cells.degree)
    size = np.linalg.norm(elements.cells.area[:owned], axis=-1).max(axis=1)
    on_axis = np.zeros((owned, 3, len(ends)), dtype=bool)
    for piece in range(3):
        at_vertices = elements.on_axis[:owned].copy()
        # The barycentre is in the place of a vertex.
        at_vertices[:, piece] = False
        on_axis[:, piece] = at_vertices[:, ends].all(axis=2)
    forces = np.where(on_axis[..., None, None], in_plane, 0.0) * size[:, None, None, None, None]
    return forces.reshape(owned, -1, 2)
