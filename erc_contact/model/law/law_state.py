"""Hold the state of a law before a load step: plastic strain and hardening, say.

It is what the body remembers, tensors and numbers at each point, as a polynomial of
degree k-1 in each cell. The law of a load step is a potential for this state. The state
after the step follows from the strain at its end.

Symbols: k degree of the displacement, n cells, q points of a cell.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from dolfinx import fem

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.expressions import Everywhere
from erc_contact.model.data.ranges import bernstein_coefficients
from erc_contact.model.law.law_entries import entries, size_of
from erc_contact.model.space import Space
from erc_contact.scene.potential import Remembering, Shapes
from namedmesh.for_solvers import INSIDE_CELLS

ValuesAt = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""A function of points (n, q, d) of cells (n,) that returns values (n, q, size)."""


class LawState:
    """Hold a state as a function of the cells; construction is collective.

    Args:
        space: The mesh.
        values: The entries, tensors in Mandel components, shape (size,) at each point.

    Attributes:
        space: As given.
        values: As given.
        size: Number of components.
        varies_in_cells: Whether they vary inside cells.
        moved: What the interpolation on another mesh changed: the root of the mean
            square of the difference at points, over the root of the mean square of the
            state [-].
        is_zero: Whether the body has not been loaded before.
    """

    def __init__(
        self, space: Space, values: fem.Function, moved: float = 0.0, *, is_zero: bool = False
    ) -> None:
        self.space = space
        self.values = values
        (self.size,) = values.ufl_shape
        is_polynomial = values.ufl_element().embedded_superdegree > 0
        self.varies_in_cells = is_polynomial and not is_zero
        self.moved = moved
        self.is_zero = is_zero
        self._at = Everywhere(values, values.function_space.mesh)

    @classmethod
    def at_rest(cls, space: Space, potential: Remembering) -> LawState:
        """Return the state of a body that has not been loaded: zero."""
        values = polynomials_in_cells(space, size_of(potential.state))
        return cls(space, values, is_zero=True)

    def at(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the entries at points (n, q, d) of cells (n,), shape (n, q, size)."""
        if self.is_zero:
            return np.zeros((*x.shape[:2], self.size))
        return self._at(x, cells)

    def ranges(self, corners: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bound the entries in pieces of cells, see :meth:`.PointLaw.data_ranges`."""
        of_pieces = bernstein_coefficients(self.values, corners, cells)
        return of_pieces.min(axis=1), of_pieces.max(axis=1)

    def ufl(self, shapes: Shapes) -> dict[str, Ufl]:
        """Return the entries of the state by their names, UFL."""
        return entries(shapes, [self.values[i] for i in range(self.size)])

    def in_cells(self, cells: np.ndarray) -> np.ndarray:
        """Return the values at the nodes inside cells (n,), shape (n, q, size)."""
        blocks = self.values.x.array.reshape(-1, self.size)
        return np.asarray(blocks[self.values.function_space.dofmap.list[cells]])

    @classmethod
    def of(cls, space: Space, size: int, values_at: ValuesAt) -> LawState:
        """Return a field by its values at points of cells; collective.

        Args:
            space: The mesh.
            size: Number of components.
            values_at: Gives them at points of cells.
        """
        values = polynomials_in_cells(space, size)
        W = values.function_space
        cells = space.owned_cells
        x = space.cell_points(W.element.interpolation_points, cells)
        blocks = values.x.array.reshape(-1, size)
        blocks[W.dofmap.list[cells].ravel()] = values_at(x, cells).reshape(-1, size)
        values.x.scatter_forward()
        return cls(space, values)


def polynomials_in_cells(space: Space, size: int, more: int = 0) -> fem.Function:
    """Return polynomials of degree k-1 (and more) in each cell, zero everywhere."""
    return space.domain.function(INSIDE_CELLS, space.degree - 1 + more, (size,))
