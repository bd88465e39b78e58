"""Where Newton's method starts: the displacement of the contact nodes.

This is enough, because the rest of the body follows in elastic equilibrium.

From a solution on another mesh, every contact node takes the interpolant on the nearest old contact facet. On a refined
mesh this is its parent facet, where the interpolant is exact; on another mesh of the same body it is a near facet. No
search tree of the cells is needed.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import together
from erc_contact.mesh.simplex import lagrange
from erc_contact.model.model import Model
from erc_contact.newton.stiffness import Stiffness

CHUNK = 1_000_000
"""Number of pairs (node, facet) that are worked on at once, to bound the memory."""


def across_gap(model: Model) -> fem.Function:
    """The displacement of the contact nodes that closes their gaps [length], zero elsewhere."""
    across = fem.Function(model.V)
    values = across.x.array.reshape(-1, model.d)
    for contact in model.contacts:
        if contact.gap is not None:
            gap = model.gap_at_nodes(contact)
            values[model.facet_nodes(contact.facets)] = gap[..., None] * contact.direction[:, None, :]
    across.x.scatter_forward()
    return across


def glued(stiffness: Stiffness, w: fem.Function) -> np.ndarray | None:
    """Displacement of the contact nodes glued to the foundations, where a gap is closed.

    Args:
        stiffness: The condensed elastic stiffness.
        w: Its glued displacement under the loads [length].

    Returns:
        The free components on rank 0, None on other ranks; collective.
    """
    a = stiffness.contact_size
    given, start = stiffness.gather(across_gap(stiffness.model))[:a], stiffness.gather(w)[:a]

    def across() -> np.ndarray | None:
        if stiffness.schur is None:
            return None
        if not given.any():
            return start
        return start + np.linalg.solve(stiffness.reduced(a)[0], stiffness.glued_by[:a] * given)

    return together(stiffness.model.comm, across)


def from_mesh(model: Model, u: fem.Function, new: Model) -> fem.Function:
    """Displacement of the contact nodes of a new mesh from that on another one; collective.

    Args:
        model: The scene on the old mesh.
        u: The displacement there [length].
        new: The scene on the new mesh.

    Returns:
        The displacement at the contact nodes of this rank [length], zero elsewhere.
    """
    corners, values = _contact_facets(model, u)
    nodes = np.unique(np.concatenate([new.facet_nodes(c.facets).ravel() for c in new.contacts]))
    x = new.V.tabulate_dof_coordinates()[nodes, : new.d]
    field = fem.Function(new.V)
    field.x.array.reshape(-1, new.d)[nodes] = interpolate(x, corners, values, model.degree)
    return field


def interpolate(x: np.ndarray, corners: np.ndarray, values: np.ndarray, degree: int = 1) -> np.ndarray:
    """Interpolants on the nearest facets.

    Args:
        x: Points, shape (n, d).
        corners: Corners of the facets, shape (f, d, d).
        values: Values at the nodes of the facets, shape (f, m, d).
        degree: Degree of the interpolants.

    Returns:
        Values at the points, shape (n, d).
    """
    edges = corners[:, 1:] - corners[:, :1]
    # of each facet: from a point to its barycentric coordinates
    to_barycentric = np.linalg.inv(edges @ edges.transpose(0, 2, 1)) @ edges
    result = np.empty_like(x)
    step = max(1, CHUNK // max(len(corners), 1))
    for first in range(0, len(x), step):
        some = x[first : first + step]
        local = np.einsum("fki,nfi->nfk", to_barycentric, some[:, None] - corners[None, :, 0])
        shape = np.maximum(np.concatenate([1 - local.sum(axis=2, keepdims=True), local], axis=2), 0.0)
        shape /= shape.sum(axis=2, keepdims=True)
        distance = np.linalg.norm(np.einsum("nfm,fmi->nfi", shape, corners) - some[:, None], axis=2)
        nearest = distance.argmin(axis=1)
        chosen = lagrange(x.shape[1] - 1, degree, shape[np.arange(len(some)), nearest, 1:])
        result[first : first + step] = np.einsum("nm,nmi->ni", chosen, values[nearest])
    return result


def _contact_facets(model: Model, u: fem.Function) -> tuple[np.ndarray, np.ndarray]:
    """Corners of all contact facets (f, d, d) and the displacements at their nodes (f, m, d), over all ranks."""
    x, at = model.V.tabulate_dof_coordinates()[:, : model.d], u.x.array.reshape(-1, model.d)
    own = [c.facets[model.owned(c.facets)] for c in model.contacts]
    nodes = model.facet_nodes(np.vstack(own))
    parts = model.comm.allgather((x[nodes[:, : model.d]], at[nodes]))
    return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
