"""Call a user's function of the position with UFL, also if it is written for numpy.

A function of numbers, ``lambda x: np.sin(x[0])``, knows nothing of UFL. It is called
with coordinates that stand for UFL: numpy hands them what it is asked for, and they
write it down in UFL. So the result is exact, and has derivatives. What numpy cannot
hand on, as ``np.interp`` and functions of scipy, needs values: a table.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl
from numpy.lib.mixins import NDArrayOperatorsMixin
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction
from ufl.corealg.traversal import unique_pre_traversal

from erc_contact.base.ufl_types import Ufl


def field_of(function: Callable[[Any], Any], x: Ufl) -> Any:
    """Return what a function of the position returns, in UFL.

    Args:
        function: The function, written for UFL or for numpy.
        x: The position, UFL, shape (d,).

    Raises:
        Exception: What the function raises with UFL, if it works with neither.
    """
    try:
        return with_counted_conditions(function(x))
    except (TypeError, ValueError, AttributeError) as reason:
        coordinates = np.empty(x.ufl_shape[0], dtype=object)
        for i in range(len(coordinates)):
            coordinates[i] = Traced(x[i])
        try:
            return _in_ufl(function(coordinates))
        except Exception:
            # What it does with UFL tells more to those who know UFL.
            raise reason from None


def with_counted_conditions(value: Any) -> Any:
    """Replace conditions that stand where a number does by 1 where they hold, else 0.

    So ``2.0 * (x[0] > 1.0)`` has in UFL the value that it has in numpy.

    Args:
        value: UFL, a number, or a list or tuple of these.
    """
    if isinstance(value, list | tuple):
        return type(value)(with_counted_conditions(entry) for entry in value)
    if not isinstance(value, ufl.core.expr.Expr):
        return value
    nodes = list(unique_pre_traversal(value))
    if not any(isinstance(node, ufl.classes.Condition) for node in nodes):
        return value
    return _counted(map_expr_dag(_CountedConditions(), value))


class _CountedConditions(MultiFunction):
    """Rebuild UFL with conditions that are numbers where operators ask for numbers."""

    def terminal(self, terminal: Ufl) -> Ufl:
        """Return numbers, coordinates and functions as they are."""
        return terminal

    def expr(self, operator: Ufl, *operands: Ufl) -> Ufl:
        """Return an operator of numbers."""
        return self.reuse_if_untouched(operator, *map(_counted, operands))

    def conditional(self, operator: Ufl, condition: Ufl, *values: Ufl) -> Ufl:
        """Return a choice between numbers."""
        return self.reuse_if_untouched(operator, condition, *map(_counted, values))

    # And, Or and Not ask for conditions.
    and_condition = or_condition = not_condition = MultiFunction.reuse_if_untouched


class Traced(NDArrayOperatorsMixin):
    """Stand for a scalar of UFL in functions of numpy.

    Args:
        expression: The scalar, or a condition.
    """

    def __init__(self, expression: Ufl) -> None:
        self.expression = expression

    def __bool__(self) -> bool:
        """Refuse ``if`` and ``max``, which would take one side everywhere."""
        raise ValueError("a condition on the position has no truth value; use np.where")

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **named: Any) -> Any:
        """Write down a function of numpy, such as ``np.sin`` or an operator."""
        arrays = [entry for entry in inputs if isinstance(entry, np.ndarray) and entry.ndim]
        if method != "__call__" or named or ufunc not in FUNCTIONS:
            return NotImplemented
        if arrays:
            return _of_entries(ufunc, inputs)
        return Traced(FUNCTIONS[ufunc](*map(_in_ufl, inputs)))

    def __array_function__(self, function: Any, types: Any, inputs: Any, named: Any) -> Any:
        """Write down a function of arrays, such as ``np.where``."""
        if function not in FUNCTIONS or named:
            return NotImplemented
        return Traced(FUNCTIONS[function](*map(_in_ufl, inputs)))

    def __getattr__(self, name: str) -> Any:
        """Return a function as a method, which numpy calls for entries of arrays."""
        ufunc: Any = getattr(np, name, None)
        if ufunc not in FUNCTIONS:
            raise AttributeError(name)
        return lambda *others: ufunc(self, *others)


def _of_entries(ufunc: Any, inputs: tuple[Any, ...]) -> np.ndarray:
    """Write down a function for each entry of arrays."""
    boxed = []
    for entry in inputs:
        box = np.empty((), dtype=object)
        box[()] = entry
        boxed.append(entry if isinstance(entry, np.ndarray) else box)
    spread = np.broadcast_arrays(*boxed)
    result = np.empty(spread[0].shape, dtype=object)
    for place in np.ndindex(result.shape):
        result[place] = Traced(FUNCTIONS[ufunc](*[_in_ufl(array[place]) for array in spread]))
    return result


def _in_ufl(value: Any) -> Any:
    """Return what numpy's functions returned as UFL; numbers stay as they are."""
    if isinstance(value, Traced):
        return value.expression
    if isinstance(value, np.ndarray):
        return _in_ufl(value.tolist())
    if isinstance(value, list | tuple):
        return type(value)(_in_ufl(entry) for entry in value)
    return value


def _counted(value: Ufl) -> Ufl:
    """Return UFL; a condition is 1 where it holds, and 0 elsewhere."""
    is_condition = isinstance(value, ufl.classes.Condition)
    return ufl.conditional(value, 1.0, 0.0) if is_condition else value


def _number(value: Any) -> Ufl:
    """Return a scalar, also of a condition."""
    return _counted(ufl.as_ufl(float(value) if isinstance(value, bool | np.bool) else value))


def _of_numbers(function: Callable[..., Ufl]) -> Callable[..., Ufl]:
    """Return a function whose arguments may be conditions."""
    return lambda *arguments: function(*map(_number, arguments))


def _clip(value: Ufl, low: Any, high: Any) -> Ufl:
    """Return a value between two limits, of which None is none."""
    if low is not None:
        value = ufl.max_value(value, low)
    return value if high is None else ufl.min_value(value, high)


NUMBERS: dict[Any, Callable[..., Ufl]] = {
    np.add: lambda a, b: a + b,
    np.subtract: lambda a, b: a - b,
    np.multiply: lambda a, b: a * b,
    np.divide: lambda a, b: a / b,
    np.power: lambda a, b: a**b,
    np.float_power: lambda a, b: a**b,
    np.square: lambda a: a * a,
    np.reciprocal: lambda a: 1 / a,
    np.negative: lambda a: -a,
    np.positive: lambda a: a,
    np.absolute: abs,
    np.fabs: abs,
    np.sign: ufl.sign,
    np.sqrt: ufl.sqrt,
    np.exp: ufl.exp,
    np.log: ufl.ln,
    np.log1p: lambda a: ufl.ln(1 + a),
    np.log10: lambda a: ufl.ln(a) / np.log(10.0),
    np.sin: ufl.sin,
    np.cos: ufl.cos,
    np.tan: ufl.tan,
    np.arcsin: ufl.asin,
    np.arccos: ufl.acos,
    np.arctan: ufl.atan,
    np.arctan2: ufl.atan2,
    np.sinh: ufl.sinh,
    np.cosh: ufl.cosh,
    np.tanh: ufl.tanh,
    np.hypot: lambda a, b: ufl.sqrt(a * a + b * b),
    np.maximum: ufl.max_value,
    np.minimum: ufl.min_value,
    np.less: ufl.lt,
    np.less_equal: ufl.le,
    np.greater: ufl.gt,
    np.greater_equal: ufl.ge,
    np.zeros_like: lambda a: 0.0 * a,
    np.ones_like: lambda a: 0.0 * a + 1.0,
}
"""Functions of numpy whose arguments are numbers."""
FUNCTIONS: dict[Any, Callable[..., Ufl]] = {
    **{function: _of_numbers(in_ufl) for function, in_ufl in NUMBERS.items()},
    np.bitwise_and: ufl.And,
    np.logical_and: ufl.And,
    np.bitwise_or: ufl.Or,
    np.logical_or: ufl.Or,
    np.invert: ufl.Not,
    np.logical_not: ufl.Not,
    np.where: lambda condition, a, b: ufl.conditional(condition, _number(a), _number(b)),
    np.clip: _clip,
}
"""Functions of numpy, and how they are written in UFL."""
