"""The last step of a history: where its contacts were, and what another mesh knows of it.

Friction acts on the tangential displacement since the last step, ``w_t - s``. Here s is
the tangential displacement at the end of that step, a polynomial of degree k on the
contact facets of the mesh that computed it. A node of another mesh takes its value on
the nearest of these facets. On the same mesh and on one that refines it s is then the
same field, up to round-off. On any other mesh s is interpolated, and what this loses is
measured.

Symbols: d dimension, f facets, m nodes of a facet, n points.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.mesh.simplex import barycentric, lagrange, rule
from erc_contact.model.space import Space

CLUSTER = 64
"""Number of points for which the nearest facets are found together."""
EXACT = 1e-12
"""Difference of interpolants that counts as round-off, over the greatest displacement [-]."""
NEAR = 0.5
"""Distance of a contact to its place in the last step that tells another body, over the
longest edge of its facets [-]. Flat facets of a curved body are nearer to each other on
any two meshes.
"""


@dataclass(frozen=True, eq=False)
class LastStep:
    """The displacement at the end of the last step.

    Attributes:
        space: The mesh that it was computed on.
        displacement: The displacement [length], a Function on it.
    """

    space: Space
    displacement: fem.Function

    def on(
        self, space: Space, name: str, direction: np.ndarray
    ) -> tuple[fem.Function, np.ndarray | None]:
        """The displacement at the nodes of a contact of another mesh; collective.

        Args:
            space: The other mesh, or the same.
            name: Name of the contact.
            direction: Unit normals of its facets, shape (f, d).

        Returns:
            The displacement [length], zero off the contact, and what the mesh does not
            carry of its tangential part s, ``int_F |s - I s|^2`` for each facet
            [length^(d+1)], shape (f,), or None where it carries all.

        Raises:
            InputError: If the contact was elsewhere in the last step.
        """
        facets, old, d = space.domain.facets(name), self.space.domain.facets(name), space.d
        nodes, before = space.facet_nodes(facets), space.function()
        values = before.x.array.reshape(-1, d)
        if space.domain is self.space.domain and space.degree == self.space.degree:
            values[nodes] = self.displacement.x.array.reshape(-1, d)[self.space.facet_nodes(old)]
            return before, None
        corners, known = gathered_facets(self.space, [old], self.displacement)
        some = np.unique(nodes)
        x = space.V.tabulate_dof_coordinates()[some, :d]
        _check_place(space, name, x, corners)
        values[some] = interpolate(x, corners, known, self.space.degree)
        points, weights = rule(d - 1, 2 * max(space.degree, self.space.degree))
        at = np.matmul(barycentric(points), space.facet_corners(facets))
        exact = interpolate(at.reshape(-1, d), corners, known, self.space.degree).reshape(at.shape)
        rest = exact - np.matmul(lagrange(d - 1, space.degree, points), values[nodes])
        rest -= (rest * direction[:, None]).sum(axis=-1, keepdims=True) * direction[:, None]
        most = space.comm.allreduce(float(abs(rest).max(initial=0.0)), MPI.MAX)
        if most <= EXACT * abs(known).max(initial=0.0):
            return before, None
        return before, space.facet_areas(facets) * ((rest**2).sum(axis=-1) @ weights)


def gathered_facets(
    space: Space, parts: Sequence[np.ndarray], u: fem.Function
) -> tuple[np.ndarray, np.ndarray]:
    """Corners (f, d, d) and displacements of the nodes (f, m, d) of facets (cell, local facet) of all ranks."""
    x, at = space.V.tabulate_dof_coordinates()[:, : space.d], u.x.array.reshape(-1, space.d)
    own = [part[space.owned(part)] for part in parts]
    nodes = space.facet_nodes(np.vstack(own))
    gathered = space.comm.allgather((x[nodes[:, : space.d]], at[nodes]))
    return np.concatenate([p[0] for p in gathered]), np.concatenate([p[1] for p in gathered])


def interpolate(
    x: np.ndarray, corners: np.ndarray, values: np.ndarray, degree: int = 1
) -> np.ndarray:
    """Interpolants on the nearest facets.

    Args:
        x: Points, shape (n, d).
        corners: Corners of the facets, shape (f, d, d).
        values: Values at the nodes of the facets, shape (f, m, d).
        degree: Degree of the interpolants.

    Returns:
        Values at the points, shape (n, d).
    """
    facet, local, _ = nearest(x, corners)
    return np.einsum("nm,nmi->ni", lagrange(x.shape[1] - 1, degree, local[:, 1:]), values[facet])


def nearest(x: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The nearest facets (f, d, d) of points (n, d).

    Points that are near to each other are worked on together, with the facets that may
    be the nearest of one of them.

    Returns:
        The numbers of the facets, shape (n,); barycentric coordinates of the nearest
        points on them, shape (n, d); the distances, shape (n,).
    """
    edges = corners[:, 1:] - corners[:, :1]
    # of each facet: from a point to its barycentric coordinates
    to_barycentric = np.linalg.inv(edges @ edges.transpose(0, 2, 1)) @ edges
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1, initial=0.0)
    facet, at, far = np.empty(len(x), dtype=int), np.empty_like(x), np.empty(len(x))
    for some in _clusters(x):
        centre = x[some].mean(axis=0)
        spread = np.linalg.norm(x[some] - centre, axis=1).max()
        away = np.linalg.norm(middle - centre, axis=1)
        near = np.flatnonzero(away - radius <= (away + radius).min() + 2 * spread)
        local = np.einsum("fki,nfi->nfk", to_barycentric[near], x[some][:, None] - corners[near, 0])
        shape = np.maximum(
            np.concatenate([1 - local.sum(axis=2, keepdims=True), local], axis=2), 0.0
        )
        shape /= shape.sum(axis=2, keepdims=True)
        distance = np.linalg.norm(
            np.einsum("nfm,fmi->nfi", shape, corners[near]) - x[some][:, None], axis=2
        )
        number, every = distance.argmin(axis=1), np.arange(len(some))
        facet[some], at[some], far[some] = (
            near[number],
            shape[every, number],
            distance[every, number],
        )
    return facet, at, far


def _clusters(x: np.ndarray) -> Iterator[np.ndarray]:
    """Numbers of points (n, d) that are near to each other, at most :data:`CLUSTER` at once."""
    waiting = [np.arange(len(x))] if len(x) else []
    while waiting:
        some = waiting.pop()
        if len(some) <= CLUSTER:
            yield some
            continue
        axis = np.ptp(x[some], axis=0).argmax()
        half = len(some) // 2
        order = np.argpartition(x[some, axis], half)
        waiting += [some[order[:half]], some[order[half:]]]


def _check_place(space: Space, name: str, x: np.ndarray, corners: np.ndarray) -> None:
    """Check that a contact with nodes x (n, d) is where it was, on facets of all ranks (f, d, d); collective."""
    here = space.facet_corners(space.domain.facets(name))
    longest = [
        float(np.linalg.norm(c - np.roll(c, 1, axis=1), axis=2).max(initial=0.0))
        for c in (here, corners)
    ]
    reach = NEAR * space.comm.allreduce(max(longest), MPI.MAX)
    low, high = np.full(space.d, np.inf), np.full(space.d, -np.inf)
    low, high = (
        np.minimum(low, x.min(axis=0, initial=np.inf)),
        np.maximum(high, x.max(axis=0, initial=-np.inf)),
    )
    space.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    space.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    ends = corners.reshape(-1, space.d)
    away = float(nearest(x, corners)[2].max(initial=0.0))
    away = max(away, abs(low - ends.min(axis=0)).max(), abs(high - ends.max(axis=0)).max())
    away = space.comm.allreduce(float(away), MPI.MAX)
    if away > reach:
        raise InputError(
            f"after: the contact {name!r} is {away:.3g} [length] away from where it was in that solution, which is one "
            "of another body. Give a solution on a mesh of the same body."
        )
