"""The contacts with Coulomb friction as one surface: its nodes, and the admissible pair on it, the same on all ranks.

Symbols: M nodes of the surface, F its facets, m nodes of a facet, d dimension; w^ and
r^ admissible displacement and traction; mu friction coefficient; t a tangential field
with |t| <= mu, mu times a direction of slip.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.mesh.simplex import bernstein, lagrange, measures, node_between, nodes, rule
from erc_contact.model.foundation import BoundContact
from erc_contact.model.friction import PROPORTIONAL
from erc_contact.model.last_step import interpolate
from erc_contact.model.model import Model
from erc_contact.model.trace import split

EDGE = 0.87
"""Least cosine of the angle between the normal of a facet and the mean normal of a node of a smooth foundation [-]."""
ALONG = 1e-8
"""Component of a normal that counts as zero [-]."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The contacts with Coulomb friction.

    Attributes:
        degree: Degree k of the displacement.
        numbers: Global numbers of the nodes, shape (M,).
        facets: Places of the nodes of each facet in ``numbers``, shape (F, m).
        corners: Vertices of the facets [length], shape (F, d, d).
        direction: Normals of the foundation on the facets, shape (F, d).
        normal: Mean normals at the nodes, shape (M, d).
        blocked: Nodes where t must vanish, shape (M,). A displacement (t.v) n cannot be
            lifted into the body there: a support or another contact holds the normal
                component and leaves a tangential one free.
    """

    degree: int
    numbers: np.ndarray
    facets: np.ndarray
    corners: np.ndarray
    direction: np.ndarray
    normal: np.ndarray
    blocked: np.ndarray

    @property
    def area(self) -> np.ndarray:
        """Areas of the facets [length^(d-1)], shape (F,)."""
        return measures(self.corners)

    def positions(self) -> np.ndarray:
        """Positions of the nodes [length], shape (M, d)."""
        d = self.normal.shape[1]
        x = np.zeros_like(self.normal)
        x[self.facets] = np.matmul(lagrange(d - 1, 1, nodes(d - 1, self.degree)), self.corners)
        return x

    @property
    def pieces(self) -> np.ndarray:
        """The facets cut into simplices of equal size whose vertices are nodes, as places in ``numbers``: (P, d)."""
        cut = pieces(self.normal.shape[1] - 1, self.degree)
        return self.facets[:, cut].reshape(-1, cut.shape[1])

    def interpolated(self, values: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Vectors at the nodes (M, d), linear between them, at the points nearest to x (n, d), shape (n, d)."""
        return interpolate(x, self.positions()[self.pieces], values[self.pieces])

    def summed(self, values: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Sums at the nodes of values at the nodes of facets or pieces, (n, m, ...), shape (M, ...)."""
        total = np.zeros((len(self.numbers), *values.shape[2:]))
        np.add.at(total, places, values)
        return total


@dataclass(frozen=True, eq=False)
class PairOnSurface:
    """An admissible pair on a surface.

    Attributes:
        surface: The surface.
        traction: Bernstein coefficients of r^ [force/area], shape (F, m, d).
        displacement: w^ at the nodes of the facets, its tangential part counted from
            the last step [length], shape (F, m, d).
        friction: mu at the nodes of the facets [-], shape (F, m).
        stiffness: The approximate stiffness of the body at the facets, E/h
            [force/length^3], shape (F,).
    """

    surface: Surface
    traction: np.ndarray
    displacement: np.ndarray
    friction: np.ndarray
    stiffness: np.ndarray

    def least_friction(self) -> np.ndarray:
        """The least mu of the facets at each node, shape (M,)."""
        least = np.full(len(self.surface.numbers), np.inf)
        np.minimum.at(least, self.surface.facets, self.friction)
        return least

    def at_points(self, degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """A quadrature on the pieces of the facets.

        Returns:
            Its weights [length^(d-1)], shape (F, c, q); the functions that are linear
            on a piece at its points, (q, d); the pressure of r^ [force/area], (F, c,
            q), and its tangential part, (F, c, q, d).
        """
        s = self.surface
        d, k = s.normal.shape[1], s.degree
        points, weights = rule(d - 1, degree)
        linear = lagrange(d - 1, 1, points)
        corners = nodes(d - 1, k)[pieces(d - 1, k)]
        shape = bernstein(d - 1, k, np.matmul(linear, corners).reshape(-1, d - 1))
        r_n, r_t, _ = split(np.matmul(shape, self.traction), s.direction[:, None, :])
        some = (len(s.facets), len(corners), len(points))
        area = np.broadcast_to(s.area[:, None, None] * weights / len(corners), some)
        return area, linear, -np.minimum(r_n, 0.0).reshape(some), r_t.reshape(*some, d)

    def unbalanced(self, t: np.ndarray) -> tuple[np.ndarray, float]:
        """The traction ``rho = r^_t + |r^_n| t`` as forces at the nodes [force], (M, d), and ``int rho.w^_t``."""
        s = self.surface
        d, k = t.shape[1], s.degree
        area, linear, pressure, shear = self.at_points(2 * k + 1)
        along = np.matmul(linear, t[s.facets[:, pieces(d - 1, k)]])
        along -= (along @ s.direction[:, None, :, None]) * s.direction[:, None, None, :]
        rho = area[..., None] * (shear + pressure[..., None] * along)
        points = np.matmul(linear, nodes(d - 1, k)[pieces(d - 1, k)])
        shape = lagrange(d - 1, k, points.reshape(-1, d - 1)).reshape(*points.shape[:2], -1)
        of_facets = np.einsum("cqm,fcqi->fmi", shape, rho)
        return s.summed(of_facets, s.facets), float(np.sum(of_facets * self.displacement))

    def unaligned(self, t: np.ndarray) -> np.ndarray:
        """``eta = mu |w^_t| - t.w^_t >= 0`` at the nodes [length], the greatest of the facets, shape (M,)."""
        s = self.surface
        _, w_t, slip = split(self.displacement, s.direction[:, None, :])
        eta = np.zeros(len(s.numbers))
        np.maximum.at(eta, s.facets, self.friction * slip - (t[s.facets] * w_t).sum(axis=-1))
        return eta


@cache
def pieces(d: int, k: int) -> np.ndarray:
    """The simplices of equal size into which the nodes of degree k cut a simplex, by numbers of nodes, (c, d+1)."""
    between = node_between(d, k) if k > 1 else None
    if between is None:
        return np.arange(d + 1)[None]
    corners = [between[i] for i in range(d + 1)]
    return np.array(
        corners if d == 1 else [*corners, [between[0, 1], between[1, 2], between[2, 0]]]
    )


def has_coulomb(contact: BoundContact) -> bool:
    """Tell whether the friction bound of a contact is a multiple of the pressure."""
    return contact.friction is not None and contact.friction.dependence == PROPORTIONAL


def coulomb_surface(model: Model) -> Surface:
    """The contacts of a model with Coulomb friction, of which there is one at least; collective."""
    contacts = [c for c in model.contacts if has_coulomb(c)]
    sides = [c.trace.here for c in contacts]
    at = [side.nodes[side.owned] for side in sides]
    numbers, corners, direction, fixed = (
        _gathered(model, part)
        for part in (
            [model.global_numbers(nodes) for nodes in at],
            [side.corners[side.owned] for side in sides],
            [c.direction[c.trace.here.owned] for c in contacts],
            [model.fixed[nodes] for nodes in at],
        )
    )
    other_sides = [c.trace.here for c in model.contacts if not has_coulomb(c)]
    others = [model.global_numbers(side.nodes[side.owned]).ravel() for side in other_sides]
    known, places = np.unique(numbers, return_inverse=True)
    facets = places.reshape(numbers.shape)
    normal = np.zeros((len(known), model.d))
    np.add.at(normal, facets, (measures(corners)[:, None] * direction)[:, None, :])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    blocked = np.isin(
        known,
        np.concatenate(model.comm.allgather(np.concatenate([*others, np.zeros(0, dtype=int)]))),
    )
    blocked[facets[(normal[facets] * direction[:, None, :]).sum(axis=-1) < EDGE]] = True
    held = np.zeros((len(known), model.d), dtype=bool)
    held[facets] = fixed
    blocked |= (held & (abs(normal) > ALONG)).any(axis=1) & ~held.all(axis=1)
    return Surface(model.degree, known, facets, corners, direction, normal, blocked)


def pair_on_surface(pair: Admissible) -> PairOnSurface:
    """An admissible pair on the contacts with Coulomb friction, of which there is one at least; collective."""
    model = pair.solution.model
    tractions = [t for t in pair.tractions if has_coulomb(t.contact)]
    own = [t.contact.trace.here.owned for t in tractions]
    u = pair.displacement.x.array
    parts: tuple[list[np.ndarray], ...] = (
        [t.values[mine] for t, mine in zip(tractions, own, strict=True)],
        [t.contact.trace.since(u)[mine] for t, mine in zip(tractions, own, strict=True)],
        [_friction(model, t.contact)[mine] for t, mine in zip(tractions, own, strict=True)],
        [t.contact.trace.stiffness[mine] for t, mine in zip(tractions, own, strict=True)],
    )
    return PairOnSurface(coulomb_surface(model), *(_gathered(model, part) for part in parts))


def _friction(model: Model, contact: BoundContact) -> np.ndarray:
    """The coefficient mu at the nodes of the facets, shape (f, m); collective."""
    ones = np.ones((len(contact.facets), len(model.facet_points)))
    return np.array(
        contact.friction_bound(ones, model.friction_parameters(contact, model.facet_points))
    )


def _gathered(model: Model, parts: list[np.ndarray]) -> Any:
    """Arrays of the facets of this rank, contact by contact, as one array of all ranks; collective."""
    return np.concatenate(model.comm.allgather(np.concatenate(parts)))
