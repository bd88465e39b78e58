"""Find how two sides in 3D lie on each other, and where outlines run together.

Symbols: "kept" is the side whose facets stay, "taken" the one that gets them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from namedmesh.base.exceptions import InputError
from namedmesh.base.percent import enough, place_words
from namedmesh.closest import closest
from namedmesh.joining.loops import loop_edges, loops, outer_edges
from namedmesh.joining.thresholds import CORNER, FACING, SAME
from namedmesh.joining.triangles import area_vectors, side_lengths
from namedmesh.plain import PlainMesh

HEIGHTS = 2.0
"""Allowed distance of curved sides, by the heights of their facets [-]."""
NEAR = 0.3
"""Greatest distance that facets explain, by the longer edge [-]."""
CLOSE = 0.3
"""Distance of points that become one where a common outline ends, by the edge [-]."""
NO_EDGES = np.empty((0, 2), dtype=np.int64)
"""An empty table of edges."""
NO_FIT = (
    "joined: the outlines of the curved parts do not fit together. Mesh the parts with similar "
    "facets along their outlines, or let both end at the same place."
)
"""Message if edges of both outlines do not find each other."""


@dataclass(frozen=True, eq=False)
class FacetSide:
    """Hold the triangles of a side.

    Attributes:
        x: All points of the mesh [length], shape (n, 3).
        triangles: The triangles, counterclockwise as seen from outside, shape (k, 3).
        outline: The edges of the outline, shape (o, 2).
    """

    x: np.ndarray
    triangles: np.ndarray
    outline: np.ndarray

    @classmethod
    def of(cls, x: np.ndarray, triangles: np.ndarray) -> FacetSide:
        """Make it of triangles, and find their outline."""
        return cls(x, triangles, outer_edges(triangles))

    @cached_property
    def normals(self) -> np.ndarray:
        """Return the outward unit normals of the triangles, shape (k, 3)."""
        normals = area_vectors(self.x[self.triangles])
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    @cached_property
    def point_normals(self) -> np.ndarray:
        """Return the mean normals at all points, zero elsewhere, shape (n, 3)."""
        return mean_normals(self.x, self.triangles, self.normals)

    @cached_property
    def _lengths(self) -> np.ndarray:
        """Return the lengths of the edges of the triangles [length], shape (k, 3)."""
        return side_lengths(self.x[self.triangles])

    @property
    def shortest(self) -> float:
        """Return the length of the shortest edge [length]."""
        return float(self._lengths.min())

    @property
    def facet_edges(self) -> np.ndarray:
        """Return the mean edges of the triangles [length], shape (k,)."""
        return self._lengths.mean(axis=1)

    @cached_property
    def edge_lengths(self) -> np.ndarray:
        """Return the greatest mean edge of the triangles at all points, shape (n,)."""
        result = np.zeros(len(self.x))
        np.maximum.at(result, self.triangles, self.facet_edges[:, None])
        return result

    @cached_property
    def facet_heights(self) -> np.ndarray:
        """Estimate the heights of the true surface over the triangles [length], (k,).

        Over a triangle with the circumradius r the surface of a ball of radius R is
        r^2 / (2 R) high, and normals at its corners turn by r / R.
        """
        normals = self.normals[:, None]
        cosine = np.sum(normals * self.point_normals[self.triangles], axis=2)
        turn = np.arccos(np.clip(cosine, -1.0, 1.0)).max(axis=1)
        radius = self._lengths.max(axis=1) / np.sqrt(3)
        return np.where(turn < CORNER, radius * turn / 2, 0.0)

    @cached_property
    def heights(self) -> np.ndarray:
        """Return the greatest height of the triangles at all points, shape (n,)."""
        result = np.zeros(len(self.x))
        np.maximum.at(result, self.triangles, self.facet_heights[:, None])
        return result


def mean_normals(x: np.ndarray, triangles: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return unit normals at points from normals of triangles, shape (n, 3).

    Args:
        x: Points [length], shape (n, 3).
        triangles: The triangles, shape (k, 3).
        normals: Their normals, as long as they count, shape (k, 3).

    Returns:
        Zero at points of no triangle.
    """
    result = np.zeros(x.shape)
    np.add.at(result, triangles, normals[:, None])
    size = np.linalg.norm(result, axis=1, keepdims=True)
    return result / np.where(size > 0, size, 1.0)


def orient(plain: PlainMesh, sides: np.ndarray) -> np.ndarray:
    """Return sides (cell, local facet) as triangles that are oriented outwards."""
    triangles = plain.points_of(sides)
    corners = plain.x[triangles]
    apex = plain.x[plain.cells[tuple(sides.T)]]
    outward = np.einsum("ij,ij->i", area_vectors(corners), corners[:, 0] - apex) > 0
    turned = triangles[:, [0, 2, 1]]
    return np.where(outward[:, None], triangles, turned)


@dataclass(frozen=True, eq=False)
class SideContact:
    """Hold how a side lies on another side, whose facets it may replace.

    Attributes:
        kept: The side whose facets stay.
        taken: The side that takes them.
        closest: The facets of the second side closest to points of the first one.
        allowed: Distance that is allowed at points of the first one [length], (n,).
        beyond: Greatest distance beyond the allowed one [length].
        message: What is wrong if they do not lie on each other.
    """

    kept: FacetSide
    taken: FacetSide
    closest: np.ndarray
    allowed: np.ndarray
    beyond: float
    message: str


def allowance(
    side: FacetSide, points: np.ndarray, other_side: FacetSide, facet: np.ndarray
) -> np.ndarray:
    """Return the distance of two sides that their flat facets explain [length].

    Args:
        side: The side of some points.
        points: These points, shape (n,).
        other_side: The other side.
        facet: The triangle of the other side that is closest to each point, shape (n,).
    """
    none = SAME * min(side.shortest, other_side.shortest)
    heights = HEIGHTS * (side.heights[points] + other_side.facet_heights[facet])
    edges = np.maximum(side.edge_lengths[points], other_side.facet_edges[facet])
    return none + np.minimum(heights, NEAR * edges)


def side_contact(kept: FacetSide, taken: FacetSide, apart: float) -> SideContact:
    """Find how a side lies on another side."""
    x = kept.x
    corners = x[taken.triangles]
    points = np.unique(kept.triangles)
    facet, _, distance = closest(x[points], corners)
    allowed = np.zeros(len(x))
    allowed[points] = apart + allowance(kept, points, taken, facet)
    excess = distance - allowed[points]
    worst = np.argmax(excess)
    beyond = float(excess[worst])
    message = (
        f"joined: the parts are {distance[worst]:.3g} apart near {place_words(x[points[worst]])}, "
        "and a part is curved. Each facet of one of them must lie on the other one: name the "
        "parts where the bodies touch, and give a clearance or an interference by apart= "
        f"({enough(apart + beyond)} is enough), and by gap= of the contact."
    )
    middles, _, _ = closest(x[kept.triangles].mean(axis=1), corners)
    cosine = np.einsum("ij,ij->i", kept.normals, taken.normals[middles]).max()
    if cosine > -FACING:
        # No distance makes them face each other.
        beyond = np.inf
        message = (
            "joined: the parts do not face each other everywhere; the cosine between their outward "
            f"normals is up to {cosine:.3g}, it must be near -1. Turn the bodies, or name the "
            "facets that lie against each other: ec.where(region=, against=, within=)."
        )
    facing = np.unique(np.concatenate([facet, middles]))
    return SideContact(kept, taken, facing, allowed, beyond, message)


@dataclass(frozen=True, eq=False)
class Outlines:
    """Hold how the outlines of the side that is kept lie on the other side.

    Attributes:
        loops: The outlines of the side that is kept.
        inner: Edges of them that lie amid the other side, shape (k, 2).
        number: The point that each point becomes, shape (n,).
        inserted: Edge of the other outline and a point that cuts it, shape (l, 2).
    """

    loops: list[np.ndarray]
    inner: np.ndarray
    number: np.ndarray
    inserted: np.ndarray


def outlines_on(x: np.ndarray, contact: SideContact) -> Outlines:
    """Find how the outlines of a side lie on another side.

    Raises:
        InputError: If points of both outlines are not in the same order.
    """
    kept = contact.kept
    taken = contact.taken
    allowed = contact.allowed
    number = np.arange(len(x))
    kept_loops = loops(x, outer_edges(kept.triangles))
    edges = np.concatenate([NO_EDGES, *[loop_edges(loop) for loop in kept_loops]])
    outline = taken.outline
    points = edges[:, 0]
    beside, _, distance = closest(x[points], x[outline])
    along = np.zeros(len(x), dtype=bool)
    along[points] = distance <= allowed[points]
    common = np.all(along[edges], axis=1)
    inner = edges[~common]
    targets = points[along[points]]
    if not len(targets):
        return Outlines(kept_loops, inner, number, NO_EDGES)

    # Points of the other outline move to the nearest ones, where both run together.
    others = np.unique(outline)
    to_common = closest(x[others], x[edges[common]]).distance
    apart = np.linalg.norm(x[others][:, None] - x[targets], axis=2)
    nearest = targets[apart.argmin(axis=1)]
    close = apart.min(axis=1) <= allowed[nearest] + CLOSE * taken.edge_lengths[others]
    moves = (to_common <= allowed[nearest]) | close
    number[others[moves]] = nearest[moves]
    alone = along[points] & ~np.isin(points, number[others])
    inserted = np.column_stack([beside[alone], points[alone]])
    ends = number[outline[inserted[:, 0]]]
    if np.any(ends[:, 0] == ends[:, 1]):
        raise InputError(NO_FIT)
    return Outlines(kept_loops, inner, number, inserted)
