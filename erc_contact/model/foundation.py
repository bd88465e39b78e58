"""A contact on a mesh: its measure, the normal of its foundation, its gap and its friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np
import ufl
from dolfinx import mesh as dmesh
from ufl.classes import Variable, Zero
from ufl.corealg.traversal import unique_pre_traversal

from erc_contact.base import compiled
from erc_contact.base.patches import forms_freed
from erc_contact.model.expressions import Everywhere, pointwise, varies_in_cells
from erc_contact.model.users import called, scalar
from erc_contact.scene.law import Law, project

CONSTANT, PROPORTIONAL, CONCAVE = "constant", "proportional", "concave"
"""How a friction bound depends on the pressure: not at all, as a multiple of it, or in another concave way."""


def split(z: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vectors (..., d) split by unit normals n.

    Returns:
        The normal component (...), the tangential part (..., d), and the length of this part (...).
    """
    z_n = (z * n).sum(axis=-1)
    z_t = z - z_n[..., None] * n
    return z_n, z_t, np.linalg.norm(z_t, axis=-1)


def pressures(r: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Pressures ``max(-r_n, 0)`` of tractions (..., d) on foundations with normals n [force/area]."""
    return np.maximum(-(r * n).sum(axis=-1), 0.0)


@dataclass(frozen=True, eq=False)
class Friction:
    """A friction law on a mesh.

    Attributes:
        law: The law.
        parameters: Values of its parameters, UFL.
        dependence: How its bound depends on the pressure: CONSTANT, PROPORTIONAL or CONCAVE.
        arithmetic: Whether its bound takes numpy arrays as well as UFL.
        share: Factor of the bound, UFL, with which a solver raises friction in steps; None outside a solver.
    """

    law: Law
    parameters: dict[str, Any]
    dependence: str
    arithmetic: bool
    share: Any = None

    @property
    def convex(self) -> bool:
        """Whether the law allows a traction at every point of a facet if it allows its Bernstein coefficients."""
        return self.dependence != CONCAVE and not any(varies_in_cells(value) for value in self.parameters.values())

    def bound(self, pressure: Any) -> Any:
        """The friction bound b(p) [force/area], UFL."""
        bound = self.law.friction_bound(pressure, **self.parameters)
        return bound if self.share is None else self.share * bound

    def numbers(self, pressure: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """The friction bound as numbers [force/area], from pressures and values of the parameters at some points."""
        if self.arithmetic:
            return np.broadcast_to(self.law.friction_bound(pressure, **values), pressure.shape)
        return pointwise(self.law.friction_bound, pressure, values)


def bind_friction(mesh: dmesh.Mesh, what: str, law: Law, parameters: dict[str, Any]) -> Friction:
    """A friction law on a mesh; collective. The bound is called once as solver and error will call it.

    Args:
        mesh: The mesh.
        what: The bound, in words for messages.
        law: The law.
        parameters: Values of its parameters, UFL.

    Raises:
        InputError: If the bound fails, or is no scalar.
    """

    def bound(pressure: Any) -> Any:
        return scalar(what, law.friction_bound(pressure, **parameters))

    def attempt() -> str:
        pressure = ufl.variable(compiled.constant(mesh, 1.0))
        with forms_freed():
            slope = ufl.algorithms.apply_derivatives.apply_derivatives(ufl.diff(bound(pressure), pressure))
        if isinstance(slope, Zero):
            return CONSTANT
        straight = not any(isinstance(one, Variable) for one in unique_pre_traversal(slope))
        return PROPORTIONAL if straight and isinstance(bound(ufl.as_ufl(0.0)), Zero) else CONCAVE

    def of_numbers() -> bool:
        ones = {name: np.ones((1, 1)) for name in parameters}
        try:
            found = law.friction_bound(np.ones((1, 1)), **ones)
        except Exception:  # UFL that numpy does not understand, or not
            return False
        return isinstance(found, Real | np.ndarray)

    dependence = called(mesh.comm, what, attempt)
    friction = Friction(law, parameters, dependence, of_numbers())
    called(mesh.comm, what, friction.numbers, np.ones((1, 1)), {name: np.ones((1, 1)) for name in parameters})
    return friction


@dataclass(frozen=True, eq=False)
class BoundContact:
    """A contact on a mesh: the measure of its boundary part, and the data of the scene as UFL.

    Attributes:
        name: Name of the boundary part.
        facets: Pairs (cell, local facet) with ghosts, shape (f, 2).
        ds: Measure of the part.
        normal: Unit normal of the foundation, UFL.
        direction: Unit normal of the foundation on each facet [-], shape (f, d).
        given_normal: The normal as the scene gives it, of any length, UFL; None where it does not vary.
        friction: Friction law, or None without friction.
        gap: Gap [length], UFL; None where it is zero.
        gap_varies: Whether the gap is a callable.
        bilateral: Whether the contact cannot open.
        before: Displacement at the end of the last step of a history, from which friction counts the tangential
            displacement [length], a Function of V; None without history or without friction.
        lost: What this mesh does not carry of it, ``int_F |s - I s|^2`` of its tangential part s on each facet
            [length^(d+1)], shape (f,); None where it carries all.
    """

    name: str
    facets: np.ndarray
    ds: Any
    normal: Any
    direction: np.ndarray
    given_normal: Any | None
    friction: Friction | None
    gap: Any | None
    gap_varies: bool
    bilateral: bool
    before: Any | None = None
    lost: np.ndarray | None = None

    @property
    def varies(self) -> bool:
        """Whether gap, normal or friction vary along facets."""
        data = self.gap, self.given_normal, *(self.friction.parameters.values() if self.friction else ())
        return any(one is not None and varies_in_cells(one) for one in data)

    @property
    def sampled(self) -> bool:
        """Whether the friction bound must be sampled on facets, as a traction may exceed it between the nodes alone."""
        return self.friction is not None and not self.friction.convex

    def with_share(self, share: Any) -> BoundContact:
        """The same contact with a factor of its friction bound, UFL, with which a solver raises friction in steps."""
        return self if self.friction is None else replace(self, friction=replace(self.friction, share=share))

    def since(self, u: Any) -> Any:
        """The displacement that the law of the contact is about [length], UFL: ``u - s``.

        It has the normal component of u, and its tangential part is that since the last step of a history, which ended
        with the tangential displacement s. Without a history it is u.
        """
        if self.before is None:
            return u
        return u - (self.before - ufl.dot(self.before, self.normal) * self.normal)

    def project(self, z: Any) -> Any:
        """The traction that the law allows for a trial traction z [force/area], UFL."""
        bound = None if self.friction is None else self.friction.bound
        return project(z, self.normal, bound, bilateral=self.bilateral)

    def status(self, r: Any) -> Any:
        """Whether a traction of :meth:`project` shows the contact open (0), in slip (1) or in stick (2), UFL."""
        r_n = ufl.dot(r, self.normal)
        r_t = r - r_n * self.normal
        limit = self.friction.bound(-r_n) if self.friction else 0
        slips = ufl.ge(ufl.dot(r_t, r_t), (1 - 1e-9) * limit**2)
        closed = ufl.conditional(slips, 1, 2)
        return closed if self.bilateral else ufl.conditional(ufl.lt(r_n, 0), closed, 0)

    def friction_bound(self, pressure: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """The friction bound b(p) at points of the facets [force/area].

        Args:
            pressure: p >= 0 at the points [force/area], shape (f, q).
            values: The law's parameters there, from :meth:`Model.friction_parameters`.

        Returns:
            The bound, shape (f, q); zero without friction.
        """
        return np.zeros(pressure.shape) if self.friction is None else self.friction.numbers(pressure, values)


class ContactData:
    """Gap, normal and friction bound of a contact at any points of its facets. Construction is collective.

    The members get ``of``, the number in the contact of each of n facets, and ``x``, q points of each [length], shape
    (n, q, d).
    """

    def __init__(self, contact: BoundContact, mesh: dmesh.Mesh) -> None:
        self.contact = contact
        self._gap, self._normal = (
            None if one is None else Everywhere(one, mesh) for one in (contact.gap, contact.given_normal)
        )
        parameters = contact.friction.parameters if contact.friction else {}
        self._parameters = {name: Everywhere(value, mesh) for name, value in parameters.items()}

    def gap(self, of: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The gap at the points [length], shape (n, q)."""
        return np.zeros(x.shape[:2]) if self._gap is None else self._gap(x, self.contact.facets[of])

    def normal(self, of: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The unit normal of the foundation at the points, shape (n, q, d), or (n, 1, d) where it does not vary."""
        if self._normal is None:
            return self.contact.direction[of][:, None, :]
        normal = self._normal(x, self.contact.facets[of])
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def bound(self, of: np.ndarray, x: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """The friction bound at the points for pressures (n, q) [force/area], shape (n, q)."""
        parameters = {name: value(x, self.contact.facets[of]) for name, value in self._parameters.items()}
        return self.contact.friction_bound(pressure, parameters)
