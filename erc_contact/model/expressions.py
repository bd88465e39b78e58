"""Values of UFL expressions at points of cells and facets, and at numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from ufl.corealg.traversal import traverse_unique_terminals
from ufl.utils.stacks import StackDict

CHUNK = 4096
"""Number of points at which an expression is evaluated at once."""


def varies(expression: Any) -> bool:
    """Whether a UFL expression varies in space: it knows more than constants."""
    in_space = (ufl.classes.GeometricQuantity, ufl.classes.Coefficient)
    return any(isinstance(terminal, in_space) for terminal in traverse_unique_terminals(expression))


def varies_in_cells(expression: Any) -> bool:
    """Whether a UFL expression varies inside straight cells and facets: it knows x, or a function that does."""
    return any(
        isinstance(terminal, ufl.classes.SpatialCoordinate)
        or (isinstance(terminal, ufl.classes.Coefficient) and terminal.ufl_element().embedded_superdegree > 0)
        for terminal in traverse_unique_terminals(ufl.as_ufl(expression))
    )


def without_plain_numbers(expression: Any, mesh: dmesh.Mesh) -> Any:
    """A UFL expression with Constants for its plain numbers: those that differ in them only are compiled once."""
    plain = [t for t in traverse_unique_terminals(expression) if isinstance(t, ufl.classes.FloatValue)]
    return ufl.replace(expression, {number: fem.Constant(mesh, float(number)) for number in plain})


def evaluate(expression: Any, mesh: dmesh.Mesh, points: np.ndarray, entities: np.ndarray) -> np.ndarray:
    """Values of a UFL expression at reference points of cells or of facets.

    Args:
        expression: UFL expression of shape s.
        mesh: Where it lives.
        points: Reference points, shape (q, d) for cells, (q, d-1) for facets.
        entities: Cells, shape (n,), or pairs (cell, local facet), shape (n, 2); ghosts are allowed.

    Returns:
        Values, shape (n, q, *s).
    """
    expression = ufl.algorithms.expand_derivatives(ufl.as_ufl(expression))
    if not varies(expression):  # a number, constants, derivatives that became constant: nothing to compile
        return np.broadcast_to(_constant(expression), (len(entities), len(points), *expression.ufl_shape))
    position = ufl.SpatialCoordinate(mesh)
    few = len(points) == 1 or entities.ndim == 2
    if few and expression != position and _is_data(expression):  # compiled once for all points; slower for many
        return Everywhere(expression, mesh)(evaluate(position, mesh, points, entities), entities)
    compiled = fem.Expression(expression, points, comm=mesh.comm, dtype=np.float64)
    return compiled.eval(mesh, entities)


def _is_data(expression: Any) -> bool:
    """Whether a UFL expression knows only the position, constants, and functions that are constant in cells."""
    return all(
        isinstance(node, ufl.classes.SpatialCoordinate | ufl.classes.ConstantValue | fem.Constant)
        or (isinstance(node, ufl.classes.Coefficient) and not varies_in_cells(node))
        for node in traverse_unique_terminals(expression)
        if not isinstance(node, ufl.classes.MultiIndex | ufl.classes.Label)
    )


def _constant(expression: Any) -> np.ndarray:
    """The value of an expression that does not vary."""
    shape, constants = expression.ufl_shape, ufl.algorithms.analysis.extract_constants(expression)
    known = {c: c.value if c.ufl_shape else float(c.value) for c in constants}
    plain = [expression.evaluate((), known, index, StackDict()) for index in np.ndindex(shape)]
    return np.reshape(plain, shape).astype(float)


class Everywhere:
    """A UFL expression at points that differ from cell to cell.

    Here x, the functions and the facet normals in the expression become numbers of each point, so that it is compiled
    once for all points.

    Args:
        expression: UFL expression of shape s; functions in it without derivatives.
        mesh: Where it lives. Construction is collective; evaluation is not.
    """

    def __init__(self, expression: Any, mesh: dmesh.Mesh) -> None:
        expression = ufl.algorithms.expand_derivatives(ufl.as_ufl(expression))
        self.shape, self.mesh = expression.ufl_shape, mesh
        self.functions: dict[Any, fem.Function] = {}
        self.plain = None if varies(expression) else _constant(expression)
        if self.plain is not None:
            return
        new = {}
        for terminal in traverse_unique_terminals(expression):
            if isinstance(terminal, ufl.classes.Coefficient | ufl.classes.GeometricQuantity):
                self.functions[terminal] = new[terminal] = _number(terminal.ufl_shape)
            elif isinstance(terminal, fem.Constant):
                new[terminal] = fem.Constant(_line(), terminal.value)
        self.compiled = _compiled(ufl.replace(expression, new), mesh.comm)
        normal, middle = ufl.FacetNormal(mesh), np.full((1, mesh.geometry.dim - 1), 1 / mesh.geometry.dim)
        self.normal: Any = fem.Expression(normal, middle, comm=mesh.comm) if normal in self.functions else None

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
        for terminal, function in self.functions.items():
            if isinstance(terminal, ufl.classes.SpatialCoordinate):
                numbers[function] = places[:, :d]
            elif isinstance(terminal, ufl.classes.FacetNormal):
                normals = self.normal.eval(self.mesh, entities) if n else np.zeros((0, 1, d))
                numbers[function] = np.repeat(normals.reshape(n, d), q, axis=0)
            elif not varies_in_cells(terminal):
                blocks = terminal.x.array.reshape(-1, function.function_space.dofmap.bs)
                numbers[function] = blocks[terminal.function_space.dofmap.list[cells, 0]]
            else:
                size = function.function_space.dofmap.bs
                numbers[function] = terminal.eval(places, cells).reshape(n * q, size) if n else np.empty((0, size))
        return _tabulated(self.compiled, numbers, n * q).reshape(n, q, *self.shape)


def pointwise(function: Callable[..., Any], first: np.ndarray, named: Mapping[str, np.ndarray]) -> np.ndarray:
    """Evaluate a UFL function of numbers at every entry of arrays, so that it is written once, in UFL.

    Args:
        function: Takes the first number by position, the others by name.
        first: Numbers of any shape.
        named: Others, of shapes that broadcast with it.
    """
    shape = np.broadcast_shapes(first.shape, *(a.shape for a in named.values()))
    size = int(np.prod(shape))
    number, names = _number(()), {name: _number(()) for name in named}
    expression = ufl.as_ufl(function(number, **names))
    if not varies(expression):
        return np.broadcast_to(_constant(expression), shape)
    numbers = {number: first, **{names[name]: array for name, array in named.items()}}
    numbers = {one: np.broadcast_to(array, shape).reshape(size, 1) for one, array in numbers.items()}
    return _tabulated(_compiled(expression, MPI.COMM_SELF), numbers, size).reshape(shape)


@cache
def _line() -> dmesh.Mesh:
    """Cells without meaning that carry the numbers of CHUNK points."""
    return dmesh.create_interval(MPI.COMM_SELF, CHUNK, (0.0, 1.0))


@cache
def _numbers(shape: tuple[int, ...]) -> fem.FunctionSpace:
    return fem.functionspace(_line(), ("DG", 0, shape))


def _number(shape: tuple[int, ...]) -> fem.Function:
    """What stands in an expression for numbers of this shape, one for each point."""
    return fem.Function(_numbers(shape))


def _compiled(expression: Any, comm: MPI.Comm) -> fem.Expression:
    return fem.Expression(without_plain_numbers(expression, _line()), np.array([[0.5]]), comm=comm, dtype=np.float64)


def _tabulated(compiled: fem.Expression, numbers: Mapping[fem.Function, np.ndarray], count: int) -> np.ndarray:
    """Values of an expression of numbers, given as arrays (count, ...)."""
    values = np.empty((count, compiled.value_size))
    for start in range(0, count, CHUNK):
        some = slice(start, min(start + CHUNK, count))
        cells = np.arange(some.stop - start, dtype=np.int32)
        for function, array in numbers.items():
            function.x.array.reshape(CHUNK, -1)[function.function_space.dofmap.list[cells, 0]] = array[some]
        values[some] = compiled.eval(_line(), cells).reshape(len(cells), compiled.value_size)
    return values
