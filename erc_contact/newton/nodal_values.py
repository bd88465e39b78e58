"""Take values at nodes from a Function, a callable of points, or points with values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import fem

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.files.displacements import FileField
from erc_contact.model.model import Model

type AnyField = fem.Function | Callable[[np.ndarray], Any] | tuple[Any, Any] | FileField
"""A Function, a callable of points, points with values, or what a file has."""
SAME_PLACE = 1e-5
"""Distance of a point to a node that is none, over the extent of the body [-].

Result files often have six digits.
"""
OFFSET = 0.2718
"""Place of the lattice of boxes, in boxes [-]."""
ASIDE = 10.0
"""Way by which points go into their bodies, by the distance that is none [-]."""


def nodal_values(model: Model, field: AnyField, nodes: np.ndarray, what: str) -> np.ndarray:
    """Return a vector field at nodes of this rank, shape (n, d).

    Args:
        model: The scene on a mesh.
        field: A Function of the mesh; or a callable, which gets points of shape (d, n)
            and returns the same shape; or points (m, d) and values (m, d).
        nodes: Numbers of the nodes, shape (n,).
        what: The field in words, for messages.

    Raises:
        InputError: If the field does not fit the mesh or its dimension.
    """
    if isinstance(field, fem.Function):
        return _of_function(model, field, what)[nodes]
    x = model.V.tabulate_dof_coordinates()[nodes, : model.d]
    if isinstance(field, FileField):
        return _of_file(model, field, nodes, what)
    if callable(field):
        return _of_callable(field, x, what)
    if not isinstance(field, tuple) or len(field) != 2:
        raise InputError(
            f"{what} is {checks.description(field)}; give a Function of the mesh, a callable of"
            " points, or (points, values)."
        )
    points, values = (np.asarray(array, dtype=float) for array in field)
    return _of_points(points, values, x, SAME_PLACE * model.domain.extent, what)


def _of_function(model: Model, field: fem.Function, what: str) -> np.ndarray:
    """Return the values of a Function at all nodes of this rank, shape (nodes, d)."""
    if field.function_space.mesh is not model.mesh:
        raise InputError(
            f"{what} lives on another mesh than domain.mesh; compute it on domain.mesh, or give"
            " (points, values)."
        )
    if field.function_space.element.value_shape != (model.d,):
        raise InputError(f"{what} must have {model.d} components.")
    same = model.function()
    same.interpolate(field)
    return same.x.array.reshape(-1, model.d)


def _of_callable(field: Callable[[np.ndarray], Any], x: np.ndarray, what: str) -> np.ndarray:
    """Return the values of a callable at points x of shape (n, d), shape (n, d)."""
    n, d = x.shape
    try:
        values = np.asarray(field(x.T.copy()), dtype=float).T
    except Exception as reason:
        raise InputError(
            f"{what} failed with {type(reason).__name__}: {reason}. It gets points of shape"
            f" ({d}, n), arrays of NumPy, and returns the same shape."
        ) from reason
    if values.shape != (n, d):
        raise InputError(
            f"{what} has the shape {values.T.shape} for points of shape {(d, n)}; return {d}"
            " rows, a component each."
        )
    return values


def _of_file(model: Model, field: FileField, nodes: np.ndarray, what: str) -> np.ndarray:
    """Return the values of a file at nodes, by their bodies where bodies touch."""
    d = model.d
    x = model.V.tabulate_dof_coordinates()[:, :d]
    points = field.points[:, :d]
    place = _nearest(x[nodes], points)
    tolerance = SAME_PLACE * model.domain.extent
    # Nodes of bodies that touch are in the same box of a lattice that no mesh has.
    boxes = np.floor(x / tolerance + OFFSET)
    _, same, count = np.unique(boxes, axis=0, return_inverse=True, return_counts=True)
    twins = np.flatnonzero(count[same.ravel()][nodes] > 1)
    if len(twins):
        into = _move_inward(x[nodes], _inward(model, x)[nodes], ASIDE * tolerance)
        of_bodies = _move_inward(points, field.inward[:, :d], ASIDE * tolerance)
        place[twins] = _nearest(into[twins], of_bodies)
    return _values_at(points, field.values, place, x[nodes], tolerance, what)


def _inward(model: Model, x: np.ndarray) -> np.ndarray:
    """Return the mean middle of the cells at each node, less the node [length]."""
    dofs = model.V.dofmap.list
    middles = x[dofs[:, : model.d + 1]].mean(axis=1)
    sums = np.zeros(x.shape)
    np.add.at(sums, dofs.ravel(), np.repeat(middles, dofs.shape[1], axis=0))
    return sums / np.bincount(dofs.ravel(), minlength=len(x))[:, None] - x


def _move_inward(x: np.ndarray, inward: np.ndarray, length: float) -> np.ndarray:
    """Move points by a length along vectors [length], shape (n, d)."""
    size = np.linalg.norm(inward, axis=1)
    return x + length * inward / np.where(size == 0, 1.0, size)[:, None]


def _of_points(
    points: np.ndarray, values: np.ndarray, x: np.ndarray, tolerance: float, what: str
) -> np.ndarray:
    """Return the values of the points at which x of shape (n, d) lie, shape (n, d)."""
    n, d = x.shape
    is_table = points.ndim == values.ndim == 2 and 0 < len(points) == len(values)
    if not is_table or min(points.shape[1], values.shape[1]) < d:
        raise InputError(
            f"{what}: points and values have the shapes {points.shape} and {values.shape}; give"
            f" (n, {d}) of both."
        )
    if not np.isfinite(points).all():
        raise InputError(f"{what}: points have coordinates that are not finite; leave them out.")
    if n == 0:
        return np.empty((0, d))
    return _values_at(points, values, _nearest(x, points[:, :d]), x, tolerance, what)


def _nearest(nodes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the number of the nearest point of each node."""
    from scipy.spatial import cKDTree  # type: ignore[import-untyped]  # noqa: PLC0415 - for points only

    return np.asarray(cKDTree(points).query(nodes)[1])


def _values_at(
    points: np.ndarray,
    values: np.ndarray,
    place: np.ndarray,
    x: np.ndarray,
    tolerance: float,
    what: str,
) -> np.ndarray:
    """Return the values of the points that were found for nodes x, shape (n, d).

    Raises:
        InputError: If a point is farther from its node than the tolerance [length].
    """
    n, d = x.shape
    distance = np.linalg.norm(points[place, :d] - x, axis=1)
    apart = distance > tolerance
    if apart.any():
        first = tuple(x[apart][0].tolist())
        raise InputError(
            f"{what}: {int(apart.sum())} of {n} nodes have no point, the first is {first},"
            f" {distance[apart][0]:.1e} from the nearest; give the values at all nodes, for degree"
            " 2 also at the middles of edges."
        )
    return values[place, :d]
