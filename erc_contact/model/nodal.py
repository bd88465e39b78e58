"""Give the data of a contact by Functions, for quadrature at its nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.expressions import evaluate
from erc_contact.model.foundation import BoundContact
from erc_contact.model.space import Space
from erc_contact.model.symbolic import varies_in_cells

CONTINUOUS = 1e-9
"""Difference of two facets at a node that counts as none, over the greatest value."""


def at_nodes(space: Space, contact: BoundContact, gaps: np.ndarray) -> BoundContact:
    """Return a contact with its data as Functions; collective.

    See :meth:`erc_contact.model.model.Model.at_nodes`.

    Args:
        space: The mesh.
        contact: The contact.
        gaps: Its gap at the nodes [length], shape (f, m).
    """
    gap = contact.gap
    stiffness = contact.stiffness
    friction = contact.friction
    trace = contact.trace
    if trace.before is not None:
        before = trace.before.copy()
        space.to_coefficients(before.x.array.reshape(-1, space.d), [contact])
        trace = replace(trace, before=before)
    # The projection holds between Bernstein coefficients, so the gap is given by its
    # own; stiffness and parameters of the law are values at the nodes.
    if contact.gap_varies:
        gap = _nodal(space, contact, gaps, coefficients=True)
    if stiffness is not None:
        stiffness = _values(space, contact, stiffness)
    if friction is not None:
        parameters = {}
        for name, value in friction.parameters.items():
            parameters[name] = _values(space, contact, value)
        friction = replace(friction, parameters=parameters)
    return replace(contact, gap=gap, stiffness=stiffness, friction=friction, trace=trace)


def _values(space: Space, contact: BoundContact, value: Ufl) -> Ufl:
    """Return data that vary in cells by their values at the nodes, UFL."""
    if not varies_in_cells(value):
        return value
    values = evaluate(value, space.mesh, space.facet_points, contact.facets)
    return _nodal(space, contact, values)


def _nodal(
    space: Space, contact: BoundContact, values: np.ndarray, *, coefficients: bool = False
) -> Ufl:
    """Make a scalar, UFL, from its values at the nodes of a contact.

    Args:
        space: The mesh.
        contact: The contact.
        values: The values, shape (f, m).
        coefficients: Whether the nodal values of the scalar become the Bernstein
            coefficients of these values, instead of the values.
    """
    function = space.function()
    nodal = function.x.array.reshape(-1, space.d)
    nodal[:, 0] = _of_nodes(space, contact, values)
    if coefficients:
        space.to_coefficients(nodal, [contact])
    return function[0]


def _of_nodes(space: Space, contact: BoundContact, values: np.ndarray) -> np.ndarray:
    """Return one value at each node from those of its facets, shape (nodes,).

    Where facets differ, as of data that jump between them, it is the mean weighted with
    their areas. So the sum of weights times values in the rule at the nodes is kept. A
    rank has all facets at the nodes of its own cells, so it needs no communication.

    Args:
        space: The mesh.
        contact: The contact.
        values: The values, shape (f, m).
    """
    nodes = contact.trace.here.nodes
    result = np.zeros(space.node_count)
    result[nodes] = values
    differs = abs(result[nodes] - values) > CONTINUOUS * abs(values).max(initial=0.0)
    if not differs.any():
        return result
    jumps = np.zeros(space.node_count, dtype=bool)
    jumps[nodes[differs]] = True
    areas = np.broadcast_to(contact.trace.here.areas[:, None], nodes.shape)
    area = np.bincount(nodes.ravel(), areas.ravel(), space.node_count)
    weighted = np.bincount(nodes.ravel(), (areas * values).ravel(), space.node_count)
    result[jumps] = weighted[jumps] / area[jumps]
    return result
