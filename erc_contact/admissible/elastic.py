"""Moduli in the cells of a model, strains of a displacement, its stress ``C eps(u)`` and the projection of this."""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from erc_contact.admissible.cells import CellGeometry, sorted_corners
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.macro import macro_points, tensors
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
    """Strain of a displacement in Mandel components, coefficients of degree k-1, shape (n, N_(k-1), s)."""
    d, k, n = cells.d, cells.degree, len(cells.nodes)
    slopes = np.ascontiguousarray(
        gradients(d, k) @ coefficients(d, k)
    )  # by the barycentric coordinates
    strain = np.empty((n, len(slopes), d * (d + 1) // 2))
    nodes = np.ascontiguousarray(cells.nodes)
    kernels()(
        "cell_strains",
        d,
        nodes.shape[1],
        len(slopes),
        n,
        nodes,
        cells.area,
        cells.volume,
        slopes,
        u.x.array,
        strain,
    )
    return strain


def elastic_stress(model: Model, cells: CellGeometry, u: fem.Function, count: int) -> np.ndarray:
    """``C eps(u)`` in Mandel components at the points of the sub-simplices [force/area].

    The shape is (count, (d+1) q, s), with 1 in place of (d+1) q where it is constant in
    each cell.
    """
    stiffness, strain = macro_moduli(model, cells, count), strains(cells, u)[:count]
    if cells.degree > 1:
        strain = np.matmul(
            bernstein(cells.d, cells.degree - 1, macro_points(cells.d, cells.degree)[1]), strain
        )
    return act(stiffness, strain)


def act(moduli: np.ndarray, tensor: np.ndarray) -> np.ndarray:
    """Products of moduli (n or 1, q or 1, s, s) and tensors in Mandel components (n, q or 1, s)."""
    if moduli.shape[1] == 1:
        return np.matmul(tensor, moduli[:, 0].transpose(0, 2, 1))
    return np.matmul(moduli, tensor[..., None])[..., 0]


def moduli(
    model: Model, cells: CellGeometry, points: np.ndarray, count: int, *, inverse: bool = False
) -> np.ndarray:
    """The elasticity (or compliance) matrix in Mandel components at reference points of the cells.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        points: Reference points (q, d) for the sorted vertices.
        count: Number of cells, the first ones.
        inverse: Compliance C^-1 [area/force] instead of stiffness C [force/area].

    Returns:
        Shape (count, q, s, s), with 1 in place of count or q where the material does
        not vary.
    """
    matrix = model.compliance if inverse else model.elasticity
    if matrix.plain is not None:
        return matrix.plain[None, None]
    places = (
        barycentric(points)
        if matrix.varies_in_cells
        else np.full((1, model.d + 1), 1 / (model.d + 1))
    )
    return matrix(
        np.matmul(places, sorted_corners(model, cells)[:count]), np.arange(count, dtype=np.int32)
    )


def macro_moduli(
    model: Model, cells: CellGeometry, count: int, *, inverse: bool = False
) -> np.ndarray:
    """Elasticity (or compliance) matrices at the points of the sub-simplices.

    The shape is (count, (d+1) q, s, s), with 1 in place of either number where the
    material does not vary.
    """
    return moduli(model, cells, macro_points(model.d, model.degree)[1], count, inverse=inverse)


def cell_stress(model: Model, cells: CellGeometry, u: fem.Function) -> np.ndarray:
    """L2 projection of ``C eps(u)`` on degree k-1 in each cell, shape (n, N_(k-1), d, d).

    It does the same work as ``C eps(u)`` on the strains of all P_k fields.
    """
    d, k = cells.d, cells.degree
    points, weights = rule(d, DATA_DEGREE)
    stiffness, strain = moduli(model, cells, points, len(cells.nodes)), strains(cells, u)
    if stiffness.shape[1] > 1:
        values = act(stiffness, np.matmul(bernstein(d, k - 1, points), strain))
        return tensors(np.matmul(projection(d, k - 1, points, weights), values), d)
    return tensors(act(stiffness, strain), d)
