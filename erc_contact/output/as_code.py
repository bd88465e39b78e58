"""Write runs as the code that makes them again, for reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from erc_contact.base.code import code_of, definitions
from erc_contact.mesh.domain import Domain
from erc_contact.mesh.parts import shape_in_words
from erc_contact.scene.scene import Scene


def run_as_code(scene: Scene, domain: Domain, arguments: Mapping[str, Any]) -> str:
    """Return the code of an adaptive run.

    Args:
        scene: Its scene.
        domain: Its first mesh, which is told in words.
        arguments: The other arguments of :func:`erc_contact.adapt` by their names.
    """
    lines = [f"    material={code_of(scene.material)},"]
    for name in ("supports", "loads", "contacts", "strains", "springs", "ties"):
        entries = [f"        {code_of(entry)}," for entry in getattr(scene, name)]
        if entries:
            lines += [f"    {name}=[", *entries, "    ],"]
    scene_code = "\n".join([*definitions(scene), "scene = ec.Scene(", *lines, ")"])
    return _script(scene_code, domain, "history = ec.adapt", "scene", arguments)


def evolution_as_code(
    scene_at: Callable[[float], Scene], domain: Domain, arguments: Mapping[str, Any]
) -> str:
    """Return the code of a loading history.

    Args:
        scene_at: The scene of each time.
        domain: Its first mesh, which is told in words.
        arguments: The other arguments of :func:`erc_contact.evolve` by their names.
    """
    scene_code = "\n".join(definitions([scene_at]))
    return _script(scene_code, domain, "evolution = ec.evolve", code_of(scene_at), arguments)


def _script(
    scene_code: str, domain: Domain, call: str, first: str, arguments: Mapping[str, Any]
) -> str:
    """Return the call of a run with its arguments, below the code of the scene."""
    shape = shape_in_words(domain.geometry, domain.dim, curved=domain.curved_facets is not None)
    parts = ", ".join(domain.names)
    facts = f"{domain.cells} cells and {domain.vertices} vertices; parts {parts}"
    lines = ["import ufl\n\nimport erc_contact as ec\n"]
    if scene_code:
        lines.append(scene_code)
    lines.append(f"# domain: {shape}; the first mesh has {facts}")
    lines.append(f"{call}(\n    {first},\n    domain,")
    for name, argument in arguments.items():
        lines.append(f"    {name}={code_of(argument)},")
    lines.append(")")
    return "\n".join(lines)
