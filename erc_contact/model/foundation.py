"""A contact on a mesh: its measure, the normal of its foundation, its gap and its friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np
import ufl
from dolfinx import mesh as dmesh
from ufl.classes import Division, Product, Sum, Variable, Zero
from ufl.corealg.traversal import unique_pre_traversal

from erc_contact.base.runtime import compiled
from erc_contact.base.runtime.patches import method_caches_off
from erc_contact.model.expressions import Everywhere, pointwise, varies_in_cells
from erc_contact.model.trace import Trace
from erc_contact.model.users import call_of_user, scalar
from erc_contact.scene.law import Law, project

CONSTANT, PROPORTIONAL, CONCAVE = "constant", "proportional", "concave"
"""How a friction bound depends on the pressure: not at all, as a multiple of it, or in another concave way."""


def pressures(r: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Pressures ``max(-r_n, 0)`` of tractions (..., d) on foundations with normals n [force/area]."""
    return np.maximum(-(r * n).sum(axis=-1), 0.0)


@dataclass(frozen=True, eq=False)
class Friction:
    """A friction law on a mesh.

    Attributes:
        law: The law.
        parameters: Values of its parameters, UFL.
        dependence: How its bound depends on the pressure: CONSTANT, PROPORTIONAL or
            CONCAVE.
        arithmetic: Whether its bound takes numpy arrays as well as UFL.
        share: Factor of the bound, UFL, with which a solver raises friction in steps;
            None outside a solver.
    """

    law: Law
    parameters: dict[str, Any]
    dependence: str
    arithmetic: bool
    share: Any = None

    @property
    def convex(self) -> bool:
        """Tell whether the law allows a traction on a whole facet if it allows its Bernstein coefficients."""
        return self.dependence != CONCAVE and not any(
            varies_in_cells(value) for value in self.parameters.values()
        )

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

    def of_numbers() -> bool:
        ones = {name: np.ones((1, 1)) for name in parameters}
        try:
            found = law.friction_bound(np.ones((1, 1)), **ones)
        except Exception:  # UFL that numpy does not understand, or not
            return False
        return isinstance(found, Real | np.ndarray)

    dependence = call_of_user(mesh.comm, what, _dependence, mesh, bound)
    friction = Friction(law, parameters, dependence, of_numbers())
    call_of_user(
        mesh.comm,
        what,
        friction.numbers,
        np.ones((1, 1)),
        {name: np.ones((1, 1)) for name in parameters},
    )
    return friction


def _dependence(mesh: dmesh.Mesh, bound: Callable[[Any], Any]) -> str:
    """Tell how a friction bound, UFL of the pressure, depends on the pressure.

    The derivative alone does not tell: that of ``sign(p)``, or of a conditional between
    two numbers, is symbolically zero, although the bound jumps. So a bound is CONSTANT
    only if the pressure is no operand of it, and PROPORTIONAL only if sums, products
    and quotients alone join the pressure to the bound. All else counts as CONCAVE, of
    which nothing is claimed that needs more.
    """
    pressure = ufl.variable(compiled.constant(mesh, 1.0))
    expression = ufl.as_ufl(bound(pressure))
    dependent = [node for node in unique_pre_traversal(expression) if _contains(node, pressure)]
    if not dependent:
        return CONSTANT
    if not all(isinstance(node, Variable | Sum | Product | Division) for node in dependent):
        return CONCAVE
    with method_caches_off():
        slope = ufl.algorithms.apply_derivatives.apply_derivatives(ufl.diff(expression, pressure))
    if _contains(slope, pressure):
        return CONCAVE
    through_zero = isinstance(bound(ufl.as_ufl(0.0)), Zero)
    return PROPORTIONAL if through_zero else CONCAVE


def _contains(expression: Any, part: Any) -> bool:
    """Tell whether a UFL expression has another one as an operand, at any depth."""
    return any(node == part for node in unique_pre_traversal(expression))


@dataclass(frozen=True, eq=False)
class BoundContact:
    """A contact on a mesh: the measure of its boundary part, and the data of the scene as UFL.

    Attributes:
        name: Name of the boundary part.
        trace: The displacement of the contact, with the facets of the body.
        ds: Measure of the part.
        normal: Unit normal of the foundation, UFL.
        given_normal: The normal as the scene gives it, of any length, UFL; None where
            it does not vary.
        friction: Friction law, or None without friction.
        gap: Gap [length], UFL; None where it is zero.
        gap_varies: Whether the gap is a callable.
        bilateral: Whether the contact cannot open.
        lost: What this mesh does not carry of it, ``int_F |s - I s|^2`` of its
            tangential part s on each facet [length^(d+1)], shape (f,); None where it
            carries all.
    """

    name: str
    trace: Trace
    ds: Any
    normal: Any
    given_normal: Any | None
    friction: Friction | None
    gap: Any | None
    gap_varies: bool
    bilateral: bool
    lost: np.ndarray | None = None

    @property
    def facets(self) -> np.ndarray:
        """Pairs (cell, local facet) with ghosts, shape (f, 2)."""
        return self.trace.here.facets

    @property
    def direction(self) -> np.ndarray:
        """Unit normal of the foundation on each facet [-], shape (f, d)."""
        return self.trace.direction

    @property
    def varies(self) -> bool:
        """Tell whether gap, normal or friction vary along facets."""
        data = (
            self.gap,
            self.given_normal,
            *(self.friction.parameters.values() if self.friction else ()),
        )
        return any(one is not None and varies_in_cells(one) for one in data)

    @property
    def sampled(self) -> bool:
        """Tell whether the friction bound must be sampled on facets.

        A traction may then exceed it between the nodes alone.
        """
        return self.friction is not None and not self.friction.convex

    def with_share(self, share: Any) -> BoundContact:
        """The same contact with a factor of its friction bound, UFL, with which a solver raises friction in steps."""
        return (
            self
            if self.friction is None
            else replace(self, friction=replace(self.friction, share=share))
        )

    def jump(self, u: Any) -> Any:
        """Give the displacement that the law of the contact is about [length], UFL.

        On a foundation it is u; in a history its tangential part is counted from the
        end of the last step, of which friction remembers the tangential displacement s:
        ``u - s``.

        Args:
            u: A displacement [length], a Function or UFL. A test or trial function has
                no history: use it as it is.
        """
        before = self.trace.before
        if before is None:
            return u
        return u - (before - ufl.dot(before, self.normal) * self.normal)

    def since(self, u: Any) -> Any:
        """Call :meth:`jump` by its name in version 0.1; methods of users may have it. To go with version 0.3."""
        return self.jump(u)

    def project(self, z: Any) -> Any:
        """The traction that the law allows for a trial traction z [force/area], UFL."""
        bound = None if self.friction is None else self.friction.bound
        return project(z, self.normal, bound, bilateral=self.bilateral)

    def status(self, r: Any) -> Any:
        """Return the status that a traction of :meth:`project` shows: open (0), slip (1) or stick (2), UFL."""
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
        return (
            np.zeros(pressure.shape)
            if self.friction is None
            else self.friction.numbers(pressure, values)
        )


class ContactData:
    """Gap, normal and friction bound of a contact at any points of its facets. Construction is collective.

    The members get ``of``, the number in the contact of each of n facets, and ``x``, q
    points of each [length], shape (n, q, d).
    """

    def __init__(self, contact: BoundContact, mesh: dmesh.Mesh) -> None:
        self.contact = contact
        self._gap, self._normal = (
            None if one is None else Everywhere(one, mesh)
            for one in (contact.gap, contact.given_normal)
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
        parameters = {
            name: value(x, self.contact.facets[of]) for name, value in self._parameters.items()
        }
        return self.contact.friction_bound(pressure, parameters)
