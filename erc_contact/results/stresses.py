"""Mean stresses of an admissible pair in the cells."""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.admissible.reference import tensors
from erc_contact.mesh.simplex import from_means, mass
from erc_contact.model.stress import stress_in_space, tells_out_of_plane, von_mises


def mean_stress(result: Any) -> np.ndarray:
    """Mean of sigma^ in each owned cell [force/area], shape (owned, 3, 3); collective.

    In 2D the stress out of plane is that of the material's ``out_of_plane``, or nan if
    the material has none.

    Args:
        result: An admissible pair, an error, or a history.
    """
    admissible = pair_of(result)
    model, stress = admissible.model, admissible.stress
    coefficients = stress.reshape(len(stress), -1, stress.shape[-1])
    share = np.full(
        coefficients.shape[1], 1 / coefficients.shape[1]
    )  # faster than numpy's mean of short rows
    return stress_in_space(model, tensors(share @ coefficients, model.d))


def vertex_stress(admissible: Admissible) -> np.ndarray:
    """The linear stress nearest to sigma^ in each owned cell, at its vertices [force/area]; collective.

    It is the projection of sigma^ in the mean square. Cells do not share values at
    vertices, which are in the order of ``cell_geometry.vertices``.

    Returns:
        Shape (owned, d+1, 3, 3). In 2D the stress out of plane is as in
        :func:`mean_stress`.
    """
    model, d = admissible.model, admissible.model.d
    vertices = np.tile(
        np.eye(d + 1), (d + 1, 1, 1)
    )  # their hat functions, by those of each sub-simplex
    for sub in range(d + 1):
        vertices[sub, :, sub] = 1 / (d + 1)
    weights = np.matmul(vertices, mass(d, 1, model.degree)) / (d + 1)
    means = np.einsum("svm,nsmc->nvc", weights, admissible.stress)
    linear = tensors(from_means(d, 1, means), d)
    return np.stack([stress_in_space(model, linear[:, vertex]) for vertex in range(d + 1)], axis=1)


def cell_stresses(admissible: Admissible) -> dict[str, np.ndarray]:
    """Means of stresses in the cells of this rank, by their names in files for ParaView."""
    model = admissible.model
    stress = mean_stress(admissible)
    fe = stress_in_space(model, admissible.fe_stress[: model.domain.owned_cells].mean(axis=1))
    mises = "von_mises" if tells_out_of_plane(model) else "von_mises_in_plane"
    return {
        "stress": stress.reshape(-1, 9),
        "stress_fe": fe.reshape(-1, 9),
        mises: von_mises(stress),
    }
