"""Put a friction law on a mesh, and find how its bound depends on the pressure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI
from ufl.classes import Division, Product, Sum
from ufl.corealg.traversal import unique_post_traversal

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.friction_set import DISC, Disc
from erc_contact.model.data.expressions import OfNumbers, stand_in
from erc_contact.model.data.symbolic import constant_value, varies, varies_in_cells
from erc_contact.model.data.tables import write_out
from erc_contact.model.data.users import call_of_user, scalar
from erc_contact.scene.law import Law
from namedmesh.base.communicators import lasting

CIRCUMFERENCE = "circumference"
"""Name of the circumference among the parameters of a law on rings."""
CONSTANT, PROPORTIONAL, CONCAVE = "constant", "proportional", "concave"
"""Kinds of friction bounds by their dependence on the pressure.

They do not depend on it, are a multiple of it, or depend on it in another concave way.
"""


@dataclass(frozen=True, eq=False)
class Friction:
    """Hold a friction law on a mesh.

    Attributes:
        law: The law.
        parameters: Values of its parameters, UFL. On rings, the circumference is one
            of them, unless the bound is a multiple of the pressure.
        dependence: How its bound depends on the pressure: CONSTANT, PROPORTIONAL or
            CONCAVE.
        arithmetic: Whether its bound takes numpy arrays as well as UFL.
        allowed: The tangential tractions that it allows.
        share: Factor of the bound, UFL, with which a solver raises friction in steps;
            None outside a solver.
    """

    law: Law
    parameters: dict[str, Ufl]
    dependence: str
    arithmetic: bool
    allowed: Disc = DISC
    share: Ufl = None

    @property
    def convex(self) -> bool:
        """Tell whether Bernstein coefficients decide on a whole facet.

        The law then allows a traction on a facet if it allows its coefficients.
        """
        if self.dependence == CONCAVE:
            return False
        return not any(varies_in_cells(value) for value in self.parameters.values())

    def bound(self, pressure: Ufl) -> Ufl:
        """Return the friction bound b(p) [force/area], UFL."""
        bound = write_out(ufl.as_ufl(self._bound(pressure, **self.parameters)))
        return bound if self.share is None else self.share * bound

    def _bound(self, pressure: Any, **parameters: Any) -> Any:
        """Return the bound for a pressure, UFL or arrays.

        On rings both are times the circumference c: it is ``c b(p/c)``.
        """
        circumference = parameters.pop(CIRCUMFERENCE, None)
        if circumference is None:
            return self.law.friction_bound(pressure, **parameters)
        if self.dependence == CONSTANT:
            return circumference * self.law.friction_bound(pressure, **parameters)
        return circumference * self.law.friction_bound(pressure / circumference, **parameters)

    def numbers(self, pressure: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Evaluate the friction bound [force/area].

        Args:
            pressure: Pressures p >= 0 [force/area], of any shape.
            values: Values of the parameters, of shapes that broadcast with it.
        """
        if self.arithmetic:
            bound = self._bound(pressure, **values)
            return np.broadcast_to(bound, pressure.shape)
        return _pointwise(self._bound, pressure, values)


def _pointwise(
    function: Callable[..., Ufl], first: np.ndarray, named: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Evaluate a function of numbers that is written in UFL at every entry of arrays.

    Args:
        function: Takes the first number by position, the others by name.
        first: Numbers of any shape.
        named: Others, of shapes that broadcast with it.
    """
    shape = np.broadcast_shapes(first.shape, *(array.shape for array in named.values()))
    size = int(np.prod(shape))
    symbol = stand_in((), 0)
    symbols = {name: stand_in((), i) for i, name in enumerate(named, start=1)}
    expression = write_out(ufl.as_ufl(function(symbol, **symbols)))
    if not varies(expression):
        return np.broadcast_to(constant_value(expression), shape)
    numbers = {symbol: np.broadcast_to(first, shape).reshape(size, 1)}
    for name, array in named.items():
        numbers[symbols[name]] = np.broadcast_to(array, shape).reshape(size, 1)
    return OfNumbers(expression, MPI.COMM_SELF)(numbers, size).reshape(shape)


def depends_on_pressure(friction: Friction | None) -> bool:
    """Tell whether the friction bound of a contact depends on the pressure.

    The bound of a contact without friction is zero.
    """
    return friction is not None and friction.dependence != CONSTANT


def bind_friction(
    mesh: dmesh.Mesh,
    what: str,
    law: Law,
    parameters: dict[str, Ufl],
    circumference: Ufl | None = None,
) -> Friction:
    """Put a friction law on a mesh; collective.

    The bound is called once as solver and error will call it.

    Args:
        mesh: The mesh.
        what: The bound, in words for messages.
        law: The law.
        parameters: Values of its parameters, UFL.
        circumference: The circumference of rings [length], UFL, or None.

    Raises:
        InputError: If the bound fails, or is no scalar.
    """

    def bound(pressure: Ufl) -> Ufl:
        return write_out(scalar(what, law.friction_bound(pressure, **parameters)))

    # The arrays that the error estimate passes have two axes, facets and points.
    pressure = np.ones((1, 1))
    values = {name: np.ones((1, 1)) for name in parameters}
    dependence = call_of_user(lasting(mesh.comm), what, _dependence, mesh, bound)
    friction = Friction(law, parameters, dependence, _takes_arrays(law, pressure, values))
    call_of_user(lasting(mesh.comm), what, friction.numbers, pressure, values)
    if circumference is None or dependence == PROPORTIONAL:
        return friction
    return replace(friction, parameters=parameters | {CIRCUMFERENCE: circumference})


def _takes_arrays(law: Law, pressure: np.ndarray, values: Mapping[str, np.ndarray]) -> bool:
    """Tell whether a friction bound takes numpy arrays as well as UFL."""
    try:
        bound = law.friction_bound(pressure, **values)
    except Exception:  # UFL functions do not understand arrays
        return False
    return isinstance(bound, Real | np.ndarray)


def _dependence(mesh: dmesh.Mesh, bound: Callable[[Ufl], Ufl]) -> str:
    """Tell how a friction bound, UFL of the pressure, depends on the pressure.

    A bound is CONSTANT only if the pressure is no operand of it, and PROPORTIONAL only
    if its form says so. A derivative would not tell: ``sign(p)``, or a conditional
    between two numbers, has a derivative that is symbolically zero, although the bound
    jumps. All else counts as CONCAVE, of which nothing is claimed that needs more.
    """
    # Not a Constant: a law of functions of numpy would take its number, and be wrong.
    pressure = ufl.variable(ufl.SpatialCoordinate(mesh)[0])
    expression = ufl.as_ufl(bound(pressure))
    dependent, multiples = {pressure}, {pressure}
    # Operands come before what is made of them, each once, however often it is used:
    # a law that is made in a loop may use a term a thousand times.
    for node in unique_post_traversal(expression):
        joined = [operand for operand in node.ufl_operands if operand in dependent]
        if not joined:
            continue
        dependent.add(node)
        if multiples.issuperset(joined) and _keeps_multiples(node, joined):
            multiples.add(node)
    if expression not in dependent:
        return CONSTANT
    return PROPORTIONAL if expression in multiples else CONCAVE


def _keeps_multiples(node: Ufl, dependent: list[Ufl]) -> bool:
    """Tell whether a node makes a multiple of the pressure from multiples of it.

    Args:
        node: A UFL expression.
        dependent: Its operands that depend on the pressure.
    """
    operands = node.ufl_operands
    if isinstance(node, Sum):
        return len(dependent) == len(operands)
    # Beside a multiple there may be a factor or a divisor that does not depend on it.
    is_multiplied = isinstance(node, Product) and len(dependent) == 1
    is_divided = isinstance(node, Division) and operands[1] not in dependent
    return is_multiplied or is_divided
