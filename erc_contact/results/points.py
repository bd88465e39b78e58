"""Compute displacement and stresses of an admissible pair at points of a user.

Symbols: u^ and sigma^ admissible displacement and stress, d dimension, k degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.model.points import along_line, at_points, elastic_stress_at, tensors_of_points
from erc_contact.model.stress import stress_in_space
from namedmesh.simplex import barycentric, bernstein, lagrange

BORDER = 1e-9
"""Difference of barycentric coordinates at the border of two sub-simplices [-]."""


@dataclass(frozen=True, eq=False)
class Values:
    """Hold values at points.

    Attributes:
        displacement: u^ [length], shape (n, d).
        stress: sigma^ [force/area], shape (n, d, d); of an axisymmetric body (n, 3, 3)
            with the rows r, z and hoop.
        elastic_stress: C eps(u^) [force/area], likewise. Its difference from
            sigma^ is the local error.
    """

    displacement: np.ndarray
    stress: np.ndarray
    elastic_stress: np.ndarray

    @property
    def best_stress(self) -> np.ndarray:
        """Return the mean of both stresses [force/area], shape (n, d, d).

        In the energy norm its error is known best, see
        :attr:`ConstitutiveError.best_stress_error`.
        """
        return 0.5 * (self.stress + self.elastic_stress)


def at(result: Any, points: Any) -> Values:
    """Compute displacement and stresses at points of the body; collective.

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
    model = pair.model
    d = model.space.d
    rows = at_points(model.space, points, partial(_values, pair))
    s = pair.stress.shape[3]
    u, sigma, elastic = np.split(rows, [d, d + s], axis=1)
    return Values(u, tensors_of_points(model, sigma), tensors_of_points(model, elastic))


def along(result: Any, start: Any, stop: Any, count: int = 101) -> np.ndarray:
    """Tabulate u^ and sigma^ along a straight line, with von Mises stress; collective.

    Args:
        result: An admissible pair, an error, or a history.
        start: Where the line starts [length], shape (d,).
        stop: Where it ends [length], shape (d,).
        count: Number of its points, evenly distributed.

    Returns:
        The table of :func:`erc_contact.model.points.along_line`, of rings with the hoop
        stress ``s_hoop``. At a point between cells it has the mean of their values.

    Raises:
        InputError: If an end has another shape, or a point lies outside the mesh.

    Example:
        >>> line = ec.results.along(error, (1.0, 0.0), (1.0, 1.0), count=3)
        >>> line["y"].tolist(), line.dtype.names[-1]
        ([0.0, 0.5, 1.0], 'von_mises')
    """
    pair = pair_of(result)
    d, s = pair.model.space.d, pair.stress.shape[3]

    def values(cell: np.ndarray, x: np.ndarray) -> np.ndarray:
        u, mandel, _ = np.split(_values(pair, cell, x), [d, d + s], axis=1)
        stress = stress_in_space(pair.model, mandel, cell)
        return np.hstack([u, stress.reshape(-1, 9)])

    return along_line(pair.model.space, (start, stop), count, values)


def _values(pair: Admissible, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Compute u^, sigma^ and C eps(u^) at points of owned cells.

    Args:
        pair: The admissible pair.
        cell: Cell of each point, shape (n,).
        x: The points [length], shape (n, d).

    Returns:
        Rows of u^ [length] and the two stresses in Mandel components [force/area],
        shape (n, d + 2 s).
    """
    model = pair.model
    space = model.space
    cells = pair.cell_geometry
    d = space.d
    k = space.degree
    x = space.section.beside_axis(x, cells.volume[cell] ** (1 / d))
    corner = space.V.tabulate_dof_coordinates()[cells.vertices[cell, 0], :d]
    local = barycentric(np.einsum("nij,nj->ni", cells.inverse[cell], x - corner))
    nodal = pair.displacement.x.array.reshape(-1, d)[cells.nodes[cell]]
    u = np.einsum("nv,nvi->ni", lagrange(d, k, local[:, 1:]), nodal) + model.jumps_at(cell, x)
    sigma = np.zeros((len(cell), pair.stress.shape[3]))
    # The barycentre of the cell replaces a vertex in each sub-simplex. A point is in
    # the one without the vertex of its least coordinate; at a border in several.
    lowest = local.min(axis=1)
    inside = local <= lowest[:, None] + BORDER
    for sub in range(d + 1):
        sub_local = local - local[:, [sub]]
        sub_local[:, sub] = (d + 1) * local[:, sub]
        polynomials = bernstein(d, k, sub_local[:, 1:])
        values = np.einsum("nm,nms->ns", polynomials, pair.stress[cell, sub])
        sigma += (inside[:, sub] / inside.sum(axis=1))[:, None] * values
    sigma = model.hoop_load.plus(sigma[:, None], x[:, None], cell)[:, 0]
    sigma = space.section.over(sigma, x)
    elastic = elastic_stress_at(model, pair.displacement, cell, x)
    return np.hstack([u, sigma, elastic])
