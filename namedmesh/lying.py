"""Find the facets against which the surface of another region lies.

The facets of two bodies that were meshed apart do not match, and on curved sides they
are not in one place: each has its own chords. So a facet lies against a surface if one
of some points of it is nearer to the surface than a share of the size of the facets,
and if the normals of both are about opposite. It may reach beyond the surface.

Symbols: d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from namedmesh.base.ranks import box, of_all
from namedmesh.closest import closest

CLEARANCE = 0.15
"""Greatest distance of a facet from what lies against it, over its size [-].

The chords of arcs of 30 degrees are 0.13 of their length apart at worst.
"""
BESIDE = 0.03
"""Greatest distance of a point beside the outline of a surface, over the size [-]."""
OUTWARD = 0.7
"""Place of the points of a facet on the way from its middle to each corner [-]."""
OPPOSITE = -0.5
"""Greatest cosine between the normals of facets that lie against each other [-]."""


@dataclass(frozen=True, eq=False)
class Facets:
    """Hold facets of a surface by their places.

    Attributes:
        corners: Their corners [length], shape (n, d, d).
        normals: Their outward normals, shape (n, d).
    """

    corners: np.ndarray
    normals: np.ndarray

    @property
    def sizes(self) -> np.ndarray:
        """Return the length of the longest edge of each facet [length], shape (n,)."""
        after = np.roll(self.corners, 1, axis=1)
        return np.linalg.norm(after - self.corners, axis=2).max(axis=1, initial=0.0)

    def places(self, corner: int) -> np.ndarray:
        """Return a point of each facet near a corner of it [length], (n, d)."""
        middle = self.corners.mean(axis=1)
        return middle + OUTWARD * (self.corners[:, corner] - middle)

    def take(self, which: np.ndarray) -> Facets:
        """Return some of the facets."""
        return Facets(self.corners[which], self.normals[which])

    def of_all_ranks(self, comm: MPI.Comm) -> Facets:
        """Return the facets of all ranks, on all ranks; collective."""
        return Facets(*of_all(comm, self.corners, self.normals))


def lying_against(
    comm: MPI.Comm, here: Facets, there: Facets, within: float | None = None
) -> np.ndarray:
    """Return which facets of this rank have others against them; collective.

    Args:
        comm: Communicator.
        here: Facets of this rank.
        there: Facets of this rank of the other surface.
        within: Greatest distance of the middle of a facet from the other surface
            [length]; None takes a share of its size, and more points of it.

    Returns:
        Truth values, shape (n,).
    """
    result = np.zeros(len(here.corners), dtype=bool)
    # Only what is near the other surface is looked at in detail.
    greatest = max(here.sizes.max(initial=0.0), there.sizes.max(initial=0.0))
    reach = within or CLEARANCE * comm.allreduce(float(greatest), MPI.MAX)
    close_here = _within(comm, here, there, reach)
    close_there = _within(comm, there, here, reach)
    others = there.take(close_there).of_all_ranks(comm)
    rows = np.flatnonzero(close_here)
    if not len(rows) or not len(others.corners):
        return result
    near = here.take(close_here)
    middles = near.corners.mean(axis=1)
    if within is not None:
        facet, _, distance = closest(middles, others.corners)
        cosine = (near.normals * others.normals[facet]).sum(axis=1)
        result[rows] = (distance <= within) & (cosine <= OPPOSITE)
        return result
    touches = _points_near(middles, near, others)
    for corner in range(near.corners.shape[1]):
        touches |= _points_near(near.places(corner), near, others)
    result[rows] = touches
    return result


def _points_near(points: np.ndarray, facets: Facets, others: Facets) -> np.ndarray:
    """Return which points of facets are on a surface, shape (n,).

    Args:
        points: One point of each facet [length], shape (n, d).
        facets: The facets.
        others: The facets of the surface.
    """
    facet, _, distance = closest(points, others.corners)
    normals = others.normals[facet]
    above = ((points - others.corners[facet, 0]) * normals).sum(axis=1)
    beside = np.sqrt(np.maximum(distance**2 - above**2, 0.0))
    size = np.maximum(facets.sizes, others.sizes[facet])
    is_close = (abs(above) <= CLEARANCE * size) & (beside <= BESIDE * size)
    cosine = (facets.normals * normals).sum(axis=1)
    return is_close & (cosine <= OPPOSITE)


def _within(comm: MPI.Comm, facets: Facets, others: Facets, reach: float) -> np.ndarray:
    """Return which facets are in the bounding box of others of all ranks; collective.

    Args:
        comm: Communicator.
        facets: Facets of this rank.
        others: The others of this rank.
        reach: Margin of the box [length].
    """
    low, high = box(comm, others.corners.reshape(-1, facets.normals.shape[1]))
    middles = facets.corners.mean(axis=1)
    # A facet whose middle is outside may reach into the box with a corner.
    margin = reach + facets.sizes[:, None]
    return np.all((middles >= low - margin) & (middles <= high + margin), axis=1)
