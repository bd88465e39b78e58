"""Tabulate the shapes of cells that files have: their corners, faces and names.

The order of the corners is that of VTK, gmsh, Abaqus and Exodus. Cells of higher order
list their corners first. The orientation of a whole cell has no meaning, but the faces
of a cell all turn the same way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Shape:
    """Describe a shape of cells.

    Attributes:
        dim: Dimension of the cell.
        faces: Corners of each face. In the plane they are the edges.
    """

    dim: int
    faces: tuple[tuple[int, ...], ...]

    @property
    def corners(self) -> int:
        """Return the number of corners."""
        return 1 + max((corner for face in self.faces for corner in face), default=0)

    @property
    def face_table(self) -> np.ndarray:
        """Return the corners of the faces, shape (faces, 2) in the plane, else (., 4).

        A triangle has its last corner twice.
        """
        width = 2 * (self.dim - 1)
        return np.array([face + face[-1:] * (width - len(face)) for face in self.faces])


SHAPES = {
    "vertex": Shape(0, ((0,),)),
    "line": Shape(1, ((0,), (1,))),
    "triangle": Shape(2, ((0, 1), (1, 2), (2, 0))),
    "quadrilateral": Shape(2, ((0, 1), (1, 2), (2, 3), (3, 0))),
    "tetrahedron": Shape(3, ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))),
    "hexahedron": Shape(
        3,
        ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    ),
    "prism": Shape(3, ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))),
    "pyramid": Shape(3, ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))),
}
"""The shapes by name."""
PLURALS = {"vertex": "vertices", "hexahedron": "hexahedra", "tetrahedron": "tetrahedra"}


def counted(number: int, shape: str) -> str:
    """Return a number of cells of a shape in words."""
    return f"{number} {shape}" if number == 1 else f"{number} {PLURALS.get(shape, shape + 's')}"
