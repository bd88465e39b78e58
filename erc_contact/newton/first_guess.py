"""Where Newton's method starts: the displacement of the contact nodes.

This is enough, because the rest of the body follows in elastic equilibrium.

From a solution on another mesh, every contact node takes the interpolant on the nearest
old contact facet. On a refined mesh this is its parent facet, where the interpolant is
exact; on another mesh of the same body it is a near facet. No search tree of the cells
is needed.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import together
from erc_contact.model.contact_values import gap_at_nodes
from erc_contact.model.last_step import gathered_facets, interpolate
from erc_contact.model.model import Model
from erc_contact.newton.linear.stiffness import Stiffness


def across_gap(model: Model) -> fem.Function:
    """Return the displacement that closes gaps and undoes slip [length].

    Only the contact nodes move: it is zero elsewhere.
    """
    across = model.function()
    for contact in model.contacts:
        if contact.gap is not None or contact.trace.before is not None:
            gap = gap_at_nodes(model, contact)[..., None] * contact.trace.normals
            contact.trace.assign(across.x.array, gap + contact.trace.slip_before)
    across.x.scatter_forward()
    return across


def glued(model: Model, stiffness: Stiffness, w: fem.Function) -> np.ndarray | None:
    """Return the displacement of the contact nodes glued to the foundations [length].

    There a gap is closed and nothing slips.

    Args:
        model: The scene on a mesh.
        stiffness: The condensed elastic stiffness.
        w: Its glued displacement under the loads [length].

    Returns:
        The free components on rank 0, None on other ranks; collective.
    """
    a = stiffness.contact_size
    pull = stiffness.gather(stiffness.glue.times(across_gap(model)))[:a]
    start = stiffness.gather(w)[:a]

    def across() -> np.ndarray | None:
        if stiffness.schur is None:
            return None
        if not pull.any():
            return start
        schur, _ = stiffness.reduced(a)
        return start + np.linalg.solve(schur, pull)

    return together(model.comm, across)


def from_mesh(model: Model, u: fem.Function, new: Model) -> fem.Function:
    """Return the displacement of the contact nodes of a new mesh; collective.

    Between bodies it is the jump, with the other side at rest
    (:meth:`.connections.Connections.least_displacement` moves both).

    Args:
        model: The scene on the old mesh.
        u: The displacement there [length].
        new: The scene on the new mesh.

    Returns:
        The displacement at the contact nodes of this rank [length], zero elsewhere.
    """
    parts = []
    for contact in model.contacts:
        parts.append((contact.facets, contact.trace.of(u.x.array)))
    corners, values = gathered_facets(model, parts)
    all_nodes = np.concatenate([c.trace.here.nodes.ravel() for c in new.contacts])
    nodes = np.unique(all_nodes)
    x = new.V.tabulate_dof_coordinates()[nodes, : new.d]
    field = new.function()
    field.x.array.reshape(-1, new.d)[nodes] = interpolate(x, corners, values, model.degree)
    return field
