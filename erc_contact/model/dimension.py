"""Check that a scene fits the dimension of a mesh."""

from __future__ import annotations

from typing import Any

from erc_contact.base.exceptions import InputError
from erc_contact.model.values import parameter
from erc_contact.scene.material import PLANE_STRAIN, is_axisymmetric
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
            " 3D: leave it out, a body in space has none."
        )
