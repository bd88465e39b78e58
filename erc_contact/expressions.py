"""Values of UFL expressions at points of cells and facets, and at numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from ufl.corealg.traversal import traverse_unique_terminals
from ufl.utils.stacks import StackDict

from erc_contact.domain import Domain


def varies(expression: Any) -> bool:
    """Whether a UFL expression varies in space: it knows more than constants."""
    in_space = (ufl.classes.GeometricQuantity, ufl.classes.Coefficient)
    return any(isinstance(terminal, in_space) for terminal in traverse_unique_terminals(expression))


def evaluate(expression: Any, domain: Domain, points: np.ndarray, entities: np.ndarray) -> np.ndarray:
    """Values of a UFL expression at reference points of cells or of facets.

    Args:
        expression: UFL expression of shape s.
        domain: Where it lives.
        points: Reference points, shape (q, d) for cells, (q, d-1) for facets.
        entities: Cells, shape (n,), or pairs (cell, local facet), shape (n, 2); ghosts are allowed.

    Returns:
        Values, shape (n, q, *s).
    """
    expression = ufl.algorithms.expand_derivatives(ufl.as_ufl(expression))
    if not varies(expression):  # a number, constants, derivatives that became constant: nothing to compile
        plain = _plain(expression)
        return np.broadcast_to(plain, (len(entities), len(points), *plain.shape))
    compiled = fem.Expression(expression, points, comm=domain.mesh.comm, dtype=np.float64)
    return compiled.eval(domain.mesh, entities)


def _plain(expression: Any) -> np.ndarray:
    """The value of a UFL expression that does not vary in space."""
    shape, constants = expression.ufl_shape, ufl.algorithms.analysis.extract_constants(expression)
    known = {c: c.value if c.ufl_shape else float(c.value) for c in constants}
    values = [expression.evaluate((), known, index, StackDict()) for index in np.ndindex(shape)]
    return np.reshape(values, shape).astype(float)


def pointwise(function: Callable[..., Any], arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """Evaluate a UFL function of numbers at every entry of arrays of one shape.

    The arrays become piecewise constants on a line of as many cells, so that the function is written once, in UFL.
    """
    shape = np.broadcast_shapes(*(a.shape for a in arrays.values()))
    size = int(np.prod(shape))
    line = dmesh.create_interval(MPI.COMM_SELF, max(size, 1), (0.0, 1.0))
    W = fem.functionspace(line, ("DG", 0))
    numbers = {}
    for name, array in arrays.items():
        numbers[name] = fem.Function(W)
        cells = line.topology.original_cell_index[:size]
        numbers[name].x.array[:size] = np.broadcast_to(array, shape).ravel()[cells]
    expression = ufl.as_ufl(function(**numbers))
    if not varies(expression):
        return np.broadcast_to(_plain(expression), shape)
    compiled = fem.Expression(expression, np.array([[0.5]]), comm=MPI.COMM_SELF, dtype=np.float64)
    values = np.empty(size)
    values[line.topology.original_cell_index[:size]] = compiled.eval(line, np.arange(size, dtype=np.int32)).ravel()
    return values.reshape(shape)
