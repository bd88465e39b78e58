"""Values at points that a user gives: the cells that hold them, and the elastic stress there.

Symbols: d dimension, k degree of the displacement, s = d(d+1)/2 Mandel components.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import fem, geometry
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.runtime import compiled
from erc_contact.mesh.simplex import in_space
from erc_contact.model.model import Model
from erc_contact.scene.material import mandel_basis, strain


def at_points(
    model: Model, points: Any, values: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> np.ndarray:
    """Values at points of the body, the same on all ranks; collective.

    At a point between several cells it is the mean of their values.

    Args:
        model: The scene on a mesh.
        points: Points, the same on all ranks [length], shape (n, d) or (d,).
        values: Gets owned cells (m,) and a point in each (m, d); returns values, shape
            (m, c). It is called once on every rank.

    Returns:
        Values, shape (n, c).

    Raises:
        InputError: If the points have another shape or are not finite, or one lies
            outside the mesh.
    """
    d, comm, mesh = model.d, model.comm, model.mesh
    x = np.atleast_2d(np.asarray(points, dtype=float))
    if x.ndim != 2 or x.shape[1] != d or not np.isfinite(x).all():
        raise InputError(
            f"The points have shape {np.shape(points)}; give finite numbers of shape (n, {d})."
        )
    three = in_space(x)
    tree = geometry.bb_tree(mesh, d, padding=1e-10 * model.domain.extent)
    near = geometry.compute_colliding_cells(
        mesh, geometry.compute_collisions_points(tree, three), three
    )
    point, own = (
        np.repeat(np.arange(len(x)), np.diff(near.offsets)),
        near.array < model.domain.owned_cells,
    )
    point, cell = point[own], near.array[own]
    found = np.column_stack([np.ones(len(point)), values(cell, x[point])])
    local = np.zeros((len(x), found.shape[1]))
    np.add.at(local, point, found)
    count, total = np.split(comm.allreduce(local, MPI.SUM), [1], axis=1)
    outside = np.flatnonzero(count == 0)
    if len(outside):
        raise InputError(
            f"{len(outside)} of the {len(x)} points lie outside the mesh, the first is "
            f"{tuple(map(float, x[outside[0]]))}; give points of the body (facets cut off a little of a curved one)."
        )
    return total / count


def elastic_stress_at(model: Model, u: fem.Function, cell: np.ndarray, x: np.ndarray) -> np.ndarray:
    """``C eps(u)`` [force/area] at points (n, d) of owned cells (n,), shape (n, d, d); collective."""
    d = model.d
    W = fem.functionspace(model.mesh, ("DG", model.degree - 1, (d, d)))
    eps = fem.Function(W)
    eps.interpolate(compiled.expression(strain(u), W.element.interpolation_points, model.comm))
    local = (
        eps.eval(in_space(x), cell.astype(np.int32)).reshape(len(x), d, d)
        if len(x)
        else np.zeros((0, d, d))
    )
    basis = mandel_basis(d)
    stress = np.einsum(
        "nab,nb->na",
        model.elasticity(x[:, None], cell)[:, 0],
        np.einsum("bij,nij->nb", basis, local),
    )
    return np.einsum("na,aij->nij", stress, basis)
