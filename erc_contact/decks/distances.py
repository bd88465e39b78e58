"""Hold the distance of two drawn surfaces, where the mesh has them in one place."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from erc_contact.base.ufl_tables import TableData, TableValue
from erc_contact.decks.locating import Locator
from namedmesh.for_solvers import DeckMesh


@dataclass(frozen=True, eq=False)
class DrawnDistance:
    """Hold the distance of two surfaces in space, a callable of the position.

    At a point of one of them it is its height above the plane of the triangle of the
    other surface that faces it, along the outward normal: negative where the bodies
    overlap. The height above its own surface, which is zero, adds to it.

    Attributes:
        here: Corners of the triangles of the first surface [length], shape (n, 3, 3),
            counterclockwise as seen from outside.
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

    @cached_property
    def _locators(self) -> tuple[Locator, Locator]:
        """Return what finds the triangles of points, on both surfaces."""
        return Locator(self.here), Locator(self.there)

    def interpolated(self, places: np.ndarray, slope: int | None = None) -> np.ndarray:
        """Evaluate the distance, or a slope of it, at places (..., 3)."""
        flat = places.reshape(-1, 3)
        total = np.zeros(len(flat))
        for locator in self._locators:
            triangle, _ = locator.locate(flat)
            corners = locator.corners[triangle]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals /= np.linalg.norm(normals, axis=1)[:, None]
            if slope is None:
                total += np.einsum("ni,ni->n", normals, flat - corners[:, 0])
            else:
                total += normals[:, slope]
        return total.reshape(places.shape[:-1])


def outward_triangles(mesh: DeckMesh, faces: np.ndarray) -> np.ndarray:
    """Return the corners of triangles of faces, counterclockwise as seen from outside.

    Shape (m, 3, 3).
    """
    corners = mesh.x[mesh.simplices(faces)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = mesh.normals(faces)[mesh.owners_of_simplices(faces)]
    is_inward = np.einsum("mi,mi->m", normals, outward) < 0
    corners[is_inward] = corners[is_inward, ::-1]
    return corners
