"""Values of UFL expressions at points of cells and facets, and at numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.corealg.traversal import traverse_unique_terminals, unique_pre_traversal
from ufl.utils.stacks import StackDict

from erc_contact.base.runtime import compiled
from erc_contact.base.runtime.patches import method_caches_off

CHUNK = 4096
"""Number of points at which an expression is evaluated at once."""


def varies(expression: Any) -> bool:
    """Tell whether a UFL expression varies in space: it contains more than constants."""
    in_space = (ufl.classes.GeometricQuantity, ufl.classes.Coefficient)
    return any(isinstance(terminal, in_space) for terminal in traverse_unique_terminals(expression))


def varies_in_cells(expression: Any) -> bool:
    """Tell whether a UFL expression varies inside straight cells and facets.

    It does if it contains x, or a function that varies there.
    """
    return any(
        isinstance(terminal, ufl.classes.SpatialCoordinate)
        or (
            isinstance(terminal, ufl.classes.Coefficient)
            and terminal.ufl_element().embedded_superdegree > 0
        )
        for terminal in traverse_unique_terminals(ufl.as_ufl(expression))
    )


def without_plain_numbers(expression: Any, mesh: dmesh.Mesh) -> Any:
    """A UFL expression whose plain numbers are replaced by Constants.

    Expressions that differ only in these numbers are then compiled once.
    """
    plain = [
        t for t in traverse_unique_terminals(expression) if isinstance(t, ufl.classes.FloatValue)
    ]
    return ufl.replace(
        expression, {number: compiled.constant(mesh, float(number)) for number in plain}
    )


def evaluate(
    expression: Any, mesh: dmesh.Mesh, points: np.ndarray, entities: np.ndarray
) -> np.ndarray:
    """Values of a UFL expression at reference points of cells or of facets.

    Args:
        expression: UFL expression of shape s.
        mesh: Where it lives.
        points: Reference points, shape (q, d) for cells, (q, d-1) for facets.
        entities: Cells, shape (n,), or pairs (cell, local facet), shape (n, 2); ghosts
            are allowed.

    Returns:
        Values, shape (n, q, *s).
    """
    if isinstance(expression, ufl.SpatialCoordinate | ufl.FacetNormal):
        return _geometric(type(expression), mesh, points).eval(mesh, entities)
    expression = ufl.as_ufl(expression)
    if not _has_fields(expression):
        expression = _without_derivatives(expression)
        if not varies(
            expression
        ):  # a number, constants, derivatives that became constant: nothing to compile
            return np.broadcast_to(
                constant_value(expression), (len(entities), len(points), *expression.ufl_shape)
            )
        few = len(points) == 1 or entities.ndim == 2
        if few and _is_data(expression):  # compiled once for all points; slower for many
            return Everywhere(expression, mesh)(
                evaluate(ufl.SpatialCoordinate(mesh), mesh, points, entities), entities
            )
    return compiled.expression(expression, points, mesh.comm).eval(mesh, entities)


def _without_derivatives(expression: Any) -> Any:
    """UFL with its derivatives carried out, or as it is where it has none."""
    expression = ufl.as_ufl(expression)
    has = any(isinstance(node, ufl.classes.Derivative) for node in unique_pre_traversal(expression))
    if not has:
        return expression
    with method_caches_off():
        return ufl.algorithms.expand_derivatives(expression)


def _has_fields(expression: Any) -> bool:
    """Tell whether a UFL expression contains functions that vary inside cells."""
    return any(
        isinstance(terminal, ufl.classes.Coefficient) and varies_in_cells(terminal)
        for terminal in traverse_unique_terminals(expression)
    )


def _is_data(expression: Any) -> bool:
    """Tell whether a UFL expression has only the position, constants, and functions constant in cells."""
    return all(
        isinstance(node, ufl.classes.SpatialCoordinate | ufl.classes.ConstantValue | fem.Constant)
        or (isinstance(node, ufl.classes.Coefficient) and not varies_in_cells(node))
        for node in traverse_unique_terminals(expression)
        if not isinstance(node, ufl.classes.MultiIndex | ufl.classes.Label)
    )


def constant_value(expression: Any) -> np.ndarray:
    """The value of an expression that does not vary."""
    if isinstance(expression, fem.Constant):
        return expression.value.astype(float)
    expression = apply_algebra_lowering(expression)
    shape, constants = expression.ufl_shape, ufl.algorithms.analysis.extract_constants(expression)
    known = {c: c.value if c.ufl_shape else float(c.value) for c in constants}
    plain = [expression.evaluate((), known, index, StackDict()) for index in np.ndindex(shape)]
    return np.reshape(plain, shape).astype(float)


class Everywhere:
    """A UFL expression at points that differ from cell to cell.

    The position, the functions and the facet normals in the expression are replaced by
    their values at each point. So the expression is compiled once for all points.

    Args:
        expression: UFL expression of shape s; functions in it without derivatives.
        mesh: Where it lives. Construction is collective; evaluation is not.
    """

    def __init__(self, expression: Any, mesh: dmesh.Mesh) -> None:
        expression = _without_derivatives(expression)
        self.shape, self.mesh = expression.ufl_shape, mesh
        self.plain = None if varies(expression) else constant_value(expression)
        if self.plain is not None:
            return
        self.values = OfNumbers(expression, mesh.comm)
        middle = np.full((1, mesh.geometry.dim - 1), 1 / mesh.geometry.dim)
        needed = ufl.FacetNormal(mesh) in self.values.numbers
        self.normal: Any = _geometric(ufl.FacetNormal, mesh, middle) if needed else None

    def __call__(self, x: np.ndarray, entities: np.ndarray) -> np.ndarray:
        """Values at points.

        Args:
            x: Points of each entity [length], shape (n, q, d).
            entities: Cells, shape (n,), or pairs (cell, local facet), shape (n, 2).

        Returns:
            Values, shape (n, q, *s).
        """
        n, q, d = x.shape
        if self.plain is not None:
            return np.broadcast_to(self.plain, (n, q, *self.shape))
        places = np.zeros((n * q, 3))
        places[:, :d] = x.reshape(-1, d)
        cells = np.repeat(entities if entities.ndim == 1 else entities[:, 0], q).astype(np.int32)
        numbers = {}
        for terminal in self.values.numbers:
            size = int(np.prod(terminal.ufl_shape))
            if isinstance(terminal, ufl.classes.SpatialCoordinate):
                numbers[terminal] = places[:, :d]
            elif isinstance(terminal, ufl.classes.FacetNormal):
                normals = self.normal.eval(self.mesh, entities) if n else np.zeros((0, 1, d))
                numbers[terminal] = np.repeat(normals.reshape(n, d), q, axis=0)
            elif not varies_in_cells(terminal):
                blocks = terminal.x.array.reshape(-1, size)
                numbers[terminal] = blocks[terminal.function_space.dofmap.list[cells, 0]]
            else:
                numbers[terminal] = (
                    terminal.eval(places, cells).reshape(n * q, size) if n else np.empty((0, size))
                )
        return self.values(numbers, n * q).reshape(n, q, *self.shape)


def pointwise(
    function: Callable[..., Any], first: np.ndarray, named: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Evaluate a function of numbers that is written in UFL at every entry of arrays.

    Args:
        function: Takes the first number by position, the others by name.
        first: Numbers of any shape.
        named: Others, of shapes that broadcast with it.
    """
    shape = np.broadcast_shapes(first.shape, *(a.shape for a in named.values()))
    size = int(np.prod(shape))
    number, *others = (stand_in((), i) for i in range(1 + len(named)))
    expression = ufl.as_ufl(function(number, **dict(zip(named, others, strict=True))))
    if not varies(expression):
        return np.broadcast_to(constant_value(expression), shape)
    arrays = dict(zip((number, *others), (first, *named.values()), strict=True))
    numbers = {one: np.broadcast_to(array, shape).reshape(size, 1) for one, array in arrays.items()}
    return OfNumbers(expression, MPI.COMM_SELF)(numbers, size).reshape(shape)


class OfNumbers:
    """A UFL expression whose terminals are numbers of each point.

    Fields and constants are replaced by those of a common mesh. So expressions that
    differ only in what they stand for are compiled once, on all meshes of a process.

    Args:
        expression: UFL expression without derivatives.
        comm: The ranks that compile it together.

    Attributes:
        numbers: What stands for each terminal that varies.
    """

    def __init__(self, expression: Any, comm: MPI.Comm) -> None:
        self.numbers: dict[Any, fem.Function] = {}
        self._constants: dict[Any, fem.Constant] = {}
        used: Counter[Any] = Counter()
        for terminal in traverse_unique_terminals(expression):
            for kinds, make, known in (
                ((ufl.classes.Coefficient, ufl.classes.GeometricQuantity), stand_in, self.numbers),
                ((fem.Constant, ufl.classes.FloatValue), _parameter, self._constants),
            ):
                if isinstance(terminal, kinds):
                    known[terminal] = make(terminal.ufl_shape, used[make, terminal.ufl_shape])
                    used[make, terminal.ufl_shape] += 1
        replaced = ufl.replace(expression, {**self.numbers, **self._constants})
        self._compiled = _compiled(replaced, np.array([[0.5]]), comm)

    def __call__(self, numbers: Mapping[Any, np.ndarray], count: int) -> np.ndarray:
        """Values for numbers of the terminals, arrays (count, size of the terminal); shape (count, size)."""
        for terminal, constant in self._constants.items():
            constant.value = (
                terminal.value if isinstance(terminal, fem.Constant) else float(terminal)
            )
        values = np.empty((count, self._compiled.value_size))
        for start in range(0, count, CHUNK):
            some = slice(start, min(start + CHUNK, count))
            cells = np.arange(some.stop - start, dtype=np.int32)
            for terminal, array in numbers.items():
                if terminal in self.numbers:
                    function = self.numbers[terminal]
                    function.x.array.reshape(CHUNK, -1)[
                        function.function_space.dofmap.list[cells, 0]
                    ] = array[some]
            values[some] = self._compiled.eval(_line(), cells).reshape(
                len(cells), self._compiled.value_size
            )
        return values


@cache
def _line() -> dmesh.Mesh:
    """A mesh whose CHUNK cells carry the values of as many points; it has no other meaning."""
    return dmesh.create_interval(MPI.COMM_SELF, CHUNK, (0.0, 1.0))


@cache
def _numbers(shape: tuple[int, ...]) -> fem.FunctionSpace:
    return fem.functionspace(_line(), ("DG", 0, shape))


@cache
def stand_in(shape: tuple[int, ...], which: int) -> fem.Function:
    """A function that stands for values of this shape in an expression, one for each point."""
    return fem.Function(_numbers(shape))


@cache
def _parameter(shape: tuple[int, ...], which: int) -> fem.Constant:
    """Return what stands in an expression for a constant of this shape."""
    return compiled.constant(_line(), np.zeros(shape))


@cache
def _cell(element: Any) -> dmesh.Mesh:
    """One cell with this coordinate element, for expressions that know nothing but the geometry of any mesh."""
    (d,) = element.reference_value_shape
    corners = np.vstack([np.zeros(d), np.eye(d)])
    return dmesh.create_mesh(MPI.COMM_SELF, np.arange(d + 1)[None], ufl.Mesh(element), corners)


def _geometric(
    quantity: Callable[[dmesh.Mesh], Any], mesh: dmesh.Mesh, points: np.ndarray
) -> fem.Expression:
    """A geometric quantity at reference points of the entities of any mesh, compiled; collective."""
    return _compiled(quantity(_cell(mesh.ufl_domain().ufl_coordinate_element())), points, mesh.comm)


_known: dict[Any, fem.Expression] = {}
"""The expressions that know no mesh of the user's, as this process has compiled them."""


def _compiled(expression: Any, points: np.ndarray, comm: MPI.Comm) -> fem.Expression:
    """The compiled expression at reference points; collective."""
    key = expression, points.shape, points.tobytes()
    known = key in _known
    if not (known if comm.size == 1 else comm.allreduce(known, MPI.LAND)):
        _known[key] = compiled.expression(expression, points, comm)
    return _known[key]
