"""Take the displacement of a contact: values on facets, forces back, stiffness.

A contact reads of a displacement u only w, its value at the contact. On a rigid
foundation w is u itself; between two bodies it is the jump, u on this side less u at
the facing points of the other side. Every contact has both sides: a foundation is a
side without facets and nodes, because no unknown moves it. In a history friction counts
the tangential part of w from the end of the last step. All modules that need w, its
Bernstein coefficients, or the forces that do work on it, ask the contact's
:class:`Trace`, so that they need not know which kind of contact it is.

The map from nodal values to w on facets is linear. It has one entry of 1 in each row
for this side, and between two bodies an entry of -1 for the other side. Its transpose
takes forces on facets to nodal forces, opposite on the two sides. Sectors of a body are
turned against each other: by R from this side to the other one, whose displacement then
counts as ``R^T u``.

Symbols: f facets of this side on this rank, p facets of the other side (f, or none on a
foundation), m nodes of a facet, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from dolfinx import fem

from erc_contact.model.contact.side import Side
from namedmesh.simplex import barycentric, coefficients

type Facets = np.ndarray | slice
"""Numbers of facets of a contact, or all of them."""
NOBODY = -1
"""Stands for no node."""
ALL = slice(None)
"""All facets."""


class Split(NamedTuple):
    """Hold vectors along and across normals.

    Attributes:
        normal: The normal component, shape (...).
        tangential: The tangential part, shape (..., d).
        length: The length of this part, shape (...).
    """

    normal: np.ndarray
    tangential: np.ndarray
    length: np.ndarray


def split(z: np.ndarray, n: np.ndarray) -> Split:
    """Split vectors (..., d) by unit normals n."""
    z_n = np.vecdot(z, n)
    z_t = z - z_n[..., None] * n
    return Split(z_n, z_t, lengths(z_t))


def lengths(z: np.ndarray) -> np.ndarray:
    """Return the lengths of vectors (..., d), three times as fast as numpy's norm."""
    return np.asarray(np.sqrt(np.vecdot(z, z)))


def interpolate_normals(of_corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Interpolate normals linearly on facets, and make them unit vectors.

    Args:
        of_corners: Unit normals at the vertices, shape (n, d, d).
        places: Barycentric coordinates of points, shape (q, d) or (n, q, d).

    Returns:
        Shape (n, q, d).
    """
    field = np.matmul(places, of_corners)
    return field / lengths(field)[..., None]


def dofs_of(nodes: np.ndarray, d: int) -> np.ndarray:
    """Return the degrees of freedom of nodes of any shape, d for each, in a row."""
    return (nodes[..., None] * d + np.arange(d)).ravel()


def places_of(values: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Return the places of values among different numbers in any order."""
    order = np.argsort(among)
    return order[np.searchsorted(among, values, sorter=order)]


def tangents(n: np.ndarray) -> list[np.ndarray]:
    """Return d - 1 orthonormal tangents to unit normals, each of their shape (..., d).

    In the plane a normal out of a body and the tangent turn counterclockwise.
    """
    if n.shape[-1] == 2:
        return [np.stack([-n[..., 1], n[..., 0]], axis=-1)]
    # The axis of the least component is far from the normal.
    axes = np.eye(3)[abs(n).argmin(axis=-1)]
    first = np.cross(n, axes)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return [first, np.cross(n, first)]


@dataclass(frozen=True, eq=False)
class Trace:
    """Take the displacement w of a contact from nodal values.

    Attributes:
        here: The side whose body the contact traction acts on.
        there: The other side, facet i of it facing facet i of this side. A foundation
            has no facets.
        direction: Unit normal of the contact in the middle of each facet, from this
            side into the other, shape (f, d).
        before: Displacement at the end of the last step of a history [length], a
            Function; None without one.
        corner_normals: Unit normals at the vertices of each facet, shape (f, d, d);
            None, on all ranks, where no facet has normals that turn.
        rotation: R, which takes this side to the other one, shape (d, d); None where
            nothing turns.

    Example:
        >>> trace = solution.model.contacts[0].trace
        >>> w = trace.of(solution.u.x.array)
        >>> w.shape  # 4 facets with 2 nodes each, in the plane
        (4, 2, 2)
        >>> trace.back(np.ones(w.shape)).sum(axis=0)  # forces of 1 at 8 nodes of facets
        array([8., 8.])
    """

    here: Side
    there: Side
    direction: np.ndarray
    before: fem.Function | None = None
    corner_normals: np.ndarray | None = None
    rotation: np.ndarray | None = None

    @property
    def facing(self) -> slice:
        """Return which facets of this side face another body."""
        return slice(len(self.there.facets))

    @property
    def on_foundation(self) -> slice:
        """Return which facets of this side are on a foundation."""
        return slice(len(self.there.facets), None)

    def normals_at(self, points: np.ndarray) -> np.ndarray:
        """Return the unit normals at points of the facets [-].

        A linear field with unit normals at the vertices gives them.

        Args:
            points: Reference points, the same on all facets, shape (q, d-1).

        Returns:
            Shape (f, q, d); (f, 1, d) where normals do not turn.
        """
        return self.normals_at_places(barycentric(points))

    def normals_at_places(self, places: np.ndarray, facet: Facets = ALL) -> np.ndarray:
        """Return unit normals at barycentric coordinates, as :meth:`normals_at` does.

        Args:
            places: Barycentric coordinates, shape (q, d) or (n, q, d).
            facet: Numbers of the facets to which they belong, shape (n,); all of them
                by default.
        """
        if self.corner_normals is None:
            return self.direction[facet][:, None, :]
        return interpolate_normals(self.corner_normals[facet], places)

    @property
    def normals_at_vertices(self) -> np.ndarray:
        """Return the unit normals at the vertices of the facets [-], (f, d, d)."""
        if self.corner_normals is not None:
            return self.corner_normals
        d = self.here.d
        return np.broadcast_to(self.direction[:, None, :], (len(self.direction), d, d))

    @cached_property
    def normals(self) -> np.ndarray:
        """Return the unit normals at the nodes of the facets [-], (f, m or 1, d)."""
        return self.normals_at_places(self.here.shares_of_nodes)

    def of(self, u: np.ndarray) -> np.ndarray:
        """Return w at the nodes of the facets [length], shape (f, m, d).

        Args:
            u: Displacement at all nodes of this rank [length], shape (nodes d,) as the
                array of a Function has it, or (nodes, d).
        """
        nodal = u.reshape(-1, self.here.d)
        w = nodal[self.here.nodes]
        w[self.facing] -= self.seen(nodal[self.partners])
        return w

    def seen(self, there: np.ndarray) -> np.ndarray:
        """Return vectors of the other side as this side sees them, ``R^T v``.

        Args:
            there: The vectors, shape (..., d).
        """
        return there if self.rotation is None else there @ self.rotation

    def sent(self, here: np.ndarray) -> np.ndarray:
        """Return vectors of this side as the other side sees them, ``R v``.

        Args:
            here: The vectors, shape (..., d).
        """
        return here if self.rotation is None else here @ self.rotation.T

    def fixed(self, of_nodes: np.ndarray) -> np.ndarray:
        """Tell which components of w supports prescribe, shape (f, m, d).

        The displacement of a foundation is known.

        Args:
            of_nodes: Components of u that supports prescribe, shape (nodes, d).
        """
        fixed = of_nodes[self.here.nodes]
        fixed[self.facing] &= of_nodes[self.partners]
        return fixed

    @cached_property
    def of_before(self) -> np.ndarray:
        """Return w at the end of the last step [length], shape (f, m, d).

        It is zero without one.
        """
        if self.before is None:
            return np.zeros((*self.here.nodes.shape, self.here.d))
        return self.of(self.before.x.array)

    @cached_property
    def slip_before(self) -> np.ndarray:
        """Return the tangential part s of w at the end of the last step [length].

        It is zero without one. Shape (f, m, d).
        """
        return split(self.of_before, self.normals).tangential

    def since(self, u: np.ndarray) -> np.ndarray:
        """Return ``w - s``, the jump since the last step [length], shape (f, m, d).

        Its tangential part counts from the end of that step.

        Args:
            u: As in :meth:`of`.
        """
        return self.of(u) - self.slip_before

    def coefficients(self, values: np.ndarray) -> np.ndarray:
        """Compute Bernstein coefficients of polynomials on the facets.

        Args:
            values: Values at the nodes of the facets, shape (f, m, ...), such as
                :meth:`of`, :meth:`since`, or the gap.
        """
        matrix = coefficients(self.here.d - 1, self.here.degree)
        components = int(np.prod(values.shape[2:]))
        long = values.reshape(*values.shape[:2], components)
        return np.matmul(matrix, long).reshape(values.shape)

    def assign(self, u: np.ndarray, w: np.ndarray) -> None:
        """Set the displacement of this side to w, in place.

        Where the other side is at rest, :meth:`of` then returns w.

        Args:
            u: Displacement at all nodes, as in :meth:`of`.
            w: Values at the nodes of the facets, or one for each facet, shape (f, m, d)
                or (f, 1, d).
        """
        u.reshape(-1, self.here.d)[self.here.nodes] = w

    def back(self, forces: np.ndarray) -> np.ndarray:
        """Add up nodal forces from forces on w, the transpose of :meth:`of`.

        Both do the same work.

        Args:
            forces: Forces on w at the nodes of the facets [force], shape (f, m, d).

        Returns:
            Nodal forces [force], shape (nodes, d); at ghost nodes they are not
            complete.
        """
        nodal = self.back_here(forces)
        np.subtract.at(nodal, self.partners, self.sent(forces[self.facing]))
        return nodal

    def back_here(self, forces: np.ndarray) -> np.ndarray:
        """Return :meth:`back`'s forces on this side [force], shape (nodes, d)."""
        nodal = np.zeros((self.here.node_count, self.here.d))
        np.add.at(nodal, self.here.nodes, forces)
        return nodal

    def back_there(self, forces: np.ndarray) -> np.ndarray:
        """Return :meth:`back`'s forces on the other side [force], shape (nodes, d)."""
        nodal = np.zeros((self.here.node_count, self.here.d))
        np.subtract.at(nodal, self.partners, self.sent(forces[self.facing]))
        return nodal

    def on_there(self, values: np.ndarray) -> np.ndarray:
        """Return vectors at the nodes of this side on the facets of the other side.

        Args:
            values: Vectors at the nodes of the facets, shape (f, m, d).

        Returns:
            The vectors in the order of the other side, shape (p, m, d).
        """
        in_order = np.take_along_axis(values[self.facing], self._order_there[..., None], axis=1)
        return self.sent(in_order)

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Estimate the stiffness ``E/h`` of the bodies at each facet [force/length^3].

        Two bodies are two springs in a row. Shape (f,).
        """
        return _in_a_row(self.here.stiffness, self.there.stiffness)

    @cached_property
    def modulus(self) -> np.ndarray:
        """Estimate the modulus of the bodies at each facet, (f,) [force/area].

        It is the modulus of two springs in a row.
        """
        return _in_a_row(self.here.modulus, self.there.modulus)

    def share(self, values: np.ndarray) -> np.ndarray:
        """Add up values of owned facets in their cells.

        Two bodies get shares in proportion to their compliances, a foundation has none.

        Args:
            values: A value of each facet, zero where this rank does not own it, shape
                (f,).

        Returns:
            Sums for the cells of this rank, shape (cells,). The sum of a ghost is for
            its owner: the other body may be on another rank.
        """
        cells = np.zeros(self.here.cell_count)
        share = self.stiffness / self.here.stiffness
        of_there = (1 - share) * values
        np.add.at(cells, self.there.facets[:, 0], of_there[self.facing])
        np.add.at(cells, self.here.facets[:, 0], share * values)
        return cells

    @cached_property
    def partners(self) -> np.ndarray:
        """Find the nodes of the other side that face this side, shape (p, m)."""
        # Node i of the other side faces the node of this side that the order tells.
        facing = np.argsort(self._order_there, axis=1)
        return np.take_along_axis(self.there.nodes, facing, axis=1)

    @property
    def nodes_there(self) -> np.ndarray:
        """Return what faces each node of the facets, shape (f, m).

        It is a node of the other body, or ``NOBODY`` on a foundation.
        """
        nodes = np.full(self.here.nodes.shape, NOBODY)
        nodes[self.facing] = self.partners
        return nodes

    @cached_property
    def to_partners(self) -> np.ndarray:
        """Return the vectors from vertices of facets to their partners, (p, d, d).

        They are zero where both sides are in one place [length].
        """
        return self.at_partners(self.there.corners) - self.here.corners[self.facing]

    def at_partners(self, of_there: np.ndarray) -> np.ndarray:
        """Return values at nodes of the other side in the order of this side.

        Args:
            of_there: Values at the nodes of its facets, or at the vertices, which come
                first, shape (f, m or d, ...).
        """
        facing = np.argsort(self._order_there, axis=1)[:, : of_there.shape[1], None]
        return np.take_along_axis(of_there, facing, axis=1)

    @cached_property
    def _order_there(self) -> np.ndarray:
        """Find the place of the node here that each node there faces, shape (p, m)."""
        here = _about_middle(self.here.places[self.facing])
        there = _about_middle(self.seen(self.there.places))
        # Facets that face each other may be apart, of other sizes, and turned against
        # each other; their vertices are in any order. Vertices face vertices, and
        # middles of edges face middles.
        orders = []
        for first, last in ((0, self.here.d), (self.here.d, here.shape[1])):
            away = there[:, first:last, None] - here[:, None, first:last]
            distance = np.linalg.norm(away, axis=-1)
            if last > first:
                orders.append(first + distance.argmin(axis=2))
        return np.concatenate(orders, axis=1)


def _in_a_row(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return the stiffness of springs here (f,) in a row with springs there (p,), (f,).

    A rigid foundation is no spring.
    """
    of_both = here.copy()
    facing = here[: len(there)]
    of_both[: len(there)] = facing * there / (facing + there)
    return of_both


def _about_middle(x: np.ndarray) -> np.ndarray:
    """Return positions of the nodes of facets (f, m, d) from the mean of each facet.

    The greatest distance of each facet is 1.
    """
    away = x - x.mean(axis=1, keepdims=True)
    return away / np.linalg.norm(away, axis=2, keepdims=True).max(axis=1, keepdims=True)
