"""Calls of the user's code: callables, laws and materials in UFL, tried when a scene meets its mesh.

An exception that the code raises on one rank becomes an :class:`InputError` on all
ranks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any

import ufl
from dolfinx import fem
from mpi4py import MPI
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.algorithms.check_arities import ArityMismatch, check_integrand_arity
from ufl.algorithms.remove_complex_nodes import remove_complex_nodes
from ufl.corealg.traversal import unique_post_traversal

from erc_contact.base.checks import description
from erc_contact.base.exceptions import ErcContactError, InputError, together
from erc_contact.base.runtime.patches import method_caches_off
from erc_contact.scene.material import Material, mandel_matrix, strain

IN_UFL = (
    "It gets UFL and returns a number or UFL: write ufl.sin(x[0]) instead of np.sin or math.sin, "
    "ufl.conditional(ufl.lt(x[0], 1), a, b) instead of if, ufl.max_value and ufl.min_value instead of max and min."
)


LEVELS = 120
"""Levels of nested UFL that can be differentiated and compiled; Python's stack ends at some 160 [-]."""


def levels(expression: Any) -> int:
    """Number of levels of nested operations in UFL, without recursion."""
    depth: dict[Any, int] = {}
    for node in unique_post_traversal(expression):
        depth[node] = 1 + max((depth[operand] for operand in node.ufl_operands), default=0)
    return depth[expression]


def call_of_user(
    comm: MPI.Comm, what: str, function: Callable[..., Any], *arguments: Any, **named: Any
) -> Any:
    """Call a function of the user's with UFL arguments and return its result; collective.

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
            if isinstance(result, ufl.core.expr.Expr) and levels(result) > LEVELS:
                raise InputError(
                    f"{what} is nested {levels(result)} levels deep; UFL follows at most {LEVELS}. Write a table of "
                    "many pieces as a sum of sums, or as fewer pieces: ufl.conditional in ufl.conditional nests, a sum "
                    "term by term, too."
                )
            return result
        except ErcContactError:
            raise
        except Exception as reason:
            raise InputError(
                f"{what} failed with {type(reason).__name__}: {reason}. {IN_UFL}"
            ) from reason

    return together(comm, attempt)


def scalar(what: str, value: Any) -> Any:
    """A number or a scalar UFL expression, as UFL.

    Raises:
        InputError: If the value is neither.
    """
    value = float(value) if isinstance(value, Real) else value
    if (
        not isinstance(value, float | ufl.core.expr.Expr)
        or ufl.as_ufl(value).ufl_shape
        or ufl.as_ufl(value).ufl_free_indices
    ):
        raise InputError(f"{what} returned {description(value)}, which is no scalar. {IN_UFL}")
    return ufl.as_ufl(value)


def vector(value: Any) -> Any:
    """A UFL expression, or a sequence of numbers and scalar UFL expressions, as UFL."""
    return (
        value
        if isinstance(value, ufl.core.expr.Expr)
        else ufl.as_vector([scalar("A component", c) for c in value])
    )


def linear(what: str, integrand: Any, *arguments: Any) -> None:
    """Check that an integrand is linear in each of its arguments, before it is compiled.

    Raises:
        InputError: If it is not linear.
    """
    real = remove_complex_nodes(apply_algebra_lowering(integrand))
    with method_caches_off():
        lowered = apply_derivatives(real)
    try:
        check_integrand_arity(lowered, arguments)
    except ArityMismatch as reason:  # no Exception for UFL
        raise InputError(f"{what} must be linear in its argument, and is not: {reason}") from None


def try_material(V: fem.FunctionSpace, material: Material, parameters: Mapping[str, Any]) -> None:
    """Call the functions of a material of the user's to see that they work; collective.

    Args:
        V: Space of the displacement.
        material: The material.
        parameters: Its parameters, UFL.

    Raises:
        InputError: If one fails.
    """
    comm, what = V.mesh.comm, f"The material {type(material).__name__}"
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    for name in ("stress", "compliance"):
        act = getattr(material, name)
        call_of_user(comm, f"{what}: {name}", mandel_matrix, act, V.mesh.geometry.dim, **parameters)
        product = call_of_user(
            comm,
            f"{what}: {name}",
            lambda act=act: ufl.inner(act(strain(u), **parameters), strain(v)),
        )
        linear(f"{what}: {name}", product, v, u)
    call_of_user(
        comm, f"{what}: modulus", lambda: scalar(f"{what}: modulus", material.modulus(**parameters))
    )
