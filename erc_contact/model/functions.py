"""Look for Functions of DOLFINx among the values of a scene.

Each lives on one mesh, and so does a scene that has one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import ufl
from ufl.corealg.traversal import traverse_unique_terminals

from erc_contact.base.code import arguments
from erc_contact.base.exceptions import InputError
from erc_contact.base.traced import field_of
from erc_contact.base.ufl_types import Ufl
from erc_contact.mesh.bodies import Bodies
from erc_contact.scene.scene import Scene


def check_no_functions(scene: Scene, domain: Bodies) -> None:
    """Check that the callables of a scene return no Functions; collective.

    Only then can the scene be put on further meshes.

    Raises:
        InputError: If one does, on all ranks.
    """
    x = ufl.SpatialCoordinate(domain.mesh)
    named = [name for name, value in _callables(scene) if _has_function(value, x)]
    names = [name for of_rank in domain.comm.allgather(named) for name in of_rank]
    if names:
        raise InputError(
            f"{names[0]} returns a Function, which lives on one mesh, and a run makes further"
            " ones. Give UFL of x; or solve on this mesh alone: ec.solve, ec.equilibrate and"
            " ec.constitutive_error, or max_steps=1."
        )


def _callables(scene: Scene) -> Iterator[tuple[str, Any]]:
    """List the callables of x among the values of a scene, with names for messages."""
    owners: list[Any] = [scene.material, *scene.supports, *scene.loads, *scene.contacts]
    owners += scene.strains
    for contact in scene.contacts:
        if hasattr(contact.friction, "friction_bound"):
            owners.append(contact.friction)
    for owner in owners:
        facets = getattr(owner, "facets", None)
        what = type(owner).__name__
        if facets:
            what += f"({facets!r})"
        for name, argument in arguments(owner).items():
            for value in _entries(argument):
                if callable(value):
                    yield f"{what}: {name}", value


def _entries(argument: Any) -> Iterator[Any]:
    """List the values in mappings, rows and components of an argument."""
    values = argument.values() if isinstance(argument, Mapping) else argument
    if not isinstance(argument, Mapping | list | tuple):
        yield argument
        return
    for value in values:
        yield from _entries(value)


def _has_function(value: Any, x: Ufl) -> bool:
    """Tell whether a callable of x returns UFL with a Function.

    A callable that fails is reported when the scene meets its mesh.
    """
    try:
        result = field_of(value, x)
        parts = result if isinstance(result, list | tuple) else [result]
        terminals = []
        for part in parts:
            terminals += traverse_unique_terminals(ufl.as_ufl(part))
    except Exception:
        return False
    return any(isinstance(terminal, ufl.Coefficient) for terminal in terminals)
