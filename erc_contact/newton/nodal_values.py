"""Take values at nodes from a Function, a callable of points, or points with values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import fem

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.nearest import SAME_PLACE, nearest
from erc_contact.model.model import Model

type AnyField = fem.Function | Callable[[np.ndarray], Any] | tuple[Any, Any]
"""A Function, a callable of points, or points with values."""


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


def _of_points(
    points: np.ndarray, values: np.ndarray, x: np.ndarray, tolerance: float, what: str
) -> np.ndarray:
    """Return the values of the points at which x of shape (n, d) lie, shape (n, d)."""
    n, d = x.shape
    is_table = points.ndim == values.ndim == 2 and len(points) == len(values)
    if not is_table or min(points.shape[1], values.shape[1]) < d:
        raise InputError(
            f"{what}: points and values have the shapes {points.shape} and {values.shape}; give"
            f" (n, {d}) of both."
        )
    if n == 0:
        return np.empty((0, d))
    place = nearest(x, points[:, :d])
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
