"""The admissible traction on a contact.

Symbols: r^ admissible contact traction, k degree, m nodes of a facet, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.model.foundation import BoundContact

SAME_NORMAL = 1e-9
"""Difference of two unit normals that counts as none [-]."""


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

    contact: BoundContact
    nodes: np.ndarray
    area: np.ndarray
    values: np.ndarray
    friction_bound: np.ndarray

    @property
    def normal_component(self) -> np.ndarray:
        """Return the normal component r^_n, shape (n, m) [force/area]."""
        return np.einsum("fmi,fi->fm", self.values, self.contact.direction)

    @property
    def tangential_part(self) -> np.ndarray:
        """Return the tangential part r^_t, shape (n, m, d) [force/area]."""
        n = self.contact.direction[:, None, :]
        return self.values - self.normal_component[..., None] * n


def is_curved(comm: MPI.Comm, contact: BoundContact) -> bool:
    """Tell whether the normals of a contact vary from facet to facet; collective."""
    low = contact.direction.min(axis=0, initial=np.inf)
    high = contact.direction.max(axis=0, initial=-np.inf)
    lowest = np.min(comm.allgather(low), axis=0)
    highest = np.max(comm.allgather(high), axis=0)
    return bool(np.any(highest - lowest > SAME_NORMAL))
