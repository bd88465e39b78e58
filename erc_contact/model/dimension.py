"""Check that a scene fits the dimension of a mesh, and the half plane of rings."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.meridian import ON_AXIS
from erc_contact.model.space import Space
from erc_contact.scene.material import PLANE_STRAIN, is_axisymmetric, parameter
from erc_contact.scene.scene import Scene


def check_dimension(scene: Scene, d: int) -> None:
    """Check that vectors and hypothesis of a scene fit the dimension of the mesh.

    Raises:
        InputError: If they do not.
    """
    vectors: list[tuple[Any, Any]] = [(support, support.value) for support in scene.supports]
    for contact in scene.contacts:
        vectors += [(contact, contact.normal), (contact, contact.motion)]
    for load in scene.loads:
        vectors += [(load, parameter(load, name)) for name in load.parameters]
    for owner, value in vectors:
        if isinstance(value, tuple) and len(value) != d:
            part = "" if owner.facets is None else f"({owner.facets!r})"
            raise InputError(
                f"{type(owner).__name__}{part} has the vector {value} of {len(value)}"
                f" components, but the mesh is {d}D: give {d}."
            )
    if d == 3 and is_axisymmetric(scene.material):
        raise InputError(
            f"{type(scene.material).__name__}: hypothesis is 'axisymmetric', and the mesh is 3D: "
            "give the mesh of the half plane, x[0] the radius and x[1] the axis, or leave the "
            "hypothesis out."
        )
    hypothesis = getattr(scene.material, "hypothesis", PLANE_STRAIN)
    if d == 3 and hypothesis != PLANE_STRAIN:
        raise InputError(
            f"{type(scene.material).__name__}: hypothesis is {hypothesis!r}, and the mesh is"
            " 3D: leave it out, a body in 3D has none."
        )


def check_half_plane(space: Space, scene: Scene) -> None:
    """Check that a mesh is the half plane of axisymmetric bodies; collective.

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
    for owner in (*scene.supports, *scene.springs, *scene.loads, *scene.contacts):
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
