"""Hold values at the nodes of a deck, quadratic in its simplices, as functions of x."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from erc_contact.base.ufl_tables import TableData, TableValue
from erc_contact.decks.locating import Locator

AT_ONCE = 20000
"""Number of points that are worked on at once."""


@dataclass(frozen=True, eq=False)
class NodalTable:
    """Hold values at nodes, which scenes take as a callable of x.

    It is quadratic in the simplices of the deck's mesh, whatever the mesh of the scene;
    beyond them the nearest simplex goes on.

    Attributes:
        x: The nodes [length], shape (n, d).
        simplices: Their corners, shape (m, d+1).
        values: Values at the nodes, shape (n,).
        between: Values at the middles of the edges of each simplex, in the order of
            ``itertools.combinations``, shape (m, d(d+1)/2).
    """

    x: np.ndarray
    simplices: np.ndarray
    values: np.ndarray
    between: np.ndarray

    def __post_init__(self) -> None:
        """Make arrays of lists, as code has them."""
        for name in ("x", "simplices", "values", "between"):
            object.__setattr__(self, name, np.asarray(getattr(self, name)))

    def __call__(self, x: Any) -> Any:
        """Return the value at a position, UFL."""
        coordinates = [x[i] for i in range(self.x.shape[1])]
        return TableValue(*coordinates, TableData(self, self._digest))

    def __repr__(self) -> str:
        """Describe the table in a line."""
        return f"<values at {len(self.x)} nodes>"

    def times(self, factor: float) -> NodalTable:
        """Return the values times a factor."""
        return replace(self, values=factor * self.values, between=factor * self.between)

    @cached_property
    def _digest(self) -> str:
        """Return a text that tells these numbers from other numbers."""
        arrays = (self.x, self.simplices, self.values, self.between)
        code = b"|".join(array.tobytes() for array in arrays)
        return hashlib.sha256(code).hexdigest()[:16]

    @property
    def kinks(self) -> list[np.ndarray]:
        """Return the coordinates of the nodes along each axis."""
        return [np.unique(self.x[:, i]) for i in range(self.x.shape[1])]

    @cached_property
    def _locator(self) -> Locator:
        """Return what finds the simplices of points."""
        return Locator(self.x[self.simplices])

    @cached_property
    def _ends(self) -> np.ndarray:
        """Return the ends of the edges of a simplex, shape (2, edges)."""
        return np.array(list(combinations(range(self.simplices.shape[1]), 2))).T

    def interpolated(self, places: np.ndarray, slope: int | None = None) -> np.ndarray:
        """Evaluate the values, or a slope of them, at places (..., d)."""
        flat = places.reshape(-1, places.shape[-1])
        parts = []
        for begin in range(0, len(flat), AT_ONCE):
            parts.append(self._at(flat[begin : begin + AT_ONCE], slope))
        result = np.concatenate([np.empty(0), *parts])
        return result.reshape(places.shape[:-1])

    def _at(self, places: np.ndarray, slope: int | None) -> np.ndarray:
        """Evaluate at places (n, d)."""
        chosen, at = self._locator.locate(places)
        values = self.values[self.simplices[chosen]]
        first, second = self._ends
        # Beside the linear function stands 4 w_i w_j times what the middle is above it.
        above = self.between[chosen] - 0.5 * (values[:, first] + values[:, second])
        if slope is None:
            bumps = 4.0 * at[:, first] * at[:, second]
            return np.asarray((at * values).sum(axis=1) + (bumps * above).sum(axis=1))
        along = self._locator.maps[chosen, :, slope]
        along = np.column_stack([-along.sum(axis=1), along])
        rises = 4.0 * (at[:, first] * along[:, second] + at[:, second] * along[:, first])
        return np.asarray((along * values).sum(axis=1) + (rises * above).sum(axis=1))
