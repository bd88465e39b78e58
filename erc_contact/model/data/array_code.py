"""Carry out UFL expressions on numpy arrays, without a compiler.

To compile an expression takes a third of a second, whatever it is, and each gap, load
or friction coefficient of the user is another one. Here an expression becomes a list of
numpy calls, in the order of its operations. Each works on thousands of points at once,
so large meshes are as fast.

An array has an axis for each free index of its node, in the order of UFL, then one for
each axis of its shape, and then the points. That axis has length one for constants.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from dolfinx import fem
from ufl import classes
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

from erc_contact.base.ufl_types import Ufl

POINTS_AT_ONCE = 4096
"""Number of points at which an expression is evaluated at once.

Their arrays stay in the cache, and are small enough for C not to ask the system for
fresh memory each time.
"""
FIELDS = classes.Coefficient | classes.GeometricQuantity
"""What the caller gives the values of."""
SAME = (classes.Variable, classes.Real, classes.Conj)
"""Operators that are their first operand, of real numbers."""
POINTWISE: dict[Any, Callable[..., np.ndarray]] = {
    classes.Sum: np.add,
    classes.Division: np.divide,
    classes.Abs: np.abs,
    classes.MinValue: np.minimum,
    classes.MaxValue: np.maximum,
    classes.Sqrt: np.sqrt,
    classes.Exp: np.exp,
    classes.Ln: np.log,
    classes.Cos: np.cos,
    classes.Sin: np.sin,
    classes.Tan: np.tan,
    classes.Cosh: np.cosh,
    classes.Sinh: np.sinh,
    classes.Tanh: np.tanh,
    classes.Acos: np.arccos,
    classes.Asin: np.arcsin,
    classes.Atan: np.arctan,
    classes.Atan2: np.arctan2,
    classes.LT: np.less,
    classes.LE: np.less_equal,
    classes.GT: np.greater,
    classes.GE: np.greater_equal,
    classes.EQ: np.equal,
    classes.NE: np.not_equal,
    classes.AndCondition: np.logical_and,
    classes.OrCondition: np.logical_or,
    classes.NotCondition: np.logical_not,
    classes.Conditional: np.where,
}
"""Operators that act on each number by itself, and how numpy calls them."""


class UnknownOperatorError(Exception):
    """Tell that an expression has an operator that only the compiler knows."""


class ArrayCode:
    """Hold a UFL expression as a list of numpy calls.

    Args:
        expression: UFL expression without derivatives of functions.

    Attributes:
        shape: Its shape.
        fields: What the caller gives values of: functions and geometric quantities.

    Raises:
        UnknownOperatorError: If an operator has no numpy call here.
    """

    def __init__(self, expression: Ufl) -> None:
        expression = apply_algebra_lowering(expression)
        self.shape = expression.ufl_shape
        self.fields: dict[Ufl, int] = {}
        self._plain: list[Any] = []
        self._constants: list[tuple[int, fem.Constant]] = []
        self._calls: list[tuple[int, Callable[..., np.ndarray], list[int]]] = []
        places: dict[Ufl, int] = {}
        for node in _in_order(expression):
            place = len(self._plain)
            places[node] = place
            self._plain.append(None)
            if isinstance(node, FIELDS):
                self.fields[node] = place
            elif isinstance(node, fem.Constant):
                self._constants.append((place, node))
            elif isinstance(node, classes.ConstantValue):
                self._plain[place] = _plain(node)
            else:
                operands = [places[o] for o in node.ufl_operands if o in places]
                self._calls.append((place, self._call_of(node), operands))

    def __call__(self, fields: Mapping[Ufl, np.ndarray], count: int) -> np.ndarray:
        """Evaluate the expression at points.

        Args:
            fields: Values of :attr:`fields`, of shape (count, size).
            count: Number of points.

        Returns:
            Values, shape (count, *s).
        """
        result = np.empty((*self.shape, count))
        values = self._plain.copy()
        for place, constant in self._constants:
            values[place] = constant.value[..., None]
        # As in C, the branch that a conditional does not take may divide by zero.
        with np.errstate(all="ignore"):
            for start in range(0, count, POINTS_AT_ONCE):
                chunk = slice(start, start + POINTS_AT_ONCE)
                for field, place in self.fields.items():
                    at_points = np.ascontiguousarray(fields[field][chunk].T)
                    values[place] = at_points.reshape(*field.ufl_shape, -1)
                for place, call, operands in self._calls:
                    values[place] = call(*[values[operand] for operand in operands])
                result[..., chunk] = values[-1]
        return np.moveaxis(result, -1, 0)

    def _call_of(self, node: Ufl) -> Callable[..., Any]:
        """Return the function of the operands that a node of an expression is.

        Raises:
            UnknownOperatorError: If there is none here.
        """
        if type(node) in POINTWISE:
            return POINTWISE[type(node)]
        if isinstance(node, SAME):
            return lambda value: value
        if type(node) in WITH_INDICES:
            return WITH_INDICES[type(node)](node)
        raise UnknownOperatorError(str(node))


def array_code(expression: Ufl) -> ArrayCode | None:
    """Return an expression as numpy calls, or None if it has an unknown operator."""
    try:
        return ArrayCode(expression)
    except UnknownOperatorError:
        return None


def _in_order(expression: Ufl) -> list[Ufl]:
    """Return the nodes of an expression, each once and after its operands.

    Indices and labels are left out.
    """
    nodes: dict[Ufl, None] = {}
    todo = [(expression, False)]
    while todo:
        node, is_ready = todo.pop()
        if node in nodes or isinstance(node, classes.MultiIndex | classes.Label):
            continue
        if is_ready or isinstance(node, FIELDS):
            nodes[node] = None
            continue
        todo.append((node, True))
        todo += [(operand, False) for operand in node.ufl_operands]
    return list(nodes)


def _plain(node: Ufl) -> np.ndarray:
    """Return the value of a number, a zero or an identity matrix."""
    if isinstance(node, classes.Zero):
        return np.zeros((*node.ufl_index_dimensions, *node.ufl_shape, 1))
    if isinstance(node, classes.Identity):
        return np.eye(node.ufl_shape[0])[..., None]
    if isinstance(node, classes.RealValue):
        return np.full(1, float(node))
    raise UnknownOperatorError(str(node))


def _power(node: Ufl) -> Callable[..., np.ndarray]:
    """Return a power; numpy makes a square of an exponent that is the number 2."""
    exponent = node.ufl_operands[1]
    if isinstance(exponent, classes.RealValue):
        number = exponent.value()
        return lambda base, _: base**number
    return np.power


def _product(node: Ufl) -> Callable[..., np.ndarray]:
    """Return the product of two scalars, each with its free indices."""
    first, second = (_axes(factor.ufl_free_indices, node) for factor in node.ufl_operands)
    return lambda a, b: a[first] * b[second]


def _axes(free: tuple[int, ...], node: Ufl) -> tuple[Any, ...]:
    """Return the numpy index that gives an array the free indices of a node."""
    axes = [slice(None) if index in free else None for index in node.ufl_free_indices]
    return (*axes, ...)


def _indexed(node: Ufl) -> Callable[..., np.ndarray]:
    """Return the entries of a tensor that have some of its indices."""
    tensor, indices = node.ufl_operands
    names = list(tensor.ufl_free_indices)
    key: list[Any] = [slice(None)] * len(names)
    for index in indices:
        fixed = isinstance(index, classes.FixedIndex)
        key.append(int(index) if fixed else slice(None))
        if not fixed:
            names.append(index.count())
    taken = tuple(key)
    free = node.ufl_free_indices
    if tuple(names) == free:
        return lambda value: value[taken]
    # einsum also takes the diagonal, where an index stands twice.
    letters = {name: chr(ord("a") + k) for k, name in enumerate(free)}
    old = "".join(letters[name] for name in names)
    new = "".join(letters[name] for name in free)
    return lambda value: np.einsum(f"{old}...->{new}...", value[taken])


def _index_sum(node: Ufl) -> Callable[..., np.ndarray]:
    """Return the sum over an index."""
    summand, index = node.ufl_operands
    axis = summand.ufl_free_indices.index(index[0].count())
    return lambda value: value.sum(axis=axis)


def _component_tensor(node: Ufl) -> Callable[..., np.ndarray]:
    """Return the tensor of an expression with free indices."""
    entry, indices = node.ufl_operands
    free = entry.ufl_free_indices
    axes = [free.index(index) for index in node.ufl_free_indices]
    axes += [free.index(index.count()) for index in indices]
    return lambda value: value.transpose(*axes, value.ndim - 1)


def _list_tensor(node: Ufl) -> Callable[..., np.ndarray]:
    """Return the tensor of its rows."""
    axis = len(node.ufl_free_indices)
    return lambda *rows: np.stack(np.broadcast_arrays(*rows), axis=axis)


WITH_INDICES: dict[Any, Callable[[Ufl], Callable[..., np.ndarray]]] = {
    classes.Power: _power,
    classes.Product: _product,
    classes.IndexSum: _index_sum,
    classes.Indexed: _indexed,
    classes.ComponentTensor: _component_tensor,
    classes.ListTensor: _list_tensor,
}
"""Operators whose numpy call depends on their exponent or their indices."""
