"""Hold the distance of two drawn surfaces, where the mesh has them in one place."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from erc_contact.base.ufl_tables import TableData, TableValue
from namedmesh.for_solvers import closest

STEP = 1e-4
"""Step of differences, as a share of the mean edge [-]."""


@dataclass(frozen=True, eq=False)
class DrawnDistance:
    """Hold the distance of two surfaces in space, a callable of the position.

    At a point of one of them it is the distance to the other surface.

    Attributes:
        here: Corners of the triangles of the first surface [length], shape (n, 3, 3).
        there: Corners of the triangles of the second surface, shape (m, 3, 3).
        beside: Distance that adds to it [length].
    """

    here: np.ndarray
    there: np.ndarray
    beside: float = 0.0

    def __post_init__(self) -> None:
        """Make arrays of lists, as code has them."""
        for name in ("here", "there"):
            object.__setattr__(self, name, np.asarray(getattr(self, name)))

    def __call__(self, x: Any) -> Any:
        """Return the distance at a position, UFL."""
        return self.beside + TableValue(x[0], x[1], x[2], TableData(self, self._digest))

    def __repr__(self) -> str:
        """Describe the distance in a line."""
        return f"<drawn distance of {len(self.here)} and {len(self.there)} triangles>"

    @cached_property
    def _digest(self) -> str:
        """Return a text that tells these surfaces from other surfaces."""
        code = self.here.tobytes() + b"|" + self.there.tobytes()
        return hashlib.sha256(code).hexdigest()[:16]

    @property
    def kinks(self) -> list[np.ndarray]:
        """Return the coordinates of the corners along each axis."""
        corners = np.concatenate([self.here, self.there]).reshape(-1, 3)
        return [np.unique(corners[:, i]) for i in range(3)]

    def interpolated(self, places: np.ndarray, slope: int | None = None) -> np.ndarray:
        """Evaluate the distance, or a slope of it, at places (..., 3)."""
        if slope is None:
            flat = places.reshape(-1, 3)
            total = closest(flat, self.here).distance + closest(flat, self.there).distance
            return np.asarray(total).reshape(places.shape[:-1])
        step = np.zeros(3)
        step[slope] = STEP * np.linalg.norm(self.here[:, 1] - self.here[:, 0], axis=1).mean()
        rise = self.interpolated(places + step) - self.interpolated(places - step)
        return rise / (2 * step[slope])
