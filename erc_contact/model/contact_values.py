"""Evaluate the friction parameters and the gap of a contact on its facets."""

from __future__ import annotations

import numpy as np

from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.space import Space


def friction_parameters(
    space: Space, contact: ContactOnMesh, points: np.ndarray
) -> dict[str, np.ndarray]:
    """Evaluate the parameters of a contact's friction law, each of shape (f, q).

    Args:
        space: The mesh.
        contact: The contact.
        points: Reference points of its facets, shape (q, d-1).
    """
    if contact.friction is None:
        return {}
    values = {}
    for name, value in contact.friction.parameters.items():
        values[name] = evaluate(value, space.mesh, points, contact.facets)
    return values


def gap_at_nodes(space: Space, contact: ContactOnMesh) -> np.ndarray:
    """Evaluate the gap at the nodes of a contact [length], shape (f, m)."""
    if contact.gap is None:
        return np.zeros((len(contact.facets), len(space.facet_points)))
    return evaluate(contact.gap, space.mesh, space.facet_points, contact.facets)
