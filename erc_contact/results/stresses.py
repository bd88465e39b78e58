"""Compute stresses of an admissible pair in the cells."""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.admissible.reference import tensors
from erc_contact.mesh.simplex import from_means, mass
from erc_contact.model.stress import stress_in_space, tells_out_of_plane, von_mises


def mean_stress(result: Any) -> np.ndarray:
    """Compute the mean of sigma^ in each owned cell [force/area]; collective.

    Its shape is (owned, 3, 3).

    In 2D the stress out of plane is that of the material's ``out_of_plane``, or nan if
    the material has none.

    Args:
        result: An admissible pair, an error, or a history.
    """
    admissible = pair_of(result)
    model = admissible.model
    stress = admissible.stress
    # All Bernstein polynomials and all sub-simplices of a cell have the same integral.
    coefficients = stress.reshape(len(stress), -1, stress.shape[-1])
    count = coefficients.shape[1]
    # A product is faster than numpy's mean of short rows.
    mean = np.full(count, 1 / count) @ coefficients
    return stress_in_space(model, tensors(mean, model.d))


def vertex_stress(admissible: Admissible) -> np.ndarray:
    """Project sigma^ on linear stresses in each owned cell [force/area]; collective.

    The projection is that in the mean square, and the result are its values at the
    vertices. Cells do not share these values. The vertices are in the order of
    ``cell_geometry.vertices``.

    Returns:
        Shape (owned, d+1, 3, 3). In 2D the stress out of plane is as in
        :func:`mean_stress`.
    """
    model = admissible.model
    d = model.d
    # Hat functions of the cell's vertices, by those of each sub-simplex.
    hats = np.tile(np.eye(d + 1), (d + 1, 1, 1))
    for sub in range(d + 1):
        hats[sub, :, sub] = 1 / (d + 1)
    weights = np.matmul(hats, mass(d, 1, model.degree)) / (d + 1)
    means = np.einsum("svm,nsmc->nvc", weights, admissible.stress)
    linear = tensors(from_means(d, 1, means), d)
    at_vertices = [stress_in_space(model, linear[:, vertex]) for vertex in range(d + 1)]
    return np.stack(at_vertices, axis=1)


def cell_stresses(admissible: Admissible) -> dict[str, np.ndarray]:
    """Compute means of stresses in owned cells [force/area], by their file names."""
    model = admissible.model
    stress = mean_stress(admissible)
    fe = stress_in_space(model, admissible.fe_stress[: model.domain.owned_cells].mean(axis=1))
    mises = "von_mises" if tells_out_of_plane(model) else "von_mises_in_plane"
    return {
        "stress": stress.reshape(-1, 9),
        "stress_fe": fe.reshape(-1, 9),
        mises: von_mises(stress),
    }
