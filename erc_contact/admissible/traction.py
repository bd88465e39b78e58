"""The admissible traction on a contact.

Symbols: r^ admissible contact traction, k degree, m nodes of a facet, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.normals import SAME_NORMAL
from erc_contact.model.contact.trace import split
from namedmesh.for_solvers import spread
from namedmesh.simplex import at_nodes, bernstein, nodes


@dataclass(frozen=True, eq=False)
class ContactTraction:
    """Hold the admissible traction r^ on one contact, of degree k on each facet.

    Attributes:
        contact: The contact.
        nodes: Nodes of each facet (cell, local facet) of ``contact.facets``, ghosts
            included, shape (n, m).
        area: Facet areas [length^(d-1)], shape (n,).
        values: Bernstein coefficients of r^ [force/area], shape (n, m, d). At a vertex
            the coefficient is the value.
        friction_bound: Bernstein coefficients of the friction bound b(p) of r^
            [force/area], shape (n, m).
    """

    contact: ContactOnMesh
    nodes: np.ndarray
    area: np.ndarray
    values: np.ndarray
    friction_bound: np.ndarray

    @property
    def normal_component(self) -> np.ndarray:
        """Return the normal components of the coefficients, shape (n, m) [force/area].

        Where normals turn along a facet, the normals at the nodes are taken.
        """
        return np.asarray((self.values * self.contact.trace.normals).sum(axis=-1))

    @property
    def tangential_part(self) -> np.ndarray:
        """Return the tangential parts of the coefficients, (n, m, d) [force/area]."""
        n = self.contact.trace.normals
        return self.values - self.normal_component[..., None] * n

    def at_points(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pressures and tangential parts of r^ at points [force/area].

        Args:
            points: Reference points of the facets, shape (q, d-1).

        Returns:
            Shapes (n, q) and (n, q, d).
        """
        here = self.contact.trace.here
        r = np.matmul(bernstein(here.d - 1, here.degree, points), self.values)
        r_n, r_t, _ = split(r, self.contact.trace.normals_at(points))
        return -r_n, r_t

    def in_law(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what the law compares [force/area]: pressure, friction and its bound.

        Friction counts by its gauge, a length where friction is isotropic.

        Coefficients are compared, whose cone contains the values. Where normals turn
        along facets, the coefficients have no cone of their own, and values at the
        nodes are compared. Shape (n, m) each.
        """
        allowed = self.contact.friction_set
        if self.contact.trace.corner_normals is None:
            normals = self.contact.trace.normals
            shear = allowed.gauge(self.tangential_part, normals)
            return -self.normal_component, shear, self.friction_bound
        here = self.contact.trace.here
        points = nodes(here.d - 1, here.degree)
        pressure, tangential = self.at_points(points)
        bound = self.friction_bound @ at_nodes(here.d - 1, here.degree).T
        shear = allowed.gauge(tangential, self.contact.trace.normals_at(points))
        return pressure, shear, bound


def is_kinked(comm: MPI.Comm, contact: ContactOnMesh) -> bool:
    """Tell whether the normals of a contact jump from facet to facet; collective."""
    if contact.trace.corner_normals is not None:
        return False
    return spread(comm, contact.direction) > SAME_NORMAL
