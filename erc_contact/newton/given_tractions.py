"""Take contact tractions that another solver has computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from dolfinx import fem

from erc_contact.base import checks
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.nearest import SAME_PLACE, nearest
from erc_contact.model.foundation import BoundContact
from erc_contact.model.model import Model

type AnyTraction = fem.Function | Callable[[np.ndarray], Any] | tuple[Any, Any]
"""A Function, a callable of points, or points with values."""


def given_multipliers(model: Model, traction: Mapping[str, AnyTraction]) -> dict[str, fem.Function]:
    """Return given tractions as Functions [force/area], by the names of contacts.

    Args:
        model: The scene on a mesh.
        traction: Tractions on the parts that contacts are named after.

    Raises:
        InputError: If a name is that of no contact, or values do not fit the nodes.
    """
    if not isinstance(traction, Mapping):
        raise InputError(
            f"certify: traction is {checks.description(traction)}; give a mapping from the names of"
            " contacts, e.g. {'bottom': (points, values)}."
        )
    multipliers = {}
    names = {contact.name for contact in model.contacts}
    for name, values in traction.items():
        if name not in names:
            known = ", ".join(sorted(names)) or "none"
            raise InputError(f"certify: traction is for {name!r}; the contacts are {known}.")
        contact = model.contact(name)
        multiplier = model.function()
        nodal = multiplier.x.array.reshape(-1, model.d)
        nodes = np.unique(contact.trace.here.nodes)
        nodal[nodes] = contact.sign * _at_nodes(model, contact, nodes, values)
        if not np.isfinite(nodal).all():
            raise InputError(f"certify: the traction on {name!r} is not finite everywhere.")
        multipliers[name] = multiplier
    return multipliers


def _at_nodes(
    model: Model, contact: BoundContact, nodes: np.ndarray, traction: AnyTraction
) -> np.ndarray:
    """Return a traction at nodes of this side of a contact, (nodes, d)."""
    d = model.d
    what = f"certify: the traction on {contact.name!r}"
    x = model.V.tabulate_dof_coordinates()[nodes, :d]
    if isinstance(traction, fem.Function):
        if traction.function_space.mesh is not model.mesh or contact.is_exchanged:
            raise InputError(
                f"{what} is a Function; it must live on domain.mesh, and be that of the softer"
                " body. Give a callable of points, or (points, values)."
            )
        same = model.function()
        same.interpolate(traction)
        return same.x.array.reshape(-1, d)[nodes]
    if callable(traction):
        values = np.asarray(traction(x.T.copy()), dtype=float).T
        if values.shape != x.shape:
            raise InputError(
                f"{what} has the shape {values.T.shape} for points of shape {x.T.shape}; return"
                f" {d} rows, a component each."
            )
        return values
    if not isinstance(traction, tuple) or len(traction) != 2:
        raise InputError(
            f"{what} is {checks.description(traction)}; give a callable of points, or"
            " (points, values)."
        )
    points = np.asarray(traction[0], dtype=float)
    values = np.asarray(traction[1], dtype=float)
    is_table = points.ndim == values.ndim == 2 and len(points) == len(values)
    if not is_table or min(points.shape[1], values.shape[1]) < d:
        raise InputError(
            f"{what}: points and values have the shapes {points.shape} and {values.shape}; give"
            f" (n, {d}) of both."
        )
    if len(nodes) == 0:
        return np.empty((0, d))
    place = nearest(x, points[:, :d])
    apart = np.linalg.norm(points[place, :d] - x, axis=1) > SAME_PLACE * model.domain.extent
    if apart.any():
        first = tuple(x[apart][0].tolist())
        raise InputError(
            f"{what}: {int(apart.sum())} of {len(nodes)} nodes have no point, the first is {first};"
            " give the values at all nodes of the part."
        )
    return values[place, :d]
