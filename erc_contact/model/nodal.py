"""Give the data of a contact by Functions, for quadrature at its nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.of_nodes import values_of_nodes
from erc_contact.model.space import Space
from erc_contact.model.symbolic import varies_in_cells


def at_nodes(space: Space, contact: ContactOnMesh, gap: Ufl | None) -> ContactOnMesh:
    """Return a contact with its data as Functions; collective.

    See :meth:`erc_contact.model.model.Model.at_nodes`.

    Args:
        space: The mesh.
        contact: The contact.
        gap: Its gap by Bernstein coefficients [length], UFL, or None.
    """
    friction = contact.friction
    trace = contact.trace
    if trace.before is not None:
        before = trace.before.copy()
        space.to_coefficients(before.x.array.reshape(-1, space.d), [contact])
        trace = replace(trace, before=before)
    # The projection holds between Bernstein coefficients, so the gap is given by its
    # own; stiffnesses and parameters of the law are values at the nodes.
    stiffnesses = {}
    for name in ("stiffness", "tangential_stiffness"):
        stiffness = getattr(contact, name)
        if stiffness is not None:
            stiffnesses[name] = _values(space, contact, stiffness)
    if friction is not None:
        parameters = {}
        for name, value in friction.parameters.items():
            parameters[name] = _values(space, contact, value)
        friction = replace(friction, parameters=parameters)
    return replace(contact, gap=gap, friction=friction, trace=trace, **stiffnesses)


def _values(space: Space, contact: ContactOnMesh, value: Ufl) -> Ufl:
    """Return data that vary in cells by their values at the nodes, UFL."""
    if not varies_in_cells(value):
        return value
    values = evaluate(value, space.mesh, space.facet_points, contact.facets)
    return _nodal(space, contact, values)


def _nodal(space: Space, contact: ContactOnMesh, values: np.ndarray) -> Ufl:
    """Make a scalar, UFL, from its values at the nodes of a contact, shape (f, m)."""
    function = space.function()
    function.x.array.reshape(-1, space.d)[:, 0] = values_of_nodes(contact.trace.here, values)
    return function[0]
