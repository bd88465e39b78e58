"""What users bring as code: callables, laws and materials in UFL, tried when a scene and a mesh meet.

What they raise, on whatever rank, becomes an :class:`InputError` on all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from mpi4py import MPI

from erc_contact.exceptions import ErcContactError, InputError, raise_together, together
from erc_contact.expressions import evaluate
from erc_contact.material import mandel_matrix
from erc_contact.simplex import nodes

if TYPE_CHECKING:
    from erc_contact.model import Model

IN_UFL = (
    "It gets UFL and returns a number or UFL: write ufl.sin(x[0]) instead of np.sin or math.sin, "
    "ufl.conditional(ufl.lt(x[0], 1), a, b) instead of if, ufl.max_value and ufl.min_value instead of max and min."
)
SKEW = 1e-8
"""Deviation from symmetry that counts as round-off, over the largest entry [-]."""
DEFINITE = 1e-12
"""Least eigenvalue that counts as positive, over the largest entry [-]."""


def called(comm: MPI.Comm, what: str, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """What a function of the user's returns for UFL arguments; collective.

    Args:
        comm: Communicator; every rank must call.
        what: Whose function it is, for the message.
        function: The function.
        arguments: Its arguments.
        named: Its arguments by name.

    Raises:
        InputError: On all ranks, if it fails on one.
    """

    def attempt() -> Any:
        try:
            return function(*arguments, **named)
        except ErcContactError:
            raise
        except Exception as reason:
            raise InputError(f"{what} failed with {type(reason).__name__}: {reason}. {IN_UFL}") from reason

    return together(comm, attempt)


def scalar(what: str, value: Any) -> Any:
    """A number or scalar UFL expression as UFL.

    Raises:
        InputError: If it is neither.
    """
    value = float(value) if isinstance(value, Real) else value
    if (
        not isinstance(value, float | ufl.core.expr.Expr)
        or ufl.as_ufl(value).ufl_shape
        or ufl.as_ufl(value).ufl_free_indices
    ):
        raise InputError(f"{what} returned {value!r}, which is no scalar. {IN_UFL}")
    return ufl.as_ufl(value)


def vector(value: Any) -> Any:
    """UFL, or a sequence of numbers and scalar UFL expressions, as UFL."""
    return value if isinstance(value, ufl.core.expr.Expr) else ufl.as_vector([scalar("A component", c) for c in value])


def check_material(model: Model) -> None:
    """Try a material of the user's: its functions work, its stiffness is symmetric and positive definite; collective.

    Args:
        model: Its parameters are bound; nothing else is needed.

    Raises:
        InputError: If not, in the middle of a cell.
    """
    material, comm, d = model.scene.material, model.comm, model.d
    what = f"The material {type(material).__name__}"
    for name in ("stress", "compliance"):
        called(comm, f"{what}: {name}", mandel_matrix, getattr(material, name), d, **model.parameters)
    modulus = called(comm, f"{what}: modulus", lambda: scalar("It", material.modulus(**model.parameters)))
    matrix = called(comm, f"{what}: stress", mandel_matrix, material.stress, d, **model.parameters)
    middle, owned = nodes(d, 0), np.arange(model.domain.owned_cells, dtype=np.int32)
    stiffness = evaluate(matrix, model.domain, middle, owned)[:, 0]
    size = abs(stiffness).max(axis=(1, 2))
    error = None
    with np.errstate(invalid="ignore"):
        skew = abs(stiffness - stiffness.swapaxes(1, 2)).max(axis=(1, 2)) > SKEW * size
    if not np.isfinite(stiffness).all():
        error = InputError(f"{what}: the stiffness is not finite everywhere; look at its stress and its parameters.")
    elif skew.any():
        error = InputError(
            f"{what}: the stiffness is not symmetric, in orthonormal (Mandel) components it is "
            f"{np.array2string(stiffness[skew][0], precision=4)} somewhere; the stress must derive from an energy."
        )
    elif len(size) and (least := np.linalg.eigvalsh(stiffness)[:, 0] / size).min() <= DEFINITE:
        error = InputError(
            f"{what}: the stiffness is not positive definite: its least eigenvalue is {least.min():.1e} of its largest "
            "entry somewhere; the energy of a strain must be > 0."
        )
    elif not (evaluate(modulus, model.domain, middle, owned) > 0).all():
        error = InputError(f"{what}: the modulus is not > 0 everywhere; it scales the contact parameters.")
    raise_together(comm, error)
