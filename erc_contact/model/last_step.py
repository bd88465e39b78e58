"""Carry the last step of a history to another mesh.

Friction acts on the tangential displacement since the last step, ``w_t - s``. Here s is
the tangential displacement at the end of that step, a polynomial of degree k on the
contact facets of the mesh that computed it. A node of another mesh takes its value on
the nearest of these facets. On the same mesh and on one that refines it s is then the
same field, up to round-off. On any other mesh s is interpolated, and what this loses is
measured.

Symbols: d dimension, f facets, m nodes of a facet, n points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.simplex import barycentric, lagrange, rule
from erc_contact.model.space import Space

CLUSTER_SIZE = 64
"""Number of points for which the nearest facets are found together."""
INTERPOLATION_ROUND_OFF = 1e-12
"""Difference of interpolants that is round-off, over the greatest displacement [-]."""
SAME_PLACE = 0.5
"""Distance of a contact to its place in the last step that tells another body [-].

It is over the longest edge of the facets. Flat facets of a curved body are nearer to
each other on any two meshes.
"""


@dataclass(frozen=True)
class Greatest:
    """Hold the sizes of a history so far. Their round-off is that of the next step.

    Attributes:
        displacement: The greatest component of the displacement [length].
        load: The greatest sum of the sizes of all nodal forces of loads and given
            strains [force].
    """

    displacement: float = 0.0
    load: float = 0.0


@dataclass(frozen=True, eq=False)
class LastStep:
    """Hold the displacement of the contacts at the end of the last step.

    Attributes:
        space: The mesh that it was computed on.
        contacts: By the name of each contact its facets (cell, local facet), ghosts
            included, shape (f, 2), and its displacement at their nodes [length], shape
            (f, m, d): between bodies the jump from the part that has this name.
        greatest: The sizes of the history so far.
    """

    space: Space
    contacts: Mapping[str, tuple[np.ndarray, np.ndarray]]
    greatest: Greatest

    def on(
        self,
        space: Space,
        name: str,
        facets: np.ndarray,
        direction: np.ndarray,
        sign: float = 1.0,
    ) -> tuple[fem.Function, np.ndarray | None]:
        """Interpolate the displacement on a contact of another mesh; collective.

        Args:
            space: The other mesh, or the same.
            name: Name of the contact.
            facets: Its facets there (cell, local facet), shape (f, 2).
            direction: Unit normals of the facets, shape (f, d).
            sign: Factor of the displacement, -1 where the sides of the contact are
                exchanged [-].

        Returns:
            The displacement [length], zero off the contact, and what the mesh does not
            carry of its tangential part s, ``int_F |s - I s|^2`` for each facet
            [length^(d+1)], shape (f,), or None where it carries all.

        Raises:
            InputError: If the contact was elsewhere in the last step.
        """
        d = space.d
        old_facets, old_w = self.contacts[name]
        old_w = sign * old_w
        nodes = space.facet_nodes(facets)
        before = space.function()
        values = before.x.array.reshape(-1, d)
        if space.domain is self.space.domain and space.degree == self.space.degree:
            values[nodes] = old_w
            return before, None
        corners, old_values = gathered_facets(self.space, [(old_facets, old_w)])
        on_contact = np.unique(nodes)
        x = space.V.tabulate_dof_coordinates()[on_contact, :d]
        _check_place(space, name, facets, x, corners)
        values[on_contact] = interpolate(x, corners, old_values, self.space.degree)
        # What is lost: the old field less its interpolant, at points of a rule that is
        # exact for the square of both, without the normal part.
        points, weights = rule(d - 1, 2 * max(space.degree, self.space.degree))
        places = np.matmul(barycentric(points), space.facet_corners(facets))
        exact = interpolate(places.reshape(-1, d), corners, old_values, self.space.degree)
        shape = lagrange(d - 1, space.degree, points)
        difference = exact.reshape(places.shape) - np.matmul(shape, values[nodes])
        n = direction[:, None]
        difference -= (difference * n).sum(axis=-1, keepdims=True) * n
        greatest = space.comm.allreduce(float(abs(difference).max(initial=0.0)), MPI.MAX)
        if greatest <= INTERPOLATION_ROUND_OFF * abs(old_values).max(initial=0.0):
            return before, None
        means = (difference**2).sum(axis=-1) @ weights
        return before, space.facet_areas(facets) * means


def gathered_facets(
    space: Space, parts: Sequence[tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Gather facets of all ranks with values at their nodes; collective.

    Args:
        space: The mesh.
        parts: Facets (cell, local facet) of each part, ghosts included, and values at
            their nodes (f, m, d).

    Returns:
        Corners of the facets (f, d, d), and the values (f, m, d).
    """
    x = space.V.tabulate_dof_coordinates()[:, : space.d]
    facets = np.vstack([of_part[space.owned(of_part)] for of_part, _ in parts])
    values = np.concatenate([at_nodes[space.owned(of_part)] for of_part, at_nodes in parts])
    nodes = space.facet_nodes(facets)
    of_ranks = space.comm.allgather((x[nodes[:, : space.d]], values))
    corners = np.concatenate([corners for corners, _ in of_ranks])
    values = np.concatenate([values for _, values in of_ranks])
    return corners, values


def interpolate(
    x: np.ndarray, corners: np.ndarray, values: np.ndarray, degree: int = 1
) -> np.ndarray:
    """Evaluate interpolants on the nearest facets.

    Args:
        x: Points, shape (n, d).
        corners: Corners of the facets, shape (f, d, d).
        values: Values at the nodes of the facets, shape (f, m, d).
        degree: Degree of the interpolants.

    Returns:
        Values at the points, shape (n, d).
    """
    facet, local, _ = nearest(x, corners)
    shape = lagrange(x.shape[1] - 1, degree, local[:, 1:])
    return np.einsum("nm,nmi->ni", shape, values[facet])


def nearest(x: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the nearest facets of points.

    Points that are near to each other are worked on together, with the facets that may
    be the nearest of one of them.

    Args:
        x: Points, shape (n, d).
        corners: Corners of the facets, shape (f, d, d).

    Returns:
        The numbers of the facets, shape (n,); barycentric coordinates of the nearest
        points on them, shape (n, d); the distances, shape (n,).
    """
    edges = corners[:, 1:] - corners[:, :1]
    # Of each facet: the map from a point to its barycentric coordinates.
    to_barycentric = np.linalg.inv(edges @ edges.transpose(0, 2, 1)) @ edges
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1, initial=0.0)
    facet = np.empty(len(x), dtype=int)
    local = np.empty_like(x)
    distance = np.empty(len(x))
    for cluster in _clusters(x):
        points = x[cluster]
        centre = points.mean(axis=0)
        spread = np.linalg.norm(points - centre, axis=1).max()
        away = np.linalg.norm(middle - centre, axis=1)
        # A facet is at least ``away - radius`` from the centre, and at most
        # ``away + radius``. At another point of the cluster each differs by the spread.
        candidates = np.flatnonzero(away - radius <= (away + radius).min() + 2 * spread)
        from_corner = points[:, None] - corners[candidates, 0]
        inner = np.einsum("fki,nfi->nfk", to_barycentric[candidates], from_corner)
        shape = np.concatenate([1 - inner.sum(axis=2, keepdims=True), inner], axis=2)
        # A foot outside its facet is moved onto it.
        shape = np.maximum(shape, 0.0)
        shape /= shape.sum(axis=2, keepdims=True)
        feet = np.einsum("nfm,fmi->nfi", shape, corners[candidates])
        to_feet = np.linalg.norm(feet - points[:, None], axis=2)
        row = np.arange(len(cluster))
        chosen = to_feet.argmin(axis=1)
        facet[cluster] = candidates[chosen]
        local[cluster] = shape[row, chosen]
        distance[cluster] = to_feet[row, chosen]
    return facet, local, distance


def _clusters(x: np.ndarray) -> Iterator[np.ndarray]:
    """Divide points (n, d) into clusters of near points.

    A cluster is cut into halves along its longest axis.

    Yields:
        Numbers of at most :data:`CLUSTER_SIZE` points.
    """
    waiting = [np.arange(len(x))] if len(x) else []
    while waiting:
        cluster = waiting.pop()
        if len(cluster) <= CLUSTER_SIZE:
            yield cluster
            continue
        axis = np.ptp(x[cluster], axis=0).argmax()
        half = len(cluster) // 2
        order = np.argpartition(x[cluster, axis], half)
        waiting.append(cluster[order[:half]])
        waiting.append(cluster[order[half:]])


def _check_place(
    space: Space, name: str, facets: np.ndarray, x: np.ndarray, corners: np.ndarray
) -> None:
    """Check that a contact is where it was in the last step; collective.

    Args:
        space: The new mesh.
        name: Name of the contact.
        facets: Its facets (cell, local facet), shape (n, 2).
        x: Its nodes, shape (n, d).
        corners: Corners of its old facets, of all ranks, shape (f, d, d).

    Raises:
        InputError: If it is elsewhere.
    """
    new_corners = space.facet_corners(facets)
    longest = max(_longest_edge(new_corners), _longest_edge(corners))
    reach = SAME_PLACE * space.comm.allreduce(longest, MPI.MAX)
    low = x.min(axis=0, initial=np.inf)
    high = x.max(axis=0, initial=-np.inf)
    space.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    space.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    # The boxes around the contact are compared, too: it may have become smaller.
    old_points = corners.reshape(-1, space.d)
    _, _, distance = nearest(x, corners)
    away = max(
        float(distance.max(initial=0.0)),
        float(abs(low - old_points.min(axis=0)).max()),
        float(abs(high - old_points.max(axis=0)).max()),
    )
    away = space.comm.allreduce(away, MPI.MAX)
    if away > reach:
        raise InputError(
            f"after: the contact {name!r} is {away:.3g} [length] away from where it was in that"
            " solution, which is one of another body. Give a solution on a mesh of the same body."
        )


def _longest_edge(corners: np.ndarray) -> float:
    """Return the longest edge of facets (f, d, d), 0 without facets [length]."""
    edges = corners - np.roll(corners, 1, axis=1)
    return float(np.linalg.norm(edges, axis=2).max(initial=0.0))
