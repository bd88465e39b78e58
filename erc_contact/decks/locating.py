"""Find the simplex of a mesh that has a point, or is left least by it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree  # type: ignore[import-untyped]

FEW, NEAREST = 6, 24
"""Numbers of simplices that are tried for a point, nearest middles first.

The greater number is for points that are in none of the first simplices.
"""
INSIDE = 1e-9
"""Barycentric coordinate below zero that round-off leaves inside [-]."""


@dataclass(frozen=True, eq=False)
class Locator:
    """Locate points in simplices; of triangles in space it locates their feet.

    Attributes:
        corners: Corners of the simplices [length], shape (m, k, d).
    """

    corners: np.ndarray

    @cached_property
    def maps(self) -> np.ndarray:
        """Return the maps to barycentric coordinates but the first, (m, k-1, d)."""
        sides = self.corners[:, 1:] - self.corners[:, :1]
        return np.linalg.pinv(np.swapaxes(sides, 1, 2))

    @cached_property
    def _tree(self) -> Any:
        """Return a tree of the middles of the simplices."""
        return cKDTree(self.corners.mean(axis=1))

    def locate(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find the simplices of places (n, d).

        Returns:
            Their numbers, and the barycentric coordinates there, shape (n, k).
        """
        chosen, at = self._among(places, FEW)
        outside = np.flatnonzero(at.min(axis=1) < -INSIDE)
        chosen[outside], at[outside] = self._among(places[outside], NEAREST)
        return chosen, at

    def _among(self, places: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Locate places among the simplices with the nearest middles."""
        count = min(count, len(self.corners))
        _, near = self._tree.query(places, k=[*range(1, count + 1)])
        arms = places[:, None] - self.corners[near, 0]
        later = np.einsum("nkij,nkj->nki", self.maps[near], arms)
        weights = np.concatenate([1.0 - later.sum(axis=2, keepdims=True), later], axis=2)
        # The simplex that has the place, or is left least.
        best = weights.min(axis=2).argmax(axis=1)
        rows = np.arange(len(places))
        return near[rows, best], weights[rows, best]
