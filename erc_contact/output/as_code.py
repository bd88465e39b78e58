"""Runs as the code that makes them again, for reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from erc_contact.base.code import code_of, definitions
from erc_contact.mesh.domain import Domain, shape_in_words
from erc_contact.scene.scene import Scene


def run_as_code(scene: Scene, domain: Domain, given: Mapping[str, Any]) -> str:
    """An adaptive run.

    Args:
        scene: Its scene.
        domain: Its first mesh, which is told in words.
        given: The other arguments of :func:`erc_contact.adapt` by their names.
    """
    lists = [f"    material={code_of(scene.material)},"]
    for name in ("supports", "loads", "contacts"):
        entries = "".join(f"        {code_of(one)},\n" for one in getattr(scene, name))
        lists += [f"    {name}=[\n{entries}    ],"] if entries else []
    made = "\n".join([*definitions(scene), "scene = ec.Scene(", *lists, ")"])
    return _script(made, domain, "history = ec.adapt", "scene", given)


def evolution_as_code(
    scene_at: Callable[[float], Scene], domain: Domain, given: Mapping[str, Any]
) -> str:
    """A loading history.

    Args:
        scene_at: The scene of each time.
        domain: Its first mesh, which is told in words.
        given: The other arguments of :func:`erc_contact.evolve` by their names.
    """
    made = "\n".join(definitions([scene_at]))
    return _script(made, domain, "evolution = ec.evolve", code_of(scene_at), given)


def _script(made: str, domain: Domain, call: str, first: str, given: Mapping[str, Any]) -> str:
    """The call of a run with arguments, below the code of what it works with."""
    facts = f"{domain.cells} cells and {domain.vertices} vertices; parts {', '.join(domain.names)}"
    return "\n".join(
        [
            "import ufl\n\nimport erc_contact as ec\n",
            *([made] if made else []),
            f"# domain: {shape_in_words(domain)}; the first mesh has {facts}",
            f"{call}(\n    {first},\n    domain,",
            *(f"    {name}={code_of(one)}," for name, one in given.items()),
            ")",
        ]
    )
