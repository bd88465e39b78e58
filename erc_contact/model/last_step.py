"""Carry the last step of a history to another mesh.

Friction acts on the tangential displacement since the last step, ``w_t - s``. Here s is
the tangential displacement at the end of that step, a polynomial of degree k on the
contact facets of the mesh that computed it. A node of another mesh takes its value on
the closest of these facets. On the same mesh and on one that refines it s is then the
same field, up to round-off. On any other mesh s is interpolated, and what this loses is
measured.

Symbols: d dimension, f facets, m nodes of a facet, n points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.trace import Trace, split
from erc_contact.model.law.law_entries import StateField
from erc_contact.model.space import Space
from namedmesh.base.ranks import boxes, greatest, of_all
from namedmesh.for_solvers import closest
from namedmesh.simplex import lagrange, rule

INTERPOLATION_ROUND_OFF = 1e-12
"""Difference of interpolants that is round-off, over the greatest displacement [-]."""
SAME_PLACE = 0.5
"""Distance of a contact to its place in the last step that tells another body [-].

It is over the longest edge of the facets. Flat facets of a curved body are nearer to
each other on any two meshes.
"""


@dataclass(frozen=True)
class Greatest:
    """Hold the sizes of a history so far. The next step has their round-off.

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
        state: The state of the law at the end of the step; None of laws without.
    """

    space: Space
    contacts: Mapping[str, tuple[np.ndarray, np.ndarray]]
    greatest: Greatest
    state: StateField | None = None

    def on(
        self, space: Space, name: str, trace: Trace, sign: float = 1.0
    ) -> tuple[fem.Function, np.ndarray | None]:
        """Interpolate the displacement on a contact of another mesh; collective.

        Args:
            space: The other mesh, or the same.
            name: Name of the contact.
            trace: Its trace there.
            sign: Factor of the displacement, -1 where the sides of the contact are
                exchanged [-].

        Returns:
            The displacement [length], zero off the contact, and what the mesh does not
            represent of its tangential part s, ``int_F |s - I s|^2`` for each facet
            [length^(d+1)], shape (f,), or None where it represents all.

        Raises:
            InputError: If the contact was elsewhere in the last step.
        """
        d = space.d
        facets = trace.here.facets
        old_facets, old_w = self.contacts[name]
        old_w = sign * old_w
        nodes = space.facet_nodes(facets)
        before = space.function()
        values = before.x.array.reshape(-1, d)
        if space.domain is self.space.domain and space.degree == self.space.degree:
            values[nodes] = old_w
            return before, None
        corners, old_values = gather_facets(self.space, [(old_facets, old_w)])
        on_contact = np.unique(nodes)
        x = space.V.tabulate_dof_coordinates()[on_contact, :d]
        _check_place(space, name, facets, x, corners)
        values[on_contact] = interpolate(x, corners, old_values, self.space.degree)
        # What is lost: the old field less its interpolant, at points of a rule that is
        # exact for the square of both, without the normal part.
        points, weights = rule(d - 1, 2 * max(space.degree, self.space.degree))
        places = trace.here.points_at(points)
        exact = interpolate(places.reshape(-1, d), corners, old_values, self.space.degree)
        shape = lagrange(d - 1, space.degree, points)
        difference = exact.reshape(places.shape) - np.matmul(shape, values[nodes])
        size = float(abs(old_values).max(initial=0.0))
        return before, lost_on_facets(space, trace, difference, size, points, weights)


def lost_on_facets(
    space: Space,
    trace: Trace,
    difference: np.ndarray,
    size: float,
    points: np.ndarray,
    weights: np.ndarray,
) -> np.ndarray | None:
    """Integrate the square of the tangential part of a difference; collective.

    Args:
        space: The mesh.
        trace: The displacement of a contact.
        difference: A displacement less its interpolant at points of the facets
            [length], shape (f, q, d).
        size: Greatest component of the displacement, on all ranks [length].
        points: Reference points of a rule, shape (q, d-1).
        weights: Its weights, shape (q,).

    Returns:
        ``int_F |s - I s|^2`` [length^(d+1)], shape (f,); None where it is round-off on
        all facets.
    """
    tangential = split(difference, trace.normals_at(points)).tangential
    if greatest(space.comm, tangential) <= INTERPOLATION_ROUND_OFF * size:
        return None
    return trace.here.areas * ((tangential**2).sum(axis=-1) @ weights)


def gather_facets(
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
    corners, values = of_all(space.comm, x[nodes[:, : space.d]], values)
    return corners, values


def interpolate(
    x: np.ndarray, corners: np.ndarray, values: np.ndarray, degree: int = 1
) -> np.ndarray:
    """Evaluate interpolants on the closest facets.

    Args:
        x: Points, shape (n, d).
        corners: Corners of the facets, shape (f, d, d).
        values: Values at the nodes of the facets, shape (f, m, d).
        degree: Degree of the interpolants.

    Returns:
        Values at the points, shape (n, d).
    """
    facet, local, _ = closest(x, corners)
    shape = lagrange(x.shape[1] - 1, degree, local[:, 1:])
    return np.einsum("nm,nmi->ni", shape, values[facet])


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
    low, high = boxes(space.comm, x, np.zeros(len(x), dtype=int), 1)
    # The boxes around the contact are compared, too: it may have become smaller.
    old_points = corners.reshape(-1, space.d)
    distance = closest(x, corners).distance
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
