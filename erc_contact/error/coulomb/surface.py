"""The contacts with Coulomb friction as one surface, the same on all ranks.

It has nodes, facets, and the admissible pair on it.

Symbols: n nodes of the surface, F its facets, m nodes of a facet, d dimension; w^ and
r^ admissible displacement and traction; mu friction coefficient; t a tangential field
with |t| <= mu, mu times a direction of slip.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.friction import PROPORTIONAL
from erc_contact.model.contact.trace import interpolate_normals, split
from erc_contact.model.last_step import interpolate
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.simplex import (
    barycentric,
    bernstein,
    lagrange,
    measures,
    node_between,
    nodes,
    rule,
)

EDGE_COSINE = 0.87
"""Least cosine of the angle between normals of a smooth foundation [-].

The angle is between the normal of a facet and the mean normal of a node.
"""
ZERO_COMPONENT = 1e-8
"""Component of a normal that counts as zero [-]."""


@dataclass(frozen=True, eq=False)
class CoulombSurface:
    """Hold the contacts with Coulomb friction.

    Attributes:
        degree: Degree k of the displacement.
        numbers: Global numbers of the nodes, shape (n,).
        facets: Places of the nodes of each facet in ``numbers``, shape (F, m).
        corners: Vertices of the facets [length], shape (F, d, d).
        of_corners: Normals of the foundation at the vertices of the facets, shape (F,
            d, d).
        normal: Mean normals at the nodes, shape (n, d).
        blocked: Nodes where t must vanish, shape (n,). A displacement (t.v) n cannot be
            lifted into the body there: a support or another contact holds the normal
            component and leaves a tangential one free.
    """

    degree: int
    numbers: np.ndarray
    facets: np.ndarray
    corners: np.ndarray
    of_corners: np.ndarray
    normal: np.ndarray
    blocked: np.ndarray

    @property
    def area(self) -> np.ndarray:
        """Return the areas of the facets [length^(d-1)], shape (F,)."""
        return measures(self.corners)

    def positions(self) -> np.ndarray:
        """Return the positions of the nodes [length], shape (n, d)."""
        d = self.normal.shape[1]
        x = np.zeros_like(self.normal)
        x[self.facets] = np.matmul(lagrange(d - 1, 1, nodes(d - 1, self.degree)), self.corners)
        return x

    def normals_at(self, points: np.ndarray) -> np.ndarray:
        """Return unit normals at reference points of the facets, shape (F, q, d)."""
        return interpolate_normals(self.of_corners, barycentric(points))

    @property
    def normals(self) -> np.ndarray:
        """Return unit normals at the nodes of the facets, shape (F, m, d)."""
        return self.normals_at(nodes(self.normal.shape[1] - 1, self.degree))

    @property
    def pieces(self) -> np.ndarray:
        """Return the facets cut into simplices of equal size whose vertices are nodes.

        A vertex is its place in ``numbers``; shape (P, d).
        """
        cut = pieces(self.normal.shape[1] - 1, self.degree)
        return self.facets[:, cut].reshape(-1, cut.shape[1])

    def interpolate(self, values: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Interpolate vectors at the nodes (n, d), linear between them.

        Args:
            values: The vectors.
            x: Points [length], shape (p, d). The nearest points of the surface count.
        """
        return interpolate(x, self.positions()[self.pieces], values[self.pieces])

    def sum_up(self, values: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Sum values at the nodes of facets or pieces, (f, m, ...) -> (n, ...)."""
        total = np.zeros((len(self.numbers), *values.shape[2:]))
        np.add.at(total, places, values)
        return total


class OnPieces(NamedTuple):
    """Hold a traction on a quadrature of the pieces of the facets.

    There are c pieces of a facet, with q points each.

    Attributes:
        area: Weights [length^(d-1)], shape (F, c, q).
        linear: The functions that are linear on a piece at its points, shape (q, d).
        pressure: Pressure of r^ [force/area], shape (F, c, q).
        shear: Its tangential part, shape (F, c, q, d).
    """

    area: np.ndarray
    linear: np.ndarray
    pressure: np.ndarray
    shear: np.ndarray


@dataclass(frozen=True, eq=False)
class PairOnSurface:
    """Hold an admissible pair on a surface.

    Attributes:
        surface: The surface.
        traction: Bernstein coefficients of r^ [force/area], shape (F, m, d).
        displacement: w^ at the nodes of the facets, its tangential part counted from
            the last step [length], shape (F, m, d).
        friction: mu at the nodes of the facets [-], shape (F, m).
        stiffness: The approximate stiffness of the body at the facets, E/h
            [force/length^3], shape (F,).
    """

    surface: CoulombSurface
    traction: np.ndarray
    displacement: np.ndarray
    friction: np.ndarray
    stiffness: np.ndarray

    def least_friction(self) -> np.ndarray:
        """Return the least mu of the facets at each node [-], shape (n,)."""
        least = np.full(len(self.surface.numbers), np.inf)
        np.minimum.at(least, self.surface.facets, self.friction)
        return least

    def at_points(self, degree: int) -> OnPieces:
        """Evaluate the traction on a quadrature of a degree."""
        s = self.surface
        d = s.normal.shape[1]
        k = s.degree
        points, weights = rule(d - 1, degree)
        linear = lagrange(d - 1, 1, points)
        corners = nodes(d - 1, k)[pieces(d - 1, k)]
        in_facet = np.matmul(linear, corners).reshape(-1, d - 1)
        r = np.matmul(bernstein(d - 1, k, in_facet), self.traction)
        r_n, r_t, _ = split(r, s.normals_at(in_facet))
        shape = (len(s.facets), len(corners), len(points))
        area = np.broadcast_to(s.area[:, None, None] * weights / len(corners), shape)
        pressure = -np.minimum(r_n, 0.0).reshape(shape)
        return OnPieces(area, linear, pressure, r_t.reshape(*shape, d))

    def unbalanced(self, t: np.ndarray) -> tuple[np.ndarray, float]:
        """Assemble ``rho = r^_t + |r^_n| t`` as forces at the nodes [force].

        Args:
            t: The field, shape (n, d).

        Returns:
            The forces, shape (n, d), and ``int rho.w^_t`` [force length].
        """
        s = self.surface
        d = t.shape[1]
        k = s.degree
        cut = pieces(d - 1, k)
        at = self.at_points(2 * k + 1)
        points = np.matmul(at.linear, nodes(d - 1, k)[cut])
        # The field is linear on a piece, less its normal part.
        field = np.matmul(at.linear, t[s.facets[:, cut]])
        normals = s.normals_at(points.reshape(-1, d - 1)).reshape(field.shape)
        field -= (field * normals).sum(axis=-1, keepdims=True) * normals
        rho = at.area[..., None] * (at.shear + at.pressure[..., None] * field)
        shape = lagrange(d - 1, k, points.reshape(-1, d - 1)).reshape(*points.shape[:2], -1)
        of_facets = np.einsum("cqm,fcqi->fmi", shape, rho)
        return s.sum_up(of_facets, s.facets), float(np.sum(of_facets * self.displacement))

    def unaligned(self, t: np.ndarray) -> np.ndarray:
        """Return ``eta = mu |w^_t| - t.w^_t >= 0`` at the nodes [length], shape (n,).

        It is the greatest of the facets.
        """
        s = self.surface
        _, w_t, slip = split(self.displacement, s.normals)
        of_facets = self.friction * slip - (t[s.facets] * w_t).sum(axis=-1)
        eta = np.zeros(len(s.numbers))
        np.maximum.at(eta, s.facets, of_facets)
        return eta


@cache
def pieces(d: int, k: int) -> np.ndarray:
    """Return the simplices of equal size into which the nodes cut a simplex.

    Returns:
        Numbers of nodes of degree k, shape (c, d+1).
    """
    if k == 1:
        return np.arange(d + 1)[None]
    between = node_between(d, k)
    corners = [between[i] for i in range(d + 1)]
    if d == 1:
        return np.array(corners)
    middle = [between[0, 1], between[1, 2], between[2, 0]]
    return np.array([*corners, middle])


def has_coulomb(contact: ContactOnMesh) -> bool:
    """Tell whether a contact has isotropic Coulomb friction, tangentially rigid."""
    if contact.friction is None or contact.tangential_stiffness is not None:
        return False
    return contact.friction_set.is_disc and contact.friction.dependence == PROPORTIONAL


def coulomb_surface(model: Model) -> CoulombSurface:
    """Gather the contacts of a model with Coulomb friction; collective.

    There is one at least.
    """
    space = model.space
    numbers_of_contacts = []
    corners_of_contacts = []
    normals_of_contacts = []
    fixed_of_contacts = []
    others = [np.zeros(0, dtype=int)]
    for contact in model.contacts:
        here = contact.trace.here
        facet_nodes = here.nodes[here.owned]
        of_contact = space.global_numbers(facet_nodes)
        if not has_coulomb(contact):
            others.append(of_contact.ravel())
            continue
        numbers_of_contacts.append(of_contact)
        corners_of_contacts.append(here.corners[here.owned])
        normals_of_contacts.append(contact.trace.normals_at_vertices[here.owned])
        fixed_of_contacts.append(contact.trace.fixed(model.fixed)[here.owned])
        # At a node of a pair the body is seen by the jump, and not by u.
        foundation = here.only(contact.trace.on_foundation)
        nodes = foundation.nodes[foundation.owned]
        others.append(space.global_numbers(nodes[model.connections.is_paired[nodes]]))
        # Where more than two bodies meet it is seen by the jump of one pair alone.
        others.append(of_contact[model.connections.is_joint[facet_nodes]])
    all_numbers = _gather(space, numbers_of_contacts)
    corners = _gather(space, corners_of_contacts)
    of_corners = _gather(space, normals_of_contacts)
    fixed = _gather(space, fixed_of_contacts)
    numbers, places = np.unique(all_numbers, return_inverse=True)
    facets = places.reshape(all_numbers.shape)
    normal = np.zeros((len(numbers), space.d))
    of_nodes = interpolate_normals(of_corners, barycentric(space.facet_points))
    np.add.at(normal, facets, measures(corners)[:, None, None] * of_nodes)
    normal /= np.linalg.norm(normal, axis=1)[:, None]

    # Blocked are nodes of another contact, at an edge of the foundation, and where a
    # support holds some component of the normal but not all components.
    blocked = np.isin(numbers, _gather(space, others))
    cosine = (normal[facets] * of_nodes).sum(axis=-1)
    blocked[facets[cosine < EDGE_COSINE]] = True
    supported = np.zeros((len(numbers), space.d), dtype=bool)
    supported[facets] = fixed
    some_of_normal = (supported & (abs(normal) > ZERO_COMPONENT)).any(axis=1)
    blocked |= some_of_normal & ~supported.all(axis=1)
    return CoulombSurface(space.degree, numbers, facets, corners, of_corners, normal, blocked)


def pair_on_surface(pair: Admissible) -> PairOnSurface:
    """Gather an admissible pair on the contacts with Coulomb friction; collective.

    There is one such contact at least.
    """
    model = pair.model
    space = model.space
    u = pair.displacement.x.array
    values = []
    displacements = []
    frictions = []
    stiffnesses = []
    for traction in pair.tractions:
        contact = traction.contact
        if not has_coulomb(contact):
            continue
        trace = contact.trace
        owned = trace.here.owned
        values.append(traction.values[owned])
        displacements.append(trace.since(u)[owned])
        frictions.append(_friction(space, contact)[owned])
        stiffnesses.append(trace.stiffness[owned])
    return PairOnSurface(
        surface=coulomb_surface(model),
        traction=_gather(space, values),
        displacement=_gather(space, displacements),
        friction=_gather(space, frictions),
        stiffness=_gather(space, stiffnesses),
    )


def _friction(space: Space, contact: ContactOnMesh) -> np.ndarray:
    """Return the coefficient mu at nodes of facets [-], shape (f, m); collective."""
    ones = np.ones((len(contact.facets), len(space.facet_points)))
    parameters = friction_parameters(space, contact, space.facet_points)
    return np.array(contact.friction_bound(ones, parameters))


def _gather(space: Space, parts: list[np.ndarray]) -> np.ndarray:
    """Gather arrays of the facets of this rank, contact by contact; collective.

    Returns:
        One array of all ranks.
    """
    gathered: list[np.ndarray] = space.comm.allgather(np.concatenate(parts))
    return np.concatenate(gathered)
