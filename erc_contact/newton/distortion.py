"""Measure how far a displacement strains, turns and inverts a body.

The theory holds for small strains and rotations. They follow from the mean gradient of
u in each cell. A cell is inverted where ``det(I + G) <= 0``: for degree 1 G is constant
in a cell, for degree 2 linear, and looked at in the vertices. All cells are looked at,
in arrays: 2 to 5% of the seconds of a solve.

Symbols: G gradient of u, ``G_kl = d u_l / d x_k`` [-], e_j the edges of a cell from a
vertex [length], f_j the derivatives of u along them [length].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.model.model import Model
from erc_contact.model.preload import shifts_of
from namedmesh.simplex import measures, node_between

ROTATION = 0.1
"""Rotation up to which the theory is good [rad]; half its square, 0.5%, is lost."""
STRAIN = 0.05
"""Strain up to which the theory is good [-]; it loses about as much of a stress."""
FLAT = 1e-6
"""Volume over the volume before below which a cell counts as inverted [-]."""


@dataclass(frozen=True, eq=False)
class Distortion:
    """Hold how far bodies are strained and turned, each body in an entry.

    Attributes:
        rotated: Share of the volume that rotates by more than ROTATION [-].
        rotation: Greatest rotation [rad].
        strained: Share of the volume that strains by more than STRAIN [-].
        strain: Greatest principal strain, without sign [-]; 0 if none is above STRAIN.
        inverted: Share of the volume that is turned inside out, or flat [-].
    """

    rotated: np.ndarray
    rotation: np.ndarray
    strained: np.ndarray
    strain: np.ndarray
    inverted: np.ndarray


@dataclass(frozen=True, eq=False)
class Gradients:
    """Hold gradients of u in the n owned cells.

    Attributes:
        corners: Vertices of the cells [length], shape (n, d+1, d).
        bodies: Body of each cell, shape (n,).
        elastic: Mean of G without the jumps of preloads, whose strain is given [-],
            shape (n, d, d).
        whole: Mean of G [-], likewise.
        hoop: Hoop strain of rings [-], shape (n,).
        left: Least volume over the volume before [-], shape (n,).
    """

    corners: np.ndarray
    bodies: np.ndarray
    elastic: np.ndarray
    whole: np.ndarray
    hoop: np.ndarray
    left: np.ndarray


def gradients_of(model: Model, u: fem.Function) -> Gradients:
    """Compute the gradients of a displacement in the cells."""
    space = model.space
    d = space.d
    body, _ = model.bodies
    cells = slice(0, model.domain.owned_cells)
    corners = space.cell_corners()[cells]
    nodes = space.nodes[cells]
    nodal = u.x.array.reshape(-1, d)
    hoop = space.section.hoop_strains(nodal, nodes[:, : d + 1], corners)
    jumps = _gradients_of_jumps(model)
    # The gradient of degree 2 is linear in a cell: its vertices have the extremes.
    samples = 1 if space.degree == 1 else d + 1
    elastic = np.zeros((len(nodes), d, d))
    left = np.full(len(nodes), np.inf)
    for vertex in range(samples):
        edges, along = _along_edges(corners, nodal, nodes, vertex, space.degree)
        volume, cofactors = _cofactors(edges)
        here = np.einsum("njk,njl->nkl", cofactors, along)
        elastic += here / (samples * volume[:, None, None])
        if jumps is not None:
            along = along + np.matmul(edges, jumps)
        volume_after, _ = _cofactors(edges + along)
        left = np.minimum(left, volume_after / volume * (1.0 + hoop))
    whole = elastic if jumps is None else elastic + jumps
    return Gradients(corners, body[nodes[:, 0]], elastic, whole, hoop, left)


def measure(model: Model, u: fem.Function) -> Distortion:
    """Measure how far a displacement distorts the bodies; collective."""
    _, count = model.bodies
    found = gradients_of(model, u)
    skew = 0.5 * (found.whole - found.whole.transpose(0, 2, 1))
    rotation = np.sqrt(0.5 * np.einsum("nij,nij->n", skew, skew))
    strain = _above(found.whole - skew, found.hoop)
    volume = measures(found.corners)
    everywhere = np.ones(len(volume))
    marks = (everywhere, rotation > ROTATION, strain > STRAIN, found.left <= FLAT)
    sums = np.zeros((4, count))
    for number, mark in enumerate(marks):
        sums[number] = np.bincount(found.bodies, volume * mark, minlength=count)
    greatest = np.zeros((2, count))
    np.maximum.at(greatest[0], found.bodies, rotation)
    np.maximum.at(greatest[1], found.bodies, strain)
    sums = model.space.comm.allreduce(sums, MPI.SUM)
    greatest = np.max(model.space.comm.allgather(greatest), axis=0)
    rotated, strained, inverted = sums[1:] / sums[0]
    return Distortion(rotated, greatest[0], strained, greatest[1], inverted)


def _along_edges(
    corners: np.ndarray, nodal: np.ndarray, nodes: np.ndarray, vertex: int, degree: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges of cells from a vertex, and the derivatives of u along them.

    Args:
        corners: Vertices of the cells [length], shape (n, d+1, d).
        nodal: u at the nodes [length], shape (nodes, d).
        nodes: Nodes of the cells, shape (n, N).
        vertex: Number of the vertex in the cells.
        degree: Degree of u.

    Returns:
        Shape (n, d, d) each.
    """
    d = nodal.shape[1]
    ends = np.delete(np.arange(d + 1), vertex)
    edges = corners[:, ends] - corners[:, [vertex]]
    here = nodal[nodes[:, [vertex]]]
    there = nodal[nodes[:, ends]]
    if degree == 1:
        return edges, there - here
    middle = nodal[nodes[:, node_between(d, 2)[vertex, ends]]]
    return edges, 4 * middle - 3 * here - there


def _cofactors(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return determinants (n,) and vectors c_i with ``e_j . c_i = det delta_ij``."""
    if edges.shape[1] == 2:
        first, second = edges[:, 0], edges[:, 1]
        of_first = np.stack([second[:, 1], -second[:, 0]], axis=1)
        of_second = np.stack([-first[:, 1], first[:, 0]], axis=1)
        cofactors = np.stack([of_first, of_second], axis=1)
    else:
        cofactors = np.cross(edges[:, [1, 2, 0]], edges[:, [2, 0, 1]])
    return np.einsum("nk,nk->n", edges[:, 0], cofactors[:, 0]), cofactors


def _above(strain: np.ndarray, hoop: np.ndarray) -> np.ndarray:
    """Return the greatest principal strain of cells where it is above STRAIN, else 0.

    Args:
        strain: Strains in the mesh [-], shape (n, d, d).
        hoop: Hoop strains of rings [-], shape (n,).
    """
    result = np.where(abs(hoop) > STRAIN, abs(hoop), 0.0)
    # No principal strain is above the norm.
    norm = np.einsum("nij,nij->n", strain, strain)
    large = np.flatnonzero(norm > STRAIN**2)
    principal = abs(np.linalg.eigvalsh(strain[large])).max(axis=1, initial=0.0)
    result[large] = np.maximum(result[large], np.where(principal > STRAIN, principal, 0.0))
    return result


def _gradients_of_jumps(model: Model) -> np.ndarray | None:
    """Return the gradients of the jumps of preloads, (cells, d, d), or None."""
    if not model.preloads:
        return None
    shifts = shifts_of(model.scene.ties)
    cells = slice(0, model.domain.owned_cells)
    total = np.zeros((model.domain.owned_cells, model.space.d, model.space.d))
    for preload in model.preloads:
        gradient = preload.gradient.x.array.reshape(-1, model.space.d)[cells]
        total += shifts[preload.name] * gradient[:, :, None] * preload.axis
    return total
