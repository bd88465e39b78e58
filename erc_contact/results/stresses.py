"""Compute stresses of an admissible pair in the cells."""

from __future__ import annotations

from typing import Any

import numpy as np

from erc_contact.admissible.elastic import elastic_stress, macro_places
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.base.exceptions import InputError
from erc_contact.model.stress import stress_in_space, tells_out_of_plane
from erc_contact.model.von_mises import von_mises
from namedmesh.simplex import barycentric, from_means

STRESSES = ("admissible", "best", "elastic")
"""Stresses of a pair: sigma^, ``(sigma^ + C eps(u^))/2``, and ``C eps(u^)``."""


def check_stress(stress: str) -> None:
    """Check the name of a stress of a pair."""
    if stress not in STRESSES:
        allowed = ", ".join(map(repr, STRESSES))
        raise InputError(f"The stress is {stress!r}; allowed are {allowed}.")


def mean_stress(result: Any, stress: str = "admissible") -> np.ndarray:
    """Compute the mean of a stress in each owned cell [force/area]; collective.

    Its shape is (owned, 3, 3).

    In 2D the material's ``out_of_plane`` gives the stress out of plane, which is nan if
    the material has none.

    Args:
        result: An admissible pair, an error, or a history.
        stress: "admissible" for sigma^; "best" for the mean of sigma^ and C eps(u^),
            whose error is known best (:attr:`ConstitutiveError.best_stress_error`);
            "elastic" for C eps(u^).

    Raises:
        InputError: If the stress is another one.
    """
    admissible = pair_of(result)
    model = admissible.model
    weights = macro_points(model.space.d, model.space.degree).weights
    mean = _weighted_sums(stress, admissible, weights[:, None])[:, 0]
    return stress_in_space(model, mean)


def _weighted_sums(stress: str, admissible: Admissible, weights: np.ndarray) -> np.ndarray:
    """Sum up a stress at the points of :func:`macro_points`, Mandel components.

    Args:
        stress: Its name, as in :func:`mean_stress`.
        admissible: The pair.
        weights: Weights of the points in v sums, shape (q, v).

    Returns:
        Shape (owned, v, s).

    Raises:
        InputError: If the stress is another one.
    """
    check_stress(stress)
    model, cells = admissible.model, admissible.cell_geometry
    owned = model.domain.owned_cells
    places = macro_places(model.space, cells, owned)
    section = model.space.section
    parts = []
    if stress != "elastic":
        at_points = section.over(admissible.stress_at_macro_points(places), places)
        parts.append(np.matmul(weights.T, at_points))
    if stress != "admissible":
        of_u = elastic_stress(model, cells, admissible.displacement, owned)
        at_points = section.over(of_u, places)
        # A stress that does not vary in cells is given at one point.
        of_points = weights if at_points.shape[1] > 1 else weights.sum(axis=0, keepdims=True)
        parts.append(np.matmul(of_points.T, at_points))
    return np.asarray(np.mean(parts, axis=0))


def vertex_stress(admissible: Admissible, stress: str = "admissible") -> np.ndarray:
    """Project a stress on linear stresses in each owned cell [force/area]; collective.

    The projection is that in the mean square, and the result are its values at the
    vertices. Cells do not share these values. The vertices are in the order of
    ``cell_geometry.vertices``.

    Args:
        admissible: The pair.
        stress: As in :func:`mean_stress`.

    Returns:
        Shape (owned, d+1, 3, 3). In 2D the stress out of plane is as in
        :func:`mean_stress`.

    Raises:
        InputError: If the stress is another one.
    """
    model = admissible.model
    d = model.space.d
    _, points, weights = macro_points(d, model.space.degree)
    # Means of the stress times the hat functions of the vertices.
    moments = _weighted_sums(stress, admissible, barycentric(points) * weights[:, None])
    linear = from_means(d, 1, moments)
    at_vertices = [stress_in_space(model, linear[:, vertex]) for vertex in range(d + 1)]
    return np.stack(at_vertices, axis=1)


def linear_mises(admissible: Admissible, stress: str = "admissible") -> np.ndarray:
    """Compute the von Mises stress in each owned cell for pictures [force/area].

    For degree 2 it is that at the vertices; shape (owned, 1 or d+1). Collective.

    Args:
        admissible: The pair.
        stress: As in :func:`mean_stress`.
    """
    if admissible.model.space.degree == 1:
        return von_mises(mean_stress(admissible, stress))[:, None]
    values = vertex_stress(admissible, stress)
    return von_mises(values.reshape(-1, 3, 3)).reshape(values.shape[:2])


def cell_stresses(admissible: Admissible) -> dict[str, np.ndarray]:
    """Compute means of stresses in owned cells [force/area], by their file names."""
    model = admissible.model
    stress = mean_stress(admissible)
    fe = stress_in_space(model, admissible.balanced.means(model, admissible.cell_geometry))
    best = mean_stress(admissible, "best")
    mises = "von_mises" if tells_out_of_plane(model) else "von_mises_in_plane"
    return {
        "stress": stress.reshape(-1, 9),
        "stress_fe": fe.reshape(-1, 9),
        mises: von_mises(stress),
        "stress_best": best.reshape(-1, 9),
        f"{mises}_best": von_mises(best),
    }
