"""Convex sets of contact tractions, and the Euclidean projection on them.

The sets are cones and cylinders.

Symbols: n normal of the foundation, p = -r_n pressure, f facets, m nodes of a facet, d
dimension, K motions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.model.contact.trace import split


def clip(z_t: np.ndarray, size: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Shorten tangential vectors to the bound where their length ``size`` is larger."""
    share = np.divide(bound, size, out=np.ones_like(size), where=size > bound)
    return share[..., None] * z_t


@dataclass(frozen=True, eq=False)
class Cones:
    """Represent a convex set of tractions at each node.

    It is ``|r_t| <= offset + slope p`` with ``p >= 0``: Coulomb's cone for offset 0,
    Tresca's half cylinder for slope 0, and a truncated cone otherwise.

    Attributes:
        n: Unit normals, shape (f, 1, d).
        slope: Slope of the friction bound [-], shape (f, m).
        offset: Friction bound without pressure [force/area], shape (f, m).
        bilateral: Where p may have any sign; the slope is zero there. Shape (f, m).

    Example:
        >>> down = np.array([[[0.0, -1.0]]])  # the foundation is below
        >>> zero = np.zeros((1, 1))
        >>> cone = Cones(n=down, slope=zero + 0.5, offset=zero, bilateral=zero > 0)
        >>> cone.nearest(np.array([[[1.0, 1.0]]]))  # a pressure and a shear of 1
        array([[[0.6, 1.2]]])
    """

    n: np.ndarray
    slope: np.ndarray
    offset: np.ndarray
    bilateral: np.ndarray

    def nearest(self, z: np.ndarray) -> np.ndarray:
        """Return the nearest traction of the set to each z [force/area].

        This is the Euclidean projection. All shapes are (f, m, d).
        """
        r, _, _, _ = self._project(z)
        return r

    def _project(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Project tractions z, shape (f, m, d) [force/area].

        Returns:
            The nearest tractions, z_t, the length of z_t, and where the friction bound
            does not limit it.
        """
        z_n, z_t, size = split(z, self.n)
        pressure = np.where(self.bilateral, -z_n, np.maximum(-z_n, 0.0))
        inside = size <= self.offset + self.slope * pressure
        # Outside, the nearest point of the line |r_t| = offset + slope p in the plane
        # of n and z_t; its apex where the pressure would be negative.
        along = np.maximum(self.slope * (size - self.offset) - z_n, 0.0)
        on_surface = along / (1 + self.slope**2)
        p = np.where(inside | self.bilateral, pressure, on_surface)
        r_t = clip(z_t, np.where(inside, 0.0, size), self.offset + self.slope * p)
        return r_t - p[..., None] * self.n, z_t, size, inside

    def derivative(self, z: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return factors of the derivative of the projection P at z.

        At each node ``q.P'q = A.B`` for motions q.

        Args:
            z: Tractions [force/area], shape (f, m, d).
            q: Motions of the body, shape (f, m, d, K).

        Returns:
            A and B of shape (f, m, d + 2, K): the parts along n, along z_t, and
            orthogonal to both.
        """
        r, z_t, size, inside = self._project(z)
        along = np.divide(z_t, size[..., None], out=np.zeros_like(z_t), where=size[..., None] > 0)
        q_n = np.einsum("fmik,fzi->fmk", q, self.n)
        q_t = np.einsum("fmik,fmi->fmk", q, along)
        across = q - self.n[..., None] * q_n[:, :, None] - along[..., None] * q_t[:, :, None]

        # On the surface of the cone a traction moves along the surface only.
        slope = self.slope[..., None]
        presses = (((r * self.n).sum(axis=-1) < 0) | self.bilateral)[..., None]
        on_surface = presses * (q_n - slope * q_t) / (1 + slope**2)
        is_free = inside[..., None]
        normal = np.where(is_free, presses * q_n, on_surface)
        tangential = np.where(is_free, q_t, -slope * on_surface)

        # A turn of z_t turns r_t, which is shorter.
        r_t = split(r, self.n).tangential
        length = np.linalg.norm(r_t, axis=-1)
        share = np.divide(length, size, out=np.zeros_like(size), where=size > 0)
        turned = np.where(inside, 1.0, share)[..., None, None] * across
        left = np.concatenate([normal[:, :, None], tangential[:, :, None], turned], axis=2)
        right = np.concatenate([q_n[:, :, None], q_t[:, :, None], across], axis=2)
        return left, right
