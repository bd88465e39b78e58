"""Functions of DOLFINx among the values of a scene: each lives on one mesh, and so does such a scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import ufl
from ufl.corealg.traversal import traverse_unique_terminals

from erc_contact.base.code import arguments
from erc_contact.base.exceptions import InputError
from erc_contact.mesh.domain import Domain
from erc_contact.scene.scene import Scene


def check_no_functions(scene: Scene, domain: Domain) -> None:
    """Check that a scene can be put on further meshes: its callables return no Functions; collective.

    Raises:
        InputError: If one does, on all ranks.
    """
    x = ufl.SpatialCoordinate(domain.mesh)
    named = [name for name, value in _callables(scene) if _has_function(value, x)]
    everywhere = domain.mesh.comm.allgather(named)
    first = next((names[0] for names in everywhere if names), None)
    if first is not None:
        raise InputError(
            f"{first} returns a Function, which lives on one mesh, and a run makes further ones. Give UFL of x; or "
            "solve on this mesh alone: ec.solve, ec.equilibrate and ec.constitutive_error, or max_steps=1."
        )


def _callables(scene: Scene) -> Iterator[tuple[str, Any]]:
    """The callables of x among the values of a scene, with names for messages."""
    laws = [
        contact.friction
        for contact in scene.contacts
        if hasattr(contact.friction, "friction_bound")
    ]
    for owner in (scene.material, *scene.supports, *scene.loads, *scene.contacts, *laws):
        facets = getattr(owner, "facets", None)
        what = type(owner).__name__ + (f"({facets!r})" if facets else "")
        for name, given in arguments(owner).items():
            values = list(given.values()) if isinstance(given, Mapping) else given
            for value in values if isinstance(values, list | tuple) else [values]:
                if callable(value):
                    yield f"{what}: {name}", value


def _has_function(value: Any, x: Any) -> bool:
    """Tell whether a callable of x returns UFL with a Function.

    A callable that fails is reported when the scene meets its mesh.
    """
    try:
        result = value(x)
        parts = result if isinstance(result, list | tuple) else [result]
        terminals = [t for part in parts for t in traverse_unique_terminals(ufl.as_ufl(part))]
    except Exception:
        return False
    return any(isinstance(terminal, ufl.Coefficient) for terminal in terminals)
