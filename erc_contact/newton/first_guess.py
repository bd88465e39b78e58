"""Where Newton's method starts: the displacement of the contact nodes.

This is enough, because the rest of the body follows in elastic equilibrium.

Loads may bring a body to its contacts by a long way first. Its displacement is u = R +
v with a motion R that no support and no spring resists, so that R has no stress and no
energy. The problem for v is the problem for u with the gaps and the slip that R leaves,
``g - R_n`` and ``s - R_t``. It has the same solution; but v is as small as the
deformation, so that K v has no round-off of a long way (:class:`CarriedBodies`).

From a solution on another mesh, every contact node takes the interpolant on the nearest
old contact facet. On a refined mesh this is its parent facet, where the interpolant is
exact; on another mesh of the same body it is a near facet. No search tree of the cells
is needed.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import together
from erc_contact.model.contact.contact_values import gap_at_nodes
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.last_step import gather_facets, interpolate
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.methods import Method
from erc_contact.newton.statics import motion_at_rest


def across_gap(model: Model) -> fem.Function:
    """Return the displacement that closes gaps and undoes slip [length].

    Only the contact nodes move: it is zero elsewhere.
    """
    across = model.space.function()
    for contact in model.contacts:
        if contact.gap is not None or contact.trace.before is not None:
            gap = gap_at_nodes(model.space, contact)[..., None] * contact.trace.normals
            contact.trace.assign(across.x.array, gap + contact.trace.slip_before)
    across.x.scatter_forward()
    return across


def solve_glued(model: Model, stiffness: Stiffness, w: fem.Function) -> np.ndarray | None:
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
        schur, _ = stiffness.reduce(a)
        return start + np.linalg.solve(schur, pull)

    return together(model.space.comm, across)


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
    space = new.space
    parts = []
    for contact in model.contacts:
        parts.append((contact.facets, contact.trace.of(u.x.array)))
    corners, values = gather_facets(model.space, parts)
    all_nodes = np.concatenate([c.trace.here.nodes.ravel() for c in new.contacts])
    nodes = np.unique(all_nodes)
    x = space.V.tabulate_dof_coordinates()[nodes, : space.d]
    field = space.function()
    field.x.array.reshape(-1, space.d)[nodes] = interpolate(x, corners, values, model.space.degree)
    return field


class CarriedBodies:
    """Carry the bodies of a model to their contacts; members are collective.

    Args:
        model: The scene on a mesh.
        loads: Nodal forces of its loads [force], not yet summed over ranks.

    Attributes:
        model: The scene with the gaps and the slip that are left; the model itself
            where nothing is carried.
    """

    def __init__(self, model: Model, loads: fem.Function) -> None:
        self.model = model
        self._motion = motion_at_rest(model, loads)
        if self._motion is None:
            return
        self.model = copy(model)
        self.model.gap_limits = {}
        self.model.contacts = [_carry(model.space, c, self._motion) for c in model.contacts]

    def forms(
        self, forms: dict[Method, ContactForms] | None
    ) -> tuple[dict[Method, ContactForms], dict[Method, ContactForms]]:
        """Return the forms to solve with, and the forms that other solves may use.

        Args:
            forms: Forms of the model at rest that there are.
        """
        if self._motion is not None:
            return {}, {}
        forms = {} if forms is None else forms
        return forms, forms

    def whole(
        self, v: fem.Function
    ) -> tuple[fem.Function, tuple[list[ContactOnMesh], fem.Function] | None]:
        """Return u = R + v [length], and what contacts know of v; None if R = 0."""
        if self._motion is None:
            return v, None
        u = v.copy()
        u.x.array[:] += self._motion.x.array
        return u, (self.model.contacts, v)

    def deformation(self, u: fem.Function) -> fem.Function:
        """Return v = u - R [length], a new Function."""
        v = u.copy()
        if self._motion is not None:
            v.x.array[:] -= self._motion.x.array
        return v

    def take_from_contacts(self, jumps: fem.Function) -> None:
        """Take the motion from jumps at contact nodes of this side, in place."""
        if self._motion is None:
            return
        at_contacts = self.model.space.function()
        for contact in self.model.contacts:
            contact.trace.assign(at_contacts.x.array, contact.trace.of(self._motion.x.array))
        jumps.x.array[:] -= at_contacts.x.array


def _carry(space: Space, contact: ContactOnMesh, motion: fem.Function) -> ContactOnMesh:
    """Return a contact with the gap and the slip that a motion leaves; collective."""
    trace = contact.trace
    jump = space.function()
    trace.assign(jump.x.array, trace.of(motion.x.array))
    if not space.comm.allreduce(bool(jump.x.array.any()), MPI.LOR):
        return contact
    gap = -ufl.dot(jump, contact.normal)
    if contact.gap is not None:
        gap += contact.gap
    if contact.friction is not None:
        before = jump.copy()
        before.x.array[:] *= -1.0
        if trace.before is not None:
            before.x.array[:] += trace.before.x.array
        trace = replace(trace, before=before)
    return replace(contact, gap=gap, gap_varies=True, trace=trace)
