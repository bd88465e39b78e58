"""Evaluate UFL expressions at points of cells and facets, and at numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import basix
import cffi
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from ufl.algorithms import extract_coefficients
from ufl.algorithms.analysis import extract_constants
from ufl.corealg.traversal import traverse_unique_terminals

from erc_contact.base.library import library
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_tables import TableFunction, has_tables
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.array_code import array_code
from erc_contact.model.data.symbolic import (
    constant_value,
    has_fields,
    is_data,
    varies,
    varies_in_cells,
    without_derivatives,
)
from erc_contact.model.data.tables import on_mesh
from namedmesh.base.communicators import lasting
from namedmesh.base.releases import cell_nodes
from namedmesh.simplex import inverses

KERNELS = Path(__file__).parent / "kernels"
"""Folder of the C source that calls compiled expressions."""


@cache
def line() -> dmesh.Mesh:
    """Make a mesh for what stands for numbers; it has no other meaning."""
    return dmesh.create_interval(MPI.COMM_SELF, 1, (0.0, 1.0))


@cache
def stand_in(shape: tuple[int, ...], which: int) -> fem.Function:
    """Make a function that stands for a value of a shape at each point."""
    return fem.Function(fem.functionspace(line(), ("DG", 0, shape)))


def evaluate(
    expression: Ufl, mesh: dmesh.Mesh, points: np.ndarray, entities: np.ndarray
) -> np.ndarray:
    """Evaluate a UFL expression at reference points of cells or of facets.

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
    if has_tables(expression):
        expression = on_mesh(without_derivatives(expression), mesh, at_cells)
    if not has_fields(expression):
        expression = without_derivatives(expression)
        # Numbers, constants, and derivatives that became constant need no compiler.
        if not varies(expression):
            shape = (len(entities), len(points), *expression.ufl_shape)
            return np.broadcast_to(constant_value(expression), shape)
        # Data need no compiler either.
        if is_data(expression):
            x = evaluate(ufl.SpatialCoordinate(mesh), mesh, points, entities)
            return Everywhere(expression, mesh)(x, entities)
    return compiled.expression(expression, points, lasting(mesh.comm)).eval(mesh, entities)


def at_cells(
    expression: Ufl, mesh: dmesh.Mesh, points: np.ndarray, cells: np.ndarray
) -> np.ndarray:
    """Evaluate a UFL expression at reference points of cells by numpy; collective."""
    x = evaluate(ufl.SpatialCoordinate(mesh), mesh, points, cells)
    return Everywhere(expression, mesh)(x, cells)


class Everywhere:
    """Evaluate a UFL expression at points that differ from cell to cell.

    The position, the functions and the facet normals in the expression are replaced by
    their values at each point.

    Args:
        expression: UFL expression of shape s; functions in it without derivatives.
        mesh: Where it lives. Construction is collective; evaluation is not.

    Attributes:
        plain: The value where the expression does not vary, else None.
    """

    def __init__(self, expression: Ufl, mesh: dmesh.Mesh) -> None:
        expression = on_mesh(without_derivatives(expression), mesh, at_cells)
        self.shape = expression.ufl_shape
        self.mesh = mesh
        self.plain = None if varies(expression) else constant_value(expression)
        if self.plain is not None:
            return
        self.values = OfNumbers(expression, lasting(mesh.comm))
        self._of_tables = {}
        for terminal in self.values.numbers:
            if isinstance(terminal, TableFunction):
                self._of_tables[terminal] = Everywhere(terminal.coordinates, mesh)
        self.normal: Any = None
        if ufl.FacetNormal(mesh) in self.values.numbers:
            d = mesh.geometry.dim
            middle = np.full((1, d - 1), 1 / d)
            self.normal = _geometric(ufl.FacetNormal, mesh, middle)

    def __call__(self, x: np.ndarray, entities: np.ndarray) -> np.ndarray:
        """Evaluate the expression at points.

        Args:
            x: Points of each entity [length], shape (n, q, d).
            entities: Cells, shape (n,), or pairs (cell, local facet), shape (n, 2).

        Returns:
            Values, shape (n, q, *s).
        """
        n, q, _ = x.shape
        if self.plain is not None:
            return np.broadcast_to(self.plain, (n, q, *self.shape))
        numbers = {terminal: self._at(terminal, x, entities) for terminal in self.values.numbers}
        return self.values(numbers, n * q).reshape(n, q, *self.shape)

    def _at(self, terminal: Ufl, x: np.ndarray, entities: np.ndarray) -> np.ndarray:
        """Evaluate a terminal of the expression at points, shape (n q, size).

        Args:
            terminal: The position, the facet normal, or a function.
            x: As in :meth:`__call__`.
            entities: As in :meth:`__call__`.
        """
        n, q, d = x.shape
        if isinstance(terminal, TableFunction):
            coordinates = self._of_tables[terminal](x, entities)
            return terminal.at(coordinates).reshape(n * q, 1)
        if isinstance(terminal, ufl.classes.SpatialCoordinate):
            return x.reshape(-1, d)
        if isinstance(terminal, ufl.classes.FacetNormal):
            normals = self.normal.eval(self.mesh, entities) if n else np.zeros((0, 1, d))
            return np.repeat(normals.reshape(n, d), q, axis=0)
        cells = entities if entities.ndim == 1 else entities[:, 0]
        return function_at(terminal, x, cells)


def function_at(function: fem.Function, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Evaluate a function at points (n, q, d) of cells (n,), shape (n q, size)."""
    n, q, d = x.shape
    size = int(np.prod(function.ufl_shape))
    if not varies_in_cells(function):
        blocks = function.x.array.reshape(-1, size)
        of_cells = blocks[function.function_space.dofmap.list[cells, 0]]
        return np.repeat(of_cells, q, axis=0)
    if n == 0:
        return np.empty((0, size))
    if is_polynomial(function):
        return polynomial_at(function, x, cells).reshape(n * q, size)
    places = np.zeros((n * q, 3))
    places[:, :d] = x.reshape(-1, d)
    of_points = np.repeat(cells, q).astype(np.int32)
    return function.eval(places, of_points).reshape(n * q, size)


def is_polynomial(function: fem.Function) -> bool:
    """Tell whether a function has nodal values of polynomials in cells."""
    space = function.function_space
    is_nodal = space.ufl_element().element_family == basix.ElementFamily.P
    return is_nodal and space.num_sub_spaces in (0, space.dofmap.bs)


def polynomial_at(function: fem.Function, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Evaluate such a function at points of cells.

    Args:
        function: The function.
        x: Points of each cell [length], shape (n, q, d).
        cells: The cells, shape (n,).

    Returns:
        Values, shape (n, q, size).
    """
    space = function.function_space
    n, q, d = x.shape
    corners = space.mesh.geometry.x[cell_nodes(space.mesh.geometry)[cells], :d]
    edges = corners[:, 1:] - corners[:, :1]
    local = np.matmul(x - corners[:, :1], inverses(edges))
    shape = space.element.basix_element.tabulate(0, local.reshape(n * q, d))[0, :, :, 0]
    blocks = function.x.array.reshape(-1, space.dofmap.bs)
    return np.matmul(shape.reshape(n, q, shape.shape[1]), blocks[space.dofmap.list[cells]])


class OfNumbers:
    """Evaluate a UFL expression whose terminals are numbers of each point.

    numpy evaluates it (:mod:`erc_contact.model.data.array_code`), unless it has an
    operator that only the compiler knows. Then fields and constants are replaced by
    fields and constants of a common mesh. So expressions that differ only in what they
    stand for are compiled once, on all meshes of a process.

    Args:
        expression: UFL expression without derivatives.
        comm: The ranks that compile it together.
        is_matrix: Whether it has so many operations that it is compiled in any case.

    Attributes:
        numbers: The terminals that vary.
    """

    def __init__(self, expression: Ufl, comm: MPI.Comm, *, is_matrix: bool = False) -> None:
        self._size = int(np.prod(expression.ufl_shape))
        self._code = None if is_matrix else array_code(expression)
        if self._code is not None:
            self.numbers = list(self._code.fields)
            return
        # The terminals of a shape get the same stand-ins in every expression, in their
        # order. So equal expressions have equal signatures.
        fields: Counter[tuple[int, ...]] = Counter()
        parameters: Counter[tuple[int, ...]] = Counter()
        stands: dict[Ufl, Ufl] = {}
        for terminal in traverse_unique_terminals(expression):
            if isinstance(terminal, ufl.classes.Coefficient | ufl.classes.GeometricQuantity):
                shape = terminal.ufl_shape
                stands[terminal] = stand_in(shape, fields[shape])
                fields[shape] += 1
            elif isinstance(terminal, fem.Constant | ufl.classes.FloatValue):
                shape = terminal.ufl_shape
                stands[terminal] = _parameter(shape, parameters[shape])
                parameters[shape] += 1
        replaced = ufl.replace(expression, stands)
        self._compiled = _compile(replaced, np.array([[0.5]]), comm)
        stood_for = {function: terminal for terminal, function in stands.items()}
        self.numbers = [stood_for[function] for function in _coefficients(self._compiled)]
        self._constants = [stood_for[constant] for constant in extract_constants(replaced)]
        tabulate = self._compiled.ufcx_expression.tabulate_tensor_float64
        self._address = int(cffi.FFI().cast("uintptr_t", tabulate))

    def __call__(self, numbers: Mapping[Ufl, np.ndarray], count: int) -> np.ndarray:
        """Evaluate the expression for numbers of its terminals.

        Args:
            numbers: Values of each terminal, shape (count, size of the terminal).
            count: Number of points.

        Returns:
            Values, shape (count, size).
        """
        if self._code is not None:
            return self._code(numbers, count).reshape(count, self._size)
        values = np.zeros((count, self._size))
        rows, constants = self._arguments(numbers, count)
        # The kernels know no dimension.
        kernels = library(KERNELS, 1)
        sizes = self._size, values, rows.shape[1]
        kernels("at_points", self._address, count, *sizes, rows, constants)
        return values

    def times(self, numbers: Mapping[Ufl, np.ndarray], vectors: np.ndarray) -> np.ndarray:
        """Multiply the expression, a compiled square matrix, and vectors at points.

        Args:
            numbers: Values of each terminal, shape (count, size of the terminal).
            vectors: A vector of each point, shape (count, s).
        """
        count, size = vectors.shape
        products = np.empty((count, size))
        rows, constants = self._arguments(numbers, count)
        arrays = products, np.ascontiguousarray(vectors), rows.shape[1], rows, constants
        library(KERNELS, 1)("times_at_points", self._address, count, size, *arrays)
        return products

    def _arguments(
        self, numbers: Mapping[Ufl, np.ndarray], count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers of points in rows, and the constants, for the kernels."""
        columns = [numbers[terminal] for terminal in self.numbers]
        # The numbers of a law are a table already, which is not copied. The tangent of
        # a linear law has none.
        rows = columns[0] if len(columns) == 1 else np.hstack([np.zeros((count, 0)), *columns])
        constants = np.zeros(0)
        if self._constants:
            constants = np.concatenate([_flat(constant) for constant in self._constants])
        return np.ascontiguousarray(rows, dtype=np.float64), constants


def definite_inverses(matrices: np.ndarray) -> np.ndarray:
    """Return the inverses of symmetric definite matrices, shape (..., s, s).

    numpy takes two to three times as long for matrices as small as these.

    Raises:
        LinAlgError: If a matrix is singular.
    """
    result = np.array(matrices, dtype=np.float64, order="C")
    size = result.shape[-1]
    library(KERNELS, 1)("invert_definite", result.size // size**2, size, result)
    if not np.isfinite(result).all():
        raise np.linalg.LinAlgError("Singular matrix")
    return result


def _coefficients(expression: fem.Expression) -> list[fem.Function]:
    """Return the functions in a compiled expression in the order of its numbers."""
    functions = extract_coefficients(expression.ufl_expression)
    compiled_form = expression.ufcx_expression
    order = compiled_form.original_coefficient_positions
    return [functions[order[i]] for i in range(compiled_form.num_coefficients)]


def _flat(constant: Ufl) -> np.ndarray:
    """Return the numbers of a Constant, or of a number in UFL, shape (size,)."""
    if isinstance(constant, fem.Constant):
        return np.ravel(constant.value)
    return np.array([float(constant)])


@cache
def _parameter(shape: tuple[int, ...], which: int) -> fem.Constant:
    """Make a Constant that stands for a constant of a shape."""
    return compiled.constant(line(), np.zeros(shape))


@cache
def _cell(element: Any) -> dmesh.Mesh:
    """Make a mesh of one cell with a coordinate element.

    It is for expressions that know nothing but the geometry of any mesh.
    """
    (d,) = element.reference_value_shape
    corners = np.vstack([np.zeros(d), np.eye(d)])
    return dmesh.create_mesh(MPI.COMM_SELF, np.arange(d + 1)[None], ufl.Mesh(element), corners)


def _geometric(
    quantity: Callable[[dmesh.Mesh], Ufl], mesh: dmesh.Mesh, points: np.ndarray
) -> fem.Expression:
    """Compile a geometric quantity at reference points of any mesh; collective."""
    cell = _cell(mesh.ufl_domain().ufl_coordinate_element())
    return _compile(quantity(cell), points, lasting(mesh.comm))


_cache_of_expressions: dict[Any, fem.Expression] = {}
"""The compiled expressions of this process that know no mesh of the user's."""


def _compile(expression: Ufl, points: np.ndarray, comm: MPI.Comm) -> fem.Expression:
    """Compile an expression at reference points once in a process; collective."""
    key = expression, points.shape, points.tobytes()
    ready = key in _cache_of_expressions
    # All ranks compile together, or none: the compiler is collective.
    if comm.size > 1:
        ready = comm.allreduce(ready, MPI.LAND)
    if not ready:
        _cache_of_expressions[key] = compiled.expression(expression, points, comm)
    return _cache_of_expressions[key]
