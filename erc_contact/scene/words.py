"""A scene in words, part by part."""

from __future__ import annotations

from typing import Any

from erc_contact.base.code import arguments, code_of


def in_words(scene: Any) -> list[tuple[str, str]]:
    """What a scene says of each part of the body: name of the part and words; callables by their source."""
    flat = not any(len(one.value) == 3 for one in scene.supports)
    rows = [("material", _object(scene.material, hypothesis=flat))]
    rows += [(one.facets, f"displacement {_vector(one.value)}") for one in scene.supports]
    rows += [(one.facets or "whole body", _object(one)) for one in scene.loads]
    return rows + [(one.facets, _contact(one)) for one in scene.contacts]


def _object(value: Any, *, hypothesis: bool = False) -> str:
    """Class of a material, load or law and what it has, without the name of the part."""
    has = {
        name: one for name, one in arguments(value).items() if name not in ("facets", "hypothesis")
    }
    if hypothesis and hasattr(value, "hypothesis"):
        has["hypothesis"] = value.hypothesis
    words = (
        one if isinstance(one, str) else f"{name} = {code_of(one)}" for name, one in has.items()
    )
    return f"{type(value).__name__}: {', '.join(words)}"


def _vector(value: Any) -> str:
    return f"({', '.join('free' if one is None else code_of(one) for one in value)})"


def _contact(contact: Any) -> str:
    law = contact.law
    friction = "no friction" if law is None else _object(law)
    if type(law).__name__ == "Coulomb":
        friction = f"Coulomb friction {code_of(law.friction)}"
    kind = "bilateral contact" if contact.bilateral else "contact"
    normal = "" if contact.normal is None else f", normal {code_of(contact.normal)}"
    return f"{kind}, {friction}, gap {code_of(contact.gap)}{normal}"
