"""Check names, numbers and vectors of a scene.

Callables are checked on the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from math import isfinite
from numbers import Real
from typing import Any

import numpy as np
import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Value

ROUND_OFF = 1e-12
"""Part of the greatest component that counts as none [-].

A vector or tensor that a user has turned has such a part where it should have a zero.
"""

Vector = Sequence[Value] | Callable[[Any], Any]
"""d values, or a callable of x that returns a vector (UFL or a sequence)."""


def check_name(what: str, name: Any) -> None:
    """Check that a value is the name of a boundary part."""
    if not isinstance(name, str):
        raise InputError(
            f"{what} is for {name!r}; give the name of one boundary part, e.g. {what}('top', ...)."
        )


def check_region(what: str, name: Any) -> None:
    """Check that a value is the name of a cell region, or None."""
    if name is not None and not isinstance(name, str):
        raise InputError(
            f"{what} has the region {name!r}; give the name of one cell region, or leave it out"
            " for the whole body."
        )


def check_value(what: str, value: Any, low: float = -float("inf"), unit: str = "") -> None:
    """Check that a value is a number, or a callable.

    Args:
        what: The value, in words for messages.
        value: The value.
        low: Least number that is allowed.
        unit: Unit, in words for messages.
    """
    _check_no_ufl(what, value)
    if callable(value):
        return
    if not isinstance(value, Real) or not isfinite(value) or value < low:
        bound = f" >= {low:g}" if isfinite(low) else ""
        raise InputError(
            f"{what} is {value!r}; give a finite number{bound}{unit}, or a callable of x."
        )


def has_callable(value: Any) -> bool:
    """Tell whether a value is a callable of x, or has any in it."""
    if callable(value):
        return True
    if isinstance(value, Mapping):
        return any(map(has_callable, value.values()))
    if isinstance(value, tuple | list):
        return any(map(has_callable, value))
    if is_dataclass(value) or hasattr(value, "parameters"):
        return any(map(has_callable, getattr(value, "__dict__", {}).values()))
    return False


def check_vector(what: str, value: Any, *, free: bool = False) -> None:
    """Check that a value is a sequence of two or three numbers or callables.

    Args:
        what: The vector, in words for messages.
        value: The value, or a callable.
        free: Whether a component may be None.
    """
    _check_no_ufl(what, value)
    if callable(value):
        return
    is_sequence = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
    if not is_sequence or len(value) not in (2, 3):
        raise InputError(
            f"{what} is {value!r}; give one value for each dimension, e.g. (0.0, -1.0),"
            " or a callable."
        )
    for component in value:
        if not (free and component is None):
            check_value(f"{what}: a component", component)


def round_off(components: Iterable[Any]) -> float:
    """Return what is round-off beside components, of which callables do not count."""
    numbers = [abs(float(value)) for value in components if isinstance(value, Real)]
    return ROUND_OFF * max(numbers, default=0.0)


def _check_no_ufl(what: str, value: Any) -> None:
    """Check that a value is no UFL: it would live on one mesh."""
    if isinstance(value, ufl.core.expr.Expr):
        raise InputError(
            f"{what} is UFL or a Function; give a callable of x that returns it,"
            " e.g. lambda x: value."
        )
