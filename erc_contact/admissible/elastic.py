"""Moduli in the cells of a model, strains of a displacement, and its stress."""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from erc_contact.admissible.cells import CellGeometry, sorted_corners
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.reference import tensors
from erc_contact.mesh.simplex import (
    barycentric,
    bernstein,
    coefficients,
    gradients,
    projection,
    rule,
)
from erc_contact.model.model import Model
from erc_contact.model.values import DATA_DEGREE


def strains(cells: CellGeometry, u: fem.Function) -> np.ndarray:
    """Compute the strain of a displacement [-].

    Returns:
        Coefficients of degree k-1 in Mandel components, shape (n, N_(k-1), s).
    """
    d, k = cells.d, cells.degree
    n = len(cells.nodes)
    # derivatives by the barycentric coordinates
    slopes = np.ascontiguousarray(gradients(d, k) @ coefficients(d, k))
    strain = np.empty((n, len(slopes), d * (d + 1) // 2))
    nodes = np.ascontiguousarray(cells.nodes)
    sizes = (d, nodes.shape[1], len(slopes), n)
    geometry = (nodes, cells.area, cells.volume)
    kernels()("cell_strains", *sizes, *geometry, slopes, u.x.array, strain)
    return strain


def elastic_stress(model: Model, cells: CellGeometry, u: fem.Function, count: int) -> np.ndarray:
    """Compute ``C eps(u)`` at the points of the sub-simplices [force/area].

    It is given in Mandel components. The shape is (count, (d+1) q, s), with 1 in place
    of (d+1) q where it is constant in each cell.
    """
    d, k = cells.d, cells.degree
    stiffness = macro_moduli(model, cells, count)
    strain = strains(cells, u)[:count]
    if k > 1:
        _, points, _ = macro_points(d, k)
        strain = np.matmul(bernstein(d, k - 1, points), strain)
    return act(stiffness, strain)


def act(moduli: np.ndarray, tensor: np.ndarray) -> np.ndarray:
    """Multiply moduli and tensors in Mandel components.

    Args:
        moduli: Shape (n or 1, q or 1, s, s).
        tensor: Shape (n, q or 1, s).
    """
    if moduli.shape[1] == 1:
        return np.matmul(tensor, moduli[:, 0].transpose(0, 2, 1))
    return np.matmul(moduli, tensor[..., None])[..., 0]


def moduli(
    model: Model, cells: CellGeometry, points: np.ndarray, count: int, *, inverse: bool = False
) -> np.ndarray:
    """Return the elasticity (or compliance) matrix at reference points of the cells.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        points: Reference points (q, d) for the sorted vertices.
        count: Number of cells, the first ones.
        inverse: Compliance C^-1 [area/force] instead of stiffness C [force/area].

    Returns:
        Mandel components, shape (count, q, s, s), with 1 in place of count or q where
        the material does not vary.
    """
    matrix = model.compliance if inverse else model.elasticity
    if matrix.plain is not None:
        return matrix.plain[None, None]
    if matrix.varies_in_cells:
        places = barycentric(points)
    else:
        places = np.full((1, model.d + 1), 1 / (model.d + 1))
    x = np.matmul(places, sorted_corners(model, cells)[:count])
    return matrix(x, np.arange(count, dtype=np.int32))


def macro_moduli(
    model: Model, cells: CellGeometry, count: int, *, inverse: bool = False
) -> np.ndarray:
    """Return elasticity (or compliance) matrices at the points of the sub-simplices.

    The shape is (count, (d+1) q, s, s), with 1 in place of either number where the
    material does not vary.
    """
    _, points, _ = macro_points(model.d, model.degree)
    return moduli(model, cells, points, count, inverse=inverse)


def cell_stress(model: Model, cells: CellGeometry, u: fem.Function) -> np.ndarray:
    """Project ``C eps(u)`` on degree k-1 in each cell [force/area].

    The L2 projection does the same work as ``C eps(u)`` on the strains of all P_k
    fields.

    Returns:
        Coefficients, shape (n, N_(k-1), d, d).
    """
    d, k = cells.d, cells.degree
    points, weights = rule(d, DATA_DEGREE)
    stiffness = moduli(model, cells, points, len(cells.nodes))
    strain = strains(cells, u)
    if stiffness.shape[1] == 1:
        # Constant moduli act on the coefficients.
        return tensors(act(stiffness, strain), d)
    values = act(stiffness, np.matmul(bernstein(d, k - 1, points), strain))
    return tensors(np.matmul(projection(d, k - 1, points, weights), values), d)
