"""Compute stresses of an admissible pair in the cells."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from erc_contact.admissible.elastic import elastic_stress, macro_places
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible, pair_of
from erc_contact.admissible.reference import mandel
from erc_contact.base.exceptions import InputError
from erc_contact.model.data.expressions import evaluate
from erc_contact.model.space import circumferences
from erc_contact.model.stress import stress_in_space, tells_out_of_plane, von_mises
from namedmesh.simplex import barycentric, from_means, mass, nodes

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
    if admissible.model.space.axisymmetric:
        weights = macro_points(2, admissible.model.space.degree).weights
        return weights @ _at_points(admissible)
    stress = admissible.stress
    # All Bernstein polynomials and all sub-simplices of a cell have the same integral.
    owned, pieces, of_piece, components = stress.shape
    count = pieces * of_piece
    coefficients = stress.reshape(owned, count, components)
    # A product is faster than numpy's mean of short rows.
    return np.full(count, 1 / count) @ coefficients


def _elastic_means(admissible: Admissible) -> np.ndarray:
    """Compute the mean of C eps(u^) in each owned cell, Mandel components."""
    model = admissible.model
    at_points = _elastic_at_points(admissible)
    if at_points.shape[1] == 1:
        return at_points[:, 0]
    weights = macro_points(model.space.d, model.space.degree).weights
    repeated = np.tile(weights.ravel(), at_points.shape[1] // weights.size)
    return (repeated / repeated.sum()) @ at_points


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
    space = admissible.model.space
    d = space.d
    if space.axisymmetric:
        _, points, weights = macro_points(d, space.degree)
        weighted = barycentric(points) * weights[:, None]
        return np.einsum("qv,nqc->nvc", weighted, _at_points(admissible))
    # Hat functions of the cell's vertices, at the vertices of each sub-simplex.
    hats = np.tile(np.eye(d + 1), (d + 1, 1, 1))
    for sub in range(d + 1):
        hats[sub, :, sub] = 1 / (d + 1)
    weights = np.matmul(hats, mass(d, 1, space.degree)) / (d + 1)
    return np.einsum("svm,nsmc->nvc", weights, admissible.stress)


def _elastic_moments(admissible: Admissible) -> np.ndarray:
    """Compute the means of C eps(u^) times the hat functions of a cell's vertices.

    They are in Mandel components, shape (owned, d+1, s).
    """
    model = admissible.model
    at_points = _elastic_at_points(admissible)
    _, points, weights = macro_points(model.space.d, model.space.degree)
    weighted = barycentric(points) * weights[:, None]
    if at_points.shape[1] == 1:
        weighted = weighted.sum(axis=0, keepdims=True)
    return np.einsum("qv,nqc->nvc", weighted, at_points)


def _elastic_at_points(admissible: Admissible) -> np.ndarray:
    """Return C eps(u^) at the points of :func:`elastic_stress` [force/area]."""
    model = admissible.model
    owned = model.domain.owned_cells
    stress = elastic_stress(model, admissible.cell_geometry, admissible.displacement, owned)
    return _over_rings(admissible, stress)


def _at_points(admissible: Admissible) -> np.ndarray:
    """Return sigma^ of rings at the points of :func:`macro_points` [force/area].

    It has Mandel components with the hoop stress last, shape (owned, q, 4).
    """
    model = admissible.model
    space = model.space
    near, _, _ = macro_points(2, space.degree)
    sigma = np.matmul(near, admissible.stress)
    owned, pieces, of_piece, components = sigma.shape
    sigma = sigma.reshape(owned, pieces * of_piece, components)
    if model.hoop_load is not None:
        places = macro_places(space, admissible.cell_geometry, owned)
        sigma[..., -1] += model.hoop_load(places, space.owned_cells)
    return _over_rings(admissible, sigma)


def _over_rings(admissible: Admissible, at_points: np.ndarray) -> np.ndarray:
    """Divide stresses at the points of :func:`macro_points` by the circumference."""
    model = admissible.model
    if not model.space.axisymmetric:
        return at_points
    places = macro_places(model.space, admissible.cell_geometry, len(at_points))
    return at_points / circumferences(places)[..., None]


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


def _fe_means(admissible: Admissible) -> np.ndarray:
    """Return means of the rebalanced finite element stress, (owned, 3, 3)."""
    model = admissible.model
    owned = model.domain.owned_cells
    in_plane = mandel(admissible.fe_stress[:owned].mean(axis=1))
    hoop = admissible.balanced.hoop
    if hoop is None:
        return stress_in_space(model, in_plane)
    # Means over the mean circumference; the hoop force is 2 pi sigma_tt.
    cells = admissible.cell_geometry
    middles = cells.corners[:owned].mean(axis=1)
    around = hoop[:owned].sum(axis=1) / (2 * np.pi * cells.volume[:owned])
    if model.body_force is not None:
        of_load = evaluate(model.body_force, model.space.mesh, nodes(2, 0), model.space.owned_cells)
        around = around + of_load[:, 0, 0] / (2 * np.pi)
    return stress_in_space(
        model, np.column_stack([in_plane / circumferences(middles)[:, None], around])
    )


def cell_stresses(admissible: Admissible) -> dict[str, np.ndarray]:
    """Compute means of stresses in owned cells [force/area], by their file names."""
    model = admissible.model
    stress = mean_stress(admissible)
    fe = _fe_means(admissible)
    best = mean_stress(admissible, "best")
    mises = "von_mises" if tells_out_of_plane(model) else "von_mises_in_plane"
    return {
        "stress": stress.reshape(-1, 9),
        "stress_fe": fe.reshape(-1, 9),
        mises: von_mises(stress),
        "stress_best": best.reshape(-1, 9),
        f"{mises}_best": von_mises(best),
    }
