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
user asks for a stress or a traction. What lies between knows no circumference.

On the axis S and R are zero. Facets on r = 0 need no name: the body has no boundary
there, and ``u_r = 0``.

Symbols: c circumference [length], t hoop direction.
"""

from __future__ import annotations

from math import pi

import numpy as np
import ufl

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.space import Space
from erc_contact.scene.material import strain
from namedmesh.simplex import barycentric, bernstein, mass, measures

ON_AXIS = 1e-12
"""Radius that counts as zero, over the extent of the body [-]."""
BESIDE_AXIS = 1e-6
"""Distance from the axis at which a limit is taken, over the size of a facet [-]."""


def strain_of(space: Space, u: Ufl) -> Ufl:
    """Return the strain of a displacement [-], UFL.

    Its shape is (d, d), of an axisymmetric body (3, 3) with the rows r, z and hoop.
    """
    in_plane = strain(u)
    if not space.axisymmetric:
        return in_plane
    hoop = u[0] / space.x[0]
    return in_space(in_plane, hoop)


def in_space(in_plane: Ufl, hoop: Ufl) -> Ufl:
    """Return the tensor (3, 3) of a part in the half plane and a hoop part, UFL."""
    rows = [[in_plane[i, j] for j in range(2)] + [0] for i in range(2)]
    return ufl.as_tensor([*rows, [0, 0, hoop]])


def in_half_plane(tensor: Ufl) -> Ufl:
    """Return the part (2, 2) of a tensor (3, 3) in the half plane, UFL."""
    return ufl.as_tensor([[tensor[i, j] for j in range(2)] for i in range(2)])


def nodes_on_axis(space: Space) -> np.ndarray:
    """Tell which nodes of this rank lie on the axis, shape (nodes,)."""
    if not space.axisymmetric:
        return np.zeros(space.node_count, dtype=bool)
    r = space.V.tabulate_dof_coordinates()[:, 0]
    return np.asarray(abs(r) <= ON_AXIS * space.domain.extent)


def off_axis(vertices: np.ndarray, degree: int) -> np.ndarray:
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


def vertices_off_axis(space: Space, corners: np.ndarray) -> np.ndarray:
    """Tell which vertices of facets (f, 2, 2) are off the axis, shape (f, 2)."""
    return np.asarray(abs(corners[..., 0]) > ON_AXIS * space.domain.extent)


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


def moments_off_axis(space: Space, facets: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Return the moments of tractions that vanish on the axis, if there is an axis.

    Args:
        space: The mesh.
        facets: Pairs (cell, local facet), shape (f, 2).
        moment: Moments of tractions that need not vanish [force], shape (f, m, 2).
    """
    if not space.axisymmetric:
        return moment
    off = off_axis(vertices_off_axis(space, space.facet_corners(facets)), space.degree)
    return np.matmul(mass(1, space.degree, space.degree), without_axis(moment, off))


def per_area(
    space: Space, corners: np.ndarray, coefficients: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Evaluate what is given per length of the meridian on facets, per area.

    Args:
        space: The mesh.
        corners: Vertices of the facets [length], shape (f, d, d).
        coefficients: Bernstein coefficients, shape (f, m, ...).
        points: Reference points of the facets, shape (q, d-1).

    Returns:
        The values, over the circumference if there is one, shape (f, q, ...). On the
        axis it is the limit.
    """
    d, k = space.d, space.degree
    trailing = coefficients.shape[2:]
    flat = coefficients.reshape(*coefficients.shape[:2], int(np.prod(trailing)))
    values = np.matmul(bernstein(d - 1, k, points), flat)
    if space.axisymmetric:
        radius, is_on_axis, inside = _radii(space, corners, points)
        values = np.where(is_on_axis, np.matmul(bernstein(d - 1, k, inside), flat), values)
        values = values / (2 * pi * radius)
    return values.reshape(*values.shape[:2], *trailing)


def area_ratio(
    space: Space, corners: np.ndarray, others: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Return the ratio of the areas of facets to other areas at their points [-].

    Facing facets of two bodies that are apart have the same forces, so a traction times
    this ratio is the traction on the other body.

    Args:
        space: The mesh.
        corners: Vertices of the facets [length], shape (f, d, d).
        others: Vertices of the other facets, in the same order.
        points: Reference points of the facets, shape (q, d-1).

    Returns:
        Shape (f, q), of rings the ratio of their areas; (f, 1) where it is constant. On
        the axis it is the limit.
    """
    ratio = (measures(corners) / measures(others))[:, None]
    if not space.axisymmetric:
        return ratio
    here, there = (_radii(space, x, points)[0][..., 0] for x in (corners, others))
    return ratio * (here / there)


def _radii(
    space: Space, corners: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return radii at points of facets [length], beside the axis for points on it.

    Returns:
        The radii, shape (f, q, 1); which points are on the axis, (f, q, 1); points
        beside the axis for all of them, shape (q, d-1).
    """
    radius = np.matmul(barycentric(points), corners[..., 0, None])
    is_on_axis = abs(radius) <= ON_AXIS * space.domain.extent
    middle = np.full((1, space.d - 1), 1 / space.d)
    inside = points + BESIDE_AXIS * (middle - points)
    beside = np.matmul(barycentric(inside), corners[..., 0, None])
    return np.where(is_on_axis, beside, radius), is_on_axis, inside


def nodal_shares(space: Space, facets: np.ndarray) -> np.ndarray:
    """Return how far nodal forces on rings are from traction times area of the nodes.

    A method with a multiplier has the nodal forces g of a contact as multipliers
    ``g/A``, with the lengths A of the meridian that its nodes have. A pressure p has
    the forces ``p int c B`` with the Bernstein polynomials B, so that the traction
    ``c p`` at a node is the multiplier times ``c A / int c B``: 0 on the axis.

    Args:
        space: The mesh.
        facets: Facets of the contact (cell, local facet), ghosts included.

    Returns:
        These factors [-], shape (nodes,), 1 off the contact.
    """
    k = space.degree
    nodes = space.facet_nodes(facets)
    corners = space.facet_corners(facets)
    area = space.facet_areas(facets)[:, None]
    share = np.broadcast_to(area / nodes.shape[1], nodes.shape)
    ring = area * (corners[..., 0] @ mass(1, 1, k))
    of_nodes = np.bincount(nodes.ravel(), share.ravel(), space.node_count)
    of_rings = np.bincount(nodes.ravel(), ring.ravel(), space.node_count)
    radius = np.where(nodes_on_axis(space), 0.0, space.V.tabulate_dof_coordinates()[:, 0])
    factors = np.ones(space.node_count)
    np.divide(radius * of_nodes, of_rings, out=factors, where=of_rings > 0)
    return factors
