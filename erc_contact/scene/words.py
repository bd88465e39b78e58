"""Write a scene in words, part by part."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from erc_contact.base.code import arguments, code_of


def names_of_sides(part: str, against: str | None) -> tuple[str, ...]:
    """Return the names of the one or two boundary parts of a contact."""
    return (part,) if against is None else (part, against)


def contact_in_words(sides: tuple[str, ...]) -> str:
    """Return "punch", or "punch against block" of a contact between two bodies."""
    return " against ".join(sides)


def in_words(scene: Any) -> list[tuple[str, str]]:
    """Return what a scene says of each part of the bodies: names of parts and words.

    Callables are shown by their source.
    """
    in_3d = any(len(support.value) == 3 for support in scene.supports)
    rows = [("material", _object(scene.material, hypothesis=not in_3d))]
    for support in scene.supports:
        is_given = type(support).__name__ == "Displacement"
        words = f"displacement {_vector(support.value)}" if is_given else _object(support)
        rows.append((support.facets, words))
    for load in scene.loads:
        region = getattr(load, "region", None)
        rows.append((load.facets or region or "whole body", _object(load)))
    for spring in scene.springs:
        rows.append((spring.facets, _object(spring)))
    for strain in scene.strains:
        rows.append((_regions(strain), _object(strain)))
    for contact in scene.contacts:
        rows.append((contact_in_words(contact.sides), _contact(contact)))
    for tie in scene.ties:
        words = "tied" if type(tie).__name__ == "Tied" else _object(tie)
        rows.append((contact_in_words(tie.sides), words))
    if scene.units:
        rows.append(("units", scene.units))
    return rows


def _regions(strain: Any) -> str:
    """Return the regions that have a given strain."""
    value = getattr(strain, "value", None)
    if strain.region is None and isinstance(value, Mapping):
        return ", ".join(value)
    return strain.region or "whole body"


def _object(value: Any, *, hypothesis: bool = False) -> str:
    """Return class and arguments of an entry of a scene, without its part.

    Args:
        value: The object.
        hypothesis: Whether its hypothesis is shown.
    """
    shown = {}
    for name, argument in arguments(value).items():
        if name not in ("facets", "against", "region", "hypothesis"):
            shown[name] = argument
    if hypothesis and hasattr(value, "hypothesis"):
        shown["hypothesis"] = value.hypothesis
    words = []
    for name, argument in shown.items():
        words.append(argument if isinstance(argument, str) else f"{name} = {_code(argument)}")
    return f"{type(value).__name__}: {', '.join(words)}"


def _vector(value: Any) -> str:
    """Return the components of a prescribed displacement in words."""
    words = ["free" if component is None else _code(component) for component in value]
    return f"({', '.join(words)})"


def _contact(contact: Any) -> str:
    """Return a contact in words."""
    kind = type(contact).__name__
    if kind == "Symmetry":
        return "plane of symmetry"
    if kind in ("Periodic", "Cyclic"):
        return _object(contact)
    law = contact.law
    if law is None:
        friction = "no friction"
    elif type(law).__name__ == "Coulomb":
        friction = f"Coulomb friction {_code(law.friction)}"
    else:
        friction = _object(law)
    kind = "bilateral contact" if contact.bilateral else "contact"
    normal = "" if contact.normal is None else f", normal {_code(contact.normal)}"
    bed = ""
    if contact.foundation is not None:
        words = []
        for name, value in arguments(contact.foundation).items():
            words.append(f"{name} stiffness {_code(value)}")
        what = "foundation" if contact.against is None else "layer"
        bed = f", {what} of {' and '.join(words)}"
    moves = ""
    if contact.motion is not None:
        moves = f", foundation moves by {_vector(contact.motion)}"
    return f"{kind}, {friction}, gap {_code(contact.gap)}{normal}{bed}{moves}"


def _code(value: Any) -> str:
    """Return a value as code; a table only with the number of its points."""
    if isinstance(value, tuple) and any(map(_is_table, value)):
        return f"({', '.join(map(_code, value))})"
    return repr(value) if _is_table(value) else code_of(value)


def _is_table(value: Any) -> bool:
    """Tell whether a value is interpolated between points that it keeps."""
    return hasattr(value, "interpolated")
