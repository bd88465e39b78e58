"""Evaluate the data of a contact on its facets, at its nodes, or at any points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import split
from erc_contact.model.data.expressions import Everywhere
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.space import Space
from namedmesh.simplex import lagrange


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
        values[name] = space.evaluate(value, points, contact.facets)
    return values


def gap_at_nodes(space: Space, contact: ContactOnMesh) -> np.ndarray:
    """Evaluate the gap at the nodes of a contact [length], shape (f, m)."""
    if contact.gap is None:
        return np.zeros((len(contact.facets), len(space.facet_points)))
    return space.evaluate(contact.gap, space.facet_points, contact.facets)


def distance_at_nodes(space: Space, contact: ContactOnMesh, u: np.ndarray) -> np.ndarray:
    """Return the gap less what a displacement closes of it at the nodes [length].

    Args:
        space: The mesh.
        contact: The contact.
        u: Displacement at all nodes of this rank [length], as :meth:`.Trace.of` has it.

    Returns:
        Shape (f, m); below zero the displacement closes more than the gap.
    """
    closed = np.vecdot(contact.trace.of(u), contact.trace.normals)
    return np.asarray(gap_at_nodes(space, contact) - closed)


def spring_displacement(
    space: Space, contact: ContactOnMesh, r: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Compute the tangential deflection of a foundation, ``-r_t/k_t`` [length].

    Args:
        space: The mesh.
        contact: A contact with a tangential stiffness.
        r: Tractions [force/area], on rings times the circumference, shape (f, q, d).
        points: Reference points of its facets, shape (q, d-1).

    Returns:
        Shape (f, q, d); 0 on the axis of rings, where no shear acts.
    """
    stiffness = space.evaluate(contact.tangential_stiffness, points, contact.facets)
    r_t = split(r, contact.trace.normals_at(points)).tangential
    k = stiffness[..., None]
    return np.divide(-r_t, k, out=np.zeros_like(r_t), where=k > 0)


def give_way(space: Space, contact: ContactOnMesh, r: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Compute the tangential deflection of the foundation [length], (f, q, d).

    The tractions r [force/area] are not about rings, as its stiffness is.
    """
    on_mesh = space.section.times(r, contact.trace.here.points_at(points))
    return spring_displacement(space, contact, on_mesh, points)


def slip_at(
    space: Space, contact: ContactOnMesh, u: np.ndarray, r: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Compute the slip w_t at points of the facets [length], shape (f, q, d).

    It counts from the end of the last step of a history, without the tangential
    deflection of a compliant foundation.

    Args:
        space: The mesh.
        contact: The contact.
        u: Displacement at all nodes of this rank [length], shape (nodes d,).
        r: Contact traction at the points [force/area], shape (f, q, d).
        points: Reference points of its facets, shape (q, d-1).
    """
    trace = contact.trace
    shape = lagrange(space.d - 1, space.degree, points)
    w = np.matmul(shape, trace.of(u) - trace.of_before)
    if contact.tangential_stiffness is not None:
        w = w - give_way(space, contact, r, points)
    return split(w, trace.normals_at(points)).tangential


class ContactData:
    """Evaluate the data of a contact at any points of its facets.

    Construction is collective. The methods get ``facet``, the number in the contact of
    each of n facets, and ``x``, q points of each [length], shape (n, q, d).
    """

    def __init__(self, contact: ContactOnMesh, mesh: dmesh.Mesh) -> None:
        self.contact = contact

        def everywhere(value: Ufl | None) -> Everywhere | None:
            return None if value is None else Everywhere(value, mesh)

        self._gap = everywhere(contact.gap)
        self._normal = everywhere(contact.given_normal)
        self._stiffness = everywhere(contact.stiffness)
        self._tangential_stiffness = everywhere(contact.tangential_stiffness)
        self._parameters = {}
        if contact.friction is not None:
            for name, value in contact.friction.parameters.items():
                self._parameters[name] = Everywhere(value, mesh)

    def gap(self, facet: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate the gap at the points [length], shape (n, q)."""
        if self._gap is None:
            return np.zeros(x.shape[:2])
        return self._gap(x, self.contact.facets[facet])

    def stiffness(self, facet: np.ndarray, x: np.ndarray) -> np.ndarray | None:
        """Evaluate k_n of the foundation at the points [force/length^3], shape (n, q).

        None if it is rigid.
        """
        if self._stiffness is None:
            return None
        return self._stiffness(x, self.contact.facets[facet])

    def tangential_stiffness(self, facet: np.ndarray, x: np.ndarray) -> np.ndarray | None:
        """Evaluate k_t of the foundation as :meth:`stiffness` does."""
        if self._tangential_stiffness is None:
            return None
        return self._tangential_stiffness(x, self.contact.facets[facet])

    def normal(self, facet: np.ndarray, x: np.ndarray, interpolated: np.ndarray) -> np.ndarray:
        """Evaluate the unit normal that the scene gives at the points.

        Args:
            facet: Numbers of the facets, shape (n,).
            x: Points [length], shape (n, q, d).
            interpolated: The normals that the contact has there, shape (n, q or 1, d).

        Returns:
            Shape (n, q, d); ``interpolated`` where the scene gives none that varies.
        """
        if self._normal is None:
            return interpolated
        normal = self._normal(x, self.contact.facets[facet])
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def bound(self, facet: np.ndarray, x: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Evaluate the friction bound at the points [force/area], shape (n, q).

        Args:
            facet: Numbers of the facets, shape (n,).
            x: Points [length], shape (n, q, d).
            pressure: Pressures there [force/area], shape (n, q).
        """
        facets = self.contact.facets[facet]
        parameters = {name: value(x, facets) for name, value in self._parameters.items()}
        return self.contact.friction_bound(pressure, parameters)


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
    values = space.evaluate(value, space.facet_points, contact.facets)
    function = space.function()
    function.x.array.reshape(-1, space.d)[:, 0] = contact.trace.here.values_of_nodes(values)
    return function[0]
