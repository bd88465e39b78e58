"""Look into UFL expressions: what they contain, their derivatives, and constant values.

Nothing here is compiled.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction
from ufl.corealg.traversal import traverse_unique_terminals, unique_pre_traversal
from ufl.utils.stacks import StackDict

from erc_contact.base.runtime.patches import method_caches_off
from erc_contact.base.ufl_tables import TableFunction
from erc_contact.base.ufl_types import Ufl


def sum_of(terms: Sequence[Ufl]) -> Ufl | None:
    """Add up UFL terms; None if there are none."""
    return sum(terms[1:], start=terms[0]) if terms else None


def varies(expression: Ufl) -> bool:
    """Tell whether a UFL expression varies in space, so is more than constants."""
    in_space = (ufl.classes.GeometricQuantity, ufl.classes.Coefficient)
    return any(isinstance(terminal, in_space) for terminal in traverse_unique_terminals(expression))


def varies_in_cells(expression: Ufl) -> bool:
    """Tell whether a UFL expression varies inside straight cells and facets.

    It does if it contains x, or a function that varies there.
    """
    for terminal in traverse_unique_terminals(ufl.as_ufl(expression)):
        if isinstance(terminal, ufl.classes.SpatialCoordinate):
            return True
        if isinstance(terminal, ufl.classes.Coefficient):
            element = terminal.ufl_element()
            if element.embedded_superdegree > 0:
                return True
    return False


def has_fields(expression: Ufl) -> bool:
    """Tell whether a UFL expression contains functions that vary inside cells."""
    for terminal in traverse_unique_terminals(expression):
        if isinstance(terminal, TableFunction):
            if has_fields(terminal.coordinates):
                return True
        elif isinstance(terminal, ufl.classes.Coefficient) and varies_in_cells(terminal):
            return True
    return False


def has_arguments(expression: Ufl) -> bool:
    """Tell whether a UFL expression contains a test or trial function."""
    terminals = traverse_unique_terminals(expression)
    return any(isinstance(terminal, ufl.Argument) for terminal in terminals)


def is_data(expression: Ufl) -> bool:
    """Tell whether a UFL expression has only data that are known in each cell.

    These are the position, the normal, constants, functions that are constant in cells,
    and tables of these.
    """
    indices = ufl.classes.MultiIndex | ufl.classes.Label
    geometry = ufl.classes.SpatialCoordinate | ufl.classes.FacetNormal
    data = geometry | ufl.classes.ConstantValue | fem.Constant
    for terminal in traverse_unique_terminals(expression):
        if isinstance(terminal, indices | data):
            continue
        if isinstance(terminal, TableFunction):
            if not is_data(terminal.coordinates):
                return False
            continue
        constant_in_cells = not varies_in_cells(terminal)
        if not (isinstance(terminal, ufl.classes.Coefficient) and constant_in_cells):
            return False
    return True


def without_derivatives(expression: Ufl) -> Ufl:
    """Carry out the derivatives of a UFL expression, if it has any."""
    expression = ufl.as_ufl(expression)
    nodes = unique_pre_traversal(expression)
    if not any(isinstance(node, ufl.classes.Derivative) for node in nodes):
        return expression
    with method_caches_off():
        return ufl.algorithms.expand_derivatives(expression)


class _Stripped(MultiFunction):
    """Replace the variables of an expression by what they stand for."""

    expr = MultiFunction.reuse_if_untouched

    def variable(self, _: Ufl, stands_for: Ufl, label: Ufl) -> Ufl:
        """Return the first operand of a variable."""
        return stands_for


def without_variables(expression: Ufl) -> Ufl:
    """Strip an expression without derivatives of its variables.

    They have numbers, by which equal expressions of two processes would differ and be
    compiled twice. UFL's own ``strip_variables`` visits a common part of an expression
    as often as it is used, which takes seconds for a law.
    """
    return map_expr_dag(_Stripped(), expression)


def constant_value(expression: Ufl) -> np.ndarray:
    """Return the value of a UFL expression that does not vary."""
    if isinstance(expression, fem.Constant):
        return expression.value.astype(float)
    expression = apply_algebra_lowering(expression)
    shape = expression.ufl_shape
    constants: dict[Ufl, Any] = {}
    for constant in ufl.algorithms.analysis.extract_constants(expression):
        constants[constant] = constant.value if constant.ufl_shape else float(constant.value)
    entries = []
    for index in np.ndindex(shape):
        entries.append(expression.evaluate((), constants, index, StackDict()))
    return np.reshape(entries, shape).astype(float)
