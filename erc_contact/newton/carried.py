"""A model whose bodies are carried by a rigid motion before they are deformed.

The displacement is u = R + v with a motion R that no support and no spring resists, so
that R has no stress and no energy. The problem for v is the problem for u with the gaps
and the slip that R leaves, ``g - R_n`` and ``s - R_t``. It has the same solution; but v
is as small as the deformation, so that K v has no round-off of a long way.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import ufl
from dolfinx import fem
from mpi4py import MPI

from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.model import Model
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.methods import Method
from erc_contact.newton.statics import motion_at_rest


class Carried:
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
        self.model.contacts = [_carried(model, c, self._motion) for c in model.contacts]

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

    def take_from_contacts(self, jumps: fem.Function) -> None:
        """Take the motion from jumps at contact nodes of this side, in place."""
        if self._motion is None:
            return
        at_contacts = self.model.function()
        for contact in self.model.contacts:
            contact.trace.assign(at_contacts.x.array, contact.trace.of(self._motion.x.array))
        jumps.x.array[:] -= at_contacts.x.array


def _carried(model: Model, contact: ContactOnMesh, motion: fem.Function) -> ContactOnMesh:
    """Return a contact with the gap and the slip that a motion leaves; collective."""
    trace = contact.trace
    jump = model.function()
    trace.assign(jump.x.array, trace.of(motion.x.array))
    if not model.comm.allreduce(bool(jump.x.array.any()), MPI.LOR):
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
