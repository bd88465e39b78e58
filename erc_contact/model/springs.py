"""Put the springs of a scene on a mesh.

Symbols: n outward normal, k_n and k_t stiffness along it and along the facet
[force/length^3], ``K = k_n n n^T + k_t (I - n n^T)``, t traction on the body, f facets,
m nodes of a facet, d dimension. Of an axisymmetric body K and t are times the
circumference (:mod:`erc_contact.model.meridian`). On a curved part K is times the area
of the true surface over the area of a facet, as a load is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.side import Side
from erc_contact.model.contact.trace import split
from erc_contact.model.space import Space
from erc_contact.scene.support import Spring
from namedmesh.simplex import bernstein, coefficients


@dataclass(frozen=True, eq=False)
class BoundSpring:
    """Hold the springs of a boundary part of a mesh.

    Attributes:
        name: Name of the part.
        side: Its facets.
        direction: Outward unit normal of each facet, shape (f, d).
        normal: k_n [force/length^3].
        tangential: k_t [force/length^3].
        space: The mesh.
        factor: The area of the true surface over the area of facets by cells [-]; None
            on a flat part, see :meth:`.Space.area_factor`.
    """

    name: str
    side: Side
    direction: np.ndarray
    normal: float
    tangential: float
    space: Space
    factor: fem.Function | None = None

    @cached_property
    def ratio(self) -> np.ndarray:
        """Return the factor of each facet [-], shape (f,)."""
        cells = self.side.facets[:, 0]
        return np.ones(len(cells)) if self.factor is None else self.factor.x.array[cells]

    def work(self, u: Ufl, v: Ufl) -> Ufl:
        """Return the UFL form ``int K u . v``."""
        n = self.space.n
        ds = self.space.ds(self.space.domain.tag(self.name))
        k_n = compiled.constant(self.space.mesh, self.normal)
        k_t = compiled.constant(self.space.mesh, self.tangential)
        u_n = ufl.dot(u, n)
        v_n = ufl.dot(v, n)
        density = (k_n - k_t) * u_n * v_n + k_t * ufl.inner(u, v)
        if self.factor is not None:
            density *= self.factor
        return self.space.on_meridian(density) * ds

    def pull(self, u: np.ndarray) -> np.ndarray:
        """Return ``K u`` on the facets [force/area], shape (f, m, d).

        Of an axisymmetric body it is projected on degree k.

        Args:
            u: Displacement at all nodes of this rank [length], as the array of a
                Function has it.

        Returns:
            Bernstein coefficients.
        """
        return self.space.section.weighted(self._of_straight(u), self.side)

    def pull_at(self, u: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return ``K u`` at reference points of the facets [force/area], (f, q, d)."""
        shape = bernstein(self.side.d - 1, self.side.degree, points)
        return self._weights(points) * np.matmul(shape, self._of_straight(u))

    def _of_straight(self, u: np.ndarray) -> np.ndarray:
        """Return the coefficients of ``K u`` without a circumference, (f, m, d)."""
        d = self.side.d
        nodal = u.reshape(-1, d)[self.side.nodes]
        of_u = np.matmul(coefficients(d - 1, self.side.degree), nodal)
        u_n, u_t, _ = split(of_u, self.direction[:, None, :])
        along = u_n[..., None] * self.direction[:, None, :]
        return self.ratio[:, None, None] * (self.normal * along + self.tangential * u_t)

    def _weights(self, points: np.ndarray) -> np.ndarray:
        """Return the weights of points of the facets, see :meth:`.Section.weight`."""
        return self.space.section.weight(self.side.points_at(points))

    def is_stiffer(self, stiffness: float, than: np.ndarray) -> np.ndarray:
        """Tell where k is more than a stiffness of each facet, shape (f,)."""
        middle = np.full((1, self.side.d - 1), 1 / self.side.d)
        return self.ratio * stiffness * self._weights(middle)[:, 0, 0] > than

    def resist(self, motions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the parts of motions that the springs resist, of any stiffness.

        Args:
            motions: The motions at all nodes of this rank, shape (nodes, d, m).

        Returns:
            Nodes of the owned facets, shape (n,), and the parts there, shape (n, d, m).
        """
        nodes = self.side.nodes[self.side.owned]
        n = self.direction[self.side.owned]
        at_nodes = motions[nodes]
        along = np.einsum("fndi,fd->fni", at_nodes, n)[:, :, None] * n[:, None, :, None]
        parts = np.zeros_like(at_nodes)
        if self.normal > 0:
            parts += along
        if self.tangential > 0:
            parts += at_nodes - along
        return nodes.ravel(), parts.reshape(-1, *parts.shape[2:])

    def squares(self, t: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return ``t . K^-1 t`` [force/length], shape (f, q) for t of shape (f, q, d).

        The part of t along which there is no stiffness is zero.

        Args:
            t: Tractions at points of the facets [force/area].
            points: These points on the reference facet, shape (q, d-1).
        """
        t_n, _, size = split(t, self.direction[:, None, :])
        result = np.zeros(t_n.shape)
        for part, k in ((t_n, self.normal), (size, self.tangential)):
            if k > 0:
                result += part**2 / k
        return result / (self.ratio[:, None] * self._weights(points)[..., 0])


def bind_springs(space: Space, springs: Sequence[Spring], modulus: Ufl) -> list[BoundSpring]:
    """Put springs on a mesh; collective.

    Args:
        space: The mesh.
        springs: The springs of the scene.
        modulus: The modulus that scales contact parameters, UFL.
    """
    bound = []
    for spring in springs:
        facets = space.domain.facets(spring.facets)
        side = space.side(facets, modulus)
        direction = space.outward_normals(facets)
        stiffnesses = spring.normal, spring.tangential
        factor = space.area_factor(spring.facets)
        bound.append(BoundSpring(spring.facets, side, direction, *stiffnesses, space, factor))
    return bound
