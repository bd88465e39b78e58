"""Displacement and stresses of an admissible pair at points that a user gives.

Symbols: u^ and sigma^ admissible displacement and stress, d dimension, k degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.admissible.reference import tensors
from erc_contact.mesh.simplex import barycentric, bernstein, lagrange
from erc_contact.model.points import at_points, elastic_stress_at

BETWEEN = 1e-9
"""Difference of barycentric coordinates below which a point lies between two sub-simplices [-]."""


@dataclass(frozen=True, eq=False)
class Values:
    """Values at points.

    Attributes:
        displacement: u^ [length], shape (n, d).
        stress: sigma^ [force/area], shape (n, d, d).
        elastic_stress: C eps(u^) [force/area], shape (n, d, d). Its difference from
            sigma^ is the local error.
    """

    displacement: np.ndarray
    stress: np.ndarray
    elastic_stress: np.ndarray


def at(result: Any, points: Any) -> Values:
    """Displacement and stresses at points of the body; collective.

    Stresses jump between cells, and sigma^ jumps between its sub-simplices. At a point
    between several of them the result is their mean.

    Args:
        result: An admissible pair, an error, or a history.
        points: Points, the same on all ranks [length], shape (n, d) or (d,).

    Raises:
        InputError: If the points have another shape or are not finite, or one lies
            outside the mesh.
    """
    pair = pair_of(result)
    model, d = pair.model, pair.model.d
    total = at_points(model, points, lambda cell, x: _values(pair, cell, x))
    u, sigma, elastic = np.split(total, [d, d + d * d], axis=1)
    return Values(u, sigma.reshape(-1, d, d), elastic.reshape(-1, d, d))


def _values(pair: Admissible, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """u^, sigma^ and C eps(u^) at points (n, d) of owned cells (n,), each row by row, shape (n, d + 2 d^2)."""
    model, cells = pair.model, pair.cell_geometry
    d, k = model.d, model.degree
    corner = model.V.tabulate_dof_coordinates()[cells.vertices[cell, 0], :d]
    local = barycentric(np.einsum("nij,nj->ni", cells.inverse[cell], x - corner))
    u = np.einsum(
        "nv,nvi->ni",
        lagrange(d, k, local[:, 1:]),
        pair.displacement.x.array.reshape(-1, d)[cells.nodes[cell]],
    )
    sigma = np.zeros((len(cell), pair.stress.shape[3]))
    lowest = local.min(
        axis=1
    )  # of the vertex that the barycentre replaces in the sub-simplex of the point
    among = local <= lowest[:, None] + BETWEEN
    for sub in range(d + 1):
        inside = local - local[:, [sub]]
        inside[:, sub] = (d + 1) * local[:, sub]
        values = np.einsum("nm,nms->ns", bernstein(d, k, inside[:, 1:]), pair.stress[cell, sub])
        sigma += (among[:, sub] / among.sum(axis=1))[:, None] * values
    elastic = elastic_stress_at(model, pair.displacement, cell, x)
    return np.hstack([u, tensors(sigma, d).reshape(len(x), d * d), elastic.reshape(len(x), d * d)])
