"""Evaluate the shape functions of the cells that files have, of first and second order.

The functions of a cell span products of powers of its local coordinates. Those of the
nodes follow from their values there: one at the own node, zero at all others.

Local coordinates are of the unit simplex and of the unit square and cube. A prism is a
unit triangle times the unit interval. A pyramid has the base ``[-1, 1]^2`` at z = 0 and
its apex at z = 1, where x and y are between ``-(1 - z)`` and ``1 - z``.

Source: Zienkiewicz, Taylor, The Finite Element Method, chapter "Standard and
hierarchical shape functions", for the families of second order; for pyramids Bedrosian,
Int. J. Numer. Meth. Engng. 35 (1992).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product

import numpy as np

from namedmesh.files.cleaning import edges_of
from namedmesh.files.file_mesh import SHAPES

CORNERS = {
    "triangle": ((0, 0), (1, 0), (0, 1)),
    "quadrilateral": ((0, 0), (1, 0), (1, 1), (0, 1)),
    "tetrahedron": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "hexahedron": (
        *((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)),
        *((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
    ),
    "prism": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)),
    "pyramid": ((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)),
}
"""Local coordinates of the corners of each shape."""
SIMPLICES = ("triangle", "tetrahedron")
"""Shapes whose functions are polynomials of a total degree."""
WHOLE = {"quadrilateral": 9, "hexahedron": 27}
"""Number of nodes of cells that have nodes in the middles of faces and of the cell."""
APEX = 1e-9
"""Distance to the apex of a pyramid at which its functions are evaluated [-]."""
STEPS = 12
"""Greatest number of Newton steps to the local coordinates of a point."""
ROUND_OFF = 1e-14
"""What is added to the derivatives of a map, by their size [-]."""
CONVERGED = 1e-12
"""Step of local coordinates that is round-off [-]."""


@dataclass(frozen=True, eq=False)
class ShapeFunctions:
    """Evaluate the shape functions of the nodes of a cell.

    Attributes:
        shape: Name of the shape.
        nodes: Local coordinates of the nodes, shape (k, d).
        order: 1 or 2.

    Example:
        >>> corner_functions("quadrilateral").at(np.array([[0.5, 0.5]]))
        array([[0.25, 0.25, 0.25, 0.25]])
    """

    shape: str
    nodes: np.ndarray
    order: int

    @cached_property
    def _powers(self) -> np.ndarray:
        """Return the powers of x, y, z and 1/(1 - z) of each product, shape (k, 4)."""
        return _powers(self.shape, self.order, whole=len(self.nodes) == WHOLE.get(self.shape))

    @cached_property
    def _coefficients(self) -> np.ndarray:
        """Return the coefficients of the products in each function, shape (k, k)."""
        return np.linalg.inv(_products(self._powers, self.nodes))

    def at(self, local: np.ndarray) -> np.ndarray:
        """Evaluate the functions at local coordinates (n, d), shape (n, k)."""
        return self.products(local) @ self._coefficients

    def gradients(self, local: np.ndarray) -> np.ndarray:
        """Evaluate their derivatives along the local coordinates, shape (n, k, d)."""
        slopes = self.slopes(local)
        return np.matmul(slopes.swapaxes(1, 2), self._coefficients).swapaxes(1, 2)

    def factors(self, nodal: np.ndarray) -> np.ndarray:
        """Return the factors of the products in fields with values at nodes.

        Many points of a cell are evaluated by ``products(local) @ factors`` with less
        work than by its functions.

        Args:
            nodal: Values at the nodes of cells, shape (m, k, i).
        """
        return np.matmul(self._coefficients, nodal)

    def products(self, local: np.ndarray) -> np.ndarray:
        """Evaluate the products at local coordinates (n, d), shape (n, k)."""
        return _products(self._powers, local)

    def slopes(self, local: np.ndarray) -> np.ndarray:
        """Evaluate the derivatives of the products, shape (n, k, d)."""
        axes = range(local.shape[1])
        return np.stack([_derivatives(self._powers, local, axis) for axis in axes], axis=-1)


@cache
def corner_functions(shape: str) -> ShapeFunctions:
    """Return the functions of first order, which map a cell with straight edges."""
    return ShapeFunctions(shape, np.array(CORNERS[shape], dtype=float), 1)


def local_coordinates(shape: str, corners: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Find the local coordinates of points in cells with straight edges.

    Args:
        shape: The shape of the cells.
        corners: Corners of the cell of each point [length], shape (n, corners, d).
        x: The points [length], shape (n, d).

    Returns:
        Shape (n, d), within the cell: a point beside it gets a point of the cell.
    """
    functions = corner_functions(shape)
    local = np.broadcast_to(functions.nodes.mean(axis=0), x.shape).copy()
    for _ in range(STEPS):
        miss = x - np.matmul(functions.at(local)[:, None], corners)[:, 0]
        jacobian = np.matmul(corners.swapaxes(1, 2), functions.gradients(local))
        step = np.matmul(inverses_of_maps(jacobian), miss[..., None])[..., 0]
        # A warped cell is folded far outside, where Newton's method would go astray.
        local = within(shape, local + step) if shape not in SIMPLICES else local + step
        if abs(step).max(initial=0.0) < CONVERGED or shape in SIMPLICES:
            break
    return within(shape, local)


def inverses_of_maps(jacobian: np.ndarray) -> np.ndarray:
    """Return the inverses of the derivatives of maps, shape (n, d, d).

    A cell that has collapsed has none at some of its corners: there they are great.
    """
    size = np.linalg.norm(jacobian, axis=(1, 2))[:, None, None]
    # LAPACK pivots, which nearly singular matrices need.
    return np.linalg.inv(jacobian + ROUND_OFF * size * np.eye(jacobian.shape[1]))


def within(shape: str, local: np.ndarray) -> np.ndarray:
    """Return points of a reference cell near local coordinates, shape (n, d)."""
    if shape in SIMPLICES or shape == "prism":
        flat = local[:, :2] if shape == "prism" else local
        weights = np.clip(np.column_stack([1.0 - flat.sum(axis=1), flat]), 0.0, None)
        flat = weights[:, 1:] / weights.sum(axis=1, keepdims=True)
        return np.column_stack([flat, np.clip(local[:, flat.shape[1] :], 0.0, 1.0)])
    if shape == "pyramid":
        height = np.clip(local[:, 2], 0.0, 1.0 - APEX)
        wide = 1.0 - height[:, None]
        return np.column_stack([np.clip(local[:, :2], -wide, wide), height])
    return np.clip(local, 0.0, 1.0)


def middle_groups(shape: str, *, whole: bool) -> list[tuple[int, ...]]:
    """Return the corners in whose middles nodes of second order lie.

    They are the ends of the edges; with ``whole`` also the corners of faces and of the
    cell.
    """
    groups: list[tuple[int, ...]] = [(int(a), int(b)) for a, b in edges_of(shape)]
    if whole:
        groups += [face for face in SHAPES[shape].faces if len(face) == 4]
        groups.append(tuple(range(SHAPES[shape].corners)))
    return groups


@cache
def _powers(shape: str, order: int, *, whole: bool) -> np.ndarray:
    """Return the powers of x, y, z and 1/(1 - z) of the products, shape (k, 4)."""
    d = SHAPES[shape].dim
    found = []
    for powers in product(range(order + 1), repeat=d):
        # Linear factors cost nothing in a serendipity element, and a prism is a
        # triangle along x and y.
        of_degree = sum(powers)
        superlinear = sum(power for power in powers if power > 1)
        if shape == "prism":
            fits = sum(powers[:2]) <= order and sum(powers[:2]) * (powers[2] > 1) <= order - 1
        elif shape in (*SIMPLICES, "pyramid"):
            fits = of_degree <= order
        else:
            fits = whole or order == 1 or superlinear <= order
        if fits:
            found.append((*powers, *(0,) * (3 - d), 0))
    if shape == "pyramid":
        # With xy/(1 - z) it is quadratic on all sides, and x^2 y of its base is there.
        rational = [(1, 1, 0, 1)]
        if order == 2:
            rational += [(2, 1, 0, 1), (1, 2, 0, 1)]
        found += rational
    return np.array(found)


def _products(powers: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Evaluate products of powers at local coordinates (n, d), shape (n, k)."""
    result = np.ones((len(local), len(powers)))
    for axis, x in enumerate(local.T):
        # A table of the powers is far quicker than numpy's powers.
        table = np.stack([np.ones(len(x)), x, x * x], axis=1)
        result *= table[:, powers[:, axis]]
    if powers[:, 3].any():
        result /= np.maximum(1.0 - local[:, 2:3], APEX) ** powers[:, 3]
    return result


def _derivatives(powers: np.ndarray, local: np.ndarray, axis: int) -> np.ndarray:
    """Evaluate the derivatives of products along an axis, shape (n, k)."""
    lower = powers.copy()
    lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
    result = powers[:, axis] * _products(lower, local)
    if axis == 2 and powers[:, 3].any():
        higher = powers + (powers[:, 3:] > 0) * np.array([0, 0, 0, 1])
        result += powers[:, 3] * _products(higher, local)
    return result
