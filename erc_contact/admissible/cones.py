"""Convex sets of contact tractions, cones and cylinders, and the Euclidean projection on them.

Symbols: n normal of the foundation, p = -r_n pressure, f facets, m nodes of a facet, d
dimension, K directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.model.trace import split


def clip(z_t: np.ndarray, size: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Tangential vectors z_t, shortened to the bound where their length ``size`` is larger."""
    return np.divide(bound, size, out=np.ones_like(size), where=size > bound)[..., None] * z_t


@dataclass(frozen=True, eq=False)
class Cones:
    """The set of tractions ``|r_t| <= offset + slope p``, ``p >= 0`` at each node.

    It is Coulomb's cone for offset 0, Tresca's half cylinder for slope 0, and a
    truncated cone otherwise.

    Attributes:
        n: Unit normals, shape (f, 1, d).
        slope: Slope of the friction bound [-], shape (f, m).
        offset: Friction bound without pressure [force/area], shape (f, m).
        bilateral: Where p may have any sign; the slope is zero there. Shape (f, m).
    """

    n: np.ndarray
    slope: np.ndarray
    offset: np.ndarray
    bilateral: np.ndarray

    def nearest(self, z: np.ndarray) -> np.ndarray:
        """The nearest traction of the set to each z, the Euclidean projection, shape (f, m, d) [force/area]."""
        return self._project(z)[0]

    def _project(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The nearest traction, z_t, the length of z_t, and where the friction bound does not limit it."""
        z_n, z_t, size = split(z, self.n)
        shown = np.where(self.bilateral, -z_n, np.maximum(-z_n, 0.0))
        inside = size <= self.offset + self.slope * shown
        on_surface = np.maximum(self.slope * (size - self.offset) - z_n, 0.0) / (1 + self.slope**2)
        p = np.where(inside | self.bilateral, shown, on_surface)
        r_t = clip(z_t, np.where(inside, 0.0, size), self.offset + self.slope * p)
        return r_t - p[..., None] * self.n, z_t, size, inside

    def derivative(self, z: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivative of the projection P at z in directions q (f, m, d, K): factors of ``q.P'q = A.B`` at each node.

        Returns:
            A and B of shape (f, m, d + 2, K): the parts along n, along z_t, and
            orthogonal to both.
        """
        r, z_t, size, inside = self._project(z)
        along = np.divide(z_t, size[..., None], out=np.zeros_like(z_t), where=size[..., None] > 0)
        q_n, q_t = np.einsum("fmik,fzi->fmk", q, self.n), np.einsum("fmik,fmi->fmk", q, along)
        across = q - self.n[..., None] * q_n[:, :, None] - along[..., None] * q_t[:, :, None]
        presses = (((r * self.n).sum(axis=-1) < 0) | self.bilateral)[..., None]
        inside, slope = inside[..., None], self.slope[..., None]
        moved = presses * (q_n - slope * q_t) / (1 + slope**2)  # on the surface
        normal = np.where(inside, presses * q_n, moved)
        tangential = np.where(inside, q_t, -slope * moved)
        length = np.linalg.norm(split(r, self.n)[1], axis=-1)
        turned = np.where(
            inside[..., 0], 1.0, np.divide(length, size, out=np.zeros_like(size), where=size > 0)
        )
        left = np.concatenate(
            [normal[:, :, None], tangential[:, :, None], turned[..., None, None] * across], axis=2
        )
        return left, np.concatenate([q_n[:, :, None], q_t[:, :, None], across], axis=2)
