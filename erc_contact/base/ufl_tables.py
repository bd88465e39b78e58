"""Represent tables in UFL: data between points, which numpy interpolates.

A formula of all pieces of a table would take FFCx ten seconds for 500 points. So a
table is an operator of its own here, of which UFL knows the derivative. Forms have a
Function in its place, which knows the table that it stands for.
"""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

import numpy as np
from dolfinx import fem
from ufl.algorithms.apply_derivatives import GenericDerivativeRuleset
from ufl.constantvalue import ConstantValue
from ufl.core.operator import Operator
from ufl.core.ufl_type import ufl_type
from ufl.corealg.multifunction import MultiFunction
from ufl.corealg.traversal import traverse_unique_terminals


class Source(Protocol):
    """Describe a table."""

    @property
    def kinks(self) -> list[np.ndarray]:
        """Return the points of each coordinate at which the slope changes."""

    def interpolated(self, places: np.ndarray, slope: int | None = None) -> np.ndarray:
        """Evaluate the table, or its slope, at places (..., coordinates)."""


@ufl_type()
class TableData(ConstantValue):
    """Hold a table as a terminal of UFL: its values, or one of its slopes.

    Args:
        source: The table.
        digest: A text that tells its numbers from the numbers of other tables.
        slope: Number of the coordinate whose derivative is meant, or None.
    """

    __slots__ = ("digest", "slope", "source")

    ufl_shape = ()
    ufl_free_indices = ()
    ufl_index_dimensions = ()

    any_made: ClassVar[bool] = False
    """Whether there was a table in this process; most programs have none."""

    def __init__(self, source: Source, digest: str, slope: int | None = None) -> None:
        super().__init__()
        TableData.any_made = True
        self.source = source
        self.slope = slope
        self.digest = digest

    def _ufl_compute_hash_(self) -> int:
        return hash(("TableData", self.digest, self.slope))

    def _ufl_signature_data_(self, renumbering: Any) -> tuple[Any, ...]:
        return ("TableData", self.digest, self.slope)

    def __eq__(self, other: object) -> bool:
        """Compare by the numbers of the table."""
        if not isinstance(other, TableData):
            return False
        return (self.digest, self.slope) == (other.digest, other.slope)

    __hash__ = ConstantValue.__hash__

    def __repr__(self) -> str:
        """Name the table by its numbers."""
        return f"TableData({self.digest}, {self.slope})"

    __str__ = __repr__


@ufl_type(is_scalar=True, num_ops="varying")
class TableValue(Operator):
    """Represent the value of a table in UFL, an operator of its coordinates.

    The last operand is the :class:`TableData`.
    """

    __slots__ = ()

    def __init__(self, *operands: Any) -> None:
        Operator.__init__(self, operands)

    @property
    def coordinates(self) -> tuple[Any, ...]:
        """Return the coordinates at which the table is taken, UFL."""
        return self.ufl_operands[:-1]

    @property
    def data(self) -> TableData:
        """Return the table and what is taken of it."""
        return self.ufl_operands[-1]

    def __str__(self) -> str:
        """Return the expression in words."""
        inside = ", ".join(str(coordinate) for coordinate in self.coordinates)
        return f"table({inside})"


@GenericDerivativeRuleset.process.register(TableValue)
def _derivative(self: Any, value: TableValue) -> Any:
    """Differentiate by the chain rule; the slopes are constant in pieces."""
    result: Any = 0
    for number, coordinate in enumerate(value.coordinates):
        if value.data.slope is not None:
            raise ValueError("A table has no second derivative.")
        data = TableData(value.data.source, value.data.digest, number)
        slope = TableValue(*value.coordinates, data)
        result = result + self(coordinate) * slope
    return result


# UFL lists the handlers of all operators once for each algorithm, perhaps before these.
MultiFunction._handlers_cache.clear()


class TableFunction(fem.Function):
    """Represent a table on a mesh: exact where numpy evaluates it, a Function in forms.

    Attributes:
        coordinates: The coordinates at which the table is taken, a UFL vector.
        data: The table, and what is taken of it.
    """

    coordinates: Any
    data: TableData

    def at(self, coordinates: np.ndarray) -> np.ndarray:
        """Evaluate the table at coordinates of points, shape (..., count)."""
        return self.data.source.interpolated(coordinates, self.data.slope)


def has_tables(expression: Any) -> bool:
    """Tell whether a UFL expression contains tables that are on no mesh yet."""
    if not TableData.any_made:
        return False
    terminals = traverse_unique_terminals(expression)
    return any(isinstance(terminal, TableData) for terminal in terminals)
