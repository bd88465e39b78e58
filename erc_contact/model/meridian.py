"""Write axisymmetric bodies as problems in the half plane of their meridian.

Coordinates are the radius r = x[0] >= 0 and the axis z = x[1]; the displacement is
(u_r, u_z), and the strain has a hoop part ``u_r/r``. With the circumference ``c = 2 pi
r`` of the ring through a point, the in-plane tensor and the hoop force

    S = c sigma,    tau = 2 pi sigma_tt

are in equilibrium, where

    div S . e_r - tau + c f_r = 0,    div S . e_z + c f_z = 0,    S n = c F.

So in the half plane the body is a plane problem with the stress S, the loads c f and c
F, and the contact tractions ``R = c r``, of which all integrals are those of full
rings: forces, energies and works need no factor any more. A cone of friction contains R
where it contains r. A Tresca bound, springs and compliant foundations are times
c, too, and so is the elasticity C. One condition less is left: the radial balance
*defines* the hoop force. A radial load is a hoop stress ``r f_r`` that is given.

All densities are put on the meridian where a scene meets its mesh
(:meth:`erc_contact.model.space.Space.on_meridian`), and taken from it again where a
user asks for a stress or a traction, by the section of the space
(:mod:`erc_contact.model.section`). What lies between knows no circumference.

On the axis S and R are zero. Facets on r = 0 need no name: the body has no boundary
there, and ``u_r = 0``.

Symbols: c circumference [length], t hoop direction.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np
import ufl

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.side import Side
from erc_contact.model.section import Section
from erc_contact.scene.material import ring_basis, strain
from namedmesh.simplex import barycentric, bernstein, coefficients, mass, nodes, projection, rule

ON_AXIS = 1e-12
"""Radius that counts as zero, over the extent of the body [-]."""
BESIDE_AXIS = 1e-6
"""Distance from the axis at which a limit is taken, over the size of a facet [-]."""
RATIONAL_DEGREE = 21
"""Quadrature degree for polynomials over the radius [-]."""


def circumferences(x: np.ndarray) -> np.ndarray:
    """Return the circumferences of the rings through points [length], shape (...).

    Args:
        x: The points [length], shape (..., 2).
    """
    return 2 * pi * x[..., 0]


class Meridian(Section):
    """Know a body of revolution; the mesh is the half plane (r, z).

    Weights are circumferences [length]. Tensors of the body have the rows r, z and
    hoop, and the hoop component as their last one.
    """

    axisymmetric = True
    varies = True
    letters = "rz"
    motions = slice(1, 2)
    holds = " or the axis, where u_r = 0,"
    tensor_words = ", which are r, z and hoop"

    def __init__(self, x: Ufl, d: int, degree: int, extent: float) -> None:
        super().__init__(x, d, degree, extent)
        self.circumference = 2 * pi * x[0]

    # -- weights

    def on_mesh(self, density: Ufl) -> Ufl:
        """Return a density per area or volume, times the circumference."""
        return self.circumference * density

    def weight(self, x: np.ndarray) -> np.ndarray:
        """Return the circumferences of points (n, q, 2), shape (n, q, 1)."""
        return circumferences(x)[..., None]

    def times(self, values: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Multiply values (..., *s) by the circumferences of points (..., 2)."""
        return _like(circumferences(x), values) * values

    def over(self, values: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Divide values (..., *s) by the circumferences of points (..., 2)."""
        return values / _like(circumferences(x), values)

    def rule_degree(self, degree: int) -> int:
        """Return the degree of a rule for rational functions of the radius."""
        return RATIONAL_DEGREE

    # -- on facets

    def weighted(self, values: np.ndarray, side: Side) -> np.ndarray:
        """Multiply a density by circumferences, see :meth:`.Section.weighted`."""
        points, weights = rule(1, 2 * self.degree + 1)
        at_points = np.matmul(bernstein(1, self.degree, points), values)
        at_points = self.times(at_points, side.points_at(points))
        return np.matmul(projection(1, self.degree, points, weights), at_points)

    def per_area(self, corners: np.ndarray, values: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Evaluate a density on facets per area, see :meth:`.Section.per_area`."""
        radius, is_on_axis, inside = self._radii(corners, points)
        at_points = super().per_area(corners, values, points)
        limits = super().per_area(corners, values, inside)
        at_points = np.where(_like(is_on_axis, at_points), limits, at_points)
        return at_points / _like(2 * pi * radius, at_points)

    def area_ratio(self, corners: np.ndarray, others: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the ratio of the areas of rings, see :meth:`.Section.area_ratio`."""
        here, there = (self._radii(x, points)[0] for x in (corners, others))
        return super().area_ratio(corners, others, points) * (here / there)

    def shown(self, values: np.ndarray, corners: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return a density per area of other facets, see :meth:`.Section.shown`."""
        points = nodes(1, self.degree)
        share = self.area_ratio(corners, others, points)
        nodal = self.per_area(corners, values, points)
        return np.matmul(coefficients(1, self.degree), share[..., None] * nodal)

    def _radii(
        self, corners: np.ndarray, points: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return radii at points of facets [length], beside the axis for points on it.

        Returns:
            The radii, shape (f, q); which points are on the axis, (f, q); points beside
            the axis for all of them, shape (q, d-1).
        """
        x = np.matmul(barycentric(points), corners)
        is_on_axis = self.on_axis(x)
        inside = points + BESIDE_AXIS * (1 / 2 - points)
        beside = np.matmul(barycentric(inside), corners)
        return np.where(is_on_axis, beside[..., 0], x[..., 0]), is_on_axis, inside

    def to_tractions(self, nodal: np.ndarray, side: Side, x: np.ndarray) -> None:
        """Replace forces over lengths by tractions, in place."""
        nodal *= self._nodal_shares(side, x)[:, None]

    def from_tractions(self, at_nodes: np.ndarray, side: Side, x: np.ndarray) -> np.ndarray:
        """Return forces over lengths from tractions, 0 on the axis."""
        shares = self._nodal_shares(side, x)[side.nodes][..., None]
        return np.divide(at_nodes, shares, out=at_nodes, where=shares > 0)

    def _nodal_shares(self, side: Side, x: np.ndarray) -> np.ndarray:
        """Return how far nodal forces are from traction times area of the nodes.

        A method with a multiplier has the nodal forces g of a contact as multipliers
        ``g/A``, with the lengths A of the meridian that its nodes have. A pressure p
        has the forces ``p int c B`` with the Bernstein polynomials B, so that the
        traction ``c p`` at a node is the multiplier times ``c A / int c B``: 0 on the
        axis.

        Returns:
            These factors [-], shape (nodes,), 1 off the contact.
        """
        area = side.areas[:, None]
        share = np.broadcast_to(area / side.nodes.shape[1], side.nodes.shape)
        ring = area * (side.corners[..., 0] @ mass(1, 1, self.degree))
        of_nodes = np.bincount(side.nodes.ravel(), share.ravel(), len(x))
        of_rings = np.bincount(side.nodes.ravel(), ring.ravel(), len(x))
        radius = np.where(self.on_axis(x), 0.0, x[:, 0])
        factors = np.ones(len(x))
        np.divide(radius * of_nodes, of_rings, out=factors, where=of_rings > 0)
        return factors

    # -- the axis

    def on_axis(self, x: np.ndarray) -> np.ndarray:
        """Tell which points (..., d) lie on the axis, shape (...)."""
        return np.asarray(abs(x[..., 0]) <= ON_AXIS * self.extent)

    def beside_axis(self, x: np.ndarray, sizes: np.ndarray | float) -> np.ndarray:
        """Return points (n, 2), near the axis moved, as a stress is a limit there."""
        moved = x.copy()
        moved[:, 0] = np.maximum(x[:, 0], BESIDE_AXIS * sizes)
        return moved

    def off_axis(self, corners: np.ndarray, degree: int) -> np.ndarray:
        """Tell which coefficients on facets are off the axis, shape (f, m)."""
        return nodes_off_axis(~self.on_axis(corners), degree)

    def vanishing(self, values: np.ndarray, off: np.ndarray) -> np.ndarray:
        """Return tractions that vanish on the axis, see :meth:`.Section.vanishing`."""
        degree = off.shape[1] - 1
        return without_axis(np.matmul(mass(1, degree, degree), values), off)

    def vanishing_moments(self, moment: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Return the moments of tractions that vanish on the axis [force]."""
        off = self.off_axis(corners, self.degree)
        return np.matmul(mass(1, self.degree, self.degree), without_axis(moment, off))

    # -- tensors

    @property
    def basis(self) -> np.ndarray:
        """Return the orthonormal basis of the tensors of the body, shape (4, 3, 3)."""
        return ring_basis()

    def strain(self, u: Ufl) -> Ufl:
        """Return the strain of a displacement [-], UFL, shape (3, 3)."""
        return in_space(strain(u), u[0] / self.x[0])

    def in_body(self, tensor: Ufl) -> Ufl:
        """Return a tensor (2, 2) without a hoop part as a tensor (3, 3), UFL."""
        return in_space(tensor, 0)

    def in_mesh(self, tensor: Ufl) -> Ufl:
        """Return the part (2, 2) of a tensor (3, 3) in the half plane, UFL."""
        return ufl.as_tensor([[tensor[i, j] for j in range(2)] for i in range(2)])

    def strain_at(
        self, in_mesh: np.ndarray, u: Callable[[], np.ndarray], x: np.ndarray
    ) -> np.ndarray:
        """Add the hoop strain ``u_r/r``, on the axis ``u_r,r``, to components."""
        is_on_axis = self.on_axis(x)
        hoop = u()[..., 0] / np.where(is_on_axis, 1.0, x[..., 0])
        hoop = np.where(is_on_axis, in_mesh[..., 0], hoop)
        return np.concatenate([in_mesh, hoop[..., None]], axis=-1)

    def hoop_strains(self, u: np.ndarray, vertices: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Return the mean hoop strain of cells, see :meth:`.Section.hoop_strains`."""
        return np.asarray(u[vertices, 0].mean(axis=1) / corners[..., 0].mean(axis=1))

    # -- forces and motions: hoop stresses balance radial forces

    def hoop_density(self, force: Ufl | None) -> Ufl | None:
        """Return the hoop component ``c r f_r`` of the stress that c f is [force]."""
        return None if force is None else self.x[0] * force[0]

    def carried(self, forces: np.ndarray) -> np.ndarray:
        """Return axial forces alone, shape (..., 2)."""
        axial = forces.copy()
        axial[..., 0] = 0.0
        return axial

    def carried_density(self, force: Ufl | None) -> Ufl | None:
        """Return an axial body force alone, UFL."""
        return None if force is None else ufl.as_vector([0.0, force[1]])

    @property
    def motion_names(self) -> list[str]:
        """Return the name of the only rigid motion."""
        return ["translation along the axis z"]


def _like(weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return weights with as many axes as values have."""
    return weights.reshape(*weights.shape, *[1] * (values.ndim - weights.ndim))


def in_space(in_plane: Ufl, hoop: Ufl) -> Ufl:
    """Return the tensor (3, 3) of a part in the half plane and a hoop part, UFL."""
    rows = [[in_plane[i, j] for j in range(2)] + [0] for i in range(2)]
    return ufl.as_tensor([*rows, [0, 0, hoop]])


def nodes_off_axis(vertices: np.ndarray, degree: int) -> np.ndarray:
    """Tell which coefficients of polynomials on facets are off the axis, shape (f, m).

    Args:
        vertices: Which vertices of the facets are off the axis, shape (f, 2).
        degree: Degree of the polynomials, 0 to 2. A constant is off the axis where both
            vertices are.
    """
    if degree == 0:
        return vertices.all(axis=1, keepdims=True)
    if degree == 1:
        return vertices
    return np.column_stack([vertices, vertices.any(axis=1)])


def without_axis(moment: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Return tractions that vanish on the axis, from moments of other tractions.

    The axial force of each facet stays. Of a radial traction the moments against the
    polynomials of the nodes off the axis stay.

    Args:
        moment: Moments ``int_F t B_m`` [force], shape (f, m, 2).
        off: Nodes off the axis, shape (f, m).

    Returns:
        Coefficients of ``|F| t`` [force], shape (f, m, 2).
    """
    m = off.shape[1]
    masses = mass(1, m - 1, m - 1)
    coefficients = np.matmul(np.linalg.inv(masses), moment)
    at_axis = np.flatnonzero(~off.all(axis=1))
    for marks in np.unique(off[at_axis], axis=0):
        facets = at_axis[(off[at_axis] == marks).all(axis=1)]
        changed = np.zeros((len(facets), m, 2))
        if marks.any():
            of_marks = masses[np.ix_(marks, marks)]
            changed[:, marks] = np.linalg.solve(of_marks, moment[facets][:, marks])
            # The same change at all these nodes gives back the axial force.
            lost = moment[facets, :, 1].sum(axis=1) - changed[..., 1].mean(axis=1)
            changed[:, marks, 1] += (lost * m / marks.sum())[:, None]
        coefficients[facets] = changed
    return coefficients
