"""Stresses of cells in space, and their von Mises stress."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl

from erc_contact.mesh.simplex import nodes
from erc_contact.model.expressions import evaluate
from erc_contact.model.model import Model
from erc_contact.scene.material import mandel_basis


def stress_in_space(model: Model, stress: np.ndarray) -> np.ndarray:
    """Stresses of owned cells (owned, d, d) as tensors in space [force/area], shape (owned, 3, 3).

    In 2D the material gives the stress out of plane, at the middle of each cell; nan
    stands for one that is not known.
    """
    d = model.d
    full = np.zeros((len(stress), 3, 3))
    full[:, :d, :d] = stress
    if not tells_out_of_plane(model):
        full[:, 2, 2] = np.nan
    elif d == 2:
        basis = mandel_basis(d)
        material: Any = model.scene.material
        images = [
            material.out_of_plane(ufl.as_matrix(b.tolist()), **model.parameters) for b in basis
        ]
        cells = np.arange(len(stress), dtype=np.int32)
        row = evaluate(ufl.as_vector(images), model.mesh, nodes(d, 0), cells)[:, 0]
        full[:, 2, 2] = np.einsum("nk,kij,nij->n", row, basis, stress)
    return full


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Von Mises stress ``sqrt(3/2) |dev sigma|`` of tensors (n, 3, 3) [force/area], shape (n,).

    A stress out of plane that is not known (nan) counts as 0. The result is then the
    von Mises stress of the part in plane.
    """
    known = np.nan_to_num(stress)
    trace = np.einsum("nii->n", known)
    deviator = known - trace[:, None, None] / 3 * np.eye(3)
    return np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))


def tells_out_of_plane(model: Model) -> bool:
    """Tell whether all stresses are known: in 3D, and where the material has a method ``out_of_plane``."""
    return model.d == 3 or hasattr(model.scene.material, "out_of_plane")
