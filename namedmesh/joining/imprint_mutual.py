"""Give two curved sides common facets where each side ends amid the other side.

A shaft that is pushed half into a hub: its side goes on outside of the hub, and the
side of the hub goes on beyond the end of the shaft. Neither lies on the other one. So
they take facets in turn. Side 2 takes the facets of side 1 that lie on it, away from
its own outline; with them it gets the outline of side 1. What it then has within this
outline lies on side 1, which takes it, up to the outline of side 2.

Where the outlines cross at a point, facets may be left out beside it. Such sides are
refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.base.percent import place_words
from namedmesh.closest import closest
from namedmesh.joining.side_contact import FACING, FacetSide, allowance, orient
from namedmesh.joining.triangles import area_vectors
from namedmesh.plain import PlainMesh
from namedmesh.rows import row_numbers

BESIDE = (0.6, 0.4, 0.2)
"""Least distance of the facets that side 2 takes from its outline, by their edges [-].

The facets between that outline and those are new. The first one is taken that works.
"""
MOST_LEFT_OUT = 1e-3
"""Greatest area that may be left out where outlines cross, by the common area [-]."""
NEAR_FACETS = 1.5
"""Distance of outlines between which facets may find no place, by their edges [-]."""
CROSSING = 0.1
"""Greatest area that a crossing explains, likewise; above it the sides do not fit."""
PLACES = np.array([[3, 3, 3], [7, 1, 1], [1, 7, 1], [1, 1, 7], [2, 2, 5], [2, 5, 2], [5, 2, 2]]) / 9
"""Barycentric coordinates of points at which facets are looked at."""
Facets = Callable[[PlainMesh, int, int, float], PlainMesh]
"""Gives a side the facets of another one that lies on it, or the other way round."""


def imprint_mutually(
    take: Facets, plain: PlainMesh, here: int, there: int, apart: float = 0.0
) -> PlainMesh:
    """Return a mesh in 3D whose two curved sides have common facets.

    Args:
        take: Takes facets, see :mod:`namedmesh.joining.imprint_curved`.
        plain: The mesh.
        here: Tag of side 1.
        there: Tag of side 2.
        apart: Greatest distance of both sides [length].

    Raises:
        InputError: If the sides do not lie on each other, their outlines cross, or the
            regions behind cannot be meshed anew.
    """
    try:
        return take(plain, here, there, apart)
    except InputError as reason:
        error = _near_outlines(plain, here, there, apart) or reason
    for (first, second), beside in product(((here, there), (there, here)), BESIDE):
        try:
            with_outline = _take_in_part(take, plain, (first, second), apart, beside)
            whole = _take_in_part(take, with_outline, (second, first), apart, 0.0)
        except InputError:
            continue
        left_out = _area_left_out(whole, here, there, apart)
        if left_out <= MOST_LEFT_OUT:
            return whole
        if left_out < CROSSING:
            error = InputError(
                "joined: the outlines of the curved parts cross each other, and facets beside the "
                f"crossing, {100 * left_out:.2g}% of the common area, would be left out. Name the "
                "parts where the bodies touch."
            )
    raise error


def _near_outlines(plain: PlainMesh, here: int, there: int, apart: float) -> InputError | None:
    """Say that the outlines of two sides nearly run together, or return None.

    Each side then ends amid the other one, and no facets fit between both ends.
    """
    first, second = (_side(plain, tag) for tag in (here, there))
    edges = _outline_amid(first, second, apart)
    others = _outline_amid(second, first, apart)
    if not len(edges) or not len(others):
        return None
    points = np.unique(edges)
    nearest, _, distance = closest(plain.x[points], plain.x[others])
    sizes = np.maximum(first.edge_lengths[points], second.edge_lengths[others[nearest, 0]])
    # Where outlines cross, they are near each other at the crossing alone.
    worst = np.argmax(distance / sizes)
    if distance[worst] > NEAR_FACETS * sizes[worst]:
        return None
    at_worst = place_words(plain.x[points[worst]])
    return InputError(
        "joined: each of the curved parts ends amid the other one, and their outlines nearly run "
        f"together: they are {distance[worst]:.3g} apart near {at_worst}, where facets have edges "
        f"of {sizes[worst]:.3g}. Mesh both parts there with facets of half that distance, or let "
        "the bodies end at the same place."
    )


def _take_in_part(
    take: Facets, plain: PlainMesh, tags: tuple[int, int], apart: float, beside: float
) -> PlainMesh:
    """Give a side the facets of another side that lie on it.

    Args:
        take: Takes facets.
        plain: The mesh.
        tags: Tags of the side whose facets stay, and of the one that takes some.
        apart: Greatest distance of both sides [length].
        beside: Least distance of the facets from the outline of the other side where
            that lies amid this one, by their edges [-].

    Raises:
        InputError: If no facets lie on it, or it cannot take them.
    """
    kept, taken = tags
    sides = plain.sides(kept)
    on_other = _lie_on(_side(plain, kept), _side(plain, taken), apart, beside)
    if not on_other.any():
        raise InputError("joined: no facets of the parts lie on each other.")
    part = int(plain.tags.max()) + 1
    of_sides = plain.tags.copy()
    of_sides[tuple(sides[on_other].T)] = part
    whole = take(replace(plain, tags=of_sides), part, taken, apart)
    return replace(whole, tags=np.where(whole.tags == part, kept, whole.tags))


def _side(plain: PlainMesh, tag: int) -> FacetSide:
    """Return the triangles of a side, oriented."""
    return FacetSide.of(plain.x, orient(plain, plain.sides(tag)))


def _lie_on(side: FacetSide, other_side: FacetSide, apart: float, beside: float) -> np.ndarray:
    """Find the triangles of a side that lie on another side, shape (k,)."""
    x = side.x
    points = np.unique(side.triangles)
    facet, _, distance = closest(x[points], x[other_side.triangles])
    lies = distance <= apart + allowance(side, points, other_side, facet)
    to_outline = closest(x[points], x[_outline_amid(other_side, side, apart)]).distance
    lies &= to_outline >= beside * side.edge_lengths[points]
    of_points = np.zeros(len(x), dtype=bool)
    of_points[points] = lies
    return of_points[side.triangles].all(axis=1) & _faces(side, other_side)


def _faces(side: FacetSide, other_side: FacetSide) -> np.ndarray:
    """Check which triangles face the nearest triangles of another side, shape (k,)."""
    x = side.x
    nearest, _, _ = closest(x[side.triangles].mean(axis=1), x[other_side.triangles])
    cosine = np.einsum("ij,ij->i", side.normals, other_side.normals[nearest])
    return cosine < -FACING


def _outline_amid(side: FacetSide, other_side: FacetSide, apart: float) -> np.ndarray:
    """Return the edges of an outline that lie amid another side, shape (k, 2)."""
    x = side.x
    points = np.unique(side.outline)
    facet, _, distance = closest(x[points], x[other_side.triangles])
    allowed = apart + allowance(side, points, other_side, facet)
    to_outline = closest(x[points], x[other_side.outline]).distance
    amid = np.zeros(len(x), dtype=bool)
    amid[points] = (distance <= allowed) & (to_outline > allowed)
    return side.outline[amid[side.outline].any(axis=1)]


def _area_left_out(plain: PlainMesh, here: int, there: int, apart: float) -> float:
    """Estimate the area on which sides face each other without common facets.

    Args:
        plain: The mesh, in which sides have common facets.
        here: Tag of side 1.
        there: Tag of side 2.
        apart: Greatest distance of both sides [length].

    Returns:
        The area of such parts of side 1 over the area of the common facets [-].
    """
    first, second = (_side(plain, tag) for tag in (here, there))
    number1, number2 = row_numbers(first.triangles, second.triangles)
    is_common = np.isin(number1, number2)
    uncommon1 = FacetSide.of(plain.x, first.triangles[~is_common])
    uncommon2 = FacetSide.of(plain.x, second.triangles[~np.isin(number2, number1)])
    areas = np.linalg.norm(area_vectors(plain.x[first.triangles]), axis=1)
    if is_common.all() or not len(uncommon2.triangles):
        return 0.0
    points = np.matmul(PLACES, plain.x[uncommon1.triangles]).reshape(-1, 3)
    of_point = np.repeat(np.arange(len(uncommon1.triangles)), len(PLACES))
    facet, _, distance = closest(points, plain.x[uncommon2.triangles])
    cosine = np.einsum("ij,ij->i", uncommon1.normals[of_point], uncommon2.normals[facet])
    allowed = apart + uncommon1.facet_heights[of_point] + uncommon2.facet_heights[facet]
    faces = (cosine < -FACING) & (distance <= allowed)
    left = np.bincount(of_point, faces, len(uncommon1.triangles)) / len(PLACES)
    return float(left @ areas[~is_common] / areas[is_common].sum())
