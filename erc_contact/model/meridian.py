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
where it contains r. A given friction bound, springs and compliant foundations are times
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
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.space import Space
from erc_contact.scene.material import strain
from erc_contact.scene.scene import Scene

ON_AXIS = 1e-12
"""Radius that counts as zero, over the extent of the body [-]."""


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
    """Return the tensor (3, 3) of a part in the half plane (2, 2) and a hoop part, UFL."""
    rows = [[in_plane[i, j] for j in range(2)] + [0] for i in range(2)]
    return ufl.as_tensor([*rows, [0, 0, hoop]])


def in_half_plane(tensor: Ufl) -> Ufl:
    """Return the part (2, 2) of a tensor (3, 3) in the half plane, UFL."""
    return ufl.as_tensor([[tensor[i, j] for j in range(2)] for i in range(2)])


def circumferences(x: np.ndarray) -> np.ndarray:
    """Return the circumferences of the rings through points [length], shape (...).

    Args:
        x: The points [length], shape (..., 2).
    """
    return 2 * pi * x[..., 0]


def nodes_on_axis(space: Space) -> np.ndarray:
    """Tell which nodes of this rank lie on the axis, shape (nodes,)."""
    if not space.axisymmetric:
        return np.zeros(space.node_count, dtype=bool)
    r = space.V.tabulate_dof_coordinates()[:, 0]
    return np.asarray(abs(r) <= ON_AXIS * space.domain.extent)


def check_half_plane(space: Space, scene: Scene) -> None:
    """Check that a mesh is the half plane of the bodies of an axisymmetric scene; collective.

    Raises:
        InputError: If a point has r < 0, or the scene has a condition on the axis.
    """
    if not space.axisymmetric:
        return
    tolerance = ON_AXIS * space.domain.extent
    x = space.mesh.geometry.x
    least = space.comm.allreduce(float(x[:, 0].min(initial=np.inf)), MPI.MIN)
    if least < -tolerance:
        raise InputError(
            f"An axisymmetric body has points with the radius x[0] = {least:.4g} < 0; draw one "
            "half only, with r = x[0] >= 0 and the axis at x[0] = 0."
        )
    for owner in (*scene.supports, *scene.springs, *scene.loads, *scene.contacts, *scene.ties):
        names = getattr(owner, "sides", (owner.facets,))
        for name in names:
            if name is None:
                continue
            r = abs(space.facet_corners(space.domain.facets(name))[..., 0])
            is_found = bool((r.max(axis=1) <= tolerance).any()) if len(r) else False
            if space.comm.allreduce(is_found, MPI.LOR):
                raise InputError(
                    f"{type(owner).__name__}({name!r}) has facets on the axis r = 0, where an "
                    "axisymmetric body has no boundary: its radial displacement is zero there, "
                    "and nothing acts. Leave the axis without a condition, or give the facets "
                    "off the axis a name of their own."
                )
