"""Compute stresses of an admissible pair in the cells."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from erc_contact.admissible.elastic import elastic_stress, macro_places
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.base.exceptions import InputError
from erc_contact.model.stress import stress_in_space, tells_out_of_plane, von_mises
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
    mean = _of_stress(stress, admissible, _admissible_means, _elastic_means)
    return stress_in_space(model, mean)


def _of_stress(
    stress: str,
    admissible: Admissible,
    of_admissible: Callable[[Admissible], np.ndarray],
    of_elastic: Callable[[Admissible], np.ndarray],
) -> np.ndarray:
    """Return what is linear in a stress, for the stress of a name.

    Args:
        stress: The name, as in :func:`mean_stress`.
        admissible: The pair.
        of_admissible: Computes it of sigma^.
        of_elastic: Computes it of C eps(u^).

    Raises:
        InputError: If the stress is another one.
    """
    check_stress(stress)
    parts = []
    if stress != "elastic":
        parts.append(of_admissible(admissible))
    if stress != "admissible":
        parts.append(of_elastic(admissible))
    return np.asarray(np.mean(parts, axis=0))


def _admissible_means(admissible: Admissible) -> np.ndarray:
    """Compute the mean of sigma^ in each owned cell, Mandel components."""
    space = admissible.model.space
    return macro_points(space.d, space.degree).weights @ _at_points(admissible)


def _elastic_means(admissible: Admissible) -> np.ndarray:
    """Compute the mean of C eps(u^) in each owned cell, Mandel components."""
    at_points = _elastic_at_points(admissible)
    if at_points.shape[1] == 1:
        return at_points[:, 0]
    space = admissible.model.space
    return macro_points(space.d, space.degree).weights @ at_points


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
    moments = _of_stress(stress, admissible, _admissible_moments, _elastic_moments)
    linear = from_means(d, 1, moments)
    at_vertices = [stress_in_space(model, linear[:, vertex]) for vertex in range(d + 1)]
    return np.stack(at_vertices, axis=1)


def _admissible_moments(admissible: Admissible) -> np.ndarray:
    """Compute the means of sigma^ times the hat functions of the vertices of a cell.

    They are in Mandel components, shape (owned, d+1, s).
    """
    weighted = _weighted_hats(admissible)
    return np.einsum("qv,nqc->nvc", weighted, _at_points(admissible))


def _weighted_hats(admissible: Admissible) -> np.ndarray:
    """Return weights times the hat functions of a cell's vertices, shape (q, d+1)."""
    space = admissible.model.space
    _, points, weights = macro_points(space.d, space.degree)
    return barycentric(points) * weights[:, None]


def _elastic_moments(admissible: Admissible) -> np.ndarray:
    """Compute the means of C eps(u^) times the hat functions of a cell's vertices.

    They are in Mandel components, shape (owned, d+1, s).
    """
    at_points = _elastic_at_points(admissible)
    weighted = _weighted_hats(admissible)
    if at_points.shape[1] == 1:
        weighted = weighted.sum(axis=0, keepdims=True)
    return np.einsum("qv,nqc->nvc", weighted, at_points)


def _elastic_at_points(admissible: Admissible) -> np.ndarray:
    """Return C eps(u^) at the points of :func:`elastic_stress` [force/area]."""
    model, cells = admissible.model, admissible.cell_geometry
    owned = model.domain.owned_cells
    stress = elastic_stress(model, cells, admissible.displacement, owned)
    return model.space.section.over(stress, macro_places(model.space, cells, owned))


def _at_points(admissible: Admissible) -> np.ndarray:
    """Return sigma^ at the points of :func:`macro_points` [force/area].

    It has Mandel components, shape (owned, q, s).
    """
    model = admissible.model
    space = model.space
    places = macro_places(model.space, admissible.cell_geometry, model.domain.owned_cells)
    return space.section.over(admissible.stress_at_macro_points(places), places)


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
