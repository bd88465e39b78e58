"""Complete stresses of cells to tensors in 3D."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from erc_contact.model.law.point_law import Search
from erc_contact.model.law.strains import Strains
from erc_contact.model.model import Model
from namedmesh.simplex import nodes


def stress_in_space(
    model: Model, stress: np.ndarray, cells: np.ndarray | None = None
) -> np.ndarray:
    """Complete stresses of cells to tensors in 3D [force/area].

    In 2D the material gives the stress out of plane, at the middle of each cell; nan
    stands for one that is not known. A potential has the one of least psi*.

    Args:
        model: The scene on a mesh.
        stress: Mandel components [force/area], shape (n, s); of an axisymmetric body
            with the hoop stress, which is the one out of plane.
        cells: The cells, shape (n,); None for all owned cells.

    Returns:
        Shape (n, 3, 3).
    """
    space = model.space
    d = space.d
    cells = space.owned_cells if cells is None else cells.astype(np.int32)
    basis, rows = space.section.basis, space.section.rows
    full = np.zeros((len(stress), 3, 3))
    full[:, :rows, :rows] = np.tensordot(stress, basis, axes=1)
    if rows == 3:
        return full
    if model.linearised is not None:
        middles = space.cell_corners()[cells].mean(axis=1, keepdims=True)
        near = 0.5 * (stress[:, None, 0] + stress[:, None, 1])
        at_middles = (middles, cells)
        _, out = model.linearised.law.complementary(stress[:, None], Search(near), *at_middles)
        full[:, 2, 2] = out[:, 0]
    elif not tells_out_of_plane(model):
        full[:, 2, 2] = np.nan
    else:
        material: Any = model.scene.material
        # The stress out of plane is linear in the stress: its values for a basis are
        # enough.
        images = []
        for matrix in basis:
            tensor = ufl.as_matrix(matrix.tolist())
            images.append(material.out_of_plane(tensor, **model.parameters))
        row = space.evaluate(ufl.as_vector(images), nodes(d, 0), cells)[:, 0]
        full[:, 2, 2] = np.einsum("nk,nk->n", row, stress)
        if isinstance(model.strains, Strains):
            # A strain out of plane that cannot take place presses on the plane.
            modulus = material.out_of_plane_modulus(**model.parameters)
            pressed = -modulus * model.strains.normal
            full[:, 2, 2] += space.evaluate(pressed, nodes(d, 0), cells)[:, 0]
    return full


def tells_out_of_plane(model: Model) -> bool:
    """Tell whether the stress out of plane is known.

    It is in 3D, and where the material has a method ``out_of_plane``, with given
    strains ``out_of_plane_modulus``, too.
    """
    if model.space.section.rows == 3 or model.linearised is not None:
        return True
    material = model.scene.material
    needed = ["out_of_plane"]
    if model.strains is not None:
        needed.append("out_of_plane_modulus")
    return all(hasattr(material, name) for name in needed)
