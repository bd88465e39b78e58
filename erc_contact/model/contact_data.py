"""Evaluate gap, normal, foundation and friction bound of a contact at any points."""

from __future__ import annotations

import numpy as np
from dolfinx import mesh as dmesh

from erc_contact.model.expressions import Everywhere
from erc_contact.model.foundation import ContactOnMesh


class ContactData:
    """Evaluate the data of a contact at any points of its facets.

    Construction is collective. The methods get ``facet``, the number in the contact of
    each of n facets, and ``x``, q points of each [length], shape (n, q, d).
    """

    def __init__(self, contact: ContactOnMesh, mesh: dmesh.Mesh) -> None:
        self.contact = contact
        self._gap = None
        if contact.gap is not None:
            self._gap = Everywhere(contact.gap, mesh)
        self._normal = None
        if contact.given_normal is not None:
            self._normal = Everywhere(contact.given_normal, mesh)
        self._stiffness = None
        if contact.stiffness is not None:
            self._stiffness = Everywhere(contact.stiffness, mesh)
        self._tangential_stiffness = None
        if contact.tangential_stiffness is not None:
            self._tangential_stiffness = Everywhere(contact.tangential_stiffness, mesh)
        self._parameters = {}
        if contact.friction is not None:
            for name, value in contact.friction.parameters.items():
                self._parameters[name] = Everywhere(value, mesh)

    def gap(self, facet: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate the gap at the points [length], shape (n, q)."""
        if self._gap is None:
            return np.zeros(x.shape[:2])
        return self._gap(x, self.contact.facets[facet])

    def stiffness(self, facet: np.ndarray, x: np.ndarray) -> np.ndarray | None:
        """Evaluate k_n of the foundation at the points [force/length^3], shape (n, q).

        None if it is rigid.
        """
        if self._stiffness is None:
            return None
        return self._stiffness(x, self.contact.facets[facet])

    def tangential_stiffness(self, facet: np.ndarray, x: np.ndarray) -> np.ndarray | None:
        """Evaluate k_t of the foundation as :meth:`stiffness` does."""
        if self._tangential_stiffness is None:
            return None
        return self._tangential_stiffness(x, self.contact.facets[facet])

    def normal(self, facet: np.ndarray, x: np.ndarray, interpolated: np.ndarray) -> np.ndarray:
        """Evaluate the unit normal that the scene gives at the points.

        Args:
            facet: Numbers of the facets, shape (n,).
            x: Points [length], shape (n, q, d).
            interpolated: The normals that the contact has there, shape (n, q or 1, d).

        Returns:
            Shape (n, q, d); ``interpolated`` where the scene gives none that varies.
        """
        if self._normal is None:
            return interpolated
        normal = self._normal(x, self.contact.facets[facet])
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def bound(self, facet: np.ndarray, x: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Evaluate the friction bound at the points [force/area], shape (n, q).

        Args:
            facet: Numbers of the facets, shape (n,).
            x: Points [length], shape (n, q, d).
            pressure: Pressures there [force/area], shape (n, q).
        """
        facets = self.contact.facets[facet]
        parameters = {name: value(x, facets) for name, value in self._parameters.items()}
        return self.contact.friction_bound(pressure, parameters)
