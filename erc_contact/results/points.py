"""Displacement and stresses at points of the user's.

Symbols: u^ and sigma^ admissible displacement and stress, d dimension, k degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, geometry
from mpi4py import MPI

from erc_contact.admissible.elastic import strains
from erc_contact.admissible.macro import tensors
from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.simplex import barycentric, bernstein, lagrange, nodes
from erc_contact.model.expressions import evaluate
from erc_contact.model.model import Model

BETWEEN = 1e-9
"""Difference of barycentric coordinates below which a point lies between two sub-simplices [-]."""


@dataclass(frozen=True, eq=False)
class Values:
    """Values at points.

    Attributes:
        displacement: u^ [length], shape (n, d).
        stress: sigma^ [force/area], shape (n, d, d).
        elastic_stress: C eps(u^) [force/area], shape (n, d, d): its distance from sigma^ is the local error.
    """

    displacement: np.ndarray
    stress: np.ndarray
    elastic_stress: np.ndarray


def at(pair: Admissible, points: Any) -> Values:
    """Displacement and stresses at points of the body; collective.

    Stresses jump between cells, and sigma^ between its sub-simplices: a point between several has the mean.

    Args:
        pair: An admissible pair.
        points: The same on all ranks [length], shape (n, d) or (d,).

    Raises:
        InputError: If the points have another shape or are not finite, or one lies outside the mesh.
    """
    model = pair.solution.model
    d, comm, mesh = model.d, model.comm, model.mesh
    x = np.atleast_2d(np.asarray(points, dtype=float))
    if x.ndim != 2 or x.shape[1] != d or not np.isfinite(x).all():
        raise InputError(f"The points have shape {np.shape(points)}; give finite numbers of shape (n, {d}).")
    three = np.pad(x, ((0, 0), (0, 3 - d)))
    tree = geometry.bb_tree(mesh, d, padding=1e-10 * model.domain.size)
    near = geometry.compute_colliding_cells(mesh, geometry.compute_collisions_points(tree, three), three)
    point, own = np.repeat(np.arange(len(x)), np.diff(near.offsets)), near.array < model.domain.owned_cells
    point, cell = point[own], near.array[own]
    local = np.zeros((len(x), 1 + d + 2 * d * d))
    np.add.at(local, point, np.column_stack([np.ones(len(point)), _values(pair, cell, x[point])]))
    count, total = np.split(comm.allreduce(local, MPI.SUM), [1], axis=1)
    outside = np.flatnonzero(count == 0)
    if len(outside):
        raise InputError(
            f"{len(outside)} of the {len(x)} points lie outside the mesh, the first is "
            f"{tuple(map(float, x[outside[0]]))}; give points of the body (facets cut off a little of a curved one)."
        )
    total /= count
    u, sigma, elastic = np.split(total, [d, d + d * d], axis=1)
    return Values(u, sigma.reshape(-1, d, d), elastic.reshape(-1, d, d))


def _values(pair: Admissible, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """u^, sigma^ and C eps(u^) at points (n, d) of owned cells (n,), row by row."""
    model, cells = pair.solution.model, pair.cells
    d, k = model.d, model.degree
    corner = model.V.tabulate_dof_coordinates()[cells.vertices[cell, 0], :d]
    local = barycentric(np.einsum("nij,nj->ni", cells.inverse[cell], x - corner))
    u = np.einsum(
        "nv,nvi->ni", lagrange(d, k, local[:, 1:]), pair.displacement.x.array.reshape(-1, d)[cells.nodes[cell]]
    )
    sigma = np.zeros((len(cell), pair.stress.shape[3]))
    lowest = local.min(axis=1)  # of the vertex that the barycentre replaces in the sub-simplex of the point
    among = local <= lowest[:, None] + BETWEEN
    for sub in range(d + 1):
        inside = local - local[:, [sub]]
        inside[:, sub] = (d + 1) * local[:, sub]
        values = np.einsum("nm,nms->ns", bernstein(d, k, inside[:, 1:]), pair.stress[cell, sub])
        sigma += (among[:, sub] / among.sum(axis=1))[:, None] * values
    strain = np.einsum("nb,nbs->ns", bernstein(d, k - 1, local[:, 1:]), strains(cells, pair.displacement)[cell])
    elastic = np.einsum("nab,nb->na", _stiffness_at(model, cell, x), strain)
    return np.hstack([u, tensors(sigma, d).reshape(len(x), d * d), tensors(elastic, d).reshape(len(x), d * d)])


def _stiffness_at(model: Model, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """C in Mandel components at points (n, d) of cells (n,), shape (n, s, s); collective."""
    matrix = model.stiffness_matrix
    if isinstance(matrix, np.ndarray):
        return np.broadcast_to(matrix, (len(x), *matrix.shape))
    point = fem.Function(fem.functionspace(model.mesh, ("DG", 0, (model.d,))))
    there = ufl.replace(matrix, {model.x: point})
    result = np.empty((len(x), *matrix.ufl_shape))
    order = np.argsort(cell, kind="stable")
    turn = np.empty(len(x), dtype=int)
    turn[order] = np.arange(len(x)) - np.searchsorted(cell[order], cell[order])  # each round one point of a cell
    for k in range(model.comm.allreduce(int(turn.max(initial=-1)), MPI.MAX) + 1):
        some = turn == k
        point.x.array.reshape(-1, model.d)[cell[some]] = x[some]
        result[some] = evaluate(there, model.mesh, nodes(model.d, 0), cell[some].astype(np.int32))[:, 0]
    return result
