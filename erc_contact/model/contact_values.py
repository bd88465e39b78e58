"""Evaluate friction parameters, gap and springs of a contact on its facets."""

from __future__ import annotations

import numpy as np

from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.space import Space
from erc_contact.model.trace import split


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


def spring_displacement(
    space: Space, contact: ContactOnMesh, r: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Compute by how much a foundation gives way tangentially, ``-r_t/k_t`` [length].

    Args:
        space: The mesh.
        contact: A contact with a tangential stiffness.
        r: Tractions [force/area], on rings times the circumference, shape (f, q, d).
        points: Reference points of its facets, shape (q, d-1).

    Returns:
        Shape (f, q, d); 0 on the axis of rings, where no shear acts.
    """
    stiffness = evaluate(contact.tangential_stiffness, space.mesh, points, contact.facets)
    _, r_t, _ = split(r, contact.trace.normals_at(points))
    k = stiffness[..., None]
    return np.divide(-r_t, k, out=np.zeros_like(r_t), where=k > 0)
