"""Call the user's code when a scene meets its mesh: callables, laws, materials.

An exception that the code raises on one rank becomes an :class:`InputError` on all
ranks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.algorithms.check_arities import ArityMismatch, check_integrand_arity
from ufl.algorithms.remove_complex_nodes import remove_complex_nodes
from ufl.corealg.traversal import unique_post_traversal

from erc_contact.base.exceptions import ErcContactError, InputError, together
from erc_contact.base.runtime.patches import method_caches_off
from erc_contact.base.ufl_types import Ufl
from erc_contact.scene.material import Material, mandel_matrix, tensor_basis
from erc_contact.scene.potential import Potential, gives_conjugate, remembers, tells_convexity
from namedmesh.base.checks import description
from namedmesh.base.communicators import lasting

IN_UFL = (
    "It gets UFL and returns a number or UFL: write ufl.sin(x[0]) or np.sin(x[0]) instead of"
    " math.sin, np.where(x[0] < 1, a, b) or ufl.conditional instead of if, np.maximum and"
    " np.minimum instead of max and min, and ec.table(points, values) instead of np.interp or"
    " scipy."
)
"""Advice to a user whose code does not work with UFL."""
NESTING_LIMIT = 120
"""Levels of nested UFL that can be differentiated and compiled [-].

Python's stack ends at some 160.
"""


def nesting(expression: Ufl) -> int:
    """Count the levels of nested operations in UFL, without recursion."""
    depth: dict[Ufl, int] = {}
    for node in unique_post_traversal(expression):
        depths = [depth[operand] for operand in node.ufl_operands]
        depth[node] = 1 + max(depths, default=0)
    return depth[expression]


def call_of_user(
    comm: MPI.Comm, what: str, function: Callable[..., Any], *arguments: Any, **named: Any
) -> Any:
    """Call a function of the user's with UFL arguments; collective.

    Args:
        comm: Communicator; every rank must call.
        what: Owner of the function, in words for the message.
        function: The function.
        arguments: Its arguments.
        named: Its arguments by name.

    Raises:
        InputError: On all ranks, if the function raises on one.
    """

    def attempt() -> Any:
        try:
            result = function(*arguments, **named)
            levels = nesting(result) if isinstance(result, ufl.core.expr.Expr) else 0
            if levels > NESTING_LIMIT:
                raise InputError(
                    f"{what} is nested {levels} levels deep; UFL follows at most"
                    f" {NESTING_LIMIT}. Write a table of many pieces as a sum of sums, or as fewer"
                    " pieces: ufl.conditional in ufl.conditional nests, a sum term by term, too."
                )
            return result
        except ErcContactError:
            # Errors of the package say already what to do.
            raise
        except Exception as reason:
            raise InputError(
                f"{what} failed with {type(reason).__name__}: {reason}. {IN_UFL}"
            ) from reason

    return together(comm, attempt)


def scalar(what: str, value: Any) -> Ufl:
    """Return a number or a scalar UFL expression as UFL.

    Raises:
        InputError: If the value is neither.
    """
    if isinstance(value, Real):
        value = float(value)
    if isinstance(value, float | ufl.core.expr.Expr):
        expression = ufl.as_ufl(value)
        if not expression.ufl_shape and not expression.ufl_free_indices:
            return expression
    raise InputError(f"{what} returned {description(value)}, which is no scalar. {IN_UFL}")


def vector(value: Any) -> Ufl:
    """Return UFL, or a sequence of numbers and scalar UFL expressions, as UFL."""
    if isinstance(value, ufl.core.expr.Expr):
        return value
    return ufl.as_vector([scalar("A component", component) for component in value])


def linear(what: str, integrand: Ufl, *arguments: Ufl) -> None:
    """Check that an integrand is linear in each of its arguments.

    It is not compiled for that.

    Raises:
        InputError: If it is not linear.
    """
    # UFL's check knows basic operations alone: compound ones and derivatives are
    # carried out first.
    real = remove_complex_nodes(apply_algebra_lowering(integrand))
    with method_caches_off():
        lowered = apply_derivatives(real)
    try:
        check_integrand_arity(lowered, arguments)
    except ArityMismatch as reason:  # no Exception for UFL
        raise InputError(f"{what} must be linear in its argument, and is not: {reason}") from None


def try_potential(comm: MPI.Comm, material: Potential, parameters: Mapping[str, Ufl]) -> None:
    """Call the functions of a potential to see that they work; collective.

    A state is zero.

    Args:
        comm: The ranks.
        material: The material.
        parameters: Its parameters, UFL.

    Raises:
        InputError: If one fails, or returns no scalar.
    """
    what = f"The material {type(material).__name__}"
    tensor = ufl.as_tensor(np.zeros((3, 3)).tolist())
    values = dict(parameters)
    if remembers(material):
        for entry, shape in material.state.items():
            values[entry] = ufl.zero(shape)
    calls = [("potential", (tensor,), values), ("modulus", (), parameters)]
    if gives_conjugate(material):
        calls.append(("conjugate", (tensor,), values))
    if tells_convexity(material):
        calls.append(("convexity", (), parameters))
    for name, arguments, numbers in calls:

        def attempt(
            name: str = name,
            arguments: tuple[Ufl, ...] = arguments,
            numbers: Mapping[str, Ufl] = numbers,
        ) -> Ufl:
            returned = getattr(material, name)(*arguments, **numbers)
            return scalar(f"{what}: {name}", returned)

        call_of_user(comm, f"{what}: {name}", attempt)
    if remembers(material):

        def new_state() -> None:
            new = material.new_state(tensor, **values)
            shapes = {entry: ufl.as_ufl(value).ufl_shape for entry, value in new.items()}
            if shapes != dict(material.state):
                raise InputError(f"{what}: new_state has {shapes}, and state {material.state}.")

        call_of_user(comm, f"{what}: new_state", new_state)


def try_material(
    V: fem.FunctionSpace,
    material: Material,
    parameters: Mapping[str, Ufl],
    strain: Callable[[Ufl], Ufl],
) -> None:
    """Call the functions of a material of the user's to see that they work; collective.

    Args:
        V: Space of the displacement.
        material: The material.
        parameters: Its parameters, UFL.
        strain: Gives the strain of a displacement.

    Raises:
        InputError: If one fails.
    """
    comm = lasting(V.mesh.comm)
    basis = tensor_basis(material, V.mesh.geometry.dim)
    what = f"The material {type(material).__name__}"
    u = ufl.TrialFunction(V)
    v = ufl.TestFunction(V)
    for name in ("stress", "compliance"):
        act = getattr(material, name)
        call_of_user(comm, f"{what}: {name}", mandel_matrix, act, basis, **parameters)

        def product(act: Callable[..., Ufl] = act) -> Ufl:
            return ufl.inner(act(strain(u), **parameters), strain(v))

        integrand = call_of_user(comm, f"{what}: {name}", product)
        linear(f"{what}: {name}", integrand, v, u)

    def modulus() -> Ufl:
        return scalar(f"{what}: modulus", material.modulus(**parameters))

    call_of_user(comm, f"{what}: modulus", modulus)
