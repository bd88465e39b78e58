"""Bound data inside pieces of cells, by interval arithmetic.

Samples do not tell what data do between them. An expression of the position does: each
operation takes the ranges of its operands to a range that contains all its results. So
the range of an expression is proved, if perhaps too wide; it becomes narrow as pieces
become small.

What is linear in a piece has its extremes at the vertices, so that a function of one
direction has its exact range. The range of another polynomial in a cell is the hull of
its Bernstein coefficients on the piece, and the range of a table the hull of its points
in the range of its coordinates. Operations on several numbers take their ranges as if
they were independent, so that the range is too wide by a part of its width. A smooth
function therefore also has the range of its tangent at the middle, and of what its
slopes differ from the slopes there, which is too wide by a term of second order:

    f(x)  in  f(c) + f'(c) (x - c) + ([f'] - f'(c)) (x - c).

Symbols: n pieces, v = d+1 number of their vertices, d dimension.

Source: Moore, Kearfott, Cloud, "Introduction to Interval Analysis", SIAM (2009).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import ufl
from dolfinx import mesh as dmesh
from ufl import classes
from ufl.corealg.traversal import unique_pre_traversal

from erc_contact.base.ufl_tables import TableFunction
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.array_code import SAME, WITH_INDICES, ArrayCode, UnknownOperatorError
from erc_contact.model.data.expressions import Everywhere, at_cells, function_at, is_polynomial
from erc_contact.model.data.symbolic import (
    constant_value,
    varies,
    varies_in_cells,
    without_derivatives,
)
from erc_contact.model.data.tables import on_mesh
from namedmesh.simplex import barycentric, coefficients, nodes

MOST_POINTS = 2500
"""Greatest number of points of a table whose range is looked for, to save time."""


class Range(NamedTuple):
    """Hold the ranges of a value in pieces.

    Attributes:
        low: The least value, of a condition whether it surely holds, shape (*s, n), or
            (*s, 1) of a constant.
        high: The greatest value, of a condition whether it may hold.
        at_vertices: The values at the vertices of all pieces, shape (*s, n v), where
            the value is linear in each piece, (*s, 1) of a constant; else None.
    """

    low: np.ndarray
    high: np.ndarray
    at_vertices: np.ndarray | None = None

    @property
    def is_constant(self) -> bool:
        """Tell whether the value is the same everywhere."""
        return self.at_vertices is not None and self.at_vertices.shape[-1] == 1


class Ranges:
    """Bound a scalar UFL expression in pieces of cells.

    Args:
        expression: UFL, functions in it without derivatives.
        mesh: Where it lives. Construction is collective; evaluation is not.

    Raises:
        UnknownOperatorError: If an operation or a function in it is not known here.
    """

    def __init__(self, expression: Ufl, mesh: dmesh.Mesh) -> None:
        expression = on_mesh(without_derivatives(expression), mesh, at_cells)
        self._plain = None if varies(expression) else float(constant_value(expression))
        if self._plain is not None:
            return
        self._code = _RangeCode(expression)
        self._tangent = _tangent_of(expression, mesh)
        self._of_tables: dict[Ufl, _TableRanges] = {}
        for field in self._code.fields:
            if isinstance(field, TableFunction):
                self._of_tables[field] = _TableRanges(field, mesh)
            elif isinstance(field, classes.Coefficient):
                if varies_in_cells(field) and not is_polynomial(field):
                    raise UnknownOperatorError(str(field))
            elif not isinstance(field, classes.SpatialCoordinate):
                raise UnknownOperatorError(str(field))

    def __call__(self, corners: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the greatest value in pieces.

        Args:
            corners: Their vertices [length], shape (n, v, d).
            cells: The cells in which they lie, shape (n,).

        Returns:
            Shape (n,) each.
        """
        if self._plain is not None:
            same = np.full(len(corners), self._plain)
            return same, same
        fields = {field: self._of(field, corners, cells) for field in self._code.fields}
        low, high, at_vertices = self._code.range_of(fields, corners.shape[1])
        if self._tangent is not None and at_vertices is None:
            of_tangent = self._tangent(corners, cells)
            low = np.maximum(low, of_tangent.low)
            high = np.minimum(high, of_tangent.high)
        return np.broadcast_to(low, len(corners)), np.broadcast_to(high, len(corners))

    def _of(self, field: Ufl, corners: np.ndarray, cells: np.ndarray) -> Range:
        """Return the range of a field."""
        if field in self._of_tables:
            return self._of_tables[field](corners, cells)
        values = corners
        if isinstance(field, classes.Coefficient):
            values = bernstein_coefficients(field, corners, cells)
        n, count, size = values.shape
        shape = field.ufl_shape
        low = values.min(axis=1).T.reshape(*shape, n)
        high = values.max(axis=1).T.reshape(*shape, n)
        if count != corners.shape[1]:
            return Range(low, high)
        return Range(low, high, values.reshape(n * count, size).T.reshape(*shape, n * count))


def ranges_of(expression: Ufl, mesh: dmesh.Mesh) -> Ranges | None:
    """Return the ranges of an expression, None where they are not known; collective."""
    try:
        return Ranges(expression, mesh)
    except UnknownOperatorError:
        return None


def bernstein_coefficients(field: Any, corners: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Compute Bernstein coefficients of a function in pieces of cells, (n, m, size)."""
    d = corners.shape[2]
    degree = field.ufl_element().embedded_superdegree
    x = np.matmul(barycentric(nodes(d, degree)), corners) if degree else corners[:, :1]
    size = int(np.prod(field.ufl_shape))
    values = function_at(field, x, cells).reshape(*x.shape[:2], size)
    return np.matmul(coefficients(d, degree), values) if degree else values


def _tangent_of(expression: Ufl, mesh: dmesh.Mesh) -> _TangentRanges | None:
    """Return the ranges of an expression by its slopes, None where it may jump."""
    jumps = (classes.Conditional, classes.Coefficient)
    if any(isinstance(node, jumps) for node in unique_pre_traversal(expression)):
        return None
    try:
        return _TangentRanges(expression, mesh)
    except UnknownOperatorError:
        return None


class _TangentRanges:
    """Bound a smooth function of the position by its tangent and its slopes.

    Args:
        expression: The function, scalar UFL.
        mesh: Where it lives. Construction is collective; evaluation is not.

    Raises:
        UnknownOperatorError: If a slope has no known range.
    """

    def __init__(self, expression: Ufl, mesh: dmesh.Mesh) -> None:
        x = ufl.SpatialCoordinate(mesh)
        slopes = without_derivatives(ufl.grad(expression))
        self._position = x
        self._codes = [_RangeCode(slopes[i]) for i in range(mesh.geometry.dim)]
        self._value = Everywhere(expression, mesh)
        self._slopes = Everywhere(slopes, mesh)

    def __call__(self, corners: np.ndarray, cells: np.ndarray) -> Range:
        """Return the least and the greatest value in pieces, shape (n,) each."""
        n, count, d = corners.shape
        middle = corners.mean(axis=1, keepdims=True)
        at_vertices = corners.reshape(n * count, d).T
        box = Range(corners.min(axis=1).T, corners.max(axis=1).T, at_vertices)
        away = corners - middle
        slope = self._slopes(middle, cells)[:, 0]
        tangent = self._value(middle, cells).reshape(n, 1) + np.einsum("nvd,nd->nv", away, slope)
        remainder = np.zeros(n)
        for axis, code in enumerate(self._codes):
            low, high, _ = code.range_of({self._position: box}, count)
            differs = np.maximum(high - slope[:, axis], slope[:, axis] - low)
            remainder += differs * abs(away[:, :, axis]).max(axis=1)
        # What is no number may be anything.
        remainder = np.where(np.isfinite(remainder), remainder, np.inf)
        return Range(tangent.min(axis=1) - remainder, tangent.max(axis=1) + remainder)


class _TableRanges:
    """Bound a table in pieces of cells; collective to make.

    Args:
        table: The Function that stands for it.
        mesh: Where it lives.

    Raises:
        UnknownOperatorError: If it is a slope, has too many points, or a coordinate has
            no known range.
    """

    def __init__(self, table: TableFunction, mesh: dmesh.Mesh) -> None:
        if table.data.slope is not None:
            raise UnknownOperatorError("the slope of a table")
        (count,) = table.coordinates.ufl_shape
        self._of_coordinates = [Ranges(table.coordinates[i], mesh) for i in range(count)]
        self._source = table.data.source
        self._points = self._source.kinks
        if np.prod([len(points) for points in self._points]) > MOST_POINTS:
            raise UnknownOperatorError("a table of many points")

    def __call__(self, corners: np.ndarray, cells: np.ndarray) -> Range:
        """Return the least and the greatest value in pieces, shape (n,) each.

        Between its points a table is linear in each coordinate. So its extremes in a
        box are at the points and at the ends of the box.
        """
        grids = []
        for of_coordinate, points in zip(self._of_coordinates, self._points, strict=True):
            low, high = of_coordinate(corners, cells)
            inside = np.clip(points, low[:, None], high[:, None])
            grids.append(np.column_stack([low, inside, high]))
        along = [grid.shape[1] for grid in grids]
        numbers = np.indices(along).reshape(len(grids), -1)
        places = [grid[:, number] for grid, number in zip(grids, numbers, strict=True)]
        values = self._source.interpolated(np.stack(places, axis=-1))
        return Range(values.min(axis=1), values.max(axis=1))


class _RangeCode(ArrayCode):
    """Carry out an expression on ranges, see :class:`.array_code.ArrayCode`."""

    def _call_of(self, node: Ufl) -> Callable[..., Any]:
        """Return what an operation does to the ranges of its operands."""
        kind = type(node)
        if isinstance(node, SAME):
            return lambda a: a
        if kind in RANGES:
            return RANGES[kind]
        if kind in OF_OPERANDS:
            return OF_OPERANDS[kind](node)
        if kind not in WITH_INDICES:
            raise UnknownOperatorError(str(node))
        # It takes entries, or adds them up: of least values as of greatest values.
        call = WITH_INDICES[kind](node)

        def each(*operands: Range) -> Range:
            low = call(*[a.low for a in operands])
            high = call(*[a.high for a in operands])
            return Range(low, high, _if_linear(call, *operands))

        return each

    def range_of(self, fields: dict[Ufl, Range], vertices: int) -> Range:
        """Evaluate the range of the expression for ranges of its fields.

        Args:
            fields: The ranges.
            vertices: Number of vertices of a piece.
        """
        values: list[Any] = [None if x is None else Range(x, x, x) for x in self._plain]
        for place, constant in self._constants:
            value = constant.value[..., None]
            values[place] = Range(value, value, value)
        for field, place in self.fields.items():
            values[place] = fields[field]
        with np.errstate(all="ignore"):
            for place, call, operands in self._calls:
                found: Any = call(*[values[operand] for operand in operands])
                values[place] = _known(found, vertices)
        result: Range = values[-1]
        return result


def _known(value: Range, vertices: int) -> Range:
    """Return a range that is exact where the value is linear, and has no nan."""
    low, high, at_vertices = value
    if at_vertices is not None and not value.is_constant:
        of_pieces = at_vertices.reshape(*at_vertices.shape[:-1], -1, vertices)
        return Range(of_pieces.min(axis=-1), of_pieces.max(axis=-1), at_vertices)
    if low.dtype != bool:
        # What is no number may be anything.
        low = np.where(np.isnan(low), -np.inf, low)
        high = np.where(np.isnan(high), np.inf, high)
    return Range(low, high, at_vertices)


def _if_linear(call: Callable[..., np.ndarray], *operands: Range) -> np.ndarray | None:
    """Return the values of a linear operation at vertices, None if any is unknown."""
    at_vertices = [a.at_vertices for a in operands]
    if any(values is None for values in at_vertices):
        return None
    return call(*at_vertices)


def _sum(a: Range, b: Range) -> Range:
    """Return the range of a sum."""
    return Range(a.low + b.low, a.high + b.high, _if_linear(np.add, a, b))


def _rising(function: Callable[[np.ndarray], np.ndarray]) -> Callable[[Range], Range]:
    """Return what a function that rises does to a range."""
    return lambda a: Range(function(a.low), function(a.high))


def _hull(*values: np.ndarray) -> Range:
    """Return the range that contains all values; what is no number may be anything."""
    low, high = values[0], values[0]
    for value in values[1:]:
        low = np.minimum(low, value)
        high = np.maximum(high, value)
    return Range(low, high)


def _divide(a: Range, b: Range) -> Range:
    """Return the range of a ratio, infinite where the divisor may be zero."""
    ends = _hull(*[x / y for x in a[:2] for y in b[:2]])
    has_zero = (b.low <= 0) & (b.high >= 0)
    low = np.where(has_zero, -np.inf, ends.low)
    high = np.where(has_zero, np.inf, ends.high)
    return Range(low, high, _if_linear(np.divide, a, b) if b.is_constant else None)


def _absolute(a: Range) -> Range:
    """Return the range of an absolute value."""
    ends = _hull(abs(a.low), abs(a.high))
    return Range(np.where((a.low <= 0) & (a.high >= 0), 0.0, ends.low), ends.high)


def _cosine(a: Range) -> Range:
    """Return the range of a cosine, which has its extremes at multiples of pi."""
    ends = _hull(np.cos(a.low), np.cos(a.high))
    # A multiple of two pi between the ends, and an odd multiple of pi.
    has_top = np.floor(a.high / (2 * np.pi)) >= np.ceil(a.low / (2 * np.pi))
    has_bottom = np.floor((a.high / np.pi - 1) / 2) >= np.ceil((a.low / np.pi - 1) / 2)
    return Range(np.where(has_bottom, -1.0, ends.low), np.where(has_top, 1.0, ends.high))


def _sine(a: Range) -> Range:
    """Return the range of a sine."""
    return _cosine(Range(a.low - np.pi / 2, a.high - np.pi / 2))


def _tangent(a: Range) -> Range:
    """Return the range of a tangent, infinite where it has a pole between the ends."""
    has_pole = np.floor(a.high / np.pi - 0.5) >= np.ceil(a.low / np.pi - 0.5)
    low = np.where(has_pole, -np.inf, np.tan(a.low))
    return Range(low, np.where(has_pole, np.inf, np.tan(a.high)))


def _even(a: Range, exponent: int) -> Range:
    """Return the range of an even power."""
    size = _absolute(a)
    return _hull(size.low**exponent, size.high**exponent)


def _product(node: Ufl) -> Callable[[Range, Range], Range]:
    """Return the range of a product, of a number with itself as of a square."""
    if node.ufl_operands[0] == node.ufl_operands[1]:
        return lambda a, _: _even(a, 2)
    call = WITH_INDICES[classes.Product](node)

    def product(a: Range, b: Range) -> Range:
        # It is linear in each factor, so that its extremes are products of ends.
        ends = _hull(*[call(x, y) for x in a[:2] for y in b[:2]])
        is_linear = a.is_constant or b.is_constant
        return Range(ends.low, ends.high, _if_linear(call, a, b) if is_linear else None)

    return product


def _power(node: Ufl) -> Callable[[Range, Range], Range]:
    """Return the range of a power."""
    exponent = node.ufl_operands[1]
    if isinstance(exponent, classes.IntValue) and exponent.value() % 2 == 0:
        whole = exponent.value()
        return lambda a, _: _even(a, whole)

    def power(a: Range, b: Range) -> Range:
        # On positive bases it is monotone in each operand, and an odd power on all.
        ends = _hull(*[x**y for x in a[:2] for y in b[:2]])
        is_known = a.low >= 0
        is_known |= (b.low == b.high) & (b.low % 2 == 1) & (b.low > 0)
        low = np.where(is_known, ends.low, -np.inf)
        return Range(low, np.where(is_known, ends.high, np.inf))

    return power


def _choose(condition: Range, a: Range, b: Range) -> Range:
    """Return the range of a conditional: of either value where both may be taken."""
    either = _hull(a.low, a.high, b.low, b.high)
    low = np.where(condition.low, a.low, np.where(condition.high, either.low, b.low))
    high = np.where(condition.low, a.high, np.where(condition.high, either.high, b.high))
    return Range(low, high)


RANGES: dict[Any, Callable[..., Range]] = {
    classes.Sqrt: _rising(np.sqrt),
    classes.Exp: _rising(np.exp),
    classes.Ln: _rising(np.log),
    classes.Sinh: _rising(np.sinh),
    classes.Tanh: _rising(np.tanh),
    classes.Asin: _rising(np.arcsin),
    classes.Atan: _rising(np.arctan),
    classes.Acos: lambda a: Range(np.arccos(a.high), np.arccos(a.low)),
    classes.Sum: _sum,
    classes.Division: _divide,
    classes.Abs: _absolute,
    classes.MinValue: lambda a, b: Range(np.minimum(a.low, b.low), np.minimum(a.high, b.high)),
    classes.MaxValue: lambda a, b: Range(np.maximum(a.low, b.low), np.maximum(a.high, b.high)),
    classes.Cos: _cosine,
    classes.Sin: _sine,
    classes.Tan: _tangent,
    classes.Cosh: lambda a: _rising(np.cosh)(_absolute(a)),
    classes.LT: lambda a, b: Range(a.high < b.low, a.low < b.high),
    classes.LE: lambda a, b: Range(a.high <= b.low, a.low <= b.high),
    classes.GT: lambda a, b: Range(a.low > b.high, a.high > b.low),
    classes.GE: lambda a, b: Range(a.low >= b.high, a.high >= b.low),
    classes.AndCondition: lambda a, b: Range(a.low & b.low, a.high & b.high),
    classes.OrCondition: lambda a, b: Range(a.low | b.low, a.high | b.high),
    classes.NotCondition: lambda a: Range(~a.high, ~a.low),
    classes.Conditional: _choose,
}
"""Operators and what they make of ranges."""
OF_OPERANDS: dict[Any, Callable[[Ufl], Callable[[Range, Range], Range]]] = {
    classes.Product: _product,
    classes.Power: _power,
}
"""Operators whose range depends on what their operands are."""
